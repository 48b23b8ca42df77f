//! The rig file as written, then as checked.
