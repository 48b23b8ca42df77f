//! Vignetting of the lens alone: measured behind a diffuser, stored beside the calibration, removed
//! from results if the rig file has `remove-vignetting`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{keep, kept};
use crate::calibration::{Calibration, DIFFUSER_LIGHT_MIN, Layout, LensFlat, LensFlatError, store};
use crate::config;
use crate::frame::{Channel, Frame, SensorSpace};
use crate::remedy::AnyFailure;
use crate::rig::exposure::Devices;
use crate::rig::shoot::{CLIPPED_SHARE_MAX, CountRange, meter, shoot};

/// File name beside the calibration's slots.
const NAME: &str = "lens-flat.json";
/// Exposures of a take: the noise of a cell falls far below a thousandth.
const EXPOSURES: u8 = 16;
/// Multiples of the rig file's exposure that metering may choose.
const TIMES: (f64, f64) = (0.05, 20.0);

/// The stored file.
#[derive(Serialize, Deserialize)]
struct StoredFlat {
    /// Identity of the rig, hexadecimal, as JSON numbers have 53 bits.
    rig: String,
    flat: LensFlat,
}

/// Measures the vignetting of the lens of `devices` behind an evenly lit diffuser, in two takes,
/// and stores it beside the calibration in `slots`. `turn` asks for the diffuser to be turned.
///
/// # Errors
/// When there is no calibration, the light is too dark, too bright or uneven, or a capture or the
/// file fails.
pub fn measure(
    config: &config::RigFile,
    devices: &mut Devices,
    slots: &Path,
    turn: &mut dyn FnMut(),
) -> Result<LensFlat, AnyFailure> {
    let calibration = store::load(slots, config.identity)?;
    let range = CountRange {
        black: calibration.black_level(Channel::Green),
        max: config.camera.count_max(),
    };
    // A camera that cannot set its exposure keeps it.
    meter(devices, config.mosaic(), range, TIMES)?;
    let takes = take(config, devices, &calibration, range).and_then(|first| {
        turn();
        Ok([first, take(config, devices, &calibration, range)?])
    });
    devices.expose_times(1.0)?;
    let flat = LensFlat::fit(&takes?, &Layout::of(config))?;
    let stored = StoredFlat { rig: identity(config), flat };
    serde_json::to_vec(&stored)
        .map_err(std::io::Error::other)
        .and_then(|bytes| keep(slots, NAME, &bytes))
        .map_err(|source| LensFlatError::Store(slots.to_owned(), source))?;
    Ok(stored.flat)
}

/// The mean of some exposures, in straight counts over black.
fn take(
    config: &config::RigFile,
    devices: &mut Devices,
    calibration: &Calibration,
    range: CountRange,
) -> Result<Frame<SensorSpace>, AnyFailure> {
    let shot = shoot(devices, config.mosaic(), range, EXPOSURES)?;
    let step = f32::from(1u16 << shot.finer);
    let take: Frame<SensorSpace> = Frame::from_fn(|c| {
        let black = calibration.black_level(c) as f32;
        shot.counts
            .plane(c)
            .map(|count| calibration.camera_curve.count(f32::from(count) / step) - black)
    });
    let light = take.plane(Channel::Green).mean() / (f64::from(range.max) - range.black).max(1.0);
    if light < DIFFUSER_LIGHT_MIN {
        return Err(LensFlatError::TooDark(light).into());
    }
    if shot.clipped_share > 10.0 * CLIPPED_SHARE_MAX {
        return Err(LensFlatError::TooBright(shot.clipped_share).into());
    }
    Ok(take)
}

/// The vignetting stored in `slots`; `None` if none is, or it belongs to another rig.
pub fn load(config: &config::RigFile, slots: &Path) -> Option<LensFlat> {
    let stored: StoredFlat = serde_json::from_slice(&kept(slots, NAME).ok()?).ok()?;
    let fits = stored.rig == identity(config) && stored.flat.fits(config.photo.size());
    fits.then_some(stored.flat)
}

fn identity(config: &config::RigFile) -> String {
    format!("{:016x}", config.identity)
}
