//! What a method may ask of the light: a picture shown, a picture seen (paper §2.1, Eq. 8).
//!
//! A method holds a `dyn` [`ForwardConvolution`] and nothing else of the rig. Behind it stands a
//! rig ([`crate::light_path`], layer 5), or for tests a lens model that convolves by computing.

use super::data_term::TRUSTED;
use crate::frame::{Channel, Frame, Size, Work};
use crate::remedy::AnyFailure;

/// One look through the lens: FC(L)(i,j) = Σ L(m,n) K(i,j,m,n), in linear light, 0..255.
#[derive(Debug, Clone)]
pub struct Seen {
    /// The picture seen, black level, dark corner and cross-channel mixing undone.
    pub light: Frame<Work>,
    /// 1 where the sensor's value can be trusted, 0 where it was saturated or missing.
    pub trusted: Frame<Work, u8>,
}

impl Seen {
    /// What a lens model that `predicted` K̂L of the picture shown leaves unexplained of this,
    /// y − K̂L, in the `channels`; zero where the capture cannot be trusted.
    pub fn unexplained(&self, predicted: &Frame<Work>, channels: &[Channel]) -> Frame<Work> {
        let mut all = Frame::zeros(predicted.size());
        for &c in channels {
            let seen = self.light.plane(c).data().iter().zip(self.trusted.plane(c).data());
            let values = all.plane_mut(c).data_mut().iter_mut().zip(predicted.plane(c).data());
            for ((left, p), (&y, &t)) in values.zip(seen) {
                *left = if t == TRUSTED { y - p } else { 0.0 };
            }
        }
        all
    }
}

/// The optics as an operator, one capture a call.
pub trait ForwardConvolution {
    /// The Work grid.
    fn size(&self) -> Size;

    /// Shows `shown` (linear light, clipped to 0..255 by the panel) and returns what was seen.
    /// Outside the frame the panel continues the picture as the light path is configured to.
    ///
    /// # Errors
    /// Whatever keeps the rig from bringing this picture's frame, with its remedy.
    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure>;

    /// What a flat picture looks like through the lens. It does not depend on the photo, so a rig
    /// may look once and remember.
    ///
    /// # Errors
    /// As [`ForwardConvolution::forward`].
    fn pedestal(&mut self, flat: &Frame<Work>) -> Result<Seen, AnyFailure> {
        self.forward(flat)
    }

    /// The panel's column, in its pixels, that each channel sees at each pixel; `None` where no
    /// panel is looked at.
    fn panel_columns(&self) -> Option<&Frame<Work>> {
        None
    }

    /// Captures made so far; every exposure counts, also those thrown away.
    fn captures(&self) -> usize;

    /// Seconds the captures took so far, on the rig's own clock.
    fn seconds(&self) -> f64;
}
