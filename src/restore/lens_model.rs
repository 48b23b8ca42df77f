//! The measured lens: spatially varying convolution and its exact adjoint.
