//! Tables and drawings made by the program: methods against each other on scenes whose truth is known.

pub mod chart;
pub mod scatter;
pub mod scenes;
pub mod stand;
pub mod study;
pub mod table;
pub mod trade;
