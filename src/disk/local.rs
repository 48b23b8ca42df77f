//! The machine's disks, local or network mounts.
//!
//! Every path is resolved from one of a few anchor folders without following links (openat2 with
//! RESOLVE_BENEATH and RESOLVE_NO_SYMLINKS): a user with write access to the inbox cannot lead the
//! daemon out of it, not even by replacing a folder by a link between two calls.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::{
    AtFlags, CWD, Dir, FileType, Mode, OFlags, RenameFlags, ResolveFlags, Stat, fstat, fstatvfs,
    linkat, mkdirat, openat, openat2, renameat, renameat_with, statat, unlinkat,
};
use rustix::io::Errno;

use super::{Disk, FileKind, Metadata, Unsynced};

/// Most attempts at an openat2(2) that a rename disturbs (EAGAIN). Guess.
const TRIES_MAX: usize = 16;

/// Fewest free inodes of a disk that counts as having room: a photo's result takes eight, and
/// without them the photo would be restored in vain. Guess.
const INODES_MIN: u64 = 32;

/// The disk beneath a few anchor folders.
#[derive(Debug, Clone)]
pub struct LocalDisk {
    anchors: Vec<AnchorFolder>,
}

/// A folder that paths are resolved from.
#[derive(Debug, Clone)]
struct AnchorFolder {
    path: PathBuf,
    /// Whether another disk is mounted there.
    is_mount: bool,
}

impl LocalDisk {
    /// The disk beneath `anchors`, which are absolute and without links.
    pub fn new(anchors: Vec<PathBuf>) -> LocalDisk {
        // A folder that does not exist yet is no mount.
        let is_mount = |path: &Path| {
            let disks = path.parent().map(|above| (disk_of(path), disk_of(above)));
            matches!(disks, Some((Ok(own), Ok(above))) if own != above)
        };
        let anchor = |path: PathBuf| AnchorFolder { is_mount: is_mount(&path), path };
        LocalDisk { anchors: anchors.into_iter().map(anchor).collect() }
    }

    /// The deepest anchor above `path`, and the path relative to it.
    fn anchored<'a>(&'a self, path: &'a Path) -> io::Result<(&'a AnchorFolder, &'a Path)> {
        let above = self
            .anchors
            .iter()
            .filter_map(|anchor| Some((anchor, path.strip_prefix(&anchor.path).ok()?)));
        above.min_by_key(|(_, relative)| relative.as_os_str().len()).ok_or_else(|| {
            let words = format!("{} is outside the drop folder", path.display());
            io::Error::new(io::ErrorKind::PermissionDenied, words)
        })
    }

    fn folder(&self, folder: &Path) -> io::Result<OwnedFd> {
        let (anchor, relative) = self.anchored(folder)?;
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
        let AnchorFolder { path, is_mount } = anchor;
        let anchor = openat(CWD, path, flags, Mode::empty())?;
        // Where a mount has vanished, the path leads to an empty folder of the disk around it.
        if *is_mount
            && path.parent().and_then(|above| disk_of(above).ok()) == Some(fstat(&anchor)?.st_dev)
        {
            let words = format!("the disk of {} is not mounted", path.display());
            return Err(io::Error::new(io::ErrorKind::NotFound, words));
        }
        match relative.as_os_str().is_empty() {
            true => Ok(anchor),
            false => Ok(open_beneath(&anchor, relative, flags)?),
        }
    }

    /// The parent folder of `path`, opened, and the file name.
    fn parent_and_name<'a>(&self, path: &'a Path) -> io::Result<(OwnedFd, &'a OsStr)> {
        match (path.parent(), path.file_name()) {
            (Some(parent), Some(name)) => Ok((self.folder(parent)?, name)),
            _ => Err(io::ErrorKind::InvalidInput.into()),
        }
    }
}

