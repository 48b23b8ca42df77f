//! Procedures: show, see, fit, judge, keep.
