//! `relens run`: the daemon over a drop folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use clap::{Args, ValueHint};
use relens::config::{self, ClockSource, Mode, RigFile};
use relens::daemon::service::Supervised;
use relens::daemon::{
    Attended, Daemon, DaemonSetting, Doing, Folders, Nightly, Reader, Restorer, Schedule, State,
    Summary, Times, interruption, write_report,
};
use relens::frame::{Frame, Work};
use relens::kiosk::front_panel::{BoxState, FrontPanel};
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

/// Seconds between two attempts to open a rig that cannot be opened.
const OPEN_AGAIN_S: f64 = 30.0;

/// Watch the drop folder and restore what is dropped
///
/// Works on the folders inbox, working, outbox, done and failed in DIR, which are made if need be.
/// Photos put into the inbox are restored into the outbox, with a report beside each and a page,
/// outbox/index.html, that shows all before and after. The originals go to done, or to failed with
/// a note that says why. Nothing is ever overwritten or lost, whenever the power fails.
///
/// A photo is taken when it is all there; one whose end is missing waits in the inbox. JPEG, PNG,
/// TIFF, WebP, BMP and GIF are read, of 8 or 16 bits, up to 32 megapixels and 256 MiB, of the rig's
/// shape; other sizes of it are resampled to the rig's. A raw photo of the rig's own sensor (DNG,
/// uncompressed, of the photo's size) comes out as a 16-bit TIFF. A simulated rig without a
/// calibration calibrates itself first.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens run --rig RIG.toml --folder DIR           until it is stopped
  relens run --rig RIG.toml --folder DIR --once
  relens run --rig truthful.toml --folder DIR --scene sharp.png")]
pub(super) struct RunOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Empty the inbox and end
    #[arg(long)]
    once: bool,
    /// Take photos of PICTURE with a simulated rig, at each `relens press`
    ///
    /// As a rig of devices does with `[run] mode = "shoot"`. The scene is before the lens for the
    /// photo; the panel comes in its place some seconds after the box has asked for it.
    #[arg(
        long,
        value_name = "PICTURE",
        value_hint = ValueHint::FilePath,
        conflicts_with = "once"
    )]
    scene: Option<PathBuf>,
}

/// Watches the inbox, or empties it once.
pub(super) fn run(options: &RunOptions) -> Result<(), CliError> {
    let mut rig = config::load(&options.rig.rig)?;
    let scene = scene_of(&mut rig, options)?;
    let folders = Folders::open(&options.folder.folder)?;
    let gallery = folders.outbox().join("index.html");
    let stopped = signals::stop_flag(folders.root().to_owned())?;
    if options.once {
        let front = FrontPanel::default();
        let asked = interruption(front, Arc::clone(&stopped));
        let mut restorer =
            opening::restorer(&rig, folders.root(), None, Some(asked), opening::devices)?;
        let stop = || stopped.load(Ordering::Acquire);
        let summary = empty_inbox(&rig, folders, &mut *restorer, &stop)?;
        return conclude(&summary, &gallery);
    }
    service_manager().ready();
    let front = FrontPanel::default();
    // Declared before all that it outlives: the lamps go dark last.
    let _front_panel = FrontPanelThread::open(&rig, folders.root(), front.clone());
    let stop = || stopped.load(Ordering::Acquire);
    let times = Times {
        clock: &Monotonic,
        calendar: &SystemTime::now,
        is_set: &clock_is_set,
        temperature_c: &temperature_c,
    };
    let mut night = rig.nights.as_ref().and_then(|nights| Nightly::new(nights, &folders, times));
    let mut open = |asked| match &scene {
        Some(scene) => scene::restorer_before(scene, &rig, folders.root(), asked),
        None => {
            let devices = match rig.run.mode {
                Mode::Shoot => opening::devices_without_panel,
                Mode::Folder | Mode::Button => opening::devices,
            };
            opening::restorer(&rig, folders.root(), None, Some(asked), devices)
        }
    };
    let Some(mut restorer) =
        open_patiently(&rig, &folders, &front, &stopped, night.as_mut(), &mut open)?
    else {
        service_manager().stopping();
        return Ok(());
    };
    log::info!(
        "watching {}; results are shown by {}",
        folders.inbox().display(),
        gallery.display()
    );
    let night: Box<dyn Schedule> = match night {
        Some(night) => Box::new(night),
        None => Box::new(()),
    };
    // As for the nights: a box with a battery clock need not wait for a network.
    let battery = rig.nights.as_ref().is_some_and(|nights| nights.clock == ClockSource::Battery);
    let believed = || battery || clock_is_set();
    let mut schedule = Attended::new(front, rig.run.mode, &Monotonic, night);
    if rig.run.mode == Mode::Shoot {
        let (nights, countdown_s) = (rig.nights.as_ref(), rig.run.countdown_s);
        schedule = schedule.shooting(&folders, nights, countdown_s, &SystemTime::now);
    }
    let mut watcher = Supervised::new(service_manager(), Box::new(PhotoProgress::default()));
    let daemon = Daemon::open(
        folders,
        setting(&rig),
        &mut *restorer,
        &Monotonic,
        &SystemTime::now,
        &mut watcher,
    )?;
    daemon.scheduled(Box::new(schedule)).keeping(rig.keep, &believed).run(&stop);
    Ok(())
}