/// The error of a disk that has room for bytes but hardly any for names.
fn no_inodes(found: u64) -> io::Error {
    let words = format!(
        "the disk has room for bytes but not for more files: found {found} free inodes, allowed \
         {INODES_MIN} or more; remove some files"
    );
    io::Error::new(io::ErrorKind::StorageFull, words)
}

/// The number of the disk that `path` lies on.
fn disk_of(path: &Path) -> io::Result<u64> {
    Ok(statat(CWD, path, AtFlags::empty())?.st_dev)
}

/// Opens `path` from `anchor` without leaving it and without following links.
fn open_beneath(anchor: &OwnedFd, path: &Path, flags: OFlags) -> rustix::io::Result<OwnedFd> {
    let resolve = ResolveFlags::BENEATH | ResolveFlags::NO_SYMLINKS | ResolveFlags::NO_MAGICLINKS;
    for _ in 0..TRIES_MAX {
        match openat2(anchor, path, flags, Mode::empty(), resolve) {
            Err(Errno::AGAIN) => {}
            // Kernels before 5.6, and sandboxes without the call.
            Err(Errno::NOSYS | Errno::PERM) => return open_by_steps(anchor, path, flags),
            done => return done,
        }
    }
    Err(Errno::AGAIN)
}

/// [`open_beneath`] without openat2(2): opens one folder at a time.
fn open_by_steps(anchor: &OwnedFd, path: &Path, flags: OFlags) -> rustix::io::Result<OwnedFd> {
    let mut names = path.iter().peekable();
    let mut at = anchor.try_clone().map_err(|_| Errno::MFILE)?;
    while let Some(name) = names.next() {
        if name == OsStr::new("..") {
            return Err(Errno::XDEV);
        }
        let last = names.peek().is_none();
        let flags = if last { flags } else { OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC };
        at = openat(&at, name, flags | OFlags::NOFOLLOW, Mode::empty())?;
    }
    Ok(at)
}

/// Renames a file to a name that must not exist, on file systems that cannot do so in one step. A
/// power cut between the two steps leaves the file under both names.
fn rename_by_steps(
    source: &OwnedFd,
    from: &OsStr,
    target: &OwnedFd,
    to: &OsStr,
) -> rustix::io::Result<()> {
    match linkat(source, from, target, to, AtFlags::empty()) {
        // Over NFS the reply to a removal may be lost, and the repeated one finds no file.
        Ok(()) => match unlinkat(source, from, AtFlags::empty()) {
            Err(Errno::NOENT) => return Ok(()),
            done => return done,
        },
        Err(Errno::EXIST) => return Err(Errno::EXIST),
        // Without hard links, check first, which suffices while one daemon uses the folder.
        Err(_) => {}
    }
    match statat(target, to, AtFlags::SYMLINK_NOFOLLOW) {
        Ok(_) => Err(Errno::EXIST),
        Err(_) => renameat(source, from, target, to),
    }
}

fn kind(of: FileType) -> FileKind {
    match of {
        FileType::RegularFile => FileKind::File,
        FileType::Directory => FileKind::Folder,
        FileType::Symlink => FileKind::Link,
        _ => FileKind::Other,
    }
}

fn metadata_of(stat: &Stat) -> Metadata {
    Metadata {
        kind: kind(FileType::from_raw_mode(stat.st_mode)),
        size: u64::try_from(stat.st_size).unwrap_or(0),
        changed: (stat.st_mtime, stat.st_mtime_nsec as i64),
        touched_unix_s: stat.st_ctime,
        inode: stat.st_ino,
    }
}

impl Unsynced for File {
    fn sync(self: Box<Self>) -> io::Result<()> {
        self.sync_all()
    }
}

