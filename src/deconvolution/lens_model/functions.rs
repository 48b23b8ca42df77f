//! The point spread functions of a lens over its field, as numbers.

use serde::{Deserialize, Serialize};

use super::LensModelError;
use crate::frame::Channel;

/// A grid of point spread functions per channel.
///
/// The centre of function `n` of `N` along a photo side of `W` pixels is at (n+½)W/N − ½; between
/// the centres functions are interpolated bilinearly at the object's place, outside the outermost
/// centres the nearest one holds. Tap `[v][u]` of a function moves light by (u − r, v − r) pixels,
/// r = (k−1)/2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensFunctions {
    /// Functions from top to bottom.
    pub rows: usize,
    /// Functions from left to right.
    pub columns: usize,
    /// Side k of the square support of each function; odd.
    pub support_px: usize,
    /// Red, green, blue; each row-major `[rows][columns][k][k]`, each function summing to about 1.
    pub taps: [Vec<f32>; 3],
}

impl LensFunctions {
    /// Their mean: one function for the whole field.
    pub fn mean(&self) -> LensFunctions {
        let (area, count) = (self.support_px.pow(2), (self.rows * self.columns).max(1) as f32);
        let taps = self.taps.each_ref().map(|taps| {
            let mut mean = vec![0.0; area];
            for function in taps.chunks_exact(area.max(1)) {
                mean.iter_mut().zip(function).for_each(|(m, tap)| *m += tap / count);
            }
            mean
        });
        LensFunctions { rows: 1, columns: 1, support_px: self.support_px, taps }
    }

    /// The functions that are `share` of the way from these to `other`, which is on the same grid.
    ///
    /// # Panics
    /// When the grids differ, which is a bug of the caller.
    #[must_use]
    pub fn between(&self, other: &LensFunctions, share: f32) -> LensFunctions {
        let grid = |of: &LensFunctions| (of.rows, of.columns, of.support_px);
        assert_eq!(grid(self), grid(other), "functions between two are on the grid of both");
        let mix = |channel: Channel| {
            let both = self.taps[channel.index()].iter().zip(&other.taps[channel.index()]);
            both.map(|(a, b)| a + share * (b - a)).collect()
        };
        LensFunctions { taps: Channel::ALL.map(mix), ..*self }
    }

    /// The functions of an array of shape `[rows, columns, 3, k, k]`, as `blur = "grid.npy"` files
    /// hold them.
    ///
    /// # Errors
    /// [`LensModelError::Shape`] when the shape is another, [`LensModelError::Support`] when k is
    /// even.
    pub fn from_npy(shape: &[usize], values: &[f32]) -> Result<Self, LensModelError> {
        let &[rows, columns, 3, k, width] = shape else {
            return Err(LensModelError::Shape { found: shape.to_vec() });
        };
        if width != k || values.len() != shape.iter().product::<usize>() {
            return Err(LensModelError::Shape { found: shape.to_vec() });
        }
        let one = k * k;
        let taps = Channel::ALL.map(|channel| {
            (0..rows * columns)
                .flat_map(|n| &values[(3 * n + channel.index()) * one..][..one])
                .copied()
                .collect()
        });
        let functions = LensFunctions { rows, columns, support_px: k, taps };
        functions.check()?;
        Ok(functions)
    }

    /// The taps `[v][u]` of the function in `row`, `column` of the grid.
    pub fn function(&self, channel: Channel, row: usize, column: usize) -> &[f32] {
        let one = self.support_px * self.support_px;
        &self.taps[channel.index()][(row * self.columns + column) * one..][..one]
    }

    /// Whether grid, support and number of taps fit together, and all taps are finite.
    ///
    /// # Errors
    /// What does not fit.
    pub fn check(&self) -> Result<(), LensModelError> {
        if self.rows == 0 || self.columns == 0 {
            return Err(LensModelError::NoFunctions { rows: self.rows, columns: self.columns });
        }
        if self.support_px.is_multiple_of(2) {
            return Err(LensModelError::Support { found: self.support_px });
        }
        let factors = [self.rows, self.columns, self.support_px, self.support_px];
        // Numbers read from flash: as many taps as no memory holds, then, and not what is left of
        // an overflow.
        let wanted = factors.into_iter().fold(1, usize::saturating_mul);
        for channel in Channel::ALL {
            let taps = &self.taps[channel.index()];
            if taps.len() != wanted {
                return Err(LensModelError::Taps {
                    channel: channel.name(),
                    found: taps.len(),
                    wanted,
                });
            }
            if let Some(place) = taps.iter().position(|t| !t.is_finite()) {
                return Err(LensModelError::NotFinite { channel: channel.name(), place });
            }
        }
        Ok(())
    }
}
