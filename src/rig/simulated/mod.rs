//! A rig like any other, made of physics.
