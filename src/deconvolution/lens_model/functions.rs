//! Point spread functions of a lens over its field.

use serde::{Deserialize, Serialize};

use crate::frame::Channel;
use crate::remedy::{Remediable, Remedy};

/// A fault in lens functions: what was found, and what is allowed.
#[derive(Debug, thiserror::Error)]
#[error("the lens model {0}")]
pub struct LensModelError(pub(super) String);

impl Remediable for LensModelError {
    fn remedy(&self) -> Remedy {
        Remedy::Recalibrate
    }
}

/// A grid of point spread functions per channel.
///
/// The centre of function `n` of `N` along a photo side of `W` pixels is at (n+½)W/N − ½. Functions
/// are interpolated bilinearly at the object's position, and constant beyond the outermost centres.
/// Tap `[v][u]` of a function displaces light by (u − r, v − r) pixels, r = (k−1)/2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensFunctions {
    /// Rows of the grid.
    pub rows: usize,
    /// Columns of the grid.
    pub columns: usize,
    /// Side k of the square support of each function; odd.
    pub support_px: usize,
    /// Red, green, blue; each row-major `[rows][columns][k][k]`, each function summing to about 1.
    pub taps: [Vec<f32>; 3],
}

impl LensFunctions {
    /// Linear interpolation from these functions (`share` 0) to `other` (1).
    ///
    /// # Panics
    /// When the grids differ, which is a bug of the caller.
    #[must_use]
    pub fn between(&self, other: &LensFunctions, share: f32) -> LensFunctions {
        let grid = |of: &LensFunctions| [of.rows, of.columns, of.support_px];
        assert_eq!(grid(self), grid(other), "interpolated functions share a grid");
        let mix = |channel: Channel| {
            let both = self.taps[channel.index()].iter().zip(&other.taps[channel.index()]);
            both.map(|(a, b)| a + share * (b - a)).collect()
        };
        LensFunctions { taps: Channel::ALL.map(mix), ..*self }
    }

    /// The taps `[v][u]` of the function in `row`, `column` of the grid.
    pub fn function(&self, channel: Channel, row: usize, column: usize) -> &[f32] {
        let one = self.support_px * self.support_px;
        &self.taps[channel.index()][(row * self.columns + column) * one..][..one]
    }

    /// Checks that grid, support and number of taps match and all taps are finite.
    ///
    /// # Errors
    /// The first mismatch.
    pub fn check(&self) -> Result<(), LensModelError> {
        let &LensFunctions { rows, columns, support_px, .. } = self;
        let refused = |found: String| Err(LensModelError(found));
        if rows == 0 || columns == 0 {
            return refused(format!(
                "has a grid of {columns}×{rows} functions; at least 1×1 is allowed"
            ));
        }
        if support_px.is_multiple_of(2) {
            return refused(format!("has functions {support_px} px wide; the width must be odd"));
        }
        // Sizes come from a file; an overflow must not wrap to a valid number.
        let wanted =
            [rows, columns, support_px, support_px].into_iter().fold(1, usize::saturating_mul);
        for channel in Channel::ALL {
            let (taps, name) = (&self.taps[channel.index()], channel.name());
            if taps.len() != wanted {
                return refused(format!(
                    "has {} taps in {name}; its grid needs {wanted}",
                    taps.len()
                ));
            }
            if let Some(place) = taps.iter().position(|t| !t.is_finite()) {
                return refused(format!(
                    "has an invalid tap in {name}: number {place} is not finite"
                ));
            }
        }
        Ok(())
    }
}
