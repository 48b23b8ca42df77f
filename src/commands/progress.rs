//! A command's progress: one line at the foot of the terminal, below the log.
//!
//! Nothing is drawn where standard error is no terminal, or one that cannot move its cursor
//! (`TERM=dumb`). There are no colours.

use std::io::IsTerminal;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use console::{Term, truncate_str};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use relens::daemon::{self, Doing, Watcher};
use relens::measurement::CalibrationProgress;

use super::service::service_manager;

/// Columns of the bar, and those kept free, where terminals echo `^C`, so that it is cleared with
/// the line.
const BAR_COLUMNS: u16 = 18 + 4;

static QUIET: AtomicBool = AtomicBool::new(false);

/// Suppresses all output but warnings and errors.
pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether output but warnings and errors is suppressed.
pub(super) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Whether progress is drawn: on a terminal that can, and without `--quiet`.
pub(super) fn is_drawn() -> bool {
    let moves = !is_quiet()
        && std::env::var_os("TERM").is_some_and(|name| !name.is_empty() && name != "dumb");
    moves && std::io::stderr().is_terminal()
}

/// The program's only line.
fn bar() -> &'static ProgressBar {
    static BAR: OnceLock<ProgressBar> = OnceLock::new();
    BAR.get_or_init(|| {
        let target = match is_drawn() {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(1), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:10} {percent:>3} %  {msg}") {
            bar.set_style(style.progress_chars("█░"));
        }
        bar.finish_and_clear();
        bar
    })
}

/// Shows `done` of `all`, and the step in progress. Control characters, which a photo's name may
/// hold, are replaced.
pub(super) fn show(done: u64, all: u64, doing: &str) {
    let bar = bar();
    if bar.is_finished() {
        bar.reset();
    }
    bar.update(|state| {
        state.set_len(all.max(1));
        state.set_pos(done.min(all));
    });
    let safe = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let doing: String = doing.chars().map(safe).collect();
    let room = Term::stderr().size().1.saturating_sub(BAR_COLUMNS);
    bar.set_message(truncate_str(&doing, room.into(), "").into_owned());
}

/// Clears the line until the next [`show`].
pub(super) fn clear() {
    bar().finish_and_clear();
}

/// Clears the line for good: other threads may still draw while the program ends.
pub(super) fn leave() {
    clear();
    bar().set_draw_target(ProgressDrawTarget::hidden());
}

/// Runs `write`, whose output goes above the progress line.
pub(super) fn above(write: impl FnOnce()) {
    bar().suspend(write);
}

/// Shows the progress of a calibration, and reports each capture to the watchdog.
pub(super) fn calibrating(progress: CalibrationProgress) {
    service_manager().worked();
    let CalibrationProgress { step, captures, total } = progress;
    show(captures.into(), total.into(), &format!("calibrating: {step}, {captures} of {total}"));
}

/// The progress of photos.
#[derive(Debug, Default)]
pub(super) struct PhotoProgress {
    label: String,
}

impl Watcher for PhotoProgress {
    fn begun(&mut self, name: &str, number: usize, of: usize) {
        self.label = match of.max(number) {
            1 => name.to_owned(),
            of => format!("{number} of {of}, {name}"),
        };
        show(0, 100, &format!("reading {}", self.label));
    }

    fn progress(&mut self, progress: daemon::Progress) {
        let captures = match progress.captures {
            0 => String::new(),
            1 => ", 1 capture".to_owned(),
            n => format!(", {n} captures"),
        };
        // NaN counts as 0.
        let percent = (progress.done.clamp(0.0, 1.0) * 100.0) as u64;
        show(percent, 100, &format!("{}{captures}: {}", progress.doing, self.label));
    }

    fn ended(&mut self) {
        clear();
    }

    fn doing(&mut self, doing: &Doing) {
        if !matches!(doing, Doing::Restoring { .. }) {
            clear();
        }
    }
}
