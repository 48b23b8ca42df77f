//! Atomic file operations on any disk: a temporary file is written, synchronised and renamed, then
//! the folder is synchronised. Every error names operation and path.
//!
//! Each of these steps is needed: `tests/drop_folder/power.rs` omits each in turn and finds a photo
//! or a result damaged.

use std::collections::HashSet;
use std::collections::hash_map::RandomState;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::hash::BuildHasher;
use std::io::{self, ErrorKind, Read};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock};

use serde::Serialize;
use serde::de::DeserializeOwned;
use unicode_normalization::UnicodeNormalization;

use super::error::{FileError, if_found};
use super::{Disk, FileKind, LocalDisk, Metadata, Unsynced};

/// Prefix and suffix of the names of temporary files, which are independent of photos' names.
const TEMPORARY: (&str, &str) = (".relens-", ".tmp");

/// Longest file name in bytes on the file systems of a board (ext4, f2fs, NAME_MAX).
const NAME_BYTES_MAX: usize = 255;

/// Longest JSON file read: room for the names of ten thousand photos.
const JSON_BYTES_MAX: u64 = 16 << 20;

/// The files of a disk.
#[derive(Clone)]
pub struct Files(Arc<dyn Disk>);

impl Files {
    /// The files of `disk`.
    pub fn on(disk: Arc<dyn Disk>) -> Files {
        Files(disk)
    }

    /// The files beneath `folders` on the machine's disks; see [`LocalDisk::new`].
    pub fn beneath(folders: Vec<PathBuf>) -> Files {
        Files(Arc::new(LocalDisk::new(folders)))
    }

    /// Names and types of the entries of `folder`, in no order.
    pub fn list(&self, folder: &Path) -> Result<Vec<(OsString, FileKind)>, FileError> {
        self.0.list(folder).map_err(FileError::at("read the folder", folder))
    }

    /// Metadata of `path`.
    ///
    /// # Errors
    /// `NotFound`, or any error of the disk.
    pub fn metadata(&self, path: &Path) -> Result<Metadata, FileError> {
        self.0.metadata(path).map_err(FileError::at("query", path))
    }

    /// Whether `path` exists.
    pub fn exists(&self, path: &Path) -> Result<bool, FileError> {
        Ok(if_found(self.metadata(path))?.is_some())
    }

    /// Opens the regular file `path` for reading.
    pub fn open(&self, path: &Path) -> Result<File, FileError> {
        self.0.open(path).map_err(FileError::at("open", path))
    }

    /// The first `bytes_max` bytes of the file `path`; `None` when it does not exist.
    pub fn read(&self, path: &Path, bytes_max: u64) -> Result<Option<Vec<u8>>, FileError> {
        let Some(file) = if_found(self.open(path))? else { return Ok(None) };
        let mut bytes = Vec::new();
        file.take(bytes_max).read_to_end(&mut bytes).map_err(FileError::at("read", path))?;
        Ok(Some(bytes))
    }

    /// The value in the JSON file `path`; `None` when the file does not exist, is longer than 16
    /// MiB or holds something else.
    pub fn read_json<T: DeserializeOwned>(&self, path: &Path) -> Result<Option<T>, FileError> {
        Ok(self.read(path, JSON_BYTES_MAX)?.and_then(|bytes| serde_json::from_slice(&bytes).ok()))
    }

    /// Free bytes on the disk of `folder`.
    pub fn free_bytes(&self, folder: &Path) -> Result<u64, FileError> {
        self.0.free_bytes(folder).map_err(FileError::at("work in", folder))
    }

    /// Makes the folder, unless it exists.
    pub fn make_folder(&self, folder: &Path) -> Result<(), FileError> {
        self.0.make_folder(folder).map_err(|error| {
            let words = "a file of that name is in the way";
            let error = match error.kind() {
                kind @ ErrorKind::AlreadyExists => io::Error::new(kind, words),
                _ => error,
            };
            FileError::at("make the folder", folder)(error)
        })
    }

    /// Removes the file `path`, if it exists.
    pub fn remove(&self, path: &Path) -> Result<(), FileError> {
        if_found(self.0.remove(path).map_err(FileError::at("remove", path))).map(|_| ())
    }

