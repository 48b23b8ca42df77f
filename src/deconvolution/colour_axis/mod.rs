//! The colour-line prior: locally, the colours of a scene lie along a line in RGB.
//!
//! A lens blurs its channels differently, so an incomplete restoration has coloured fringes at
//! edges. The line is therefore estimated where all channels are blurred equally:
//!
//! 1. *Equal blur* ([`equal_blur`]): each channel of the photo is convolved with the point spread
//!    functions of the other two.
//! 2. *Axis* ([`axis`]): the principal direction u of the local colour covariance, a measure of how
//!    linear the colours are, and the extra shrinkage κ off the line.
//! 3. *Start* ([`ColourAxes::project`]): the initial picture's details are projected on u, with
//!    each channel weighted by the lens's power transmission α at that level, so that channels
//!    with little signal follow the others.
//! 4. *Shrinkage* ([`AlongAxes`]): details are shrunk along u by the prior's rule, and off it by
//!    the norm of the remaining vector.
//!
//! Guided filtering (He, Sun & Tang 2013, "Guided image filtering") regresses all channels on one
//! of them; here the line is symmetric in the channels, and the data determine the position along
//! it.

mod axis;
mod equal_blur;
mod shrinkage;

use rayon::prelude::*;

use super::lens_model::LensModel;
use super::smoothing::halve;
use crate::frame::{Frame, Plane, Work};
use axis::LocalAxis;
pub use equal_blur::width_px;
pub use shrinkage::{AlongAxes, AxisWeights, Thresholds};

/// The colour axes of a photo, at the resolution of each wavelet level.
#[derive(Debug, Clone)]
pub struct ColourAxes {
    levels: Vec<AxisMap>,
}

/// The axes of one level.
#[derive(Debug, Clone)]
struct AxisMap {
    /// Details per cell along each side: 2 at the finest level, 1 at others.
    details: usize,
    /// Unit vector u of the axis, one plane per channel.
    direction: [Plane; 3],
    /// κ, the factor on thresholds off the axis.
    strictness: Plane,
    /// Linearity of the colours, 0 to 1.
    line: Plane,
}

impl ColourAxes {
    /// The axes of `photo`, taken through `model` with a mean noise σ of `noise` grey levels, for
    /// `levels` levels of details.
    ///
    /// # Panics
    /// When the photo does not have the model's size.
    pub fn of(model: &LensModel, photo: &Frame<Work>, noise: f32, levels: usize) -> ColourAxes {
        let equal = equal_blur::equalise_blur(model, photo);
        let map = AxisMap::of(&equal_blur::statistics(&equal, model.functions()), noise);
        let mut maps = vec![AxisMap { details: 2, ..map.clone() }, map];
        while maps.len() < levels {
            maps.push(maps[maps.len() - 1].halve());
        }
        maps.truncate(levels);
        ColourAxes { levels: maps }
    }

    /// Projects the details of `picture` on the axes, to the degree that the colours are linear;
    /// `passed` is the power transmission α of each level and channel, finest level first.
    ///
    /// # Panics
    /// When `picture` or `transforms` do not have the photo's size.
    pub fn project(&self, picture: &mut Frame<Work>, passed: &[[f32; 3]], transforms: &AlongAxes) {
        transforms.at_shift(picture.planes_mut(), (0, 0), &|level, bands| {
            shrinkage::project(bands, &self.levels[level], passed[level]);
        });
    }
}

impl AxisMap {
    /// The axes of colours with the given local `statistics`.
    fn of(statistics: &equal_blur::Statistics, noise: f32) -> AxisMap {
        let size = statistics.mean[0].size();
        let rows = 0..size.height;
        let found: Vec<LocalAxis> = rows
            .into_par_iter()
            .flat_map_iter(|y| {
                let axis_at = move |x| {
                    let (mean, covariance) = statistics.at(x, y);
                    LocalAxis::of(mean, covariance, noise)
                };
                (0..size.width).map(axis_at)
            })
            .collect();
        let plane = |of: &dyn Fn(&LocalAxis) -> f32| {
            Plane::from_fn(size, |x, y| of(&found[y * size.width + x]))
        };
        AxisMap {
            details: 1,
            direction: [0, 1, 2].map(|c| plane(&|axis| axis.direction[c])),
            strictness: plane(&|axis| axis.strictness),
            line: plane(&|axis| axis.line),
        }
    }

    /// The mean of every 2×2 cells.
    fn halve(&self) -> AxisMap {
        let mut direction = self.direction.each_ref().map(halve);
        let [r, g, b] = &mut direction;
        for ((r, g), b) in r.data_mut().iter_mut().zip(g.data_mut()).zip(b.data_mut()) {
            [*r, *g, *b] = axis::unit([*r, *g, *b]);
        }
        let (strictness, line) = (halve(&self.strictness), halve(&self.line));
        AxisMap { details: 1, direction, strictness, line }
    }
}

#[cfg(test)]
mod tests;
