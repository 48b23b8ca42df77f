//! The other prior: what a scene shows once it mostly shows again nearby.
//!
//! Blocks that look alike are put together in groups; a group's three-dimensional transform is
//! sparser than a block's own, since what the blocks share is in few of its coefficients, so noise
//! is told from detail that no single block could tell ("Image denoising by sparse 3D
//! transform-domain collaborative filtering", Dabov, Foi, Katkovnik & Egiazarian 2007). Each pixel
//! is the weighted mean of all blocks over it.
//!
//! Of that paper's two passes only the second is here: all coefficients drawn by Wiener's rule,
//! with a guide for the power of the signal. The first one, a hard threshold, is there to make the
//! guide; a solve has a better one, its picture so far (measured, see [`super::method::blocks`]). A
//! picture smaller than a block of 8×8 stays as it is.

mod filter;
mod noise;
mod search;
mod transform;

pub use filter::filter;
pub use noise::{BlockNoise, Passed};
pub use search::{Groups, Search};

#[cfg(test)]
mod plain;
#[cfg(test)]
mod tests;