/// What a simulated `rig` photographs, which makes it one that takes photos.
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

/// The restorer of `rig`, tried until `open` has it; `None` when it was stopped before. What is
/// wrong is said by lamps, log, state file and service manager, and by the panel if at least that
/// can be had.
fn open_patiently(
    rig: &RigFile,
    folders: &Folders,
    front: &FrontPanel,
    stopped: &Arc<AtomicBool>,
    mut night: Option<&mut Nightly<'_>>,
    open: &mut dyn FnMut(Interruption) -> Result<Box<dyn Restorer>, CliError>,
) -> Result<Option<Box<dyn Restorer>>, CliError> {
    let mut told = (String::new(), Vec::new());
    loop {
        let asked = interruption(front.clone(), Arc::clone(stopped));
        service_manager().status("opening the rig");
        let trouble = match open(asked) {
            Ok(restorer) => return Ok(Some(restorer)),
            Err(trouble) => trouble,
        };
        if stopped.load(Ordering::Acquire) {
            say_ended(rig, folders);
            return Ok(None);
        }
        let reason = relens::remedy::full_message(&trouble);
        front.set(BoxState::Trouble);
        let attention = night.as_deref_mut().map_or(Vec::new(), |night| {
            night.shut_out(&reason);
            night.attention().iter().map(ToString::to_string).collect()
        });
        if told.0 != reason {
            log::warn!("holding: {reason}");
        }
        if told.1 != attention {
            attention.iter().for_each(|words| log::warn!("{words}"));
            let written = write_report(folders, &rig.name, &attention, unix_s());
            let _ =
                written.inspect_err(|error| log::debug!("{}", relens::remedy::full_message(error)));
        }
        let now = (reason.clone(), attention);
        if told != now {
            let doing = Doing::Held { reason: reason.clone() };
            // A disk that is full is told of by the log.
            let state =
                State { attention: now.1.clone(), ..State::new(&rig.name, doing, unix_s()) };
            let _ = state.write(folders);
            told = now;
        }
        service_manager().status(&format!("needs help: {reason}"));
        let _panel = opening::show_trouble(rig, &reason, trouble.what_to_do());
        let until = Monotonic.now().0 + OPEN_AGAIN_S;
        while Monotonic.now().0 < until {
            if stopped.load(Ordering::Acquire) {
                say_ended(rig, folders);
                return Ok(None);
            }
            Monotonic.wait_until(Moment(Monotonic.now().0 + 0.2));
        }
        // An attempt was finished; one that hangs in a device feeds no watchdog.
        service_manager().worked();
    }
}

/// Writes down that the daemon has ended; a disk that is full has been told of.
fn say_ended(rig: &RigFile, folders: &Folders) {
    let _ = State::new(&rig.name, Doing::Ended, unix_s()).write(folders);
}

fn unix_s() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

/// Whether the network has set the clock: the kernel says so, or, where a service may not ask it,
/// the mark that systemd-timesyncd leaves when it has (systemd-timesyncd.service(8)).
fn clock_is_set() -> bool {
    relens::rig::kernel_time::is_synchronised()
        || Path::new("/run/systemd/timesync/synchronized").exists()
}

/// Temperature of the board's first thermal zone, which on boards is the processor's.
fn temperature_c() -> Option<f64> {
    let text = std::fs::read_to_string("/sys/class/thermal/thermal_zone0/temp").ok()?;
    Some(text.trim().parse::<f64>().ok()? / 1000.0)
}

/// Restores all that is in the inbox of `folders`, until `stop` says so.
pub(super) fn empty_inbox(
    rig: &RigFile,
    folders: Folders,
    restorer: &mut dyn Restorer,
    stop: &dyn Fn() -> bool,
) -> Result<Summary, CliError> {
    let mut watcher = PhotoProgress::default();
    let mut daemon =
        Daemon::open(folders, setting(rig), restorer, &Monotonic, &SystemTime::now, &mut watcher)?;
    Ok(daemon.once_until(stop)?)
}

fn setting(rig: &RigFile) -> DaemonSetting {
    let reader = Reader::Worker(Worker::of_this_program());
    let floor_bytes = (rig.disk.floor_mib * f64::from(1 << 20)) as u64;
    DaemonSetting {
        reader,
        floor_bytes,
        needs_button: rig.run.mode != Mode::Folder,
        larger_photos: rig.run.larger_photos,
        raw_results: rig.photo.raw_results,
        ..DaemonSetting::new(&rig.name, rig.photo_grid(), rig.photo.curve)
    }
}

fn conclude(summary: &Summary, gallery: &Path) -> Result<(), CliError> {
    let counts = summary.counts();
    if counts.all() == 0 {
        say("the inbox is empty");
        return Ok(());
    }
    // What became of each, and why, the log has said.
    say(&format!("{counts}; see {}", gallery.display()));
    match counts.failed + counts.waiting.all() {
        0 => Ok(()),
        failed => Err(CliError::SomeFailed { failed, all: counts.all() }),
    }
}