    /// CRC-32 and length of the file `path`.
    pub fn checksum(&self, path: &Path) -> Result<(u32, u64), FileError> {
        let (mut file, mut hasher) = (self.open(path)?, crc32fast::Hasher::new());
        let (mut piece, mut length) = (vec![0; 1 << 16], 0);
        loop {
            match file.read(&mut piece).map_err(FileError::at("read", path))? {
                0 => return Ok((hasher.finalize(), length)),
                n => {
                    hasher.update(&piece[..n]);
                    length += n as u64;
                }
            }
        }
    }

    /// Moves `from` to `to`, which must not exist, even to another file system.
    ///
    /// # Errors
    /// `AlreadyExists`, or any error of the disk; nothing has changed then.
    pub fn rename_new(&self, from: &Path, to: &Path) -> Result<(), FileError> {
        self.moved(self.0.rename_new(from, to), from, to)
    }

    /// Copies `from` to `to` if the rename `done` found that they are on different file systems.
    fn moved(&self, done: io::Result<()>, from: &Path, to: &Path) -> Result<(), FileError> {
        match done {
            Err(error) if error.kind() == ErrorKind::CrossesDevices => self.copy_across(from, to),
            done => done,
        }
        .map_err(FileError::at("move", from))
    }

    /// Moves `from` to `to` on another file system: copied, synchronised, then removed. After a
    /// power cut before the removal the file is in both places.
    fn copy_across(&self, from: &Path, to: &Path) -> io::Result<()> {
        let (Some(source), Some(target)) = (from.parent(), to.parent()) else {
            return Err(ErrorKind::InvalidInput.into());
        };
        let before = self.0.metadata(from)?;
        let temporary = temporary_in(target);
        let copied = self
            .0
            .open(from)
            .and_then(|mut content| self.0.write(&temporary, &mut content)?.sync())
            .and_then(|()| self.0.rename_new(&temporary, to));
        copied.inspect_err(|_| drop(self.0.remove(&temporary)))?;
        self.0.sync_folder(target)?;
        if self.0.metadata(from)? != before {
            self.0.remove(to)?;
            return Err(io::Error::new(ErrorKind::ResourceBusy, "it is still being written"));
        }
        self.0.remove(from)?;
        self.0.sync_folder(source)
    }

    /// Makes the names in `folder` durable.
    pub fn sync_folder(&self, folder: &Path) -> Result<(), FileError> {
        self.0.sync_folder(folder).map_err(FileError::at("synchronise the folder", folder))
    }

    /// Makes the content of the file `path` durable.
    pub fn sync_file(&self, path: &Path) -> Result<(), FileError> {
        self.0.sync_file(path).map_err(FileError::at("synchronise", path))
    }

    /// Writes `content` to the new file `folder/name`, atomically and durably.
    ///
    /// # Errors
    /// `AlreadyExists`, or any error of the disk.
    pub fn write_new(
        &self,
        folder: &Path,
        name: &OsStr,
        content: &mut dyn Read,
    ) -> Result<(), FileError> {
        let path = folder.join(name);
        let rename = |temporary: &Path| self.0.rename_new(temporary, &path);
        self.write_by(rename, &path, content, Unsynced::sync)?;
        // If the file stayed, the next attempt would write a second copy beside it.
        self.sync_folder(folder).inspect_err(|_| drop(self.0.remove(&path)))
    }

    /// Replaces the file `path` by `bytes`, atomically. Until its folder is synchronised, a power
    /// cut may restore the previous file.
    pub fn replace(&self, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
        let rename = |temporary: &Path| self.0.rename(temporary, path);
        self.write_by(rename, path, &mut &*bytes, Unsynced::sync)
    }

    /// Replaces the file `path` by `bytes`, atomically and durably.
    pub fn replace_for_good(&self, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
        self.replace(path, bytes)?;
        self.sync_folder(folder_of(path))
    }

    /// Replaces the file `path` by `bytes`, atomically for readers, but with undefined content
    /// after a power cut: for files that are rewritten at every start. Nothing is synchronised,
    /// which saves writes to the memory card.
    pub fn replace_for_now(&self, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
        let rename = |temporary: &Path| self.0.rename(temporary, path);
        self.write_by(rename, path, &mut &*bytes, |_| Ok(()))
    }

