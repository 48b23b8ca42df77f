//! One file a command; this one reads the words, starts the log and turns trouble into an exit
//! code.

mod arguments;
mod clock;
mod demo;
mod drop_folder;
mod error;
mod front_desk;
mod help;
mod rigged;
mod screens;
mod simulated_button;
mod single;
mod status;

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::process::ExitCode;
use std::sync::OnceLock;

use relens::picture::worker;

use arguments::{Command, Parsed};
use error::CliError;
use relens::daemon::service::ServiceManager;

/// Runs the command in `words` (the program's name left out).
pub(crate) fn run(words: impl Iterator<Item = OsString>) -> ExitCode {
    let mut words = words.peekable();
    if words.next_if(|word| word == worker::WORD).is_some() {
        return read_photo(&words.next().unwrap_or_default());
    }
    let parsed = match arguments::parse(words) {
        Ok(parsed) => parsed,
        Err(trouble) => return end(&trouble),
    };
    let level = if parsed.verbose { log::LevelFilter::Debug } else { log::LevelFilter::Info };
    relens::daemon::log_writer::start(level);
    match dispatch(parsed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(trouble) => end(&trouble),
    }
}

/// This process is the worker of a daemon: not for people, and mute.
fn read_photo(ask: &OsStr) -> ExitCode {
    match worker::serve(&ask.to_string_lossy()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}

fn dispatch(parsed: Parsed) -> Result<(), CliError> {
    match parsed.command {
        Command::Demo { out } => demo::run(&out),
        Command::Run { rig, folder, once, share_as } => {
            drop_folder::run(&rig, &folder, once, share_as.as_deref())
        }
        Command::Calibrate { rig, folder } => rigged::calibrate(&single::rig(&rig)?, &folder),
        Command::Restore(words) => single::restore(&words),
        Command::Photograph { rig, scene, photo } => single::photograph(&rig, &scene, &photo),
        Command::Chart { rig, out, quick, folder } => {
            rigged::chart(&single::rig(&rig)?, &out, quick, &folder)
        }
        Command::Check { rig, folder } => rigged::check(&single::rig(&rig)?, &folder),
        Command::Status { folder } => status::run(&folder),
        Command::Screens { rig, out } => screens::run(&single::rig(&rig)?, &out),
        Command::Press { folder, long } => simulated_button::press(&folder, long),
        Command::Help { about } => say(help::text(about.as_deref())),
        Command::Version => say(concat!("relens ", env!("CARGO_PKG_VERSION"))),
    }
}

/// The service manager that started this program, if one did.
fn service_manager() -> &'static ServiceManager {
    static MANAGER: OnceLock<ServiceManager> = OnceLock::new();
    MANAGER.get_or_init(|| ServiceManager::at(std::env::var_os("NOTIFY_SOCKET").as_deref()))
}

/// Writes one line to standard output. A reader that went away is no trouble of ours.
fn say(line: &str) -> Result<(), CliError> {
    let _ = writeln!(std::io::stdout(), "{line}");
    Ok(())
}

fn end(trouble: &CliError) -> ExitCode {
    // Nothing can be done when even standard error is gone; the exit code still tells.
    let _ = writeln!(std::io::stderr(), "relens: {}", relens::remedy::full_message(trouble));
    ExitCode::from(trouble.exit_code())
}