impl Disk for LocalDisk {
    fn list(&self, folder: &Path) -> io::Result<Vec<(OsString, FileKind)>> {
        let folder = self.folder(folder)?;
        let mut found = Vec::new();
        for entry in Dir::read_from(&folder)? {
            let entry = entry?;
            let name = OsStr::from_bytes(entry.file_name().to_bytes());
            if name == "." || name == ".." {
                continue;
            }
            let kind = match entry.file_type() {
                // Some file systems list names without types.
                FileType::Unknown => match statat(&folder, name, AtFlags::SYMLINK_NOFOLLOW) {
                    Ok(stat) => kind(FileType::from_raw_mode(stat.st_mode)),
                    Err(Errno::NOENT) => continue,
                    Err(errno) => return Err(errno.into()),
                },
                known => kind(known),
            };
            found.push((name.to_owned(), kind));
        }
        Ok(found)
    }

    fn metadata(&self, path: &Path) -> io::Result<Metadata> {
        let (folder, name) = self.parent_and_name(path)?;
        Ok(metadata_of(&statat(&folder, name, AtFlags::SYMLINK_NOFOLLOW)?))
    }

    fn open(&self, path: &Path) -> io::Result<File> {
        let (folder, name) = self.parent_and_name(path)?;
        let flags =
            OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        // Checked before opening, too: opening a device may have side effects.
        let not_a_file = || io::Error::new(io::ErrorKind::InvalidInput, "not a regular file");
        let before = metadata_of(&statat(&folder, name, AtFlags::SYMLINK_NOFOLLOW)?);
        if before.kind != FileKind::File {
            return Err(not_a_file());
        }
        let file = File::from(open_beneath(&folder, name.as_ref(), flags)?);
        if file.metadata()?.is_file() { Ok(file) } else { Err(not_a_file()) }
    }