    /// Moves `from` to `folder/name`, numbered if that name is taken, and returns the new path. The
    /// move is durable once [`Files::sync_folder`] was called for either folder.
    ///
    /// # Errors
    /// Any error of the disk; the file has not moved then.
    pub fn move_to(&self, from: &Path, folder: &Path, name: &OsStr) -> Result<PathBuf, FileError> {
        self.move_by(&|from, to| self.0.rename_new(from, to), from, folder, name)
    }

    /// [`Files::move_to`] for a `folder` in which only this process makes files. A rename that may
    /// overwrite suffices there, and every disk does it in one step, even NFS.
    pub fn move_to_own(
        &self,
        from: &Path,
        folder: &Path,
        name: &OsStr,
    ) -> Result<PathBuf, FileError> {
        self.move_by(&|from, to| self.0.rename(from, to), from, folder, name)
    }

    fn move_by(
        &self,
        rename: &dyn Fn(&Path, &Path) -> io::Result<()>,
        from: &Path,
        folder: &Path,
        name: &OsStr,
    ) -> Result<PathBuf, FileError> {
        self.with_free_name(folder, name, &TakenNames::holds, &mut |name| {
            let path = folder.join(name);
            self.moved(rename(from, &path), from, &path)?;
            Ok(path)
        })
    }

