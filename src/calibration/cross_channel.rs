//! Mixing of the panel's primaries in the camera's channels (paper Eq. 13).

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// C of Eq. 13, diagonal 1: `seen[to] = Σ from[…] · C[from][to]`, in units in which each channel's
/// own light has gain 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CrossChannel {
    /// `c[from][to]`: response of camera channel `to` to one unit of the displayed channel `from`.
    pub c: [[f32; 3]; 3],
}

impl CrossChannel {
    /// No mixing.
    pub const IDENTITY: CrossChannel =
        CrossChannel { c: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// C⁻¹ in the same layout: `light[to] = Σ seen[from] · inverse[from][to]`; `None` if C is
    /// singular.
    pub fn inverse(&self) -> Option<[[f32; 3]; 3]> {
        let m = Matrix3::from_fn(|i, j| f64::from(self.c[i][j])).try_inverse()?;
        let inverse = [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)] as f32));
        inverse.iter().flatten().all(|v| v.is_finite()).then_some(inverse)
    }
}

/// Capture of one block of a gradation shown in one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockReading {
    /// Code of the block.
    pub code: u8,
    /// Codes of the blocks around it.
    pub around: Vec<u8>,
    /// Squared distance from the middle of the field, 1 in its corners.
    pub field: f64,
    /// Mean counts of its middle in the three channels over black, divided by the dark corner of
    /// the channel shown.
    pub counts: [f64; 3],
}

/// Row `from` of C: slopes of the camera channels' readings against those of the channel shown.
/// Slopes are insensitive to glare, which lifts all blocks alike. `None` without contrast.
pub fn row(from: usize, readings: &[BlockReading]) -> Option<[f32; 3]> {
    let count = readings.len() as f64;
    let mean = |k: usize| readings.iter().map(|r| r.counts[k]).sum::<f64>() / count;
    let means = [mean(0), mean(1), mean(2)];
    let product = |k: usize| -> f64 {
        readings.iter().map(|r| (r.counts[k] - means[k]) * (r.counts[from] - means[from])).sum()
    };
    let own = product(from);
    (own > 0.0).then(|| {
        let mut slopes = [0, 1, 2].map(|k| (product(k) / own) as f32);
        slopes[from] = 1.0;
        slopes
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_give_the_mixing_despite_added_light() {
        let readings: Vec<BlockReading> = (0..=255u8)
            .map(|code| {
                let light = 700.0 * (f64::from(code) / 255.0).powf(2.2) + 30.0;
                BlockReading {
                    code,
                    around: vec![],
                    field: 0.0,
                    counts: [0.12 * light + 5.0, light, -0.04 * light + 1.0],
                }
            })
            .collect();
        let row = row(1, &readings).unwrap();
        assert!((row[0] - 0.12).abs() < 1e-6 && (row[2] + 0.04).abs() < 1e-6);
        assert_eq!(row[1].to_bits(), 1.0f32.to_bits());
    }

    #[test]
    fn the_inverse_removes_the_mixing() {
        let mixing = CrossChannel { c: [[1.0, 0.1, 0.02], [0.07, 1.0, 0.11], [0.01, 0.15, 1.0]] };
        let inverse = mixing.inverse().unwrap();
        for (i, row) in mixing.c.iter().enumerate() {
            for j in 0..3 {
                let product: f32 =
                    row.iter().zip(&inverse).map(|(c, inverse)| c * inverse[j]).sum();
                assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-6);
            }
        }
        assert!(CrossChannel { c: [[1.0; 3]; 3] }.inverse().is_none());
    }
}
