//! Show, settle, trigger, see: one capture.
