//! A measured blur in place of a lens: point spread functions read from a file.

use std::path::Path;

use super::error::ConfigError;
use super::places::Places;
use crate::frame::read_npy_f32;

/// How far a function's sum may be from 1: `f32` rounding of a few hundred taps, with room.
const SUM_TOLERANCE: f32 = 1e-3;

/// Point spread functions on a grid, `[rows, columns, 3, k, k]`. Tile centres are evenly spread
/// over the photo's grid: the centre of tile n of N along a length W is (n + ½)·W/N − ½.
#[derive(Debug, Clone, PartialEq)]
pub struct BlurGrid {
    /// Rows of functions.
    pub rows: usize,
    /// Columns of functions.
    pub columns: usize,
    /// Width and height of a function, odd.
    pub support_px: usize,
    /// All functions, in the order of the shape.
    pub functions: Vec<f32>,
}

impl BlurGrid {
    /// The function of tile (`row`, `column`) and channel number `channel`, row-major.
    pub fn function(&self, row: usize, column: usize, channel: usize) -> &[f32] {
        let area = self.support_px * self.support_px;
        &self.functions[((row * self.columns + column) * 3 + channel) * area..][..area]
    }

    /// Reads and checks the array in `path`, which `lens.blur` names.
    pub(super) fn read(path: &Path, places: &Places) -> Result<Self, ConfigError> {
        let key = "lens.blur";
        let (shape, functions) = read_npy_f32(path)
            .map_err(|source| ConfigError::Blur { at: places.of(key), source })?;
        let wrong = |found: String, allowed: &str| places.broken(key, found, allowed);
        let &[rows, columns, 3, support_px, height] = shape.as_slice() else {
            return Err(wrong(format!("an array of shape {shape:?}"), "[rows, columns, 3, k, k]"));
        };
        if rows * columns == 0 || height != support_px || support_px.is_multiple_of(2) {
            return Err(wrong(
                format!("an array of shape {shape:?}"),
                "[rows, columns, 3, k, k] with odd k",
            ));
        }
        for (n, function) in functions.chunks_exact(support_px * support_px).enumerate() {
            let sum: f32 = function.iter().sum();
            if sum.is_nan() || (sum - 1.0).abs() > SUM_TOLERANCE {
                let (tile, channel) = (n / 3, n % 3);
                let place =
                    format!("row {}, column {}, channel {channel}", tile / columns, tile % columns);
                return Err(wrong(
                    format!("a sum of {sum} ({place})"),
                    "1 ± 0.001 for every function",
                ));
            }
        }
        Ok(BlurGrid { rows, columns, support_px, functions })
    }
}
