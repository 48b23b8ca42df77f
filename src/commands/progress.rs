//! How far a command is: one line at the foot of a terminal, with the log's lines above it.
//!
//! Nothing is drawn where standard error is no terminal, or one that cannot move its cursor
//! (`TERM=dumb`). There are no colours.

use std::io::{IsTerminal, Result};
use std::sync::OnceLock;

use console::Term;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};
use relens::daemon::{self, Doing, Watcher};
use relens::measurement::CalibrationProgress;

use super::output::is_quiet;
use super::service::service_manager;

/// Columns that are left free: there a terminal shows the `^C` of a key, and it is cleared with the
/// line.
const ECHO_COLUMNS: u16 = 4;

/// A terminal that says it is a little narrower than it is.
#[derive(Debug)]
struct Narrowed(Term);

impl TermLike for Narrowed {
    fn width(&self) -> u16 {
        // Whoever says how wide it is, for a terminal that cannot or lies, is believed.
        let said = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
        let columns: u16 = said.filter(|&columns| columns > 0).unwrap_or(self.0.size().1);
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

/// Whether there is a terminal to draw on, and somebody who wants to see it.
pub(super) fn is_drawn() -> bool {
    let moves = !is_quiet()
        && std::env::var_os("TERM").is_some_and(|name| !name.is_empty() && name != "dumb");
    moves && std::io::stderr().is_terminal()
}

/// The line, which is the program's only one.
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
        // The words get what the terminal has left, and are cut there.
        if let Ok(style) = ProgressStyle::with_template("{bar:10} {percent:>3} %  {wide_msg}") {
            bar.set_style(style.progress_chars("█░"));
        }
        bar.finish_and_clear();
        bar
    })
}

/// Draws that `done` of `all` is done, and what is being done. Control characters, which a photo's
/// name may hold, are shown and not obeyed.
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

/// Takes the line away until the next [`show`].
pub(super) fn clear() {
    bar().finish_and_clear();
}

/// Takes the line away for good: the program ends while others may still draw.
pub(super) fn leave() {
    clear();
    bar().set_draw_target(ProgressDrawTarget::hidden());
}

/// Writes above the line of progress what `write` writes.
pub(super) fn above(write: impl FnOnce()) {
    bar().suspend(write);
}

/// The progress of a calibration, each of whose captures is a sign of life.
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
        // A share that is not a number is none.
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
