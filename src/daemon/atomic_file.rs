//! Files that are whole or absent: temporary file, synchronised, renamed, folder synchronised.
//!
//! Each of these steps is needed: `tests/drop_folder/power.rs` takes each away in turn and sees a
//! photo or a result come to harm.

use std::collections::HashSet;
use std::collections::hash_map::RandomState;
use std::ffi::{OsStr, OsString};
use std::hash::BuildHasher;
use std::io::{ErrorKind, Read};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering};

use super::DaemonError;
use crate::disk::{Disk, Kind};

/// Beginning and end of the names of temporary files; they never depend on a photo's name, which
/// may be long.
const TEMPORARY: (&str, &str) = (".relens-", ".tmp");

/// Longest file name in bytes on the file systems of a board (ext4, f2fs, NAME_MAX).
const NAME_BYTES_MAX: usize = 255;

/// Writes `content` to the new file `folder/name`, whole or not at all, and makes it last.
///
/// # Errors
/// When it cannot, or when `name` is taken (`AlreadyExists`).
pub(super) fn write_new(
    disk: &dyn Disk,
    folder: &Path,
    name: &OsStr,
    content: &mut dyn Read,
) -> Result<(), DaemonError> {
    let temporary = write_temporary(disk, folder, content)?;
    let path = folder.join(name);
    if let Err(error) = disk.rename_new(&temporary, &path) {
        let _ = disk.remove(&temporary);
        return Err(DaemonError::files("write", &path)(error));
    }
    sync_folder(disk, folder)
}

/// Writes `bytes` to `folder/name` in place of what is there, whole or not at all. Until the folder
/// is synchronised a power cut may bring back what was there before.
///
/// # Errors
/// When it cannot.
pub(super) fn replace(
    disk: &dyn Disk,
    folder: &Path,
    name: &OsStr,
    bytes: &[u8],
) -> Result<(), DaemonError> {
    let temporary = write_temporary(disk, folder, &mut &*bytes)?;
    rename_over(disk, &temporary, &folder.join(name))
}

/// The same for what is written anew at every start: whole for whoever reads it now, anything at
/// all after a power cut. It costs the memory card nothing until the system writes back by itself.
///
/// # Errors
/// When it cannot.
pub(super) fn replace_for_now(
    disk: &dyn Disk,
    folder: &Path,
    name: &OsStr,
    bytes: &[u8],
) -> Result<(), DaemonError> {
    let temporary = temporary_in(folder);
    if let Err(error) = disk.write(&temporary, &mut &*bytes) {
        let _ = disk.remove(&temporary);
        return Err(DaemonError::files("write", &temporary)(error));
    }
    rename_over(disk, &temporary, &folder.join(name))
}

/// Moves `from` to `folder/name`, with a number when the name is taken, and returns the new path.
/// It is there for good once [`sync_folder`] was called for either folder.
///
/// # Errors
/// When it cannot; the file then is where it was.
pub(super) fn move_to(
    disk: &dyn Disk,
    from: &Path,
    folder: &Path,
    name: &OsStr,
) -> Result<PathBuf, DaemonError> {
    move_by(&|from, to| disk.rename_new(from, to), disk, from, folder, name)
}

/// The same where nobody else puts files into `folder`: in one step on every disk, also where a
/// rename cannot be told to overwrite nothing (NFS). Of several who move the same file exactly one
/// succeeds.
///
/// # Errors
/// As [`move_to`].
pub(super) fn move_to_own(
    disk: &dyn Disk,
    from: &Path,
    folder: &Path,
    name: &OsStr,
) -> Result<PathBuf, DaemonError> {
    move_by(&|from, to| disk.rename(from, to), disk, from, folder, name)
}

fn move_by(
    rename: &dyn Fn(&Path, &Path) -> std::io::Result<()>,
    disk: &dyn Disk,
    from: &Path,
    folder: &Path,
    name: &OsStr,
) -> Result<PathBuf, DaemonError> {
    let taken = Taken::of(disk, folder)?;
    for number in 1.. {
        let name = numbered(name, number);
        if taken.holds(&name) {
            continue;
        }
        let path = folder.join(name);
        match rename(from, &path) {
            Ok(()) => return Ok(path),
            // Given to another since the look.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(DaemonError::files("move", from)(error)),
        }
    }
    Err(DaemonError::files("move", from)(ErrorKind::AlreadyExists.into()))
}

/// The names of a folder, upper and lower case being one: on a share that does not tell them apart,
/// or for a customer whose computer does not, `A.jpg` would hide `a.jpg`.
pub(super) struct Taken(HashSet<Vec<u8>>);

impl Taken {
    pub(super) fn of(disk: &dyn Disk, folder: &Path) -> Result<Taken, DaemonError> {
        let found = disk.list(folder).map_err(DaemonError::files("read the folder", folder))?;
        Ok(Taken(found.iter().map(|(name, _)| folded(name)).collect()))
    }

    pub(super) fn holds(&self, name: &OsStr) -> bool {
        self.0.contains(&folded(name))
    }
}

