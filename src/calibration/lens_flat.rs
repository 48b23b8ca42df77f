//! Vignetting of the lens alone, measured behind a diffuser. The flats of a calibration contain the
//! panel's own dark corners, which a photo does not have.

use std::path::PathBuf;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::correction::Layout;
use super::dark_corner::{normalised, smooth};
use super::surface::{Surface, SurfaceError};
use crate::frame::{Channel, Frame, Plane, Rect, SensorSpace, Size, Work};
use crate::remedy::{Remediable, Remedy};

/// Least mean light of a take, as a share of the camera's range. Guess.
pub const DIFFUSER_LIGHT_MIN: f64 = 0.1;
/// Points along each side of the photo at which surfaces are compared.
const POINTS: usize = 9;
/// Largest difference of two takes with the diffuser turned in between, as a share. Guess: twice
/// the smallest visible error of a corner.
const UNEVEN_MAX: f64 = 0.02;
/// Least share of the light anywhere; below it something covers the lens.
const SHARE_MIN: f64 = 0.05;

/// Share of the light that the lens transmits to each point of the photo, per channel; 1 at the
/// brightest point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensFlat {
    shares: [Surface; 3],
    photo: Size,
}

/// Why a lens's vignetting was not measured or stored.
#[derive(Debug, thiserror::Error)]
pub enum LensFlatError {
    /// Too little light, as a share of the camera's range.
    #[error(
        "the camera sees {:.1} % of its range behind the diffuser, at least {:.0} % are needed: \
         brighten the light",
        100.0 * .0, 100.0 * DIFFUSER_LIGHT_MIN
    )]
    TooDark(f64),
    /// Too much light; the saturated share.
    #[error("{:.1} % of the pixels are saturated behind the diffuser: dim the light", 100.0 * .0)]
    TooBright(f64),
    /// No surface can be fitted.
    #[error("the light behind the diffuser is no smooth surface")]
    Rough(#[from] SurfaceError),
    /// The largest relative difference between the takes.
    #[error(
        "the light behind the diffuser differs by {:.1} % between the two takes, allowed {:.0} %: \
         light it more evenly, from farther away",
        100.0 * .0, 100.0 * UNEVEN_MAX
    )]
    Uneven(f64),
    /// The least share of the light.
    #[error(
        "a corner has {:.1} % of the brightest point's light, allowed {:.0} % or more: cover the \
         whole lens with the diffuser",
        100.0 * .0, 100.0 * SHARE_MIN
    )]
    Covered(f64),
    /// The file cannot be written.
    #[error("cannot store the lens's vignetting in {0}")]
    Store(PathBuf, #[source] std::io::Error),
}

impl Remediable for LensFlatError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}

impl LensFlat {
    /// Fits two `takes` of the whole sensor, straight counts over black, between which the diffuser
    /// was turned.
    ///
    /// # Errors
    /// When the takes are rough, differ, or have a dark corner.
    pub fn fit(
        takes: &[Frame<SensorSpace>; 2],
        layout: &Layout,
    ) -> Result<LensFlat, LensFlatError> {
        let area = Rect { x: 0, y: 0, size: layout.photo };
        let origin = (layout.photo_x_px, layout.photo_y_px);
        let fit = |plane: &Plane| -> Result<Surface, SurfaceError> {
            Ok(normalised(&smooth(plane, origin, layout.domain(), 0)?, area).0)
        };
        let mut shares = [(); 3].map(|()| Surface::constant(layout.domain(), 1.0));
        for (share, c) in shares.iter_mut().zip(Channel::ALL) {
            let [first, second] = takes.each_ref().map(|take| take.plane(c));
            let (a, b) = (fit(first)?, fit(second)?);
            let difference = |(x, y)| (a.at(x, y) / b.at(x, y) - 1.0).abs();
            let largest = points(layout.photo).map(difference).fold(0.0, f64::max);
            if largest > UNEVEN_MAX {
                return Err(LensFlatError::Uneven(largest));
            }
            let mut sum = first.clone();
            sum.add_scaled(1.0, second);
            let surface = fit(&sum)?;
            let brightest = points(layout.photo)
                .map(|(x, y)| surface.at(x, y))
                .fold(f64::MIN_POSITIVE, f64::max);
            *share = surface.scaled(1.0 / brightest);
        }
        let flat = LensFlat { shares, photo: layout.photo };
        let darkest = flat.darkest();
        if darkest < SHARE_MIN { Err(LensFlatError::Covered(darkest)) } else { Ok(flat) }
    }