    /// Makes a file in `folder` by calling `make` with `name`, or with its first numbered variant
    /// that `is_taken` does not find among the names there. If the name has been taken meanwhile,
    /// the next variant is tried.
    pub fn with_free_name<T>(
        &self,
        folder: &Path,
        name: &OsStr,
        is_taken: &dyn Fn(&TakenNames, &OsStr) -> bool,
        make: &mut dyn FnMut(&OsStr) -> Result<T, FileError>,
    ) -> Result<T, FileError> {
        let taken = self.taken_names(folder)?;
        for name in numbered(name).filter(|name| !is_taken(&taken, name)) {
            match make(&name) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                made => return made,
            }
        }
        Err(FileError::at("write in", folder)(ErrorKind::AlreadyExists.into()))
    }

    /// Names in `folder`.
    pub fn taken_names(&self, folder: &Path) -> Result<TakenNames, FileError> {
        Ok(TakenNames(self.list(folder)?.iter().map(|(name, _)| folded(name)).collect()))
    }

    /// Removes temporary files left in `folder` by a power cut.
    pub fn sweep(&self, folder: &Path) -> Result<(), FileError> {
        for (name, kind) in self.list(folder)? {
            let bytes = name.as_bytes();
            let ours = bytes.starts_with(TEMPORARY.0.as_bytes())
                && bytes.ends_with(TEMPORARY.1.as_bytes());
            if ours && kind == FileKind::File {
                self.remove(&folder.join(name))?;
            }
        }
        Ok(())
    }

    /// Writes a temporary file beside `path`, and gives it that name by `rename`. Errors name
    /// `path`, because the temporary name is a new one each time.
    fn write_by(
        &self,
        rename: impl FnOnce(&Path) -> io::Result<()>,
        path: &Path,
        content: &mut dyn Read,
        sync: impl FnOnce(Box<dyn Unsynced>) -> io::Result<()>,
    ) -> Result<(), FileError> {
        let temporary = temporary_in(folder_of(path));
        let written = self.0.write(&temporary, content).and_then(sync);
        written.and_then(|()| rename(&temporary)).map_err(|error| {
            let _ = self.0.remove(&temporary);
            FileError::at("write", path)(error)
        })
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// `value` as JSON, to be written to `path`.
pub fn json(value: &impl Serialize, path: &Path) -> Result<Vec<u8>, FileError> {
    serde_json::to_vec(value).map_err(|e| FileError::at("write", path)(e.into()))
}

/// `value` as indented JSON, for human readers.
pub fn json_in_lines(value: &impl Serialize, path: &Path) -> Result<Vec<u8>, FileError> {
    serde_json::to_vec_pretty(value).map_err(|e| FileError::at("write", path)(e.into()))
}

/// Names in a folder, compared without case and in composed form (NFC): on some shares and
/// computers `A.jpg` hides `a.jpg`, and a composed `é` hides a decomposed one.
pub struct TakenNames(HashSet<Vec<u8>>);

impl TakenNames {
    /// Whether `name` is taken.
    pub fn holds(&self, name: &OsStr) -> bool {
        self.0.contains(&folded(name))
    }
}

/// `name` composed (NFC) and in lower case; if it is not UTF-8, only ASCII letters are lowered.
fn folded(name: &OsStr) -> Vec<u8> {
    match name.to_str() {
        Some(text) if text.is_ascii() => text.to_ascii_lowercase().into_bytes(),
        Some(text) => text.nfc().collect::<String>().to_lowercase().into_bytes(),
        None => name.as_bytes().to_ascii_lowercase(),
    }
}

/// `name`, then `stem-2.ext`, `stem-3.ext` and so on, shortened to leave room for `.json`.
pub fn numbered(name: &OsStr) -> impl Iterator<Item = OsString> + use<> {
    let name = name.to_owned();
    (1..).map(move |number| with_number(&name, number))
}

fn with_number(name: &OsStr, number: u32) -> OsString {
    let suffix = if number > 1 { format!("-{number}") } else { String::new() };
    let extension = Path::new(name).extension().map(OsStr::as_bytes).unwrap_or_default();
    // An extension longer than any real one is treated as part of the stem.
    let extension = if extension.len() > 16 { &[] } else { extension };
    let mut stem = match extension.is_empty() {
        true => name.as_bytes().to_vec(),
        false => name.as_bytes()[..name.len() - extension.len() - 1].to_vec(),
    };
    // Room for the dot, the extension, the number and the longest suffix added, `.json`.
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

/// A path for a temporary file in `folder`, unique among processes. It contains a random number,
/// because processes in different containers may share a process number.
fn temporary_in(folder: &Path) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    // From the seed of the standard library's hash maps.
    static DRAWN: LazyLock<u64> = LazyLock::new(|| RandomState::new().hash_one(std::process::id()));
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    folder.join(format!("{}{:016x}-{number}{}", TEMPORARY.0, *DRAWN, TEMPORARY.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_precede_the_extension_and_names_are_short_enough() {
        assert_eq!(with_number(OsStr::new("a.jpg"), 1), "a.jpg");
        assert_eq!(with_number(OsStr::new("a.b.jpg"), 3), "a.b-3.jpg");
        assert_eq!(with_number(OsStr::new("plain"), 2), "plain-2");
        let long = OsString::from("é".repeat(126) + ".jpg");
        let cut = with_number(&long, 12);
        assert!(
            cut.len() + 5 <= NAME_BYTES_MAX
                && cut.to_str().is_some_and(|s| s.ends_with("é-12.jpg"))
        );
        let ending = OsString::from(format!("a.{}", "b".repeat(253)));
        assert!(with_number(&ending, 12).len() + 5 <= NAME_BYTES_MAX);
    }

    #[test]
    fn nothing_is_overwritten_or_hidden_by_another_case() {
        let folder = tempfile::tempdir().unwrap();
        let at = &folder.path().canonicalize().unwrap();
        let files = Files::beneath(vec![at.clone()]);
        files.write_new(at, OsStr::new("a.txt"), &mut &b"first"[..]).unwrap();
        assert!(files.write_new(at, OsStr::new("a.txt"), &mut &b"second"[..]).is_err());
        files.write_new(at, OsStr::new("b.txt"), &mut &b"third"[..]).unwrap();
        let composed = files.move_to(&at.join("b.txt"), at, OsStr::new("\u{e9}.txt")).unwrap();
        files.write_new(at, OsStr::new("b.txt"), &mut &b"fourth"[..]).unwrap();
        let other = files.move_to(&at.join("b.txt"), at, OsStr::new("e\u{301}.txt")).unwrap();
        assert!(composed != other && other.ends_with("e\u{301}-2.txt"), "{other:?}");
        files.move_to(&composed, at, OsStr::new("b.txt")).unwrap();
        files.remove(&other).unwrap();
        let moved = files.move_to(&at.join("b.txt"), at, OsStr::new("A.txt")).unwrap();
        assert_eq!(moved.file_name().unwrap(), "A-2.txt");
        assert_eq!(std::fs::read(at.join("a.txt")).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(at).unwrap().count(), 2, "no temporary file remains");
    }
}
