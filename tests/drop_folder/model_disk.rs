//! A model disk with minimal guarantees: synchronised data survive a power cut, and any part of
//! everything else may be lost.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

use relens::disk::{Disk, FileKind, Metadata, Unsynced};

/// An operation on the disk.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Op {
    /// Reads names or content.
    Read(PathBuf),
    Write(PathBuf),
    Sync(PathBuf),
    Rename(PathBuf, PathBuf),
    Remove(PathBuf),
    SyncFolder(PathBuf),
}

/// A change of names not yet durable.
#[derive(Debug, Clone)]
enum Change {
    Made(PathBuf, u64),
    Renamed(PathBuf, PathBuf),
    Removed(PathBuf),
}

impl Change {
    fn names(&self) -> Vec<&PathBuf> {
        match self {
            Change::Made(path, _) | Change::Removed(path) => vec![path],
            Change::Renamed(from, to) => vec![from, to],
        }
    }
}

#[derive(Debug, Clone)]
struct Inode {
    holds: Arc<[u8]>,
    durable: bool,
}

/// State of the disk.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    folders: BTreeSet<PathBuf>,
    inodes: BTreeMap<u64, Inode>,
    names: BTreeMap<PathBuf, u64>,
    kept: BTreeMap<PathBuf, u64>,
    pending: Vec<Change>,
    next: u64,
}

/// Files and their durable contents: the disk after a power cut.
pub type Survivors = BTreeMap<PathBuf, (u64, Arc<[u8]>)>;

/// Effect of a power cut on content that was not durable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unsafe {
    Kept,
    Empty,
    Zeros,
    Half,
    Garbled,
}

impl Unsafe {
    pub const ALL: [Unsafe; 5] =
        [Unsafe::Kept, Unsafe::Empty, Unsafe::Zeros, Unsafe::Half, Unsafe::Garbled];

    fn of(self, holds: &Arc<[u8]>) -> Arc<[u8]> {
        match self {
            Unsafe::Kept => Arc::clone(holds),
            Unsafe::Empty => Arc::from([]),
            Unsafe::Zeros => vec![0; holds.len()].into(),
            Unsafe::Half => holds[..holds.len() / 2].into(),
            Unsafe::Garbled => holds.iter().map(|b| b ^ 0x5a).collect(),
        }
    }
}

impl Contents {
    /// Makes changes durable if `concern` holds for one of their names, and earlier ones of these
    /// names.
    fn make_durable(&mut self, concern: &dyn Fn(&Path) -> bool) {
        let Contents { pending, kept, .. } = self;
        let mut names: BTreeSet<PathBuf> = BTreeSet::new();
        let mut durable = vec![false; pending.len()];
        for (n, change) in pending.iter().enumerate().rev() {
            let touched = change.names();
            if touched.iter().any(|path| concern(path) || names.contains(*path)) {
                names.extend(touched.into_iter().cloned());
                durable[n] = true;
            }
        }
        let mut durable = durable.into_iter();
        pending.retain(|change| {
            let durable = durable.next() == Some(true);
            if durable {
                apply(change, kept);
            }
            !durable
        });
    }

    /// A disk with `survivors` in `folders`.
    pub fn after(survivors: &Survivors, folders: &BTreeSet<PathBuf>) -> Contents {
        let mut contents = Contents { folders: folders.clone(), ..Contents::default() };
        for (path, (inode, holds)) in survivors {
            contents.names.insert(path.clone(), *inode);
            contents.inodes.insert(*inode, Inode { holds: Arc::clone(holds), durable: true });
        }
        contents.kept = contents.names.clone();
        contents.next = contents.inodes.keys().copied().max().unwrap_or(0);
        contents
    }

    /// Current files, durable or not.
    pub fn now(&self) -> Survivors {
        let holds = |inode: &u64| (*inode, Arc::clone(&self.inodes[inode].holds));
        self.names.iter().map(|(path, inode)| (path.clone(), holds(inode))).collect()
    }

    pub fn folders(&self) -> &BTreeSet<PathBuf> {
        &self.folders
    }

    /// Makes the content of `path` not durable, as if a copy had not been synchronised.
    pub fn forget_sync(&mut self, path: &Path) {
        if let Some(inode) = self.names.get(path).and_then(|inode| self.inodes.get_mut(inode)) {
            inode.durable = false;
        }
    }

