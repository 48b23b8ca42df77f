//! What a method may ask of the light: a picture shown, a picture seen (paper §2.1, Eq. 8).
//!
//! A method holds a `dyn` [`ForwardConvolution`] and nothing else of the rig. Behind it stands a rig
//! ([`crate::light_path`], layer 3), or for tests a lens model that convolves by computing.

use crate::frame::{Frame, Size, Work};
use crate::remedy::AnyFailure;

/// One look through the lens: FC(L)(i,j) = Σ L(m,n) K(i,j,m,n), in linear light, 0..255.
#[derive(Debug, Clone)]
pub struct Seen {
    /// The picture seen, black level, dark corner and cross-channel mixing undone.
    pub light: Frame<Work>,
    /// 1 where the sensor's value can be trusted, 0 where it was saturated or missing.
    pub trusted: Frame<Work, u8>,
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

    /// What a flat picture looks like through the lens. It does not depend on the photo, so a rig may
    /// look once and remember.
    ///
    /// # Errors
    /// As [`ForwardConvolution::forward`].
    fn pedestal(&mut self, flat: &Frame<Work>) -> Result<Seen, AnyFailure> {
        self.forward(flat)
    }

    /// Captures made so far; every exposure counts, also those thrown away.
    fn captures(&self) -> usize;

    /// Seconds the captures took so far, on the rig's own clock.
    fn seconds(&self) -> f64;
}
