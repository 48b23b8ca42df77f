//! The patch grid of backward convolution.
