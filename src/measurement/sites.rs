//! Response of the sensor's sites, from many flats and darks.

use super::CalibrateError;
use super::session::{Session, difference, rim_px, smooth};
use crate::calibration::response_pattern::{EvenlyLit, ResponsePattern};
use crate::calibration::{Calibration, dark_corner};
use crate::frame::{Channel, Frame, Plane, Rect, SensorSpace};
use crate::patterns;

/// Number of exposures of black: enough to separate hot sites from noise.
pub(super) const DARKS: usize = 8;
/// Code of the flats, which gives three quarters of white's light: as bright as photos, and below a
/// sensor's knee.
const CODE: u8 = 224;

pub(super) struct Flats {
    dark: Frame<SensorSpace>,
    light: Frame<SensorSpace>,
}

/// Captures the flats if the rig file asks for them. Precedes geometry, as the panel drifts.
pub(super) fn expose(session: &mut Session<'_>) -> Result<Option<Flats>, CalibrateError> {
    let flats = session.config.calibration.response_flats;
    if flats == 0 {
        return Ok(None);
    }
    session.step("response pattern");
    let panel = session.layout.panel;
    let dark = session.mean(&patterns::flat(panel, [0; 3]), DARKS)?;
    let light = session.mean(&patterns::flat(panel, [CODE; 3]), flats)?;
    Ok(Some(Flats { dark, light }))
}

/// Fits the response pattern to `flats`, given geometry and black level.
pub(super) fn pattern(
    session: &Session<'_>,
    calibration: &mut Calibration,
    Flats { dark, light }: &Flats,
) -> Result<(), CalibrateError> {
    let layout = session.layout;
    let canvas = layout.canvas_on_sensor();
    let rim = rim_px(session.config);
    let photo = Rect { x: 0, y: 0, size: calibration.photo };
    let [mut ratios, mut shares, mut darks] = [(); 3].map(|()| Frame::zeros(canvas.size));
    for c in Channel::ALL {
        let over = difference(light.plane(c), dark.plane(c));
        let surface = smooth(&over, &layout, rim, "response pattern")?;
        let (share, counts) = dark_corner::normalised(&surface, photo);
        let (over, share) = (over.crop(canvas), layout.on_canvas(&share));
        let ratio = Plane::from_fn(layout.canvas(), |x, y| {
            over.at(x, y) / (share.at(x, y) * counts as f32)
        });
        *ratios.plane_mut(c) = ratio;
        *shares.plane_mut(c) = share;
        let smooth_dark = layout.on_canvas(&calibration.black[c.index()]);
        *darks.plane_mut(c) = difference(&dark.plane(c).crop(canvas), &smooth_dark);
    }
    let seen = EvenlyLit {
        ratio: &ratios,
        share: &shares,
        wave: &layout.column_wave(&calibration.geometry),
        dark: &darks,
        mosaic: layout.canvas_mosaic(),
        rim_px: rim,
    };
    calibration.pattern = ResponsePattern::fit(&seen).map_err(CalibrateError::BadSites)?;
    Ok(())
}
