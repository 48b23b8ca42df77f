//! Vignetting of the lens alone, removed from results if the rig file has `remove-vignetting`. It
//! is measured behind a diffuser, since the flats of a calibration contain the panel's own dark
//! corners, and stored beside the calibration.

use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::photo_file::SensorFacts;
use super::{identity, keep, kept};
use crate::calibration::dark_corner::{normalised, smooth};
use crate::calibration::surface::Surface;
use crate::calibration::{Calibration, Layout, store};
use crate::config::RigFile;
use crate::disk::files::json;
use crate::frame::{Channel, Frame, Plane, Rect, SensorSpace, Size, Work};
use crate::remedy::{AnyFailure, Remediable, Remedy};
use crate::rig::exposure::Devices;
use crate::rig::shoot::{CLIPPED_SHARE_MAX, CountRange, meter, shoot};

const NAME: &str = "lens-flat.json";
/// Exposures averaged in a take: the noise of a cell falls far below a thousandth.
const EXPOSURES: u8 = 16;
/// Multiples of the rig file's exposure that metering may choose.
const TIMES: (f64, f64) = (0.05, 20.0);
/// Least mean light of a take, as a share of the camera's range. Guess.
const LIGHT_MIN: f64 = 0.1;
/// Points along each side of the photo at which surfaces are compared.
const POINTS: usize = 9;
/// Largest difference between the two takes, before and after the diffuser is turned, as a share.
/// Guess: twice the smallest visible error of a corner.
const UNEVEN_MAX: f64 = 0.02;
/// Smallest share of the light at any point; below it something covers the lens.
const SHARE_MIN: f64 = 0.05;

/// Share of the light that the lens transmits to each point of the photo, per channel; 1 at the
/// brightest point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensFlat {
    /// Identity of the rig.
    rig: String,
    shares: [Surface; 3],
    photo: Size,
}

/// The light is unsuitable; states what was found, what is allowed and what to do.
#[derive(Debug, thiserror::Error)]
#[error("behind the diffuser {0}")]
struct UnsuitableLight(String);

impl Remediable for UnsuitableLight {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}

/// Measures the vignetting of the lens of `devices` behind an evenly lit diffuser, in two takes,
/// and stores it beside the calibration in `slots`. `turn` asks the user to turn the diffuser
/// between them.
///
/// # Errors
/// When there is no calibration, the light is too dark, too bright or uneven, or a capture or the
/// file fails.
pub fn measure(
    config: &RigFile,
    devices: &mut Devices,
    slots: &Path,
    turn: &mut dyn FnMut(),
) -> Result<LensFlat, AnyFailure> {
    let calibration = store::load(slots, config.identity)?;
    let range = SensorFacts::of(config, &calibration).range;
    // A camera that cannot set its exposure keeps it.
    meter(devices, config.mosaic(), range, TIMES)?;
    let takes = take(config, devices, &calibration, range).and_then(|first| {
        turn();
        Ok([first, take(config, devices, &calibration, range)?])
    });
    devices.expose_times(1.0)?;
    let flat = LensFlat::fit(&takes?, config)?;
    keep(slots, NAME, &json(&flat, &slots.join(NAME))?)?;
    Ok(flat)
}

/// Mean of [`EXPOSURES`] exposures, in linearised counts above black.
fn take(
    config: &RigFile,
    devices: &mut Devices,
    calibration: &Calibration,
    range: CountRange,
) -> Result<Frame<SensorSpace>, AnyFailure> {
    let shot = shoot(devices, config.mosaic(), range, EXPOSURES)?;
    let step = f32::from(1u16 << shot.finer);
    let take: Frame<SensorSpace> = Frame::from_fn(|c| {
        let black = calibration.black_level(c) as f32;
        let straight = |count| calibration.camera_curve.count(f32::from(count) / step) - black;
        shot.counts.plane(c).map(straight)
    });
    let light = take.plane(Channel::Green).mean() / (f64::from(range.max) - range.black).max(1.0);
    let clipped = shot.clipped_share;
    let (most, percent) = (10.0 * CLIPPED_SHARE_MAX, 100.0);
    if light < LIGHT_MIN || clipped > most {
        let found = format!(
            "the camera sees {:.1} % of its range, allowed {:.0} % or more, and {:.1} % of the \
             pixels are saturated, allowed {:.0} %: adjust the light",
            percent * light,
            percent * LIGHT_MIN,
            percent * clipped,
            percent * most
        );
        return Err(UnsuitableLight(found).into());
    }
    Ok(take)
}

/// Reads the vignetting stored in `slots`; `None` if there is none or it belongs to another rig.
pub fn load(config: &RigFile, slots: &Path) -> Option<LensFlat> {
    let flat: LensFlat = serde_json::from_slice(&kept(slots, NAME).ok()??).ok()?;
    let fits = flat.rig == identity(config)
        && flat.photo == config.photo.size()
        && flat.shares.iter().all(Surface::is_whole);
    Some(flat).filter(|flat| fits && flat.darkest() >= SHARE_MIN)
}

