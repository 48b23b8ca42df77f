//! A result's file: its ending tells the format, and it never goes over another file.

use std::io::Write;
use std::path::Path;

use relens::picture::Format;

use super::error::CliError;

/// The format that a result's ending tells.
pub(super) fn format_of(out: &Path) -> Result<Format, CliError> {
    let extension = out.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    Format::of_extension(&extension).ok_or_else(|| CliError::Format(out.to_owned()))
}

/// Said before the long work, not after it.
pub(super) fn must_be_new(out: &Path) -> Result<(), CliError> {
    match out.symlink_metadata() {
        Ok(_) => Err(CliError::Taken(out.to_owned())),
        Err(_) => Ok(()),
    }
}

/// Writes a file that must not exist yet.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let file = std::fs::OpenOptions::new().write(true).create_new(true).open(path);
    file.and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .map_err(|e| CliError::writing(path, e))
}
