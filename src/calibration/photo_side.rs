//! The part of a calibration that applies to photos: camera curve and dark corner.

use rayon::prelude::*;

use super::surface::Surface;
use super::{Calibration, CameraCurve};
use crate::frame::{Channel, FULL_SCALE, Frame, Work};

/// Smallest dark-corner share used as a divisor; darker parts stay dark.
const DARKEST: f32 = 0.05;
/// Rows of a picture per task.
const BAND_ROWS: usize = 32;

/// Camera curve and dark corner of a calibration, prepared for photos.
#[derive(Debug, Clone)]
pub struct PhotoSide {
    curve: CameraCurve,
    /// Counts over black of the panel's white, assumed for the white of a developed photo.
    white: f32,
    /// Relative illumination over the photo.
    dark_corner: [Surface; 3],
}

impl PhotoSide {
    /// Prepares the part of `calibration` that applies to photos.
    pub fn new(calibration: &Calibration) -> PhotoSide {
        let curve = calibration.camera_curve.clone();
        let white = FULL_SCALE * calibration.counts_per_level[Channel::Green.index()];
        PhotoSide { white: curve.bent(white), curve, dark_corner: calibration.dark_corner.clone() }
    }

    /// The map from a photo's values to linear light; `None` for a linear camera. White keeps its
    /// value; it stands for `white` counts over black or, if `None`, for the panel's white, as in a
    /// photo developed by the camera.
    pub fn straightened(&self, white: Option<f32>) -> Option<impl Fn(f32) -> f32 + Sync + '_> {
        let counts = white.unwrap_or(self.white);
        let scale = FULL_SCALE / self.curve.over_black(counts);
        let straight = move |bent: f32| scale * self.curve.over_black(bent * (counts / FULL_SCALE));
        (!self.curve.is_straight()).then_some(straight)
    }

    /// Divides `photo` (photo-sized) by the dark corner of the flats, as is done for captures;
    /// meant for photos of scenes in front of darkness, like the panel.
    pub fn undo_dark_corner(&self, photo: &mut Frame<Work>) {
        self.scale_by_corner(photo, |v, share| v / share);
    }

    /// Multiplies `light` (photo-sized) by the dark corner.
    pub fn put_dark_corner(&self, light: &mut Frame<Work>) {
        self.scale_by_corner(light, |v, share| v * share);
    }

    /// Applies `change` to each value of `photo` and the illumination there relative to the middle.
    fn scale_by_corner(&self, photo: &mut Frame<Work>, change: impl Fn(f32, f32) -> f32 + Sync) {
        for c in Channel::ALL {
            let (surface, plane) = (&self.dark_corner[c.index()], photo.plane_mut(c));
            let (width, height) = (plane.width(), plane.height());
            // The surface has mean 1 over the photo; a photo's exposure refers to its middle, which
            // must keep its light.
            let middle = surface.at(width as f64 / 2.0, height as f64 / 2.0) as f32;
            plane
                .data_mut()
                .par_chunks_mut(width.max(1))
                .with_min_len(BAND_ROWS)
                .enumerate()
                .for_each_init(
                    || vec![0.0; width],
                    |shares, (y, row)| {
                        surface.row(y as f64, 0.0, 1.0, shares);
                        let darkest = DARKEST * middle;
                        row.iter_mut()
                            .zip(&*shares)
                            .for_each(|(v, share)| *v = change(*v, share.max(darkest) / middle));
                    },
                );
        }
    }
}
