//! Noise of one capture against the level of light, from repeated captures.

use serde::{Deserialize, Serialize};

/// Variance = `at_black` + `per_level` · light: read noise and shot noise of one channel of one capture,
/// in light (0..255), as an average over the field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Variance without light, squared grey levels.
    pub at_black: f32,
    /// Variance added by each grey level.
    pub per_level: f32,
}

impl Noise {
    /// Standard deviation at `light`, grey levels.
    pub fn sigma(&self, light: f32) -> f32 {
        (self.at_black + self.per_level * light).max(0.0).sqrt()
    }
}
