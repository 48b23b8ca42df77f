//! `relens align`: live measurements while a rig is assembled.

use clap::Args;
use console::Term;
use relens::alignment::{AlignmentReport, RigView};
use relens::config::{self, RigFile};

use super::error::CliError;
use super::options::RigOption;
use super::output::say;

/// Focus measurements between one of aim and the next of brightness, or the reverse; aim and
/// brightness change less often and take four times as long.
const FOCUS_LOOKS: u64 = 8;

/// Focus, aim and expose a rig by live measurements
///
/// Shows a fine pattern and prints its contrast on the sensor at nine places, in per cent and
/// relative to the best so far; at times the panel's place on the sensor and its brightness; and
/// what to adjust next. Needs no calibration. Ctrl-C ends it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens align --rig RIG.toml")]
pub(super) struct AlignOptions {
    #[command(flatten)]
    rig: RigOption,
    /// Number of measurements; without it, until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    looks: Option<u64>,
}

pub(super) fn run(options: &AlignOptions) -> Result<(), CliError> {
    let rig = config::load(&options.rig.rig)?;
    let mut devices = relens::rig::open_without_marks(&rig)?;
    let mut view = RigView::new(&mut devices, &rig)?;
    measure_live(&mut view, &rig, options.looks.unwrap_or(u64::MAX))
}

/// Lines of a terminal, redrawn each time.
struct Redrawn {
    terminal: Term,
    drawn: usize,
}

impl Redrawn {
    fn new() -> Redrawn {
        Redrawn { terminal: Term::stdout(), drawn: 0 }
    }

    fn draw(&mut self, lines: &[String]) {
        let is_term = self.terminal.is_term();
        let columns = if is_term { usize::from(self.terminal.size().1) } else { 100 };
        let lines = wrapped(lines, columns.max(20) - 1);
        if is_term {
            // Where lines cannot be cleared, they follow each other.
            let _ = self.terminal.clear_last_lines(self.drawn);
        }
        self.drawn = lines.len();
        say(&lines.join("\n"));
    }
}

fn measure_live(view: &mut RigView<'_>, rig: &RigFile, looks: u64) -> Result<(), CliError> {
    let mut report = AlignmentReport::new(rig);
    let mut terminal = Redrawn::new();
    for look in 0..looks {
        match look % (2 * FOCUS_LOOKS) {
            0 => {
                report.add_aim(view.measure_aim()?);
                if look == 0 {
                    report.add_brightness(view.measure_brightness()?);
                }
            }
            FOCUS_LOOKS => report.add_brightness(view.measure_brightness()?),
            _ => {}
        }
        report.add_focus(&view.measure_focus()?);
        terminal.draw(&report.lines());
    }
    Ok(())
}

/// `lines` wrapped to `columns` letters, continuation lines indented.
fn wrapped(lines: &[String], columns: usize) -> Vec<String> {
    let mut all = Vec::new();
    for line in lines {
        let mut rest: Vec<char> = line.chars().collect();
        while rest.len() > columns {
            let space = rest[..=columns].iter().rposition(|&c| c == ' ').filter(|&n| n > 4);
            let (end, next) = space.map_or((columns, columns), |n| (n, n + 1));
            all.push(rest[..end].iter().collect());
            rest = "   ".chars().chain(rest[next..].iter().copied()).collect();
        }
        all.push(rest.into_iter().collect());
    }
    all
}
