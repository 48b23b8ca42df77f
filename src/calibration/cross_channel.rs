//! The mixing of the panel's primaries in the camera's channels (paper Eq. 13).

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// C of Eq. 13, diagonal 1: `seen[to] = Σ from[…] · C[from][to]`, in units in which each channel's own light has gain 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CrossChannel {
    /// `c[from][to]`: what one unit of the displayed channel `from` adds to the camera's channel `to`.
    pub c: [[f32; 3]; 3],
}

impl CrossChannel {
    /// No mixing.
    pub const IDENTITY: CrossChannel =
        CrossChannel { c: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// C⁻¹, laid out the same: `light[to] = Σ seen[from] · inverse[from][to]`. `None` when the channels
    /// cannot be told apart.
    pub fn inverse(&self) -> Option<[[f32; 3]; 3]> {
        let m = Matrix3::from_fn(|i, j| f64::from(self.c[i][j])).try_inverse()?;
        let inverse = [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)] as f32));
        inverse.iter().flatten().all(|v| v.is_finite()).then_some(inverse)
    }
}
