//! A command's progress: one line at the foot of the terminal, below the log.
//!
//! Nothing is drawn where standard error is no terminal, or one that cannot move its cursor
//! (`TERM=dumb`). There are no colours.

use std::io::{IsTerminal, Result};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use console::Term;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};
use relens::daemon::{self, Doing, Watcher};
use relens::measurement::CalibrationProgress;

use super::service::service_manager;

/// Columns kept free for the `^C` that terminals echo, so that it is cleared with the line.
const ECHO_COLUMNS: u16 = 4;

static QUIET: AtomicBool = AtomicBool::new(false);

pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether all output but warnings and errors is suppressed.
pub(super) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// A terminal, with its width reduced by [`ECHO_COLUMNS`].
#[derive(Debug)]
struct Narrowed(Term);

impl TermLike for Narrowed {
    fn width(&self) -> u16 {
        // `COLUMNS` is for terminals that do not report their width.
        let stated = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
        let columns: u16 = stated.filter(|&columns| columns > 0).unwrap_or(self.0.size().1);
        columns.saturating_sub(ECHO_COLUMNS).max(1)
    }
    fn height(&self) -> u16 {
        self.0.size().0
    }
    fn move_cursor_up(&self, n: usize) -> Result<()> {
        self.0.move_cursor_up(n)
    }
    fn move_cursor_down(&self, n: usize) -> Result<()> {
        self.0.move_cursor_down(n)
    }
    fn move_cursor_right(&self, n: usize) -> Result<()> {
        self.0.move_cursor_right(n)
    }
    fn move_cursor_left(&self, n: usize) -> Result<()> {
        self.0.move_cursor_left(n)
    }
    fn write_line(&self, line: &str) -> Result<()> {
        self.0.write_line(line)
    }
    fn write_str(&self, text: &str) -> Result<()> {
        self.0.write_str(text)
    }
    fn clear_line(&self) -> Result<()> {
        self.0.clear_line()
    }
    fn flush(&self) -> Result<()> {
        self.0.flush()
    }
}

/// Whether progress is drawn: on a terminal that can move its cursor, without `--quiet`.
pub(super) fn is_drawn() -> bool {
    let moves = !is_quiet()
        && std::env::var_os("TERM").is_some_and(|name| !name.is_empty() && name != "dumb");
    moves && std::io::stderr().is_terminal()
}

fn bar() -> &'static ProgressBar {
    static BAR: OnceLock<ProgressBar> = OnceLock::new();
    BAR.get_or_init(|| {
        let target = match is_drawn() {
            true => ProgressDrawTarget::term_like_with_hz(
                Box::new(Narrowed(Term::buffered_stderr())),
                20,
            ),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(1), target);
        // The message takes the remaining width, and is cut there.
        if let Ok(style) = ProgressStyle::with_template("{bar:10} {percent:>3} %  {wide_msg}") {
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
    bar.set_message(doing.chars().map(safe).collect::<String>());
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
