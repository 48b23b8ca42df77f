//! The block-matching prior: collaborative filtering of groups of similar blocks.
//!
//! Similar blocks are stacked in groups, whose three-dimensional transform is sparser than that of
//! a single block, so that noise and detail separate better ("Image denoising by sparse 3D
//! transform-domain collaborative filtering", Dabov, Foi, Katkovnik & Egiazarian 2007). Each pixel
//! is the weighted mean of all blocks that cover it.
//!
//! Of that paper's two passes only the second is used, Wiener filtering with the signal's power
//! taken from a guide. The first pass, hard thresholding, provides a guide there; here the current
//! picture of the solve is a better one (measured, see [`super::method::blocks`]). Pictures smaller
//! than a block of 8×8 are unchanged.

mod filter;
mod noise;
mod search;
mod transform;

pub use filter::filter;
pub use noise::{BlockNoise, Passed};
pub use search::{Groups, Search};

#[cfg(test)]
mod tests;