    /// Whether it is valid for photos of this size; checks data read from flash.
    pub fn fits(&self, photo: Size) -> bool {
        self.photo == photo
            && self.shares.iter().all(Surface::is_whole)
            && self.darkest() >= SHARE_MIN
    }

    /// The least share of the light.
    pub fn darkest(&self) -> f64 {
        let shares = |(x, y)| self.shares.each_ref().map(|share| share.at(x, y));
        points(self.photo).flat_map(shares).fold(f64::INFINITY, f64::min)
    }

    /// Divides `picture` (photo-sized linear light) by the shares.
    pub fn remove_from(&self, picture: &mut Frame<Work>) {
        for (plane, share) in picture.planes_mut().iter_mut().zip(&self.shares) {
            let width = plane.width().max(1);
            plane.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
                let mut shares = vec![0.0; row.len()];
                share.row(y as f64, 0.0, 1.0, &mut shares);
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
    use std::path::Path;

    fn layout() -> Layout {
        Layout::of(&config::load(Path::new("small.toml")).unwrap())
    }

    /// Light with cos⁴-like vignetting, tilted by `slope` from the left to the right edge.
    fn seen(layout: &Layout, light: f32, slope: f32) -> Frame<SensorSpace> {
        let (width, height) = (layout.sensor.width as f32, layout.sensor.height as f32);
        Frame::from_fn(|_| {
            Plane::from_fn(layout.sensor, |x, y| {
                let (dx, dy) = (x as f32 / width - 0.5, y as f32 / height - 0.5);
                light * (1.0 + slope * dx) * (1.0 + dx * dx + dy * dy).powi(-2)
            })
        })
    }

    #[test]
    fn vignetting_is_measured_and_removed() {
        let layout = layout();
        let takes = [seen(&layout, 500.0, 0.008), seen(&layout, 700.0, -0.008)];
        let flat = LensFlat::fit(&takes, &layout).unwrap();
        assert!(flat.fits(layout.photo) && !flat.fits(Size::new(9, 9)));
        let rect = Rect { x: layout.photo_x_px, y: layout.photo_y_px, size: layout.photo };
        let mut picture: Frame<Work> =
            Frame::from_fn(|c| seen(&layout, 100.0, 0.0).plane(c).crop(rect));
        flat.remove_from(&mut picture);
        let middle = picture.plane(Channel::Red).at(128, 96);
        for &v in picture.planes().iter().flat_map(|plane| plane.data()) {
            assert!((v / middle - 1.0).abs() < 0.002, "{v} of {middle}");
        }
    }

    #[test]
    fn uneven_light_and_a_covered_lens_are_refused() {
        let layout = layout();
        let uneven = [seen(&layout, 500.0, 0.03), seen(&layout, 500.0, -0.03)];
        let error = LensFlat::fit(&uneven, &layout).unwrap_err();
        assert!(matches!(error, LensFlatError::Uneven(_)), "{error}");
        let half = |x: usize| if x < 100 { 0.0 } else { 400.0 };
        let covered: Frame<SensorSpace> =
            Frame::from_fn(|_| Plane::from_fn(layout.sensor, |x, _| half(x)));
        assert!(LensFlat::fit(&[covered.clone(), covered], &layout).is_err());
    }
}
