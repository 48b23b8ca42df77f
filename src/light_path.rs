//! Forward convolution through a rig.
