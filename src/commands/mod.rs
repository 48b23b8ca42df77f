//! The commands, a file each; this one parses the command line, starts the log and returns the exit
//! code.

mod align;
mod arguments;
mod board;
mod calibrate;
mod chart;
mod check;
mod demo;
mod error;
mod front_panel;
mod manual;
mod new_file;
mod opening;
mod options;
mod output;
mod photograph;
mod press;
mod progress;
mod restore;
mod run;
mod scene;
mod service;
mod shoot;
mod signals;
mod status;

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use relens::daemon::log_writer;
use relens::picture::worker;

use arguments::{Command, CommandLine};
use error::CliError;

pub(crate) fn run(words: Vec<OsString>) -> ExitCode {
    if words.get(1).is_some_and(|word| word == worker::WORD) {
        return read_photo(words.get(2).map_or(OsStr::new(""), OsString::as_os_str));
    }
    let line = match CommandLine::try_parse_from(words) {
        Ok(line) => line,
        Err(help_or_error) => {
            // A closed output is ignored.
            let _ = help_or_error.print();
            return ExitCode::from(help_or_error.exit_code() as u8);
        }
    };
    let level = match (line.verbose, line.quiet) {
        (true, _) => log::LevelFilter::Debug,
        (_, true) => log::LevelFilter::Warn,
        _ => log::LevelFilter::Info,
    };
    // `--quiet` does not hide the output of commands that only print.
    let prints = matches!(
        line.command,
        Command::Status(_)
            | Command::Check(_)
            | Command::Align(_)
            | Command::Completions(_)
            | Command::Man(_)
    );
    if line.quiet && !prints {
        progress::be_quiet();
    }
    let journal_stream = std::env::var_os("JOURNAL_STREAM");
    log_writer::start(level, journal_stream.as_deref(), output::log);
    let done = dispatch(&line);
    progress::leave();
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Without standard error, the exit code still reports it.
            let message = relens::remedy::full_message(&error);
            let _ = writeln!(std::io::stderr(), "relens: {message}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Runs as a worker of the daemon; prints nothing.
fn read_photo(ask: &OsStr) -> ExitCode {
    match worker::serve(&ask.to_string_lossy()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}

fn dispatch(line: &CommandLine) -> Result<(), CliError> {
    if progress::is_drawn() && !matches!(line.command, Command::Run(_)) {
        signals::end_cleanly()?;
    }
    match &line.command {
        Command::Demo(options) => demo::run(options),
        Command::Run(options) => run::run(options),
        Command::Calibrate(options) => calibrate::run(options),
        Command::Restore(options) => restore::run(options),
        Command::Photograph(options) => photograph::run(options),
        Command::Shoot(options) => shoot::run(options),
        Command::Chart(options) => chart::run(options),
        Command::Align(options) => align::run(options),
        Command::Check(options) => check::run(options),
        Command::Status(options) => status::run(options),
        Command::Press(options) => press::run(options),
        Command::Completions(options) => manual::completions(options, CommandLine::command()),
        Command::Man(options) => manual::man(options, CommandLine::command()),
    }
}
