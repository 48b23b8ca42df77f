//! What is shown on purpose.
