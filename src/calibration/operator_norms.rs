//! Norms of the lens as an operator, at all pixels or at the sites of colour filters.

use serde::{Deserialize, Serialize};

use super::lens_blur;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::{Channel, Mosaic, Plane};

/// Rounds of Lanczos's method for each wavelet level: at sites many singular values are close, and
/// after 8 rounds the norms are up to a tenth too small.
const ROUNDS: usize = 16;
/// Rounds of the power method, started from grey, which is close to the dominant picture.
const POWER_ROUNDS: usize = 12;
/// Seed of the initial picture for each wavelet level.
const LEVEL_SEED: u64 = 17;

/// Norms of K, or of √weight · K at the sites of colour filters, for raw photos
/// ([`crate::deconvolution::method::Problem`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OperatorNorms {
    /// Largest squared singular value, per channel.
    pub squared: [f32; 3],
    /// Norm on each wavelet level, per channel.
    pub levels: [LevelNorms; 3],
}

impl OperatorNorms {
    /// The same ‖K‖² for all channels and each of `levels` wavelet levels.
    pub fn uniform(levels: usize, squared: f32) -> OperatorNorms {
        let of_level = || LevelNorms::uniform(levels, squared);
        OperatorNorms { squared: [squared; 3], levels: [(); 3].map(|()| of_level()) }
    }

    /// Computes the norms of `model` for `levels` wavelet levels; also returns green's dominant
    /// picture.
    pub fn at_pixels(model: &LensModel, levels: usize) -> (OperatorNorms, Plane) {
        let found = Channel::each(|c| lens_blur::dominant(model, c, POWER_ROUNDS));
        let squared = found.each_ref().map(|(norm, _)| *norm);
        let of_channel = |c| LevelNorms::measure(model, c, levels, ROUNDS, LEVEL_SEED);
        let [_, (_, green), _] = found;
        (OperatorNorms { squared, levels: Channel::each(of_channel) }, green)
    }

    /// Computes the norms of `model` at sites for `levels` wavelet levels. All Bayer mosaics have
    /// the same norms.
    pub fn at_sites(model: &LensModel, levels: usize) -> OperatorNorms {
        let of_channel = |c| LevelNorms::at_sites(model, c, Mosaic::Rggb, levels, ROUNDS);
        let measured = Channel::each(of_channel);
        OperatorNorms {
            squared: measured.each_ref().map(|(_, norm)| *norm),
            levels: measured.map(|(norms, _)| norms),
        }
    }

    pub(super) fn is_whole(&self) -> bool {
        let positive = |norm: &f32| norm.is_finite() && *norm > 0.0;
        self.squared.iter().all(positive) && self.levels.iter().all(LevelNorms::is_whole)
    }

    /// The larger of both lenses' norms: bounds for every lens between them, as norms are convex.
    #[must_use]
    pub fn or_larger(&self, other: &OperatorNorms) -> OperatorNorms {
        let [a, b] = [self, other];
        OperatorNorms {
            squared: [0, 1, 2].map(|c| a.squared[c].max(b.squared[c])),
            levels: [0, 1, 2].map(|c| a.levels[c].or_larger(&b.levels[c])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::LensFunctions;
    use crate::frame::Size;

    /// A lens whose functions widen over the field, with a width factor for each channel.
    fn lens() -> LensModel {
        let taps = |factor: f32| {
            let mut taps = Vec::new();
            for place in 0..9 {
                let width = factor * (0.9 + 0.15 * place as f32);
                let around = (0..121).map(|t| {
                    let (x, y) = ((t % 11) as f32 - 5.0, (t / 11) as f32 - 5.0);
                    (-(x * x + y * y) / (2.0 * width * width)).exp()
                });
                let function: Vec<f32> = around.collect();
                let total: f32 = function.iter().sum();
                taps.extend(function.iter().map(|t| t / total));
            }
            taps
        };
        let taps = [taps(1.0), taps(0.8), taps(1.2)];
        let functions = LensFunctions { rows: 3, columns: 3, support_px: 11, taps };
        LensModel::new(Size::new(128, 96), 8, &functions).unwrap()
    }

    #[test]
    #[ignore = "a minute: the gate runs it"]
    fn more_rounds_hardly_increase_the_norms() {
        let model = lens();
        for channel in Channel::ALL {
            let after = |rounds| LevelNorms::at_sites(&model, channel, Mosaic::Rggb, 4, rounds);
            let ((levels, whole), (more, more_whole)) = (after(ROUNDS), after(200));
            let rise = (0..=4).map(|level| more.at(level) / levels.at(level));
            let rise: Vec<f32> = rise.chain([more_whole / whole]).collect();
            println!("{channel:?}: {rise:.3?}");
            assert!(rise.iter().all(|&rise| rise < 1.02), "{channel:?}: {rise:.3?}");
            let everywhere = |rounds| LevelNorms::measure(&model, channel, 4, rounds, 1);
            let (levels, more) = (everywhere(ROUNDS), everywhere(200));
            let rise: Vec<f32> = (0..=4).map(|level| more.at(level) / levels.at(level)).collect();
            println!("{channel:?} everywhere: {rise:.3?}");
            assert!(rise.iter().all(|&rise| rise < 1.02), "{channel:?}: {rise:.3?}");
        }
    }
}
