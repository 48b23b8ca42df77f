//! The orthonormal Symlet-8 transform, periodised, any size.
