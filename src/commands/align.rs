//! `relens align`: a live look at a rig that is being bolted together.

use clap::Args;
use console::Term;
use relens::alignment::plan::Plan;
use relens::alignment::{RigView, Sharpness};
use relens::config::{self, RigFile};

use super::error::CliError;
use super::options::RigOption;
use super::output::say;

/// Looks between two of aim and brightness, which change less often than focus.
const FOCUS_LOOKS: u64 = 8;

/// Focus, aim and expose a rig: a live look, and what to turn
///
/// Shows a fine pattern, and says how sharp the camera sees it at nine places (contrast in per
/// cent, and how much of the best so far that is); now and then where the panel lies on the sensor
/// and how bright it is. Needs no calibration. Ctrl-C ends it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens align --rig RIG.toml
  relens align --rig RIG.toml --looks 1
  relens align --rig RIG.toml --plan 25 27 3.45")]
pub(super) struct AlignOptions {
    #[command(flatten)]
    rig: RigOption,
    /// Looks before it ends; without it, until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    looks: Option<u64>,
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
    let rig = config::load(&options.rig.rig)?;
    if let Some([lens_mm, panel_inches, pixel_um]) = options.plan.as_deref() {
        let (panel, sensor) = (rig.panel.size(), rig.photo_grid().sensor);
        let (lens_mm, panel_inches, pixel_um) = (*lens_mm, *panel_inches, *pixel_um);
        say(&Plan { lens_mm, panel_inches, panel, pixel_um, sensor }.to_string());
        return Ok(());
    }
    let mut devices = relens::rig::open_without_marks(&rig).map_err(CliError::of)?;
    let mut alignment = RigView::new(&mut devices, &rig).map_err(CliError::of)?;
    let terminal = Term::stdout();
    let (mut best, mut pose, mut drawn) = (Sharpness([0.0; 9]), String::new(), 0);
    for look in 0..options.looks.unwrap_or(u64::MAX) {
        if look % FOCUS_LOOKS == 0 {
            pose = pose_and_light(&mut alignment, &rig)?;
        }
        let sharpness = alignment.sharpness().map_err(CliError::of)?;
        best = best.or_better(&sharpness);
        let text = format!(
            "focus {:5.1} %, best {:5.1} %\n{}\n{pose}",
            100.0 * sharpness.mean(),
            100.0 * best.mean(),
            sharpness.table(&best)
        );
        if terminal.is_term() {
            // A terminal that does not forget lines gets them one below the other.
            let _ = terminal.clear_last_lines(drawn);
        }
        drawn = text.lines().count();
        say(&text);
    }
    Ok(())
}

/// Where the panel lies and how bright it is, and what to do about it.
fn pose_and_light(alignment: &mut RigView<'_>, rig: &RigFile) -> Result<String, CliError> {
    let light = alignment.brightness().map_err(CliError::of)?;
    let mut todo = light.advice(rig.camera.exposure_ms, rig.panel.refresh_hz);
    let aim = match alignment.aim().map_err(CliError::of)? {
        Some(aim) => {
            todo.extend(aim.advice(rig.camera.size().width));
            format!(
                "the panel's middle is {:.0} px right of the sensor's and {:.0} px below, turned \
                 by {:.1}°, {:.2} sensor px a panel px",
                aim.offset_px[0], aim.offset_px[1], aim.turned_deg, aim.magnification
            )
        }
        None => {
            todo.insert(0, "the panel is not in view: aim the camera at its middle".to_owned());
            "where the panel is cannot be seen".to_owned()
        }
    };
    let mut lines = vec![
        format!(
            "white is {:.0} % of the range, {:.2} % of the sites full; it changes by {:.2} %",
            100.0 * light.white,
            100.0 * light.clipped_share,
            100.0 * light.flicker
        ),
        aim,
    ];
    match todo.is_empty() {
        true => lines.push("aim and brightness are well; turn the focus to the best".to_owned()),
        false => lines.extend(todo.into_iter().map(|line| format!("-> {line}"))),
    }
    Ok(lines.join("\n"))
}
