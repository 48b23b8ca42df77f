//! Photos in the inbox: whether each has stopped changing and is complete.
//!
//! Files are polled; events (see [`super::hints`]) only make the next scan come sooner. A photo is
//! ready when it has been quiet (size, time of change and inode unchanged for a while) *and* its
//! content is complete. A quiet, incomplete one waits and is reported.

use std::collections::{BTreeMap, HashMap};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::companions::{KINDS, is_companion_at, is_hidden, is_junk};
use super::folders::Folders;
use super::hints::Hints;
use super::report_file::Failed;
use super::waiting::Waiting;
use crate::disk::{FileError, FileKind, Files, Metadata};
use crate::rig::Moment;

/// Depth of subfolders scanned. Guess: photos are not nested deeper.
const DEPTH_MAX: usize = 8;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Patience {
    /// Time without a change after which a file is opened.
    pub(crate) quiet_s: f64,
    /// Time without a change after which an incomplete file is reported.
    pub(crate) mention_s: f64,
    /// Time without a change after which an incomplete file is rejected as broken.
    pub(crate) unfinished_s: f64,
    /// Current time, seconds since 1970, if files' own times of change are trusted: when the inbox
    /// is emptied once, there is no time to watch them.
    pub(crate) trusted_unix_s: Option<u64>,
}

#[derive(Debug)]
struct SeenFile {
    metadata: Metadata,
    since: Moment,
    is_companion: bool,
    /// What the file with this `metadata` lacks, if anything; `None` before it was examined.
    missing: Option<Option<String>>,
}

impl SeenFile {
    /// Seconds since the last change and what the file lacks, while that is a reason to wait.
    fn unfinished(&self, now: Moment, patience: Patience) -> Option<(f64, &str)> {
        let missing = self.missing.as_ref()?.as_deref()?;
        let unchanged_s = match patience.trusted_unix_s {
            // A time in the future is from a calendar that jumped, and proves nothing.
            Some(now_unix_s) => (now_unix_s as f64 - self.metadata.touched_unix_s as f64).max(0.0),
            None => now.0 - self.since.0,
        };
        (unchanged_s < patience.unfinished_s).then_some((unchanged_s, missing))
    }
}

#[derive(Debug)]
struct Retry {
    metadata: Option<Metadata>,
    at: Moment,
}

/// The inbox over time. Paths are relative to it.
#[derive(Debug, Default)]
pub(crate) struct Inbox {
    seen: HashMap<PathBuf, SeenFile>,
    /// When the next known file will have been quiet for long enough.
    pub(crate) due: Option<Moment>,
    /// Photos put back: not to be tried before their time unless they change.
    retries: HashMap<PathBuf, Retry>,
    /// Photos that stay for now, with the reason.
    deferred: BTreeMap<PathBuf, Failed>,
    hints: Hints,
    /// Numbers of waiting photos by what they wait for.
    pub(crate) waiting: Waiting,
    /// Number of companions of photos, which stay in the inbox.
    companions: usize,
}

#[derive(Debug)]
pub(crate) struct Ready {
    /// Paths of photos that may be taken, oldest first.
    pub(crate) photos: Vec<PathBuf>,
    /// Number of complete photos, those to be retried later included.
    pub(crate) waiting: usize,
}

impl Inbox {
    pub(crate) fn new(hints: Hints) -> Inbox {
        Inbox { hints, ..Inbox::default() }
    }

    /// Scans the inbox. Photos count as ready once they are quiet; [`Inbox::may_be_taken`] checks
    /// for completeness when their turn comes, since that means reading them.
    pub(crate) fn scan(
        &mut self,
        folders: &Folders,
        now: Moment,
        patience: Patience,
    ) -> Result<Ready, FileError> {
        let (files, inbox) = (&folders.files, &folders.inbox);
        self.hints.watch(inbox, Path::new(""));
        let mut scan = InboxScan::default();
        collect(files, inbox, Path::new(""), 0, &mut scan)?;
        let InboxScan { found, mut deferred, folders, mut companions } = scan;
        folders.iter().for_each(|path| self.hints.watch(inbox, path));
        self.note_seen(found, now, patience, |path, kind| {
            is_companion_at(files, &inbox.join(path), kind)
        });
        companions += self.seen.values().filter(|seen| seen.is_companion).count();
        if companions > self.companions {
            log::info!("{companions} files beside photos stay in the inbox: {KINDS}");
        }
        self.companions = companions;
        let unreachable = deferred.len();
        let ready = self.sort_out(now, patience, &mut deferred);
        let metadata = |path: &Path| files.metadata(&inbox.join(path)).ok();
        self.retries.retain(|path, _| metadata(path).is_some());
        self.deferred
            .retain(|path, _| self.retries.contains_key(path) || deferred.contains_key(path));
        for (path, reason) in deferred {
            self.defer(path, reason);
        }
        let (all, retries) = (ready.len(), &self.retries);
        let may_go = |path: &PathBuf| match retries.get(path) {
            Some(retry) => retry.metadata != metadata(path) || now >= retry.at,
            None => true,
        };
        let photos: Vec<PathBuf> = ready.into_iter().filter(may_go).collect();
        self.waiting.turn = photos.len();
        self.waiting.retry = all - photos.len() + unreachable;
        Ok(Ready { photos, waiting: all })
    }

