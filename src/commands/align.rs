//! `relens align`: live measurements while a rig is assembled.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, ValueHint};
use console::Term;
use relens::alignment::plan::Plan;
use relens::alignment::{Advice, AlignmentReport, GREYS, PLACES, RigView};
use relens::config::{self, Curve, RigFile};
use relens::disk::Files;
use relens::picture::{self, Format, Manner};

use super::error::CliError;
use super::options::RigOption;
use super::output::say;

/// Focus measurements between two of aim, and between two of brightness, which change less often
/// and take four times as long.
const FOCUS_LOOKS: u64 = 8;
/// Least time between two writes of the page, which reloads as often.
const PAGE_EVERY: Duration = Duration::from_secs(1);
/// File names of the page and its picture.
const PAGE: (&str, &str) = ("align.html", "align.png");

/// Focus, aim and expose a rig by live measurements
///
/// Shows a fine pattern and prints its contrast on the sensor at nine places, in per cent and
/// relative to the best so far; at times the panel's place on the sensor and its brightness; and
/// what to adjust next. Needs no calibration. Ctrl-C ends it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens align --rig RIG.toml
  relens align --rig RIG.toml --page DIR
  relens align --rig RIG.toml --light
  relens align --rig RIG.toml --leaks
  relens align --rig RIG.toml --plan 25 27 3.45")]
pub(super) struct AlignOptions {
    #[command(flatten)]
    rig: RigOption,
    /// Number of measurements; without it, until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    looks: Option<u64>,
    /// Also write a page into this folder, align.html, which reloads itself, with the camera's
    /// picture
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    page: Option<PathBuf>,
    /// Print the panel's tilt in degrees as well, for a lens of this focal length and sensor pixels
    /// of this side
    #[arg(long, num_args = 2, value_names = ["LENS_MM", "PIXEL_UM"], value_parser = length)]
    lens: Option<Vec<f64>>,
    /// Measure flicker over 200 captures of grey, and linearity of the camera's counts in exposure,
    /// and end
    #[arg(long, conflicts_with_all = ["looks", "page", "lens"])]
    light: bool,
    /// Find light leaks: shows black, and prints the light at the nine places above the least so
    /// far; move a torch around the box
    #[arg(long, conflicts_with_all = ["page", "lens", "light"])]
    leaks: bool,
    /// Print the distances of panel and sensor from a lens, and end: from its focal length, the
    /// panel's diagonal and the side of a sensor pixel, with the rig file's numbers of pixels
    #[arg(long, num_args = 3, value_names = ["LENS_MM", "PANEL_INCHES", "PIXEL_UM"],
          value_parser = length)]
    plan: Option<Vec<f64>>,
}

fn length(word: &str) -> Result<f64, String> {
    let inside = |length: &f64| (0.1..=10_000.0).contains(length);
    word.parse().ok().filter(inside).ok_or(format!("found {word}, allowed 0.1 to 10000"))
}

