//! Full-colour light, developed by a camera or converter, of any file but a JPEG of the rig's size.

use super::sampling::{DataKind, Sampling};
use crate::frame::Mosaic;

/// Developed light.
#[derive(Debug, Clone)]
pub struct Developed {
    /// The filters between whose sites the camera interpolated, over the canvas.
    pub interpolated: Option<Mosaic>,
    /// Whether a JPEG's blocks are visible: coding coarsened the colours, and they have no axes.
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
