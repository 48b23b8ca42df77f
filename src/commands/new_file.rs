//! New files for results, which never replace another file.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use relens::picture::Format;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use super::error::CliError;

/// The format of a result's file ending.
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
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".part");
    let part = path.with_file_name(name);
    let written = File::create(&part)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| rename(&part, path));
    written.map_err(|e| {
        let _ = std::fs::remove_file(&part);
        CliError::writing(path, e)
    })
}

/// Renames `part` to `path`, which must not exist.
fn rename(part: &Path, path: &Path) -> io::Result<()> {
    match renameat_with(CWD, part, CWD, path, RenameFlags::NOREPLACE) {
        // NFS has no such renaming; `must_be_new` was checked before.
        Err(Errno::INVAL) => std::fs::rename(part, path),
        renamed => Ok(renamed?),
    }
}
