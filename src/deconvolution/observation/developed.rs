//! Full-colour light, developed by a camera or converter, of any file but a JPEG of the rig's size.

use super::sampling::{DataKind, Sampling};
use crate::frame::Mosaic;

/// Developed light.
#[derive(Debug, Clone)]
pub struct Developed {
    /// Colour-filter mosaic over the canvas from whose sites the camera interpolated, if it did.
    pub interpolated: Option<Mosaic>,
    /// Whether a JPEG's blocks are visible: its coding has coarsened the colours, and their axes
    /// cannot be estimated.
    pub has_blocks: bool,
}

impl Sampling for Developed {
    fn kind(&self) -> DataKind {
        DataKind::Developed
    }

    fn interpolated(&self) -> Option<Mosaic> {
        self.interpolated
    }

    fn has_colour_axes(&self) -> bool {
        !self.has_blocks
    }
}