    /// All states possible after a power cut: every subset of the pending changes of names (only
    /// significant subsets of more than six changes), with each kind of damage to content that is
    /// not durable. Files that are `exempt` are not damaged.
    pub fn cuts(&self, exempt: &dyn Fn(&Path) -> bool) -> Vec<Survivors> {
        // Files rewritten at each start would only multiply the choices.
        let ignored = |path: &&PathBuf| {
            path.file_name()
                .is_some_and(|name| name == ".relens-state.json" || name == "removed.json")
        };
        let ignored: BTreeSet<&PathBuf> = (self.pending.iter())
            .filter(|change| change.names().iter().any(ignored))
            .flat_map(Change::names)
            .collect();
        let pending: Vec<&Change> = self
            .pending
            .iter()
            .filter(|change| !change.names().iter().any(|path| ignored.contains(path)))
            .collect();
        let n = pending.len();
        let every = (1u64 << n.min(6)) - 1;
        let mut choices: BTreeSet<u64> =
            if n <= 6 { (0..=every).collect() } else { BTreeSet::new() };
        let all = if n >= 64 { u64::MAX } else { (1 << n) - 1 };
        for i in 0..n.min(63) {
            choices.extend([all, 0, 1 << i, all & !(1 << i), (1 << i) - 1, all & !((1 << i) - 1)]);
        }
        let mut cuts = Vec::new();
        for choice in choices {
            let mut names = self.kept.clone();
            // Changes beyond 64 follow the last bit.
            let kept = |i: usize| choice >> i.min(63) & 1 == 1;
            for (_, change) in pending.iter().enumerate().filter(|&(i, _)| kept(i)) {
                apply(change, &mut names);
            }
            let damaged =
                |path: &PathBuf, inode: &u64| !self.inodes[inode].durable && !exempt(path);
            let any = names.iter().any(|(path, inode)| damaged(path, inode));
            for damage in Unsafe::ALL.into_iter().take(if any { 5 } else { 1 }) {
                let survive = |(path, inode): (&PathBuf, &u64)| {
                    let holds = &self.inodes[inode].holds;
                    let holds =
                        if damaged(path, inode) { damage.of(holds) } else { Arc::clone(holds) };
                    (path.clone(), (*inode, holds))
                };
                cuts.push(names.iter().map(survive).collect());
            }
        }
        cuts
    }
}

fn apply(change: &Change, names: &mut BTreeMap<PathBuf, u64>) {
    match change {
        Change::Made(path, inode) => {
            names.insert(path.clone(), *inode);
        }
        // A file whose creation did not survive cannot be renamed or removed.
        Change::Renamed(from, to) => {
            if let Some(inode) = names.remove(from) {
                names.insert(to.clone(), inode);
            }
        }
        Change::Removed(path) => {
            names.remove(path);
        }
    }
}

/// Called before each operation with the state of the disk; may refuse or skip it.
pub type Guard = Box<dyn FnMut(&Op, &Contents) -> io::Result<Verdict> + Send>;

/// Decision on an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Done,
    /// Reported as done, but not done.
    Skipped,
}

struct Inside {
    contents: Contents,
    guard: Guard,
}

/// The disk. A clone is the same disk.
#[derive(Clone)]
pub struct ModelDisk(Arc<Mutex<Inside>>);

impl ModelDisk {
    pub fn new(contents: Contents, guard: Guard) -> ModelDisk {
        ModelDisk(Arc::new(Mutex::new(Inside { contents, guard })))
    }

    pub fn contents(&self) -> Contents {
        self.inside().contents.clone()
    }

    /// Adds a durable file.
    pub fn drop_in(&self, path: &Path, bytes: &[u8], inode: u64) {
        let contents = &mut self.inside().contents;
        contents.make_durable(&|changed| changed == path);
        contents.inodes.insert(inode, Inode { holds: bytes.into(), durable: true });
        contents.names.insert(path.to_owned(), inode);
        contents.kept.insert(path.to_owned(), inode);
    }

    /// Removes a file durably.
    pub fn take_away(&self, path: &Path) {
        let contents = &mut self.inside().contents;
        contents.make_durable(&|changed| changed == path);
        contents.names.remove(path);
        contents.kept.remove(path);
    }

    /// Replaces the guard.
    pub fn guarded_by(&self, guard: Guard) {
        self.inside().guard = guard;
    }

    fn inside(&self) -> MutexGuard<'_, Inside> {
        // The lock is poisoned if a test stopped the daemon during an operation.
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn ask(&self, op: &Op) -> io::Result<(MutexGuard<'_, Inside>, bool)> {
        let mut inside = self.inside();
        let Inside { contents, guard } = &mut *inside;
        let verdict = guard(op, contents)?;
        Ok((inside, verdict == Verdict::Done))
    }
}

/// Whether `folder` is the parent of `path`.
fn holds(folder: &Path, path: &Path) -> bool {
    path.parent() == Some(folder)
}

fn not_found() -> io::Error {
    ErrorKind::NotFound.into()
}

struct Handle(ModelDisk, PathBuf, u64);