impl LensFlat {
    /// Fits the vignetting to two `takes` of the whole sensor, in linearised counts above black,
    /// between which the diffuser was turned.
    ///
    /// # Errors
    /// When the takes are rough, differ, or have a dark corner.
    fn fit(takes: &[Frame<SensorSpace>; 2], config: &RigFile) -> Result<LensFlat, UnsuitableLight> {
        let (layout, photo) = (Layout::of(config), config.photo.size());
        let area = Rect { x: 0, y: 0, size: photo };
        let origin = (layout.photo_x_px, layout.photo_y_px);
        let fit = |plane: &Plane| match smooth(plane, origin, layout.domain(), 0) {
            Ok(surface) => Ok(normalised(&surface, area).0),
            Err(error) => Err(UnsuitableLight(error.to_string())),
        };
        let mut shares = [(); 3].map(|()| Surface::constant(layout.domain(), 1.0));
        for (share, c) in shares.iter_mut().zip(Channel::ALL) {
            let [first, second] = takes.each_ref().map(|take| take.plane(c));
            let (a, b) = (fit(first)?, fit(second)?);
            let difference = |(x, y)| (a.at(x, y) / b.at(x, y) - 1.0).abs();
            let largest = points(photo).map(difference).fold(0.0, f64::max);
            if largest > UNEVEN_MAX {
                return Err(UnsuitableLight(format!(
                    "the light differs by {:.1} % between the two takes, allowed {:.0} %: light \
                     it more evenly, from farther away",
                    100.0 * largest,
                    100.0 * UNEVEN_MAX
                )));
            }
            let mut sum = first.clone();
            sum.add_scaled(1.0, second);
            let surface = fit(&sum)?;
            let lights = points(photo).map(|(x, y)| surface.at(x, y));
            *share = surface.scaled(1.0 / lights.fold(f64::MIN_POSITIVE, f64::max));
        }
        let flat = LensFlat { rig: identity(config), shares, photo };
        let darkest = flat.darkest();
        if darkest >= SHARE_MIN {
            return Ok(flat);
        }
        Err(UnsuitableLight(format!(
            "a corner has {:.1} % of the brightest point's light, allowed {:.0} % or more: cover \
             the whole lens with the diffuser",
            100.0 * darkest,
            100.0 * SHARE_MIN
        )))
    }

    /// Smallest share of the light, at any point and in any channel.
    pub fn darkest(&self) -> f64 {
        let shares = |(x, y)| self.shares.each_ref().map(|share| share.at(x, y));
        points(self.photo).flat_map(shares).fold(f64::INFINITY, f64::min)
    }

    /// Divides `picture`, whose upper left pixel is at column `left` and row `top` of the rig's
    /// photo, by the shares. `picture` is linear light.
    pub(super) fn remove_from(&self, picture: &mut Frame<Work>, (left, top): (usize, usize)) {
        for (plane, share) in picture.planes_mut().iter_mut().zip(&self.shares) {
            let width = plane.width().max(1);
            plane.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
                let mut shares = vec![0.0; row.len()];
                share.row((top + y) as f64, left as f64, 1.0, &mut shares);
                row.iter_mut().zip(shares).for_each(|(v, share)| *v /= share);
            });
        }
    }
}

/// Points spread over a photo, its corners included.
fn points(photo: Size) -> impl Iterator<Item = (f64, f64)> {
    let along = |n: usize, pixels: usize| n as f64 / (POINTS - 1) as f64 * (pixels as f64 - 1.0);
    (0..POINTS * POINTS)
        .map(move |n| (along(n % POINTS, photo.width), along(n / POINTS, photo.height)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;

    fn rig() -> RigFile {
        config::load(Path::new("small.toml")).unwrap()
    }

    /// Light with cos⁴-like vignetting, tilted by `slope` from the left to the right edge.
    fn seen(sensor: Size, light: f32, slope: f32) -> Frame<SensorSpace> {
        let (width, height) = (sensor.width as f32, sensor.height as f32);
        Frame::from_fn(|_| {
            Plane::from_fn(sensor, |x, y| {
                let (dx, dy) = (x as f32 / width - 0.5, y as f32 / height - 0.5);
                light * (1.0 + slope * dx) * (1.0 + dx * dx + dy * dy).powi(-2)
            })
        })
    }

    #[test]
    fn vignetting_is_measured_and_removed() {
        let (config, layout) = (rig(), Layout::of(&rig()));
        let takes = [(500.0, 0.008), (700.0, -0.008)]
            .map(|(light, slope)| seen(layout.sensor, light, slope));
        let flat = LensFlat::fit(&takes, &config).unwrap();
        let rect = Rect { x: layout.photo_x_px, y: layout.photo_y_px, size: layout.photo };
        let even = seen(layout.sensor, 100.0, 0.0);
        let mut picture: Frame<Work> = Frame::from_fn(|c| even.plane(c).crop(rect));
        flat.remove_from(&mut picture, (0, 0));
        let middle = picture.plane(Channel::Red).at(128, 96);
        for &v in picture.planes().iter().flat_map(|plane| plane.data()) {
            assert!((v / middle - 1.0).abs() < 0.002, "{v} of {middle}");
        }
    }

    #[test]
    fn uneven_light_and_a_covered_lens_are_refused() {
        let (config, sensor) = (rig(), Layout::of(&rig()).sensor);
        let uneven = [0.03, -0.03].map(|slope| seen(sensor, 500.0, slope));
        let error = LensFlat::fit(&uneven, &config).unwrap_err();
        assert!(error.to_string().contains("differs by"), "{error}");
        let half = |x: usize| if x < 100 { 0.0 } else { 400.0 };
        let covered: Frame<SensorSpace> =
            Frame::from_fn(|_| Plane::from_fn(sensor, |x, _| half(x)));
        assert!(LensFlat::fit(&[covered.clone(), covered], &config).is_err());
    }
}
