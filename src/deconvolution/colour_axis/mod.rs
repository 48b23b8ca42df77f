//! The prior of colour: at a place, the colours of a scene lie along a line.
//!
//! A lens blurs its channels differently. What a solve has not yet brought back of one channel and
//! has of another is a coloured rim, and no photo can tell it from a coloured scene. So the line is
//! taken from where all three channels are blurred alike. In four steps:
//!
//! 1. *Equal blur*: each channel of the photo through the lens's two others.
//! 2. *Axis* ([`axis`]): of the local covariance of those, its first direction u, how little of a
//!    line it is, and by how much more what is off the line is to be shrunk.
//! 3. *Start* ([`ColourAxes::project`]): details along u, each channel counted by how much of their
//!    level the lens lets through, so that blue's follow green's where blue cannot know.
//! 4. *Shrinkage* ([`AlongAxes`]): details along u by the prior's rule, and what is left, a vector,
//!    by its length.
//!
//! A regression of colours on one of them in windows (He, Sun & Tang 2013, "Guided image
//! filtering") ties all to that one; the line here is no channel's own, and the data still say
//! where along it.
//! Wiener's start, level steps and momentum stay the method's. One channel has no axes and pays
//! nothing.

mod axis;
mod equal_blur;
mod shrinkage;

use rayon::prelude::*;

use super::lens_model::LensModel;
use crate::frame::{Frame, Plane, Work};
use axis::LocalAxis;
pub use equal_blur::width_px;
pub(super) use equal_blur::{blurred, halved};
pub use shrinkage::{AlongAxes, Thresholds};

/// The axes of a photo's colours, as the details of each wavelet level see them.
#[derive(Debug, Clone)]
pub struct ColourAxes {
    levels: Vec<AxisMap>,
}

/// The axes of one level.
#[derive(Debug, Clone)]
struct AxisMap {
    /// Details along the side of a place: 2 of the finest level, 1 of others.
    details: usize,
    /// u, one plane a channel.
    direction: [Plane; 3],
    /// κ: by how much more what is off the axis is shrunk.
    strictness: Plane,
    /// How much of a line the colours are, 0 to 1.
    line: Plane,
}

impl ColourAxes {
    /// The axes of `photo`, which `model` blurred and which has noise of `noise` grey levels in the
    /// mean channel, for `levels` levels of details.
    ///
    /// # Panics
    /// When the photo has not the model's size, which is a bug of the caller.
    pub fn of(model: &LensModel, photo: &Frame<Work>, noise: f32, levels: usize) -> ColourAxes {
        let alike = equal_blur::equally_blurred(model, photo);
        let map = AxisMap::of(&equal_blur::statistics(&alike, model.functions()), noise);
        let mut maps = vec![AxisMap { details: 2, ..map.clone() }, map];
        while maps.len() < levels {
            maps.push(maps[maps.len() - 1].halved());
        }
        maps.truncate(levels);
        ColourAxes { levels: maps }
    }

    /// `picture` with its details drawn to the axes where colours are a line; `passed` says how
    /// much of each level arrives in each channel, finest first, and so how much the channel knows.
    ///
    /// # Panics
    /// When picture or `transforms` are not of the photo's size, which is a bug of the caller.
    pub fn project(
        &self,
        picture: &mut Frame<Work>,
        passed: &[[f32; 3]],
        transforms: &mut AlongAxes,
    ) {
        transforms.at_shift(picture.planes_mut(), (0, 0), &|level, bands| {
            shrinkage::project(bands, &self.levels[level], passed[level]);
        });
    }
}

impl AxisMap {
    /// The axes of places of given means and covariances.
    fn of(places: &equal_blur::Statistics, noise: f32) -> AxisMap {
        let size = places.mean[0].size();
        let rows = 0..size.height;
        let found: Vec<LocalAxis> = rows
            .into_par_iter()
            .flat_map_iter(|y| {
                let axis_at = move |x| {
                    let (mean, covariance) = places.at(x, y);
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

    /// The mean of every four places.
    fn halved(&self) -> AxisMap {
        let mut direction = self.direction.each_ref().map(halved);
        let [r, g, b] = &mut direction;
        for ((r, g), b) in r.data_mut().iter_mut().zip(g.data_mut()).zip(b.data_mut()) {
            [*r, *g, *b] = axis::unit([*r, *g, *b]);
        }
        let (strictness, line) = (halved(&self.strictness), halved(&self.line));
        AxisMap { details: 1, direction, strictness, line }
    }
}

#[cfg(test)]
mod plain;
#[cfg(test)]
mod tests;
