//! The drop folder: inbox to outbox.
