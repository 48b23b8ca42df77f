//! Photo files in and out, under limits.
