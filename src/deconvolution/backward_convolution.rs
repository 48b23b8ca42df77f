//! Backward convolution by flip–FC–flip: Kᵀ computed by the lens itself (paper §2.2, Eqs. 9–12).
//!
//! The five steps of the paper: split into four pictures so that adjacent patches never appear
//! together; flip every patch; show and photograph the four; flip every patch back, with the margin
//! that the blur added; sew. It is exact where the blur does not vary within a patch and its margin
//! (Eq. 10).

use super::forward_convolution::ForwardConvolution;
use super::patches::{PARITY_CLASSES, PatchGrid};
use crate::frame::{Channels, Frame, Work};
use crate::remedy::AnyFailure;

/// Backward convolution BC(`picture`), computed from four captures.
///
/// # Errors
/// When a capture fails.
pub fn backward_convolution(
    optics: &mut dyn ForwardConvolution,
    picture: &Frame<Work>,
    grid: &PatchGrid,
    channels: Channels,
) -> Result<Frame<Work>, AnyFailure> {
    let mut sewn = Frame::zeros(picture.size());
    for parity in 0..PARITY_CLASSES {
        let mut shown = Frame::zeros(picture.size());
        for &channel in channels.list() {
            *shown.plane_mut(channel) = grid.flipped_class(picture.plane(channel), parity);
        }
        let seen = optics.forward(&shown)?.light;
        for &channel in channels.list() {
            grid.sew_class(seen.plane(channel), parity, sewn.plane_mut(channel));
        }
    }
    Ok(sewn)
}