    fn note_seen(
        &mut self,
        found: Vec<(PathBuf, Metadata)>,
        now: Moment,
        patience: Patience,
        is_companion: impl Fn(&Path, FileKind) -> bool,
    ) {
        let mut before = std::mem::take(&mut self.seen);
        self.hints.poll();
        let moved = self.hints.take_moved();
        for (path, metadata) in found {
            let mut seen = match before.remove(&path) {
                Some(seen) if seen.metadata == metadata => seen,
                _ => {
                    let is_companion = is_companion(&path, metadata.kind);
                    SeenFile { metadata, since: now, is_companion, missing: None }
                }
            };
            // A file moved in, alone or with its folder, was written elsewhere and need not settle.
            if path.ancestors().any(|moved_there| moved.contains(moved_there)) {
                seen.since = Moment(seen.since.0.min(now.0 - patience.quiet_s));
            }
            self.seen.insert(path, seen);
        }
    }

    /// Returns the quiet photos, in the order in which they are taken, and counts the others.
    fn sort_out(
        &mut self,
        now: Moment,
        patience: Patience,
        deferred: &mut BTreeMap<PathBuf, String>,
    ) -> Vec<PathBuf> {
        let mut ready = Vec::new();
        (self.waiting, self.due) = (Waiting::default(), None);
        for (path, seen) in self.seen.iter().filter(|(_, seen)| !seen.is_companion) {
            if now.0 - seen.since.0 < patience.quiet_s {
                self.waiting.settling += 1;
                let due = Moment(seen.since.0 + patience.quiet_s);
                self.due = Some(self.due.filter(|&before| before <= due).unwrap_or(due));
            } else if let Some((unchanged_s, missing)) = seen.unfinished(now, patience) {
                self.waiting.unfinished += 1;
                if unchanged_s >= patience.mention_s {
                    deferred.insert(path.clone(), format!("{missing} (waiting for the rest)"));
                }
            } else {
                ready.push((path, seen));
            }
        }
        // Photos deferred before come last.
        let order = |&(path, seen): &(&PathBuf, &SeenFile)| {
            (self.deferred.contains_key(path), seen.metadata.changed, path.clone())
        };
        ready.sort_by_cached_key(order);
        ready.into_iter().map(|(path, _)| path.clone()).collect()
    }

    /// Whether the photo at `path`, ready at the last scan, is complete or has been waited for long
    /// enough. `find_missing` examines it and returns what it lacks; it is called once while the
    /// file does not change.
    pub(crate) fn may_be_taken<E>(
        &mut self,
        path: &Path,
        now: Moment,
        patience: Patience,
        find_missing: impl FnOnce() -> Result<Option<String>, E>,
    ) -> Result<bool, E> {
        let Some(seen) = self.seen.get_mut(path) else { return Ok(false) };
        // Links, pipes and devices are rejected by the job.
        if seen.metadata.kind == FileKind::File && seen.missing.is_none() {
            seen.missing = Some(find_missing()?);
        }
        Ok(seen.unfinished(now, patience).is_none())
    }

    /// Defers the photo at `path`, for `reason`, until `retry_at` or until it changes.
    pub(crate) fn put_back(
        &mut self,
        folders: &Folders,
        path: PathBuf,
        reason: String,
        retry_at: Moment,
    ) {
        let metadata = folders.files.metadata(&folders.inbox.join(&path)).ok();
        self.retries.insert(path.clone(), Retry { metadata, at: retry_at });
        self.waiting.retry += 1;
        self.defer(path, reason);
    }

    /// Notes why the photo at `path` stays, and logs each new reason once.
    fn defer(&mut self, path: PathBuf, reason: String) {
        if self.deferred.get(&path).is_none_or(|before| before.reason != reason) {
            log::warn!("kept in the inbox: {reason}");
        }
        let photo = path.to_string_lossy().into_owned();
        self.deferred.insert(path, Failed { photo, reason });
    }

    /// Counts one photo fewer that waits for its turn.
    pub(crate) fn count_turn(&mut self) {
        self.waiting.turn = self.waiting.turn.saturating_sub(1);
    }

    /// Forgets the photo at `path`, which has left the inbox.
    pub(crate) fn forget(&mut self, path: &Path) {
        self.deferred.remove(path);
        self.retries.remove(path);
    }

    /// Makes all photos that were put back ready at once.
    pub(crate) fn retry_now(&mut self) {
        self.retries.clear();
    }

    /// Photos that stay for now, with the reasons.
    pub(crate) fn deferred(&self) -> Vec<Failed> {
        self.deferred.values().cloned().collect()
    }

    pub(crate) fn is_deferred(&self, path: &Path) -> bool {
        self.deferred.contains_key(path)
    }

    /// Whether there were events in the inbox since the last call.
    pub(crate) fn has_events(&self) -> bool {
        self.hints.poll()
    }
}

