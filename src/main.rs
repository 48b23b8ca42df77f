//! The command line of relens: words in, exit code out. Everything else is in the library.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run(std::env::args_os().collect())
}
