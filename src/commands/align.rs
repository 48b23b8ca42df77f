//! `relens align`: a live look at a rig that is being bolted together.

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

/// Looks between two at where the panel lies, and between two at white: they change less often than
/// focus. One of the two, and the pattern after it, take four looks' time.
const FOCUS_LOOKS: u64 = 8;
/// The page is written no more often than it is loaded.
const PAGE_EVERY: Duration = Duration::from_secs(1);
/// The page and its picture.
const PAGE: (&str, &str) = ("align.html", "align.png");

/// Focus, aim and expose a rig: a live look, and what to turn
///
/// Shows a fine pattern, and says how sharp the camera sees it at nine places (contrast in per
/// cent, and how much of the best so far that is); now and then where the panel lies on the sensor
/// and how bright it is; and what to do next. Needs no calibration. Ctrl-C ends it.
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
    /// Looks before it ends; without it, until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    looks: Option<u64>,
    /// Write the same into this folder as a page, align.html, which loads itself anew, and a
    /// picture of what the camera sees
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    page: Option<PathBuf>,
    /// Say the panel's tilt in degrees, too: of a lens of this focal length before a sensor with
    /// pixels of this side
    #[arg(long, num_args = 2, value_names = ["LENS_MM", "PIXEL_UM"], value_parser = length)]
    lens: Option<Vec<f64>>,
    /// Measure the light and end: flicker over 200 captures of grey, and whether the camera's
    /// counts follow the exposure
    #[arg(long, conflicts_with_all = ["looks", "page", "lens"])]
    light: bool,
    /// Look for light that comes into the box: shows black, and how much more than the least so far
    /// each of the nine places sees; go around the box with a torch
    #[arg(long, conflicts_with_all = ["page", "lens", "light"])]
    leaks: bool,
    /// How far panel and sensor go from such a lens, and nothing else: its focal length, the
    /// panel's diagonal and the side of a sensor pixel; the rig file says how many pixels there are
    #[arg(long, num_args = 3, value_names = ["LENS_MM", "PANEL_INCHES", "PIXEL_UM"],
          value_parser = length)]
    plan: Option<Vec<f64>>,
}

fn length(word: &str) -> Result<f64, String> {
    let inside = |length: &f64| (0.1..=10_000.0).contains(length);
    word.parse().ok().filter(inside).ok_or(format!("found {word}, allowed 0.1 to 10000"))
}

/// `relens align`.
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
        look_for_leaks(&mut view, options)
    } else {
        live(&mut view, &rig, options)
    }
}

/// Lines of a terminal that are written anew each time.
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
            // A terminal that does not forget lines gets them one below the other.
            let _ = self.terminal.clear_last_lines(self.drawn);
        }
        self.drawn = lines.len();
        say(&lines.join("\n"));
    }
}

/// Says what each place sees in the dark, until there were enough looks.
fn look_for_leaks(view: &mut RigView<'_>, options: &AlignOptions) -> Result<(), CliError> {
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

/// Looks until there were enough of them.
fn live(view: &mut RigView<'_>, rig: &RigFile, options: &AlignOptions) -> Result<(), CliError> {
    let image_distance_px = match options.lens.as_deref() {
        // Focused at a panel some metres away, the image is hardly farther than the focal length.
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

/// Lines of at most `columns` letters, the rest of longer ones below them, set in.
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

/// The folder that the page is in.
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

    /// Writes page and picture anew, each of them whole.
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

/// Measures what a live look cannot, says it, and what to do.
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
        say("the light is well");
        return Ok(());
    }
    Err(CliError::Unwell(todo.iter().map(Advice::to_string).collect()))
}
