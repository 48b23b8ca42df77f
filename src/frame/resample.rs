//! Bicubic resampling of a plane at given places.