    fn free_bytes(&self, folder: &Path) -> io::Result<u64> {
        let about = fstatvfs(self.folder(folder)?)?;
        // Some file systems count no inodes, and state 0 of 0.
        if about.f_files > 0 && about.f_favail < INODES_MIN {
            return Err(no_inodes(about.f_favail));
        }
        Ok(about.f_bavail.saturating_mul(about.f_frsize))
    }

    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        // The folder above an anchor may lie outside all anchors, so it cannot be looked up.
        if self.anchors.iter().any(|anchor| anchor.path == folder) && self.folder(folder).is_ok() {
            return Ok(());
        }
        let (above, name) = self.parent_and_name(folder)?;
        match mkdirat(&above, name, Mode::from_raw_mode(0o777)) {
            Err(Errno::EXIST) if self.metadata(folder)?.kind == FileKind::Folder => Ok(()),
            done => Ok(done?),
        }
    }

    fn write(&self, path: &Path, content: &mut dyn Read) -> io::Result<Box<dyn Unsynced>> {
        let (folder, name) = self.parent_and_name(path)?;
        let flags =
            OFlags::WRONLY | OFlags::CREATE | OFlags::TRUNC | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let file = openat(&folder, name, flags, Mode::from_raw_mode(0o666));
        let mut file = File::from(file.map_err(|errno| match fstatvfs(&folder) {
            Ok(disk) if errno == Errno::NOSPC && disk.f_bavail > 0 => no_inodes(disk.f_favail),
            _ => errno.into(),
        })?);
        io::copy(content, &mut file)?;
        file.flush()?;
        Ok(Box::new(file))
    }

    fn sync_file(&self, path: &Path) -> io::Result<()> {
        self.open(path)?.sync_all()
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let ((source, from), (target, to)) =
            (self.parent_and_name(from)?, self.parent_and_name(to)?);
        Ok(renameat(&source, from, &target, to)?)
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        let ((source, from), (target, to)) =
            (self.parent_and_name(from)?, self.parent_and_name(to)?);
        match renameat_with(&source, from, &target, to, RenameFlags::NOREPLACE) {
            // Some network and FUSE file systems lack the flag.
            Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => {}
            done => return Ok(done?),
        }
        Ok(rename_by_steps(&source, from, &target, to)?)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        let (folder, name) = self.parent_and_name(path)?;
        Ok(unlinkat(&folder, name, AtFlags::empty())?)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        match File::from(self.folder(folder)?).sync_all() {
            // Network mounts that cannot synchronise a folder do so at every rename.
            Err(error) if error.raw_os_error() == Some(Errno::INVAL.raw_os_error()) => Ok(()),
            done => done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_not_followed_and_pipes_do_not_block() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let (inside, outside) = (root.join("inbox"), root.join("outside"));
        for folder in [&inside, &outside] {
            std::fs::create_dir(folder).unwrap();
        }
        std::fs::write(outside.join("secret"), b"s").unwrap();
        std::fs::write(inside.join("plain"), b"p").unwrap();
        std::os::unix::fs::symlink(&outside, inside.join("way")).unwrap();
        std::os::unix::fs::symlink(outside.join("secret"), inside.join("link")).unwrap();
        let mode = Mode::RUSR | Mode::WUSR;
        rustix::fs::mknodat(CWD, inside.join("pipe"), FileType::Fifo, mode, 0).unwrap();
        let disk = LocalDisk::new(vec![inside.clone()]);
        assert!(disk.open(&inside.join("plain")).is_ok());
        for bad in ["way/secret", "link", "pipe", "way", "../outside/secret"] {
            assert!(disk.open(&inside.join(bad)).is_err(), "{bad}");
        }
        assert!(
            disk.list(&inside.join("way")).is_err() && disk.open(&outside.join("secret")).is_err()
        );
        assert!(disk.rename(&inside.join("way/secret"), &inside.join("mine")).is_err());
        let anchor = disk.folder(&inside).unwrap();
        let flags = OFlags::RDONLY | OFlags::CLOEXEC;
        assert!(open_by_steps(&anchor, Path::new("plain"), flags).is_ok());
        for bad in ["way/secret", "link", "../outside/secret"] {
            assert!(open_by_steps(&anchor, Path::new(bad), flags).is_err(), "{bad}");
        }
        let kinds: std::collections::BTreeMap<_, _> =
            disk.list(&inside).unwrap().into_iter().collect();
        let kinds = |name: &str| kinds[OsStr::new(name)];
        assert_eq!(
            (kinds("plain"), kinds("way"), kinds("link"), kinds("pipe")),
            (FileKind::File, FileKind::Link, FileKind::Link, FileKind::Other)
        );
    }

    #[test]
    fn a_mount_that_vanished_is_no_empty_folder() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().canonicalize().unwrap();
        let on =
            |is_mount| LocalDisk { anchors: vec![AnchorFolder { path: path.clone(), is_mount }] };
        assert!(on(false).list(&path).is_ok());
        let error = on(true).list(&path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        assert!(error.to_string().contains("is not mounted"), "{error}");
        assert!(!LocalDisk::new(vec![path.join("absent")]).anchors[0].is_mount);
        assert!(!LocalDisk::new(vec![path]).anchors[0].is_mount);
        assert!(LocalDisk::new(vec!["/proc".into()]).anchors[0].is_mount);
    }

    #[test]
    fn renaming_by_steps_overwrites_nothing() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let folder = LocalDisk::new(vec![root.clone()]).folder(&root).unwrap();
        let rename =
            |from: &str, to: &str| rename_by_steps(&folder, from.as_ref(), &folder, to.as_ref());
        for (name, holds) in [("a", "first"), ("b", "second")] {
            std::fs::write(root.join(name), holds).unwrap();
        }
        assert_eq!(rename("a", "b"), Err(Errno::EXIST));
        rename("a", "c").unwrap();
        // Folders, which have no hard links, are renamed after a check, as on a disk without links.
        std::fs::create_dir(root.join("d")).unwrap();
        assert_eq!(rename("d", "b"), Err(Errno::EXIST));
        rename("d", "e").unwrap();
        let mut names: Vec<_> =
            std::fs::read_dir(&root).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["b", "c", "e"]);
        assert_eq!(std::fs::read(root.join("c")).unwrap(), b"first");
    }
}
