//! The mathematics of the paper, without devices, files, clocks or rigs.
//!
//! | paper | here |
//! |---|---|
//! | Eq. 1, 8: forward convolution | [`forward_convolution`], modelled by [`lens_model`] |
//! | Eqs. 9–12: flip–FC–flip | [`backward_convolution`] over [`patches`] |
//! | Eq. 3: wavelet term, Symlets 8 | [`wavelet`] |
//! | Eq. 6: shrinkage | [`wavelet_shrinkage`] |
//! | Eqs. 4, 5, 7: the loop | [`method`]; steps by [`level_norms`], colours by [`colour_axis`] |
//! | Eq. 2: data term | [`data_term`]; a photo's data: [`observation`], a JPEG's: [`jpeg`] |
//! | (not in the paper: another focus, aperture or gain) | [`focus`] |
//! | (not in the paper: details and flat places) | [`detail_mask`] |

pub mod backward_convolution;
pub mod block_matching;
pub mod blocking;
pub mod colour_axis;
pub mod colour_focus;
mod colour_lines;
pub mod data_term;
pub mod detail_mask;
#[cfg(test)]
#[path = "tests/example_lens.rs"]
mod example_lens;
pub mod focus;
pub mod forward_convolution;
pub mod hot_pixels;
pub mod jpeg;
pub mod lens_model;
pub mod level_norms;
pub mod method;
pub mod observation;
pub mod opponent;
pub mod panel_beat;
pub mod patches;
pub mod quality;
pub mod registration;
pub mod smoothing;
pub mod stage;
pub mod wavelet;
pub mod wavelet_shrinkage;
