//! `relens screens`: the panel's screens between jobs, as pictures.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use relens::chart::scenes::Scene;
use relens::config::{self, Curve};
use relens::frame::{Frame, Work};
use relens::kiosk::screen::{PhotoPair, draw, examples};
use relens::picture::{Format, Manner, encode};

use super::error::CliError;
use super::options::RigOption;
use super::output::say;

/// Draw the panel's screens between jobs
///
/// Draws one screen of each kind for the rig's panel, as PNG files.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens screens --rig RIG.toml -o DIR")]
pub(super) struct ScreensOptions {
    #[command(flatten)]
    rig: RigOption,
    /// Folder for the pictures, made if missing
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: PathBuf,
}

/// Runs `relens screens`.
pub(super) fn run(options: &ScreensOptions) -> Result<(), CliError> {
    // The sizes alone, so that a panel can be viewed before its devices are supported.
    let [panel, camera] = config::sizes(&options.rig.rig)?;
    let out = &options.out;
    std::fs::create_dir_all(out).map_err(|e| CliError::writing(out, e))?;
    let picture = Scene::Astronaut.codes(camera);
    let picture: Frame<Work> =
        Frame::from_fn(|c| picture.plane(c).map(|v| 255.0 * (v / 255.0).max(0.0).powf(2.2)));
    let manner = Manner::plain(Format::Png, 8, Curve::Linear);
    for (name, screen) in examples() {
        let codes = draw(&screen, panel, Some(PhotoPair { before: &picture, after: &picture }));
        // Codes as they are, for the viewer stands for the panel.
        let light: Frame<Work> = Frame::from_fn(|c| codes.plane(c).map(f32::from));
        let path = out.join(format!("{name}.png"));
        let bytes = encode(name, &light, &manner, false).map_err(CliError::of)?;
        std::fs::write(&path, bytes).map_err(|e| CliError::writing(&path, e))?;
    }
    say(&format!("written to {}", out.display()));
    Ok(())
}