#[derive(Default)]
struct InboxScan {
    found: Vec<(PathBuf, Metadata)>,
    /// Paths that cannot be examined, with the reason.
    deferred: BTreeMap<PathBuf, String>,
    folders: Vec<PathBuf>,
    companions: usize,
}

/// Adds the files in `inbox/path` and its subfolders to `scan`.
fn collect(
    files: &Files,
    inbox: &Path,
    path: &Path,
    depth: usize,
    scan: &mut InboxScan,
) -> Result<(), FileError> {
    let folder = if depth == 0 { inbox.to_owned() } else { inbox.join(path) };
    let listed = match files.list(&folder) {
        Err(error) if depth > 0 && !error.is_of_disk() => {
            // Otherwise the folder was removed, or replaced by a link, since it was listed.
            if error.kind() == ErrorKind::PermissionDenied {
                scan.deferred.insert(path.to_owned(), error.message_for_owner());
            }
            return Ok(());
        }
        listed => listed?,
    };
    for (name, kind) in listed {
        if is_junk(&name, kind) {
            scan.companions += usize::from(!is_hidden(&name));
            continue;
        }
        let path = path.join(&name);
        if kind == FileKind::Folder {
            if depth < DEPTH_MAX {
                collect(files, inbox, &path, depth + 1, scan)?;
                scan.folders.push(path);
            }
            continue;
        }
        match files.metadata(&inbox.join(&path)) {
            Ok(metadata) if metadata.kind != FileKind::Folder => scan.found.push((path, metadata)),
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) if error.is_of_disk() => return Err(error),
            Err(error) => {
                scan.deferred.insert(path, error.message_for_owner());
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_of_companions_is_set_aside_and_the_photos_among_them_are_taken() {
        let root = tempfile::tempdir().unwrap();
        let folders = Folders::open(root.path()).unwrap();
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folders.inbox.join(name), bytes).unwrap();
        };
        for (name, bytes) in [
            ("IMG_1.AAE", &b"<?xml"[..]),
            ("IMG_1.MOV", b"\0\0\0\x14ftypqt  "),
            ("PXL_1.MP", b"\0\0\0\x18ftypmp42"),
            ("a.jpg.json", b"{}"),
            ("a.jpg.pp3", b"[Version]"),
            ("a.NEF.dop", b"Sidecar = {"),
            ("digikam4.db", b"SQLite format 3\0"),
            ("100_0001_Timestamp.MRK", b"1"),
            ("catalogue", b"SQLite format 3\0"),
            ("a.jpg.aria2", b"\0\x01"),
        ] {
            write(name, bytes);
        }
        let photo = b"\xff\xd8\xff\xe0 a photo";
        write("a.jpg", photo);
        write("a.log", photo);
        write("letter", b"Dear Sir");
        let mut inbox = Inbox::new(Hints::default());
        let patience =
            Patience { quiet_s: 0.0, mention_s: 0.0, unfinished_s: 0.0, trusted_unix_s: None };
        let mut scan = || {
            let ready = inbox.scan(&folders, Moment(0.0), patience).unwrap().photos;
            let names = ready.iter().map(|path| path.to_string_lossy().into_owned());
            (names.collect::<std::collections::BTreeSet<_>>(), inbox.companions)
        };
        let photos = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(scan(), (photos(&["a.jpg", "a.log", "letter"]), 10));
        // A changed file is examined again.
        write("a.jpg.json", photo);
        assert_eq!(scan(), (photos(&["a.jpg", "a.jpg.json", "a.log", "letter"]), 9));
    }

    #[test]
    fn a_file_is_ready_once_it_is_quiet_and_complete() {
        let root = tempfile::tempdir().unwrap();
        let folders = Folders::open(root.path()).unwrap();
        let file = folders.inbox.join("a.jpg");
        std::fs::write(&file, b"one").unwrap();
        let mut inbox = Inbox::new(Hints::default());
        let patience =
            Patience { quiet_s: 5.0, mention_s: 60.0, unfinished_s: 900.0, trusted_unix_s: None };
        let examined = std::cell::Cell::new(0);
        let mut at = |s: f64| {
            let now = Moment(s);
            let mut ready = inbox.scan(&folders, now, patience).unwrap().photos;
            ready.retain(|path| {
                let taken = inbox.may_be_taken(path, now, patience, || {
                    examined.set(examined.get() + 1);
                    let bytes = std::fs::read(folders.inbox.join(path))?;
                    Ok::<_, std::io::Error>(
                        (!bytes.ends_with(b"two")).then(|| "its end".to_owned()),
                    )
                });
                taken.unwrap()
            });
            (ready.len(), inbox.deferred().len())
        };
        assert_eq!((at(0.0), at(4.9), at(6.0), at(59.0)), ((0, 0), (0, 0), (0, 0), (0, 0)));
        assert_eq!((at(60.0), at(899.0), at(900.0)), ((0, 1), (0, 1), (1, 0)));
        assert_eq!(examined.get(), 1, "examined once while it does not change");
        std::fs::write(&file, b"one and two").unwrap();
        assert_eq!((at(901.0), at(905.9), at(906.1)), ((0, 0), (0, 0), (1, 0)));
    }
}
