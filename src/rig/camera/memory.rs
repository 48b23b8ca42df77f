//! Reusable memory for the frames of cameras, and their errors.

use crate::frame::{Counts, Plane, Size};
use crate::rig::RigError;

pub(super) fn gone(what: impl Into<String>) -> RigError {
    RigError::gone("camera", what)
}

pub(super) fn refused(found: impl Into<String>, allowed: impl Into<String>) -> RigError {
    RigError::refused("camera", found, allowed)
}

/// Error of a camera that was lost and has not been reopened.
pub(super) fn not_open() -> RigError {
    gone("it was disconnected and has not been reopened")
}

/// Memory for frames and Bayer sites, reused by captures.
pub(super) struct FrameMemory {
    spare: heapless::Vec<Counts, 4>,
    pub(super) sites: Plane<u16>,
}

impl FrameMemory {
    pub(super) fn new(size: Size) -> FrameMemory {
        FrameMemory { spare: heapless::Vec::new(), sites: Plane::zeros(size) }
    }

    pub(super) fn take(&mut self) -> Counts {
        self.spare.pop().unwrap_or_else(|| Counts::zeros(self.sites.size()))
    }

    pub(super) fn give_back(&mut self, counts: Counts) {
        if counts.size() == self.sites.size() {
            // Surplus memory is freed.
            let _ = self.spare.push(counts);
        }
    }
}