/// Runs `relens align`.
pub(super) fn run(options: &AlignOptions) -> Result<(), CliError> {
    if let Some([lens_mm, panel_inches, pixel_um]) = options.plan.as_deref() {
        let [panel, sensor] = config::sizes(&options.rig.rig)?;
        let (lens_mm, panel_inches, pixel_um) = (*lens_mm, *panel_inches, *pixel_um);
        say(&Plan { lens_mm, panel_inches, panel, pixel_um, sensor }.to_string());
        return Ok(());
    }
    let rig = config::load(&options.rig.rig)?;
    let mut devices = relens::rig::open_without_marks(&rig).map_err(CliError::of)?;
    let mut view = RigView::new(&mut devices, &rig).map_err(CliError::of)?;
    if options.light {
        measure_light(&mut view, &rig)
    } else if options.leaks {
        find_leaks(&mut view, options)
    } else {
        measure_live(&mut view, &rig, options)
    }
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

/// Prints the light at each place with a black panel.
fn find_leaks(view: &mut RigView<'_>, options: &AlignOptions) -> Result<(), CliError> {
    let (mut least, mut most) = ([f64::INFINITY; PLACES], 0.0f64);
    let mut terminal = Redrawn::new();
    for _ in 0..options.looks.unwrap_or(u64::MAX) {
        let seen = view.measure_darkness().map_err(CliError::of)?;
        least = std::array::from_fn(|n| least[n].min(seen[n]));
        let more: [f64; PLACES] = std::array::from_fn(|n| seen[n] - least[n]);
        most = more.iter().copied().fold(most, f64::max);
        let mut lines =
            vec![format!("more light than the least so far; most yet {:.2} %", 100.0 * most)];
        for row in more.chunks(3) {
            let cells: Vec<String> =
                row.iter().map(|more| format!("{:6.2} %", 100.0 * more)).collect();
            lines.push(format!("  {}", cells.join("  ")));
        }
        lines.extend(Advice::leaks(&more).map(|advice| format!("-> {advice}")));
        terminal.draw(&lines);
    }
    Ok(())
}

/// Measures and prints focus, aim and brightness.
fn measure_live(
    view: &mut RigView<'_>,
    rig: &RigFile,
    options: &AlignOptions,
) -> Result<(), CliError> {
    let image_distance_px = match options.lens.as_deref() {
        // With the panel some metres away, the image distance is about the focal length.
        Some([lens_mm, pixel_um]) => Some(1000.0 * lens_mm / pixel_um),
        _ => None,
    };
    let mut report = AlignmentReport::new(rig, image_distance_px);
    let page = options.page.as_ref().map(|folder| Page::new(folder.clone())).transpose()?;
    let mut written: Option<Instant> = None;
    let mut terminal = Redrawn::new();
    let looks = options.looks.unwrap_or(u64::MAX);
    for look in 0..looks {
        match look % (2 * FOCUS_LOOKS) {
            0 => {
                let (aim, seen) = view.measure_aim().map_err(CliError::of)?;
                report.add_aim(aim, seen);
                if look == 0 {
                    report.add_brightness(view.measure_brightness().map_err(CliError::of)?);
                }
            }
            FOCUS_LOOKS => report.add_brightness(view.measure_brightness().map_err(CliError::of)?),
            _ => {}
        }
        let seen = view.measure_focus().map_err(CliError::of)?;
        report.add_focus(&seen, view.now_s());
        terminal.draw(&report.lines());
        if let Some(page) = &page
            && (look + 1 == looks || written.is_none_or(|then| then.elapsed() >= PAGE_EVERY))
        {
            page.write(&report)?;
            written = Some(Instant::now());
        }
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

/// The page and its folder.
struct Page {
    files: Files,
    folder: PathBuf,
}

impl Page {
    fn new(folder: PathBuf) -> Result<Page, CliError> {
        let made = std::fs::create_dir_all(&folder).and_then(|()| folder.canonicalize());
        let folder = made.map_err(|e| CliError::writing(&folder, e))?;
        Ok(Page { files: Files::beneath(vec![folder.clone()]), folder })
    }

    /// Writes page and picture, each of them whole.
    fn write(&self, report: &AlignmentReport) -> Result<(), CliError> {
        if let Some(seen) = report.picture() {
            let manner = Manner::plain(Format::Png, 8, Curve::Srgb);
            let bytes = picture::encode(PAGE.1, &seen, &manner, true).map_err(CliError::of)?;
            self.put(PAGE.1, &bytes)?;
        }
        self.put(PAGE.0, report.page(PAGE.1).as_bytes())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        Ok(self.files.replace_for_now(&self.folder, name.as_ref(), bytes)?)
    }
}

/// Measures brightness, flicker and linearity, and prints advice.
fn measure_light(view: &mut RigView<'_>, rig: &RigFile) -> Result<(), CliError> {
    let white = view.measure_brightness().map_err(CliError::of)?;
    let mut todo = white.advice(rig.panel.refresh_hz);
    say(&format!(
        "white is {:.0} % of the range, {:.2} % of the sites full",
        100.0 * white.white,
        100.0 * white.clipped_share
    ));
    let steady = view.measure_steadiness(&mut |_| {}).map_err(CliError::of)?;
    todo.extend(steady.advice());
    say(&format!(
        "over {GREYS} captures of grey: {:.2} % of change from one to the next, {:.2} % in bands, \
         {:+.2} % from first to last",
        100.0 * steady.flicker,
        100.0 * steady.bands,
        100.0 * steady.drift
    ));
    match view.measure_linearity(rig).map_err(CliError::of)? {
        Some(linear) => {
            let [twice, thrice] = linear.ratios;
            todo.extend(Advice::linearity(&linear));
            say(&format!("2 and 3 times the exposure bring {twice:.2} and {thrice:.2} times"));
        }
        None => say("linearity: this camera's exposure cannot be set by program"),
    }
    if todo.is_empty() {
        say("the light is steady and linear");
        return Ok(());
    }
    Err(CliError::Faults(todo.iter().map(Advice::to_string).collect()))
}
