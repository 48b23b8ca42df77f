//! A sensor's sites behind colour filters, before any interpolation.

use super::sampling::{AxisStarts, DataKind, Sampling};
use crate::frame::{Channel, Mosaic};

/// Factors on the thresholds of the two finest levels, for each opponent colour. The prior alone
/// determines details that fall between sites, and colour differences have few such details. Set on
/// astronaut and coffee.
const FINEST_THRESHOLDS: [[f32; 2]; 3] = [[3.0, 2.0], [10.0, 4.0], [10.0, 4.0]];

/// Raw sites.
#[derive(Debug, Clone)]
pub struct Raw {
    /// Colour-filter mosaic over the canvas.
    pub mosaic: Mosaic,
}

impl Sampling for Raw {
    fn kind(&self) -> DataKind {
        DataKind::Raw
    }

    fn mosaic(&self) -> Option<Mosaic> {
        Some(self.mosaic)
    }

    /// The wider the blur, the less of a scene is finer than the distance between sites, and the
    /// more weight the data deserve. A Gaussian of the lens's width passes exp(−(πσ/2)²) of the
    /// power at the Nyquist frequency of sites two pixels apart; the rest is set on astronaut,
    /// coffee, rocket and a chart, through small.toml's lens (0.056) and study.toml's (0.007).
    fn axis_starts(&self, lens_width_px: f32) -> AxisStarts {
        let sigma = lens_width_px / (Channel::ALL.len() as f32).sqrt();
        let folded = (-(std::f32::consts::FRAC_PI_2 * sigma).powi(2)).exp().clamp(0.005, 0.1);
        AxisStarts { count: 4, noise_to_signal: 16.0 * folded * folded }
    }

    /// With data at sites the steps are shorter, and a start along the axes saves none.
    fn solve_steps(&self, steps: u32, _has_axes: bool) -> u32 {
        steps
    }

    fn finest_thresholds(&self) -> [[f32; 2]; 3] {
        FINEST_THRESHOLDS
    }
}
