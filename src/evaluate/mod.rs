//! Tables and drawings made by the program: methods against each other on scenes whose truth is
//! known.

pub mod chart;
pub mod drawing;
pub mod figures;
pub mod ladder;
pub mod operating_point;
pub mod peers;
pub mod regimes;
pub mod scatter;
pub mod scenes;
pub mod sizes;
pub mod stability;
pub mod study;
pub mod table;
pub mod test_rig;
pub mod trade;
