//! Files that are whole or absent: temporary file, fsync, rename, fsync of the folder.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use rustix::fs::{CWD, RenameFlags, renameat_with};

use super::DaemonError;

/// Beginning and end of the names of temporary files; they never depend on a photo's name, which may be long.
const TEMPORARY: (&str, &str) = (".relens-", ".tmp");

/// Longest file name in bytes on the file systems of a board (ext4, f2fs, NAME_MAX).
const NAME_BYTES_MAX: usize = 255;

/// Writes `bytes` to the new file `folder/name`, whole or not at all.
///
/// # Errors
/// When it cannot, or when `name` is taken (`AlreadyExists`).
pub(super) fn write_new(folder: &Path, name: &OsStr, bytes: &[u8]) -> Result<(), DaemonError> {
    let temporary = write_temporary(folder, bytes)?;
    let path = folder.join(name);
    if let Err(error) = rename_new(&temporary, &path) {
        let _ = std::fs::remove_file(&temporary);
        return Err(DaemonError::files("write", &path)(error));
    }
    sync_folder(folder)
}

/// Writes `bytes` to `folder/name` in place of what is there, whole or not at all.
///
/// # Errors
/// When it cannot.
pub(super) fn replace(folder: &Path, name: &OsStr, bytes: &[u8]) -> Result<(), DaemonError> {
    let temporary = write_temporary(folder, bytes)?;
    let path = folder.join(name);
    if let Err(error) = std::fs::rename(&temporary, &path) {
        let _ = std::fs::remove_file(&temporary);
        return Err(DaemonError::files("write", &path)(error));
    }
    sync_folder(folder)
}

/// Moves `from` to `folder/name`, with a number when the name is taken, and returns the new path.
///
/// # Errors
/// When it cannot; the file then is where it was.
pub(super) fn move_to(from: &Path, folder: &Path, name: &OsStr) -> Result<PathBuf, DaemonError> {
    let mut number = 1;
    loop {
        let path = folder.join(numbered(name, number));
        match rename_new(from, &path) {
            Ok(()) => {
                sync_folder(folder)?;
                if let Some(left) = from.parent() {
                    sync_folder(left)?;
                }
                return Ok(path);
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(DaemonError::files("move", from)(error)),
        }
    }
}

/// `name` itself for number 1, else `stem-number.ext`; cut to leave room for `.json` and the like.
pub(super) fn numbered(name: &OsStr, number: u32) -> OsString {
    let suffix = if number > 1 { format!("-{number}") } else { String::new() };
    let extension = Path::new(name).extension().map(OsStr::as_bytes).unwrap_or_default();
    let mut stem = match extension.is_empty() {
        true => name.as_bytes().to_vec(),
        false => name.as_bytes()[..name.len() - extension.len() - 1].to_vec(),
    };
    // Room for the dot, the extension, the number and the longest ending that is added, `.json`.
    let room = NAME_BYTES_MAX.saturating_sub(extension.len() + 1 + suffix.len() + 5).max(1);
    if stem.len() > room {
        // Not through the middle of a UTF-8 character.
        let mut at = room;
        while at > 1 && stem[at] & 0xc0 == 0x80 {
            at -= 1;
        }
        stem.truncate(at);
    }
    stem.extend_from_slice(suffix.as_bytes());
    if !extension.is_empty() {
        stem.push(b'.');
        stem.extend_from_slice(extension);
    }
    OsString::from_vec(stem)
}

/// Makes the folder's entries last over a power cut.
pub(super) fn sync_folder(folder: &Path) -> Result<(), DaemonError> {
    File::open(folder).and_then(|f| f.sync_all()).map_err(DaemonError::files("sync the folder", folder))
}

/// Removes temporary files that a cut left in `folder`.
pub(super) fn sweep(folder: &Path) -> Result<(), DaemonError> {
    for entry in std::fs::read_dir(folder).map_err(DaemonError::files("read the folder", folder))?.flatten() {
        let name = entry.file_name();
        let bytes = name.as_bytes();
        if bytes.starts_with(TEMPORARY.0.as_bytes()) && bytes.ends_with(TEMPORARY.1.as_bytes()) {
            std::fs::remove_file(entry.path()).map_err(DaemonError::files("remove", &entry.path()))?;
        }
    }
    Ok(())
}

fn write_temporary(folder: &Path, bytes: &[u8]) -> Result<PathBuf, DaemonError> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let path = folder.join(format!("{}{}-{number}{}", TEMPORARY.0, std::process::id(), TEMPORARY.1));
    let written = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .open(&path)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()));
    if let Err(error) = written {
        let _ = std::fs::remove_file(&path);
        return Err(DaemonError::files("write", &path)(error));
    }
    Ok(path)
}

/// Renames without ever replacing what has the new name.
fn rename_new(from: &Path, to: &Path) -> std::io::Result<()> {
    use rustix::io::Errno;
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        Ok(()) => Ok(()),
        // File systems without the flag (some network and FUSE ones): a look first, which is as good
        // as one daemon a folder makes it.
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => match to.symlink_metadata() {
            Ok(_) => Err(std::io::ErrorKind::AlreadyExists.into()),
            Err(_) => std::fs::rename(from, to),
        },
        Err(errno) => Err(errno.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_before_the_ending_and_names_stay_short_enough() {
        assert_eq!(numbered(OsStr::new("a.jpg"), 1), "a.jpg");
        assert_eq!(numbered(OsStr::new("a.b.jpg"), 3), "a.b-3.jpg");
        assert_eq!(numbered(OsStr::new("plain"), 2), "plain-2");
        let long = OsString::from("é".repeat(126) + ".jpg");
        let cut = numbered(&long, 12);
        assert!(cut.len() + 5 <= NAME_BYTES_MAX && cut.to_str().is_some_and(|s| s.ends_with("é-12.jpg")));
    }

    #[test]
    fn nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        write_new(at, OsStr::new("a.txt"), b"first").unwrap();
        assert!(write_new(at, OsStr::new("a.txt"), b"second").is_err());
        write_new(at, OsStr::new("b.txt"), b"third").unwrap();
        let moved = move_to(&at.join("b.txt"), at, OsStr::new("a.txt")).unwrap();
        assert_eq!(moved.file_name().unwrap(), "a-2.txt");
        assert_eq!(std::fs::read(at.join("a.txt")).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(at).unwrap().count(), 2, "no temporary file stays");
    }
}
