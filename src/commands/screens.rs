//! `relens screens`: what the panel shows between jobs, as pictures to look at.

use std::path::Path;

use relens::chart::scenes::Scene;
use relens::config::{Curve, Rig};
use relens::frame::{Frame, Work};
use relens::kiosk::screen::{draw, examples};
use relens::picture::{Format, Manner, encode};

use super::{CliError, say};

/// Draws one screen of each kind for the panel of `rig` into `out`.
pub(super) fn run(rig: &Rig, out: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(out).map_err(|e| CliError::writing(out, &e))?;
    let picture = Scene::Astronaut.codes(rig.photo.size());
    let picture: Frame<Work> =
        Frame::from_fn(|c| picture.plane(c).map(|v| 255.0 * (v / 255.0).powf(2.2)));
    let manner = Manner::plain(Format::Png, 8, Curve::Linear);
    for (name, screen) in examples() {
        let codes = draw(&screen, rig.panel.size(), Some((&picture, &picture)));
        // Codes as they are: the file's viewer is the panel.
        let light: Frame<Work> = Frame::from_fn(|c| codes.plane(c).map(f32::from));
        let path = out.join(format!("{name}.png"));
        let bytes = encode(name, &light, &manner, false).map_err(|e| CliError::of(&e))?;
        std::fs::write(&path, bytes).map_err(|e| CliError::writing(&path, &e))?;
    }
    say(&format!("written to {}", out.display()))
}
