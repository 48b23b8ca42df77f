//! `relens run`: the daemon over a drop folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use clap::{Args, ValueHint};
use relens::config::{self, Mode, RigFile};
use relens::daemon::service::Supervised;
use relens::daemon::{
    Attended, Daemon, DaemonSetting, Doing, Folders, Nightly, Restorer, Schedule, Shooting, State,
    Summary, Times, interruption,
};
use relens::frame::{Frame, Work};
use relens::kiosk::front_panel::{BoxState, FrontPanel};
use relens::nights::trust::unix_s;
use relens::picture::ReadOptions;
use relens::picture::worker::Worker;
use relens::pipeline::Interruption;
use relens::rig::monotonic::Monotonic;
use relens::rig::{Clock, Moment};

use super::error::CliError;
use super::front_panel::FrontPanelThread;
use super::options::{FolderOption, RigOption};
use super::output::say;
use super::progress::PhotoProgress;
use super::service::service_manager;
use super::{opening, scene, signals};

const OPEN_AGAIN_S: f64 = 30.0;

/// Watch the drop folder and restore the photos in it
///
/// Works on the folders inbox, working, outbox, done and failed in DIR, which are made if missing.
/// Photos in the inbox are restored into the outbox, with a report for each and a page,
/// outbox/index.html, that shows all before and after. The originals are moved to done, or to
/// failed with a note of the reason. Nothing is ever overwritten or lost, even when the power
/// fails.
///
/// A photo is restored once it is complete; an incomplete one waits in the inbox. JPEG, PNG, TIFF,
/// WebP, BMP and GIF of 8 or 16 bits are read, up to 32 megapixels and 256 MiB, in the shape of the
/// rig's photos; other sizes are resampled to the rig's. A raw photo of the rig's own sensor (DNG,
/// uncompressed, of the photo's size) gives a 16-bit TIFF. A simulated rig without a calibration
/// calibrates itself first.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens run --rig RIG.toml --folder DIR           until stopped
  relens run --rig RIG.toml --folder DIR --once
  relens run --rig truthful.toml --folder DIR --scene sharp.png")]
pub(super) struct RunOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Restore what is in the inbox, and end
    #[arg(long)]
    once: bool,
    /// Photograph PICTURE with a simulated rig at each `relens press`
    ///
    /// Works like a real rig with `[run] mode = "shoot"`: the scene is before the lens for the
    /// photo, and the panel some seconds after the box has asked for it.
    #[arg(
        long,
        value_name = "PICTURE",
        value_hint = ValueHint::FilePath,
        conflicts_with = "once"
    )]
    scene: Option<PathBuf>,
}

pub(super) fn run(options: &RunOptions) -> Result<(), CliError> {
    let mut rig = config::load(&options.rig.rig)?;
    let scene = scene_of(&mut rig, options)?;
    let folders = Folders::open(&options.folder.folder)?;
    let stopped = signals::stop_flag()?;
    if !options.once {
        return watch(&rig, scene.as_ref(), folders, &stopped);
    }
    let asked = interruption(FrontPanel::default(), Arc::clone(&stopped));
    let mut restorer = opening::restorer(&rig, &folders.root, None, Some(asked), opening::devices)?;
    let gallery = folders.outbox.join("index.html");
    let stop = || stopped.load(Ordering::Acquire);
    let summary = empty_inbox(&rig, folders, &mut *restorer, &stop)?;
    print_summary(&summary, &gallery)
}

fn watch(
    rig: &RigFile,
    scene: Option<&Frame<Work>>,
    folders: Folders,
    stopped: &Arc<AtomicBool>,
) -> Result<(), CliError> {
    service_manager().ready();
    let front = FrontPanel::default();
    // Declared first, to be dropped last: the lamps go dark at the end.
    let _front_panel = FrontPanelThread::start(rig, &folders.root, front.clone());
    let times = Times { clock: &Monotonic, calendar: &SystemTime::now, is_set: &clock_is_set };
    let night = rig.nights.as_ref().and_then(|nights| Nightly::new(nights, &folders, times));
    let mut open = |asked| open_restorer(rig, scene, &folders, asked);
    let Some(mut restorer) = open_patiently(rig, &folders, &front, stopped, &mut open)? else {
        service_manager().stopping();
        return Ok(());
    };
    log::info!(
        "watching {}; results are shown by {}",
        folders.inbox.display(),
        folders.outbox.join("index.html").display()
    );
    let night: Box<dyn Schedule> = match night {
        Some(night) => Box::new(night),
        None => Box::new(()),
    };
    let mut schedule = Attended::new(front, rig.run.mode, &Monotonic, night);
    if rig.run.mode == Mode::Shoot {
        let (nights, countdown_s) = (rig.nights.as_ref(), rig.run.countdown_s);
        let shooting = Shooting::new(folders.clone(), nights, countdown_s, &SystemTime::now);
        schedule = schedule.shooting(shooting);
    }
    let mut watcher = Supervised::new(service_manager(), Box::new(PhotoProgress::default()));
    let daemon = Daemon::open(
        folders,
        setting(rig),
        &mut *restorer,
        &Monotonic,
        &SystemTime::now,
        &mut watcher,
    )?;
    let stop = || stopped.load(Ordering::Acquire);
    daemon.scheduled(Box::new(schedule)).run(&stop);
    Ok(())
}

