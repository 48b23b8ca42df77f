//! The command line of relens: words in, exit code out. Everything else is in the library.

fn main() {}
