//! New files for results, which never replace another file.

use std::path::Path;

use relens::disk::Files;
use relens::picture::Format;

use super::error::CliError;

pub(super) fn format_of(out: &Path) -> Result<Format, CliError> {
    let extension = out.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    Format::of_extension(&extension).ok_or_else(|| CliError::Format(out.to_owned()))
}

/// Checks, before the long work, that `out` does not exist.
pub(super) fn must_be_new(out: &Path) -> Result<(), CliError> {
    match out.symlink_metadata() {
        Ok(_) => Err(CliError::Taken(out.to_owned())),
        Err(_) => Ok(()),
    }
}

/// Writes a new file, whole or not at all. Until it is whole it has a hidden name, which the daemon
/// ignores.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let path = std::path::absolute(path).map_err(|e| CliError::writing(path, e))?;
    let (folder, name) = (path.parent().unwrap_or(&path), path.file_name().unwrap_or_default());
    let written = Files::beneath(vec![folder.to_owned()]).write_new(folder, name, &mut &*bytes);
    written.map_err(|e| CliError::writing(&path, e.into()))
}