impl Unsynced for Handle {
    fn sync(self: Box<Self>) -> io::Result<()> {
        let (mut inside, done) = self.0.ask(&Op::Sync(self.1.clone()))?;
        if let Some(inode) = inside.contents.inodes.get_mut(&self.2).filter(|_| done) {
            inode.durable = true;
        }
        Ok(())
    }
}

impl Disk for ModelDisk {
    fn list(&self, folder: &Path) -> io::Result<Vec<(OsString, FileKind)>> {
        let (inside, _) = self.ask(&Op::Read(folder.to_owned()))?;
        let Contents { folders, names, .. } = &inside.contents;
        if !folders.contains(folder) {
            return Err(not_found());
        }
        let name = |path: &PathBuf| path.file_name().map(OsString::from).unwrap_or_default();
        let files = names
            .keys()
            .filter(|path| holds(folder, path))
            .map(|path| (name(path), FileKind::File));
        let inner = folders
            .iter()
            .filter(|path| holds(folder, path))
            .map(|path| (name(path), FileKind::Folder));
        Ok(files.chain(inner).collect())
    }

    fn metadata(&self, path: &Path) -> io::Result<Metadata> {
        let (inside, _) = self.ask(&Op::Read(path.to_owned()))?;
        let inode = *inside.contents.names.get(path).ok_or_else(not_found)?;
        let size = inside.contents.inodes[&inode].holds.len() as u64;
        let (changed, touched_unix_s) = ((inode as i64, 0), inode as i64);
        Ok(Metadata { kind: FileKind::File, size, changed, touched_unix_s, inode })
    }

    fn open(&self, path: &Path) -> io::Result<File> {
        let (inside, _) = self.ask(&Op::Read(path.to_owned()))?;
        let inode = inside.contents.names.get(path).ok_or_else(not_found)?;
        let memory = rustix::fs::memfd_create("model", rustix::fs::MemfdFlags::CLOEXEC)?;
        let mut file = File::from(memory);
        file.write_all(&inside.contents.inodes[inode].holds)?;
        file.rewind()?;
        Ok(file)
    }

    fn free_bytes(&self, _: &Path) -> io::Result<u64> {
        Ok(u64::MAX)
    }

    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        // Folders are durable at once.
        self.inside().contents.folders.insert(folder.to_owned());
        Ok(())
    }

    fn write(&self, path: &Path, content: &mut dyn Read) -> io::Result<Box<dyn Unsynced>> {
        let mut bytes = Vec::new();
        content.read_to_end(&mut bytes)?;
        let asked = self.ask(&Op::Write(path.to_owned()));
        let (mut inside, _) = asked.inspect_err(|_| {
            // A full disk leaves the name and part of the content.
            let mut inside = self.inside();
            make(&mut inside.contents, path, bytes[..bytes.len() / 3].into());
        })?;
        let inode = make(&mut inside.contents, path, bytes.into());
        Ok(Box::new(Handle(self.clone(), path.to_owned(), inode)))
    }

    fn sync_file(&self, path: &Path) -> io::Result<()> {
        let (mut inside, done) = self.ask(&Op::Sync(path.to_owned()))?;
        let inode = *inside.contents.names.get(path).ok_or_else(not_found)?;
        if let Some(inode) = inside.contents.inodes.get_mut(&inode).filter(|_| done) {
            inode.durable = true;
        }
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let (mut inside, done) = self.ask(&Op::Rename(from.to_owned(), to.to_owned()))?;
        if !inside.contents.names.contains_key(from) {
            return Err(not_found());
        }
        if done {
            let change = Change::Renamed(from.to_owned(), to.to_owned());
            apply(&change, &mut inside.contents.names);
            inside.contents.pending.push(change);
        }
        Ok(())
    }

    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        if self.inside().contents.names.contains_key(to) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        self.rename(from, to)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        if !self.inside().contents.names.contains_key(path) {
            return Err(not_found());
        }
        let (mut inside, done) = self.ask(&Op::Remove(path.to_owned()))?;
        if done {
            let change = Change::Removed(path.to_owned());
            apply(&change, &mut inside.contents.names);
            inside.contents.pending.push(change);
        }
        Ok(())
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        let (mut inside, done) = self.ask(&Op::SyncFolder(folder.to_owned()))?;
        if done {
            inside.contents.make_durable(&|path| holds(folder, path));
        }
        Ok(())
    }
}

fn make(contents: &mut Contents, path: &Path, holds: Arc<[u8]>) -> u64 {
    if let Some(&inode) = contents.names.get(path) {
        // Truncated and rewritten.
        contents.inodes.insert(inode, Inode { holds, durable: false });
        return inode;
    }
    contents.next = contents.next.max(1000) + 1;
    let inode = contents.next;
    contents.inodes.insert(inode, Inode { holds, durable: false });
    let change = Change::Made(path.to_owned(), inode);
    apply(&change, &mut contents.names);
    contents.pending.push(change);
    inode
}
