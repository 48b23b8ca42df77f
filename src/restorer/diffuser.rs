//! The lens's own dark corner: measured behind a diffuser, kept beside the calibration, taken out
//! of results where the rig file asks for it (`remove-vignetting`).

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::on_rig::black_of;
use super::{keep, kept};
use crate::calibration::{Calibration, Layout, LensFlat, store};
use crate::config;
use crate::frame::{Channel, Frame, SensorSpace};
use crate::remedy::{AnyFailure, Remediable, Remedy};
use crate::rig::exposure::Devices;
use crate::rig::shoot::{CLIPPED_SHARE_MAX, CountRange, meter, shoot};

/// Name of the file beside the calibration's slots.
const NAME: &str = "lens-flat.json";
/// Exposures of a take: they bring the noise of a place far below a thousandth.
const EXPOSURES: u8 = 16;
/// Multiples of the rig file's exposure that are tried.
const TIMES: (f64, f64) = (0.05, 20.0);
/// Mean light of a take, as a share of the range, at the least. Guess.
const LIGHT_MIN: f64 = 0.1;

#[derive(Serialize, Deserialize)]
struct KeptFlat {
    /// Identity of the rig it was measured on, in hexadecimal: numbers of JSON have 53 bits.
    rig: String,
    flat: LensFlat,
}

/// Why nothing was measured or kept.
#[derive(Debug, thiserror::Error)]
pub enum DiffuserError {
    /// Too much or too little light.
    #[error(
        "behind the diffuser the camera sees {found_percent:.1} % of its range and \
         {clipped_percent:.2} % of its sites are full, allowed {allowed_percent:.0} % or more and \
         {clipped_allowed_percent} %: {todo}"
    )]
    Light {
        /// Mean light.
        found_percent: f64,
        /// Full sites.
        clipped_percent: f64,
        /// Least light.
        allowed_percent: f64,
        /// Most full sites.
        clipped_allowed_percent: f64,
        /// What to do.
        todo: &'static str,
    },
    /// The file cannot be written.
    #[error("cannot keep what was measured in {folder}")]
    Keep {
        /// The folder.
        folder: std::path::PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
}

impl Remediable for DiffuserError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}

/// Measures what the lens of `devices` alone darkens, behind an evenly lit diffuser that `turn`
/// asks to be turned between two takes, and keeps it beside the calibration in `slots`.
///
/// # Errors
/// When there is no calibration to tell black from, too little light, light that is not even, or no
/// room to keep it.
pub fn measure(
    config: &config::RigFile,
    devices: &mut Devices,
    slots: &Path,
    turn: &mut dyn FnMut(),
) -> Result<LensFlat, AnyFailure> {
    let calibration = store::load(slots, config.identity).map_err(boxed)?;
    let range =
        CountRange { black: black_of(config, &calibration), max: config.camera.count_max() };
    // A camera whose exposure is set elsewhere is taken as it is.
    meter(devices, config.mosaic(), range, TIMES).map_err(boxed)?;
    let first = take(config, devices, &calibration, range);
    let both = first.and_then(|first| {
        turn();
        Ok([first, take(config, devices, &calibration, range)?])
    });
    devices.expose_times(1.0).map_err(boxed)?;
    let flat = LensFlat::of(&both?, &Layout::of(config)).map_err(boxed)?;
    let bytes = serde_json::to_vec(&KeptFlat { rig: identity(config), flat: flat.clone() });
    bytes
        .map_err(std::io::Error::other)
        .and_then(|bytes| keep(slots, NAME, &bytes))
        .map_err(|source| boxed(DiffuserError::Keep { folder: slots.to_owned(), source }))?;
    Ok(flat)
}

/// Some exposures: straight counts over black.
fn take(
    config: &config::RigFile,
    devices: &mut Devices,
    calibration: &Calibration,
    range: CountRange,
) -> Result<Frame<SensorSpace>, AnyFailure> {
    let shot = shoot(devices, config.mosaic(), range, EXPOSURES).map_err(boxed)?;
    let curve = &calibration.camera_curve;
    let middle = config.canvas_size();
    let seen: Frame<SensorSpace> = Frame::from_fn(|c| {
        let black = &calibration.black[c.index()];
        let black = black.at(middle.width as f64 / 2.0, middle.height as f64 / 2.0) as f32;
        let step = f32::from(1u16 << shot.finer);
        shot.counts.plane(c).map(|count| curve.count(f32::from(count) / step) - black)
    });
    let light = seen.plane(Channel::Green).mean() / (f64::from(range.max) - range.black).max(1.0);
    let too_dark = light < LIGHT_MIN;
    if too_dark || shot.clipped_share > 10.0 * CLIPPED_SHARE_MAX {
        return Err(boxed(DiffuserError::Light {
            found_percent: 100.0 * light,
            clipped_percent: 100.0 * shot.clipped_share,
            allowed_percent: 100.0 * LIGHT_MIN,
            clipped_allowed_percent: 1000.0 * CLIPPED_SHARE_MAX,
            todo: if too_dark { "more light" } else { "less light" },
        }));
    }
    Ok(seen)
}

/// What was measured on the rig of `config`, whose calibration is in `slots`; nothing where nothing
/// was, or it is another rig's.
pub fn load(config: &config::RigFile, slots: &Path) -> Option<LensFlat> {
    let kept: KeptFlat = serde_json::from_slice(&kept(slots, NAME).ok()?).ok()?;
    (kept.rig == identity(config) && kept.flat.fits(config.photo.size())).then_some(kept.flat)
}

fn identity(config: &config::RigFile) -> String {
    format!("{:016x}", config.identity)
}

fn boxed(error: impl Remediable + Send + Sync + 'static) -> AnyFailure {
    Box::new(error)
}
