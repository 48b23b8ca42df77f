//! The named ways to solve.
