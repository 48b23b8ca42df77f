//! `relens run`: the daemon over a drop folder.

use std::ffi::OsStr;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use relens::config::{ClockSource, Rig};
use relens::daemon::service::Supervised;
use relens::daemon::{
    Attended, Daemon, Doing, Folders, Nightly, ProgressLine, Reader, Restorer, Schedule, Setting,
    State, Summary, Times, Watcher, interruption, write_report,
};
use relens::kiosk::front::{self, Front};
use relens::picture::worker::Worker;
use relens::rig::{Clock, Moment};

use super::clock::MachineClock;
use super::front_desk::FrontDesk;
use super::{CliError, rigged, say, service_manager, single};

/// Seconds between two attempts to open a rig that cannot be opened.
const OPEN_AGAIN_S: f64 = 30.0;

/// Watches the inbox in `folder`, or empties it `once`; alone, or as one box of several.
pub(super) fn run(
    rig: &Path,
    folder: &Path,
    once: bool,
    share_as: Option<&OsStr>,
) -> Result<(), CliError> {
    let rig = single::rig(rig)?;
    let folders = match share_as {
        None => Folders::open(folder)?,
        Some(name) => Folders::open_shared(folder, name)?,
    };
    let gallery = folders.outbox().join("index.html");
    let stopped = stop_flag()?;
    if once {
        let front = Front::default();
        let asked = interruption(front, Arc::clone(&stopped));
        let mut restorer =
            rigged::restorer(&rig, &folders.home(), None, Some(asked), &mut |words| {
                log::info!("{words}")
            })?;
        let summary = empty_inbox(&rig, folders, &mut *restorer)?;
        return conclude(&summary, &gallery);
    }
    service_manager().ready();
    let front = Front::default();
    // Declared before all that it outlives: the lamps go dark last.
    let _desk = FrontDesk::open(&rig, folders.root(), front.clone());
    let clock = MachineClock::new();
    let stop = || stopped.load(Ordering::Acquire);
    let times = Times {
        clock: &clock,
        calendar: &SystemTime::now,
        is_set: &clock_is_set,
        temperature_c: &temperature_c,
    };
    let mut night = rig.nights.as_ref().and_then(|nights| Nightly::new(nights, &folders, times));
    let Some(mut restorer) =
        open_patiently(&rig, &folders, &front, &stopped, &clock, night.as_mut())?
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
    let schedule = Attended::new(front, rig.run.mode, &clock, night);
    let mut watcher = Supervised::new(service_manager(), watcher());
    let daemon = Daemon::open(
        folders,
        setting(&rig),
        &mut *restorer,
        &clock,
        &SystemTime::now,
        &mut watcher,
    )?;
    daemon.scheduled(Box::new(schedule)).keeping(rig.keep, &believed).run(&stop);
    Ok(())
}

/// True once SIGTERM or SIGINT came: the photo under way is given up before its next capture, or
/// finished. A second SIGINT ends the program at once, for those who sit before it.
fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let stopped = Arc::new(AtomicBool::new(false));
    let failed = |error: std::io::Error| CliError::Failure {
        words: format!("cannot listen to signals: {error}"),
        remedy: relens::remedy::Remedy::CallOperator,
    };
    signal_hook::flag::register_conditional_shutdown(SIGINT, 130, Arc::clone(&stopped))
        .map_err(failed)?;
    for signal in [SIGTERM, SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stopped)).map_err(failed)?;
    }
    Ok(stopped)
}

/// The restorer of `rig`, tried until it can be had; `None` when it was stopped before. What is
/// wrong is said by lamps, log, state file and service manager, and by the panel if at least that
/// can be had.
fn open_patiently(
    rig: &Rig,
    folders: &Folders,
    front: &Front,
    stopped: &Arc<AtomicBool>,
    clock: &MachineClock,
    mut night: Option<&mut Nightly<'_>>,
) -> Result<Option<Box<dyn Restorer>>, CliError> {
    let mut told = (String::new(), Vec::new());
    loop {
        let asked = interruption(front.clone(), Arc::clone(stopped));
        service_manager().status("opening the rig");
        let tell = &mut |words: &str| log::info!("{words}");
        let trouble = match rigged::restorer(rig, &folders.home(), None, Some(asked), tell) {
            Ok(restorer) => return Ok(Some(restorer)),
            Err(trouble) => trouble,
        };
        let reason = relens::remedy::full_message(&trouble);
        front.set(front::State::Trouble { reason: reason.clone() });
        let attention = night.as_deref_mut().map_or(Vec::new(), |night| {
            night.shut_out(&reason);
            night.attention()
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
        let _panel = rigged::show_trouble(rig, &reason);
        let until = clock.now().0 + OPEN_AGAIN_S;
        while clock.now().0 < until {
            if stopped.load(Ordering::Acquire) {
                let _ = State::new(&rig.name, Doing::Ended, unix_s()).write(folders);
                return Ok(None);
            }
            clock.wait_until(Moment(clock.now().0 + 0.2));
        }
        // An attempt was finished; one that hangs in a device feeds no watchdog.
        service_manager().worked();
    }
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

/// Restores all that is in the inbox of `folders`.
pub(super) fn empty_inbox(
    rig: &Rig,
    folders: Folders,
    restorer: &mut dyn Restorer,
) -> Result<Summary, CliError> {
    let (clock, mut watcher) = (MachineClock::new(), watcher());
    let mut daemon =
        Daemon::open(folders, setting(rig), restorer, &clock, &SystemTime::now, &mut *watcher)?;
    Ok(daemon.once()?)
}

/// A line that moves on a terminal, nothing elsewhere: the log has one line a photo.
fn watcher() -> Box<dyn Watcher> {
    match std::io::stderr().is_terminal() {
        true => Box::new(ProgressLine::new(std::io::stderr())),
        false => Box::new(()),
    }
}

fn setting(rig: &Rig) -> Setting {
    let reader = Reader::Worker(Worker::of_this_program());
    let floor_bytes = (rig.disk.floor_mib * f64::from(1 << 20)) as u64;
    let lease_s = rig.share.lease_s;
    Setting {
        reader,
        floor_bytes,
        lease_s,
        ..Setting::new(&rig.name, rig.photo.size(), rig.photo.curve)
    }
}

fn conclude(summary: &Summary, gallery: &Path) -> Result<(), CliError> {
    let (restored, failed, left) =
        (summary.restored.len(), summary.failed.len(), summary.left.len());
    if restored + failed + left == 0 {
        return say("the inbox is empty");
    }
    for photo in &summary.failed {
        say(&format!("not restored: {}", photo.reason))?;
    }
    for photo in &summary.left {
        say(&format!("left in the inbox: {}", photo.reason))?;
    }
    say(&format!("{restored} restored, {failed} failed, {left} left; see {}", gallery.display()))?;
    match failed + left {
        0 => Ok(()),
        failed => Err(CliError::SomeFailed { failed, all: restored + failed }),
    }
}
