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

/// Representation of a signed picture on a panel, which shows no negative light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sign {
    /// The picture is light already (the paper's way).
    Unsigned,
    /// Shown as `level + gain · picture`; the capture of the pedestal alone is subtracted.
    Pedestal {
        /// Grey level of the pedestal, 0..255.
        level: f32,
        /// Grey levels shown for each level of the picture.
        gain: f32,
    },
}

/// BC(picture), in four captures. For [`Sign::Pedestal`] `pedestal_seen` is a capture of the
/// pedestal alone.
///
/// # Errors
/// The failure of the capture that failed.
pub fn backward_convolution(
    optics: &mut dyn ForwardConvolution,
    picture: &Frame<Work>,
    grid: &PatchGrid,
    channels: Channels,
    sign: Sign,
    pedestal_seen: Option<&Frame<Work>>,
) -> Result<Frame<Work>, AnyFailure> {
    let mut sewn = Frame::zeros(picture.size());
    for parity in 0..PARITY_CLASSES {
        let mut shown = Frame::zeros(picture.size());
        for &channel in channels.list() {
            let plane = match sign {
                Sign::Unsigned => grid.flipped_class(picture.plane(channel), parity, 0.0),
                Sign::Pedestal { level, gain } => {
                    let mut plane = grid.flipped_class(picture.plane(channel), parity, 0.0);
                    plane.data_mut().iter_mut().for_each(|v| *v = level + gain * *v);
                    plane
                }
            };
            *shown.plane_mut(channel) = plane;
        }
        let mut seen = optics.forward(&shown)?.light;
        for &channel in channels.list() {
            if let (Sign::Pedestal { gain, .. }, Some(pedestal)) = (sign, pedestal_seen) {
                let pedestal = pedestal.plane(channel).data();
                for (s, p) in seen.plane_mut(channel).data_mut().iter_mut().zip(pedestal) {
                    *s = (*s - p) / gain;
                }
            }
            grid.sew_class(seen.plane(channel), parity, sewn.plane_mut(channel));
        }
    }
    Ok(sewn)
}
