//! Fits and corrections from captures alone.