/// A name without the difference of cases. Names are bytes: what is no text is compared as it is.
fn folded(name: &OsStr) -> Vec<u8> {
    match name.to_str() {
        Some(text) => text.to_lowercase().into_bytes(),
        None => name.as_bytes().to_ascii_lowercase(),
    }
}

/// `name` itself for number 1, else `stem-number.ext`; cut to leave room for `.json` and the like.
pub(super) fn numbered(name: &OsStr, number: u32) -> OsString {
    let suffix = if number > 1 { format!("-{number}") } else { String::new() };
    let extension = Path::new(name).extension().map(OsStr::as_bytes).unwrap_or_default();
    // An ending longer than any real one is part of the name.
    let extension = if extension.len() > 16 { &[] } else { extension };
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

/// Makes the folder's names last over a power cut.
pub(super) fn sync_folder(disk: &dyn Disk, folder: &Path) -> Result<(), DaemonError> {
    disk.sync_folder(folder).map_err(DaemonError::files("synchronise the folder", folder))
}

/// Removes temporary files that a cut left in `folder`.
pub(super) fn sweep(disk: &dyn Disk, folder: &Path) -> Result<(), DaemonError> {
    for (name, kind) in disk.list(folder).map_err(DaemonError::files("read the folder", folder))? {
        let bytes = name.as_bytes();
        let ours =
            bytes.starts_with(TEMPORARY.0.as_bytes()) && bytes.ends_with(TEMPORARY.1.as_bytes());
        if ours && kind == Kind::File {
            let path = folder.join(name);
            disk.remove(&path).map_err(DaemonError::files("remove", &path))?;
        }
    }
    Ok(())
}

/// At most `bytes_max` bytes of the file `path`; `None` when it is not there.
pub(super) fn read(
    disk: &dyn Disk,
    path: &Path,
    bytes_max: u64,
) -> Result<Option<Vec<u8>>, DaemonError> {
    let file = match disk.open(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        opened => opened.map_err(DaemonError::files("open", path))?,
    };
    let mut bytes = Vec::new();
    file.take(bytes_max).read_to_end(&mut bytes).map_err(DaemonError::files("read", path))?;
    Ok(Some(bytes))
}

/// A name that nobody else has. Boxes that share a folder are alike down to the number of the
/// process, so a number drawn by this one is part of it.
fn temporary_in(folder: &Path) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    static DRAWN: LazyLock<u64> = LazyLock::new(drawn);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    folder.join(format!("{}{:016x}-{number}{}", TEMPORARY.0, *DRAWN, TEMPORARY.1))
}

/// A number by the system's randomness, with which the standard library's hash maps begin.
fn drawn() -> u64 {
    RandomState::new().hash_one(std::process::id())
}

fn write_temporary(
    disk: &dyn Disk,
    folder: &Path,
    content: &mut dyn Read,
) -> Result<PathBuf, DaemonError> {
    let path = temporary_in(folder);
    if let Err(error) = disk.write(&path, content).and_then(crate::disk::Written::sync) {
        let _ = disk.remove(&path);
        return Err(DaemonError::files("write", &path)(error));
    }
    Ok(path)
}

fn rename_over(disk: &dyn Disk, temporary: &Path, path: &Path) -> Result<(), DaemonError> {
    disk.rename(temporary, path).map_err(|error| {
        let _ = disk.remove(temporary);
        DaemonError::files("write", path)(error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::disk::LocalDisk;

    #[test]
    fn numbers_go_before_the_ending_and_names_stay_short_enough() {
        assert_eq!(numbered(OsStr::new("a.jpg"), 1), "a.jpg");
        assert_eq!(numbered(OsStr::new("a.b.jpg"), 3), "a.b-3.jpg");
        assert_eq!(numbered(OsStr::new("plain"), 2), "plain-2");
        let long = OsString::from("é".repeat(126) + ".jpg");
        let cut = numbered(&long, 12);
        assert!(
            cut.len() + 5 <= NAME_BYTES_MAX
                && cut.to_str().is_some_and(|s| s.ends_with("é-12.jpg"))
        );
        let ending = OsString::from(format!("a.{}", "b".repeat(253)));
        assert!(numbered(&ending, 12).len() + 5 <= NAME_BYTES_MAX);
    }

    #[test]
    fn nothing_is_overwritten_or_hidden_by_another_case() {
        let folder = tempfile::tempdir().unwrap();
        let at = &folder.path().canonicalize().unwrap();
        let disk = LocalDisk::new(vec![at.clone()]);
        write_new(&disk, at, OsStr::new("a.txt"), &mut &b"first"[..]).unwrap();
        assert!(write_new(&disk, at, OsStr::new("a.txt"), &mut &b"second"[..]).is_err());
        write_new(&disk, at, OsStr::new("b.txt"), &mut &b"third"[..]).unwrap();
        let moved = move_to(&disk, &at.join("b.txt"), at, OsStr::new("A.txt")).unwrap();
        assert_eq!(moved.file_name().unwrap(), "A-2.txt");
        assert_eq!(std::fs::read(at.join("a.txt")).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(at).unwrap().count(), 2, "no temporary file stays");
    }
}
