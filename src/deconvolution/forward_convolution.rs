//! Forward convolution: a picture shown on the panel and captured through the lens (paper §2.1,
//! Eq. 8).
//!
//! Methods access the rig only through a `dyn` [`ForwardConvolution`]. It is implemented by the
//! rig's light path ([`crate::light_path`]) and, for tests, by a lens model.

use super::data_term::TRUSTED;
use super::panel_beat::ColumnWave;
use crate::frame::{Channel, Frame, Size, Work};
use crate::remedy::AnyFailure;

/// A capture: FC(L)(i,j) = Σ L(m,n) K(i,j,m,n), in linear light, 0..255.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Captured light, corrected for black level, vignetting and cross-channel mixing.
    pub light: Frame<Work>,
    /// 1 where the sensor's value is valid, 0 where it was saturated or missing.
    pub trusted: Frame<Work, u8>,
}

impl Seen {
    /// The residual y − K̂L of a `predicted` capture K̂L in the `channels`; 0 where the capture is
    /// invalid.
    pub fn unexplained(&self, predicted: &Frame<Work>, channels: &[Channel]) -> Frame<Work> {
        let mut all = Frame::zeros(predicted.size());
        for &c in channels {
            let seen = self.light.plane(c).data().iter().zip(self.trusted.plane(c).data());
            let values = all.plane_mut(c).data_mut().iter_mut().zip(predicted.plane(c).data());
            for ((residual, p), (&y, &t)) in values.zip(seen) {
                *residual = if t == TRUSTED { y - p } else { 0.0 };
            }
        }
        all
    }
}

/// The optics as a linear operator, one capture per call.
pub trait ForwardConvolution {
    /// Size of the canvas.
    fn size(&self) -> Size;

    /// Captures `shown` (linear light, clipped to 0..255 by the panel). The light path configures
    /// how the panel continues the picture outside the canvas.
    ///
    /// # Errors
    /// The failure of the capture, with its remedy.
    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure>;

    /// [`forward`](ForwardConvolution::forward) for a `shown` in 0..255 whose prediction K̂ is
    /// already known as `predicted`.
    ///
    /// # Errors
    /// The failure of the capture, with its remedy.
    fn forward_predicted(
        &mut self,
        shown: &Frame<Work>,
        _predicted: &Frame<Work>,
    ) -> Result<Seen, AnyFailure> {
        self.forward(shown)
    }

    /// The wave of the panel's columns on the canvas; `None` without a panel.
    fn column_wave(&self) -> Option<ColumnWave> {
        None
    }

    /// Number of captures so far, discarded exposures included.
    fn captures(&self) -> usize;

    /// Seconds spent on captures so far, on the rig's clock.
    fn seconds(&self) -> f64;
}
