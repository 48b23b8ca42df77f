//! Response of the sensor's sites, from many flats and darks.

use super::CalibrateError;
use super::session::{Session, difference, rim_px, smooth};
use crate::calibration::response_pattern::{EvenlyLit, ResponsePattern};
use crate::calibration::{Calibration, Layout, dark_corner};
use crate::frame::{Channel, Frame, Plane, Rect, SensorSpace, Work};
use crate::patterns;

/// Exposures of black: enough to separate hot sites from noise.
pub(super) const DARKS: usize = 8;
/// Code of the flats, three quarters of white's light: as bright as photos, and below a sensor's
/// knee.
const CODE: u8 = 224;

/// Mean counts of a black panel and of a flat.
pub(super) struct Flats {
    dark: Frame<SensorSpace>,
    light: Frame<SensorSpace>,
}

/// Captures the flats, if the rig file asks for them; first of all, as the panel drifts meanwhile.
///
/// # Errors
/// When a capture fails.
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
///
/// # Errors
/// [`CalibrateError::BadSites`].
pub(super) fn pattern(
    session: &Session<'_>,
    calibration: &mut Calibration,
    Flats { dark, light }: &Flats,
) -> Result<(), CalibrateError> {
    let layout = session.layout;
    let rim = rim_px(session.config);
    let photo = Rect { x: 0, y: 0, size: calibration.photo };
    let (mut ratios, mut shares, mut darks) = (Vec::new(), Vec::new(), Vec::new());
    for c in Channel::ALL {
        let over = difference(light.plane(c), dark.plane(c));
        let surface = smooth(&over, &layout, rim, "response pattern")?;
        let (share, counts) = dark_corner::normalised(&surface, photo);
        let (over, share) = (on_canvas(&over, &layout), layout.on_canvas(&share));
        let ratio = Plane::from_fn(layout.canvas(), |x, y| {
            over.at(x, y) / (share.at(x, y) * counts as f32)
        });
        ratios.push(ratio);
        shares.push(share);
        let smooth_dark = layout.on_canvas(&calibration.black[c.index()]);
        darks.push(difference(&on_canvas(dark.plane(c), &layout), &smooth_dark));
    }
    let seen = EvenlyLit {
        ratio: &frame(ratios, &layout),
        share: &frame(shares, &layout),
        panel: &layout.panel_columns(&calibration.geometry),
        dark: &frame(darks, &layout),
        mosaic: layout.canvas_mosaic(),
        rim_px: rim,
    };
    calibration.pattern = ResponsePattern::fit(&seen).map_err(CalibrateError::BadSites)?;
    Ok(())
}

/// The canvas's part of a sensor-sized plane; NaN beyond the sensor.
fn on_canvas(plane: &Plane, layout: &Layout) -> Plane {
    let at = |to: usize, first: usize, end: usize| {
        (first + to).checked_sub(layout.margin_px).filter(|&v| v < end)
    };
    Plane::from_fn(layout.canvas(), |x, y| {
        let place =
            at(x, layout.photo_x_px, plane.width()).zip(at(y, layout.photo_y_px, plane.height()));
        place.map_or(f32::NAN, |(x, y)| plane.at(x, y))
    })
}

fn frame(planes: Vec<Plane>, layout: &Layout) -> Frame<Work> {
    let mut planes = planes.into_iter();
    Frame::from_fn(|_| planes.next().unwrap_or_else(|| Plane::zeros(layout.canvas())))
}
