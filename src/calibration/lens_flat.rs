//! The lens's own dark corner, measured behind a diffuser. The flats of a calibration are of the
//! panel, whose corners are darker, too: they say nothing of the photo's.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::correction::Layout;
use super::dark_corner::{normalised, smooth};
use super::surface::{Surface, SurfaceError};
use crate::frame::{Channel, Frame, Rect, SensorSpace, Size, Work};
use crate::remedy::{Remediable, Remedy};

/// Places at which two takes are compared, along each side.
const COMPARED: usize = 9;
/// Two takes, with the diffuser turned in between, that differ by more, as a share, were not lit
/// evenly. Guess: twice the corner's error that one would see.
const UNEVEN_MAX: f64 = 0.02;
/// A lens that passes less light somewhere is no lens, but a cap.
const DARKEST: f64 = 0.05;
/// Rows of a picture changed at a time.
const BAND_ROWS: usize = 32;

/// Share of the light that the lens brings to each place of the photo, in each channel; 1 where it
/// is brightest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensFlat {
    shares: [Surface; 3],
    photo: Size,
}

/// Why what was seen behind a diffuser is no lens's dark corner.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LensFlatError {
    /// No surface goes through it.
    #[error("the light behind the diffuser is no smooth surface")]
    Rough(#[from] SurfaceError),
    /// It is not even.
    #[error(
        "the light behind the diffuser differs by {found_percent:.1} % from one take to the \
         other, allowed {allowed_percent:.0} %: light it more evenly, from farther away"
    )]
    Uneven {
        /// How much.
        found_percent: f64,
        /// How much may be.
        allowed_percent: f64,
    },
    /// A part of it is dark.
    #[error(
        "a corner has {found_percent:.1} % of the brightest place's light behind the diffuser, \
         allowed {allowed_percent:.0} % or more: cover all of the lens with it"
    )]
    Dark {
        /// How much it has.
        found_percent: f64,
        /// How much it must have.
        allowed_percent: f64,
    },
}

impl Remediable for LensFlatError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}

impl LensFlat {
    /// Of two `takes` of the whole sensor, straight counts over black, with the diffuser turned in
    /// between.
    ///
    /// # Errors
    /// When they are not even, or not alike.
    pub fn of(takes: &[Frame<SensorSpace>; 2], layout: &Layout) -> Result<LensFlat, LensFlatError> {
        let photo = Rect { x: 0, y: 0, size: layout.photo };
        let origin = (layout.photo_x_px, layout.photo_y_px);
        let of_take = |take: &Frame<SensorSpace>, c: Channel| {
            let surface = smooth(take.plane(c), origin, layout.domain(), 0)?;
            Ok::<Surface, SurfaceError>(normalised(&surface, photo).0)
        };
        let both = Frame::from_fn(|c| {
            let mut plane = takes[0].plane(c).clone();
            plane.add_scaled(1.0, takes[1].plane(c));
            plane
        });
        let mut shares = Vec::new();
        for c in Channel::ALL {
            let (first, second) = (of_take(&takes[0], c)?, of_take(&takes[1], c)?);
            let differ = |(x, y)| (first.at(x, y) / second.at(x, y) - 1.0).abs();
            let most = places(layout.photo).map(differ).fold(0.0, f64::max);
            if most > UNEVEN_MAX {
                return Err(LensFlatError::Uneven {
                    found_percent: 100.0 * most,
                    allowed_percent: 100.0 * UNEVEN_MAX,
                });
            }
            let surface = of_take(&both, c)?;
            let at = |(x, y)| surface.at(x, y);
            let brightest = places(layout.photo).map(at).fold(f64::MIN_POSITIVE, f64::max);
            shares.push(surface.scaled(1.0 / brightest));
        }
        let mut shares = shares.into_iter();
        let mut next = || shares.next().unwrap_or_else(|| Surface::constant(layout.domain(), 1.0));
        let flat = LensFlat { shares: [next(), next(), next()], photo: layout.photo };
        let darkest = flat.darkest();
        if darkest < DARKEST {
            return Err(LensFlatError::Dark {
                found_percent: 100.0 * darkest,
                allowed_percent: 100.0 * DARKEST,
            });
        }
        Ok(flat)
    }

    /// Whether it is whole and of photos of this size; data read from flash is checked with it.
    pub fn fits(&self, photo: Size) -> bool {
        self.photo == photo
            && self.shares.iter().all(Surface::is_whole)
            && self.darkest() >= DARKEST
    }

    /// The least share anywhere.
    pub fn darkest(&self) -> f64 {
        let at = |(x, y)| self.shares.each_ref().map(|share| share.at(x, y));
        places(self.photo).flat_map(at).fold(f64::INFINITY, f64::min)
    }

    /// Brings `picture` (photo-sized linear light) to the light of its brightest place everywhere.
    pub fn take_out_of(&self, picture: &mut Frame<Work>) {
        for c in Channel::ALL {
            let (share, plane) = (&self.shares[c.index()], picture.plane_mut(c));
            let width = plane.width();
            let rows = plane.data_mut().par_chunks_mut(width.max(1)).with_min_len(BAND_ROWS);
            rows.enumerate().for_each_init(
                || vec![0.0; width],
                |shares, (y, row)| {
                    share.row(y as f64, 0.0, 1.0, shares);
                    row.iter_mut().zip(&*shares).for_each(|(v, share)| *v /= share);
                },
            );
        }
    }
}

/// Places spread over a photo, its corners among them.
fn places(photo: Size) -> impl Iterator<Item = (f64, f64)> {
    let along = |n: usize, pixels: usize| n as f64 / (COMPARED - 1) as f64 * (pixels as f64 - 1.0);
    (0..COMPARED * COMPARED)
        .map(move |n| (along(n % COMPARED, photo.width), along(n / COMPARED, photo.height)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use crate::frame::Plane;
    use std::path::Path;

    fn layout() -> Layout {
        Layout::of(&config::load(Path::new("small.toml")).unwrap())
    }

    /// cos⁴-like shading of a sensor, tilted by `slope` from its left to its right edge.
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
    fn what_shaded_a_picture_is_taken_out_again() {
        let layout = layout();
        let takes = [seen(&layout, 500.0, 0.008), seen(&layout, 700.0, -0.008)];
        let flat = LensFlat::of(&takes, &layout).unwrap();
        assert!(flat.fits(layout.photo) && !flat.fits(Size::new(9, 9)));
        let rect = Rect { x: layout.photo_x_px, y: layout.photo_y_px, size: layout.photo };
        let mut picture: Frame<Work> =
            Frame::from_fn(|c| seen(&layout, 100.0, 0.0).plane(c).crop(rect));
        flat.take_out_of(&mut picture);
        let middle = picture.plane(Channel::Red).at(128, 96);
        for &v in picture.planes().iter().flat_map(|plane| plane.data()) {
            assert!((v / middle - 1.0).abs() < 0.002, "{v} of {middle}");
        }
    }

    #[test]
    fn uneven_light_and_a_covered_lens_are_refused() {
        let layout = layout();
        let uneven = [seen(&layout, 500.0, 0.03), seen(&layout, 500.0, -0.03)];
        let error = LensFlat::of(&uneven, &layout).unwrap_err();
        assert!(matches!(error, LensFlatError::Uneven { .. }), "{error}");
        let half = |x: usize| if x < 100 { 0.0 } else { 400.0 };
        let covered: Frame<SensorSpace> =
            Frame::from_fn(|_| Plane::from_fn(layout.sensor, |x, _| half(x)));
        assert!(LensFlat::of(&[covered.clone(), covered], &layout).is_err());
    }
}