/// Opens the restorer of `rig`, with the panel in view where its mode needs that.
fn open_restorer(
    rig: &RigFile,
    scene: Option<&Frame<Work>>,
    folders: &Folders,
    asked: Interruption,
) -> Result<Box<dyn Restorer>, CliError> {
    if let Some(scene) = scene {
        return scene::restorer_before(scene, rig, &folders.root, asked);
    }
    let devices = match rig.run.mode {
        Mode::Shoot => opening::devices_without_panel,
        Mode::Folder | Mode::Button => opening::devices,
    };
    opening::restorer(rig, &folders.root, None, Some(asked), devices)
}

/// The scene of a simulated `rig`, whose mode it sets to [`Mode::Shoot`].
fn scene_of(rig: &mut RigFile, options: &RunOptions) -> Result<Option<Frame<Work>>, CliError> {
    match (&options.scene, rig.simulation()) {
        (Some(_), None) => Err(CliError::NotSimulated(rig.name.clone())),
        (Some(path), Some(_)) => {
            rig.run.mode = Mode::Shoot;
            scene::read(rig, path).map(Some)
        }
        (None, Some(_)) if rig.run.mode == Mode::Shoot && !options.once => {
            Err(CliError::NoScene(rig.name.clone()))
        }
        (None, _) => Ok(None),
    }
}

/// Opens the restorer of `rig` by `open`, again and again until it succeeds; `None` when stopped
/// before. Failures are reported by lamps, log, state file, service manager and, if possible, the
/// panel.
fn open_patiently(
    rig: &RigFile,
    folders: &Folders,
    front: &FrontPanel,
    stopped: &Arc<AtomicBool>,
    open: &mut dyn FnMut(Interruption) -> Result<Box<dyn Restorer>, CliError>,
) -> Result<Option<Box<dyn Restorer>>, CliError> {
    let mut last = String::new();
    loop {
        let asked = interruption(front.clone(), Arc::clone(stopped));
        service_manager().status("opening the rig");
        let error = match open(asked) {
            Ok(restorer) => return Ok(Some(restorer)),
            Err(error) => error,
        };
        let mut panel = None;
        if !stopped.load(Ordering::Acquire) {
            let reason = relens::remedy::full_message(&error);
            front.set(BoxState::Trouble);
            if last != reason {
                log::warn!("held: {reason}");
                let doing = Doing::Held { reason: reason.clone() };
                // The log reports a full disk.
                let _ = State::new(&rig.name, doing, now_unix_s()).write(folders);
            }
            service_manager().status(&format!("needs help: {reason}"));
            panel = opening::show_trouble(rig, &reason, error.what_to_do());
            last = reason;
        }
        let until = Monotonic.now().0 + OPEN_AGAIN_S;
        while Monotonic.now().0 < until {
            if stopped.load(Ordering::Acquire) {
                // The log reports a full disk.
                let _ = State::new(&rig.name, Doing::Ended, now_unix_s()).write(folders);
                return Ok(None);
            }
            Monotonic.wait_until(Moment(Monotonic.now().0 + 0.2));
        }
        drop(panel);
        // Only a finished attempt feeds the watchdog, not one that hangs in a device.
        service_manager().worked();
    }
}

fn now_unix_s() -> u64 {
    unix_s(SystemTime::now()) as u64
}

/// Whether the network has set the clock, according to the kernel or, if a service may not ask it,
/// to the marker file of systemd-timesyncd (systemd-timesyncd.service(8)).
fn clock_is_set() -> bool {
    relens::rig::kernel_time::is_synchronised()
        || Path::new("/run/systemd/timesync/synchronized").exists()
}

/// Restores all photos in the inbox of `folders`, until `stop` returns true.
pub(super) fn empty_inbox(
    rig: &RigFile,
    folders: Folders,
    restorer: &mut dyn Restorer,
    stop: &dyn Fn() -> bool,
) -> Result<Summary, CliError> {
    let mut watcher = PhotoProgress::default();
    let mut daemon =
        Daemon::open(folders, setting(rig), restorer, &Monotonic, &SystemTime::now, &mut watcher)?;
    Ok(daemon.once(stop)?)
}

fn setting(rig: &RigFile) -> DaemonSetting {
    let floor_bytes = (rig.disk.floor_mib * f64::from(1 << 20)) as u64;
    DaemonSetting {
        worker: Some(Worker::of_this_program()),
        floor_bytes,
        needs_button: rig.run.mode != Mode::Folder,
        reading: ReadOptions::of(rig),
        ..DaemonSetting::new(&rig.name, rig.photo_grid(), rig.photo.curve)
    }
}

fn print_summary(summary: &Summary, gallery: &Path) -> Result<(), CliError> {
    let counts = summary.counts();
    if counts.all() == 0 {
        say("the inbox is empty");
        return Ok(());
    }
    // The log has listed each photo.
    say(&format!("{counts}; see {}", gallery.display()));
    match counts.failed + counts.waiting.all() {
        0 => Ok(()),
        failed => Err(CliError::SomeFailed { failed, all: counts.all() }),
    }
}
