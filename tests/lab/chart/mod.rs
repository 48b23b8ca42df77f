//! Drawings: the chart of speed against accuracy, and what it is made of.

pub(crate) mod axes;
pub(crate) mod drawing;
pub(crate) mod labels;
pub(crate) mod marks;
pub(crate) mod scatter;
