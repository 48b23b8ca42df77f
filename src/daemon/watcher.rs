//! Who looks on: a line on a terminal, nobody, or a test that stops the daemon between two steps.

use std::io::Write;

use super::{Doing, Progress};

/// The steps of a job at which the disk has changed. Between any two the power may fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// The photo is in `working`.
    Claimed,
    /// The attempt is written down.
    Recorded,
    /// The picture is restored and held in memory.
    Restored,
    /// The result's name is written down.
    Named,
    /// The gallery's pictures and the report are in the outbox.
    Reported,
    /// The result is in the outbox.
    Delivered,
    /// The original is in `done`.
    Moved,
    /// The record of the job is removed.
    Closed,
}

impl Step {
    /// All steps in order.
    pub const ALL: [Step; 8] = [
        Step::Claimed,
        Step::Recorded,
        Step::Restored,
        Step::Named,
        Step::Reported,
        Step::Delivered,
        Step::Moved,
        Step::Closed,
    ];
}

/// Looks on while the daemon works. Each method may do nothing.
pub trait Watcher {
    /// A photo is begun: its name, its number in this pass and how many are waiting in all.
    fn begun(&mut self, name: &str, number: usize, of: usize) {
        let _ = (name, number, of);
    }
    /// The restoration of the photo begun last has come further.
    fn progress(&mut self, progress: Progress) {
        let _ = progress;
    }
    /// The disk has changed.
    fn step(&mut self, step: Step) {
        let _ = step;
    }
    /// The photo begun last is over and its log line is about to be written.
    fn ended(&mut self) {}
    /// The loop has come round: a look at the inbox is over, whatever it found.
    fn looked(&mut self) {}
    /// What the daemon does has changed.
    fn doing(&mut self, doing: &Doing) {
        let _ = doing;
    }
}

/// Nobody looks on.
impl Watcher for () {}

/// One line that is drawn over and over: `photo.jpg 3 of 12 ████████░░░░ 62 % shrinking 2
/// captures`.
#[derive(Debug)]
pub struct ProgressLine<W: Write> {
    out: W,
    label: String,
    drawn: Option<u32>,
}

impl<W: Write> ProgressLine<W> {
    /// A line on `out`, which must be a terminal.
    pub fn new(out: W) -> Self {
        ProgressLine { out, label: String::new(), drawn: None }
    }

    fn draw(&mut self, progress: Progress) {
        const CELLS: usize = 24;
        let share = if progress.done.is_finite() { progress.done.clamp(0.0, 1.0) } else { 0.0 };
        let percent = (share * 100.0) as u32;
        if self.drawn == Some(percent) {
            return;
        }
        self.drawn = Some(percent);
        let full = (share * CELLS as f32).round() as usize;
        let bar = "█".repeat(full) + &"░".repeat(CELLS - full);
        let captures = match progress.captures {
            0 => String::new(),
            1 => "  1 capture".to_owned(),
            n => format!("  {n} captures"),
        };
        // A line that cannot be drawn is no reason to stop restoring.
        let _ = write!(
            self.out,
            "\r\x1b[2K{}  {bar} {percent:3} %  {}{captures}",
            self.label, progress.doing
        );
        let _ = self.out.flush();
    }
}

impl<W: Write> Watcher for ProgressLine<W> {
    fn begun(&mut self, name: &str, number: usize, of: usize) {
        let name: String = name.chars().filter(|c| !c.is_control()).collect();
        let short: String = name.chars().take(28).collect();
        let more = if name.chars().count() > 28 { "…" } else { "" };
        self.label = format!("{short}{more}  {number} of {}", of.max(number));
        self.drawn = None;
        self.draw(Progress { done: 0.0, doing: "reading", captures: 0 });
    }

    fn progress(&mut self, progress: Progress) {
        self.draw(progress);
    }

    fn ended(&mut self) {
        let _ = write!(self.out, "\r\x1b[2K");
        let _ = self.out.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_says_what_is_going_on_and_cleans_up() {
        let mut line = ProgressLine::new(Vec::new());
        line.begun("holi\x1bday.jpg", 3, 12);
        line.progress(Progress { done: 0.5, doing: "shrinking", captures: 2 });
        line.progress(Progress { done: f32::NAN, doing: "shrinking", captures: 2 });
        line.ended();
        let text = String::from_utf8(line.out).unwrap();
        assert!(
            text.contains("holiday.jpg  3 of 12") && text.contains(" 50 %  shrinking  2 captures")
        );
        assert!(text.ends_with("\r\x1b[2K"));
    }
}
