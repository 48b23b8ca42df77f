//! Basic types: planes of numbers, frames of three channels, and the spaces they belong to.
//!
//! The three spaces are types that do not mix: [`PanelSpace`] (panel pixels, 8-bit codes),
//! [`SensorSpace`] (camera pixels, raw counts) and [`Work`] (the photo's own grid, linear light,
//! 0..255 full scale as in the paper). Every plane is row-major, height × width.

mod bands;
pub mod binning;
pub mod block_transform;
mod channel;
mod coding;
pub mod instructions;
mod mosaic;
#[cfg(test)]
#[path = "../../tests/golden/npy.rs"]
mod npy;
mod once;
mod plane;
pub mod resample;
mod space;
mod square;
mod steps;

pub use bands::{CoarseResult, DeliveredPicture, bands_of};
pub use channel::{Channel, Channels};
pub use coding::{BLOCK_AREA, BLOCK_PX, CodedComponent, Coding, TO_YCC, usual_step};
pub use mosaic::{Mosaic, RawSites};
#[cfg(test)]
pub(crate) use npy::read_npy_f32;
pub use once::once;
pub use plane::{PhotoGrid, Plane, Rect, Size};

pub use space::{Codes, Counts, Frame, PanelSpace, SensorSpace, Work};
pub use square::SquarePlace;
pub use steps::{at_step, step_of};

/// Full scale of linear light in Work space (the paper's 0..255).
pub const FULL_SCALE: f32 = 255.0;

/// Pixels per task in parallel passes over a plane.
pub const STRETCH: usize = 1 << 15;
