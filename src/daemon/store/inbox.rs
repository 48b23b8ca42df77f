//! What is waiting in the inbox, whether it has come to rest, and whether it is all there.
//!
//! The truth is a look at every file, again and again: events (see [`super::hints`]) only
//! make the next look come sooner. A photo is ready when it was quiet (size, time of change and
//! inode the same for a while) *and* its content is whole. One that is quiet and not whole waits
//! where it is, and is spoken about.

use std::collections::{BTreeMap, HashMap};
use std::ffi::OsStr;
use std::io::ErrorKind;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use super::folders::Folders;
use super::hints::Hints;
use super::report_file::Failed;
use super::waiting::{Awaited, Waiting};
use crate::disk::{FileError, FileKind, Files, Look};
use crate::rig::Moment;

/// Folders within folders are looked into this deep. Guess: deeper ones are no way to hand in
/// photos.
const DEPTH_MAX: usize = 8;

/// When a file counts as what it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patience {
    /// A file is looked into when it has not changed for this long.
    pub(crate) quiet_s: f64,
    /// One that is not whole is spoken about after this long without a change …
    pub(crate) mention_s: f64,
    /// … and taken for what it is after this long: a broken file, to be set aside.
    pub(crate) unfinished_s: f64,
    /// Seconds since 1970 by which a file's own record of its last change is believed, if there is
    /// no time to watch it: the daemon is to empty the inbox once.
    pub(crate) by_its_record: Option<u64>,
}

#[derive(Debug)]
struct SeenFile {
    look: Look,
    since: Moment,
    /// What is missing from the content that looks like `look`; `None` before anyone looked into
    /// it.
    missing: Option<Option<String>>,
}

impl SeenFile {
    /// What is missing from the file, if that is a reason to wait, and for how long it has not
    /// changed.
    fn unfinished(&self, now: Moment, patience: Patience) -> Option<(f64, &str)> {
        let missing = self.missing.as_ref()?.as_deref()?;
        let unchanged_s = match patience.by_its_record {
            // A record from the future is of a calendar that jumped, and proves nothing.
            Some(now_unix_s) => (now_unix_s as f64 - self.look.touched_unix_s as f64).max(0.0),
            None => now.0 - self.since.0,
        };
        (unchanged_s < patience.unfinished_s).then_some((unchanged_s, missing))
    }
}

/// Photos that stay for now, after one was put back.
#[derive(Debug)]
struct Resting {
    look: Option<Look>,
    until: Moment,
}

/// Looks at the inbox over time.
#[derive(Debug)]
pub(crate) struct Inbox {
    seen: HashMap<PathBuf, SeenFile>,
    /// When the next file will have been quiet for long enough.
    due: Option<Moment>,
    /// Photos put back: not to be tried before their time unless they change.
    resting: HashMap<PathBuf, Resting>,
    /// Photos that stay for now, by the way to them, and why.
    left: BTreeMap<PathBuf, Failed>,
    hints: Hints,
    waiting: Waiting,
}

/// What may be taken at one look.
#[derive(Debug)]
pub(crate) struct Ready {
    /// Ways from the inbox to the photos, oldest first.
    pub(crate) photos: Vec<PathBuf>,
    /// How many wait in all, those included that rest for now.
    pub(crate) waiting: usize,
}

impl Inbox {
    /// An inbox never looked at, whose events are told by `hints`.
    pub(crate) fn new(hints: Hints) -> Inbox {
        Inbox {
            seen: HashMap::new(),
            due: None,
            resting: HashMap::new(),
            left: BTreeMap::new(),
            hints,
            waiting: Waiting::default(),
        }
    }

    /// What may be taken now. Photos are said to be ready as soon as they are quiet: whether one is
    /// whole is asked of [`Inbox::may_be_taken`] when its turn comes, for it means reading it.
    pub(crate) fn look(
        &mut self,
        folders: &Folders,
        now: Moment,
        patience: Patience,
    ) -> Result<Ready, FileError> {
        let (files, folder) = (folders.files(), folders.inbox());
        self.hints.listen(folder, Path::new(""));
        let mut all = Collected::default();
        collect(files, folder, Path::new(""), 0, &mut all)?;
        let Collected { found, mut staying, folders } = all;
        folders.iter().for_each(|way| self.hints.listen(folder, way));
        let out_of_reach = staying.len();
        let mut before = std::mem::take(&mut self.seen);
        let mut ready = Vec::new();
        self.due = None;
        self.hints.heard();
        let moved = self.hints.moved();
        let mut waiting = Waiting::default();
        for (way, look) in found {
            let mut seen = match before.remove(&way) {
                Some(seen) if seen.look == look => seen,
                _ => SeenFile { look, since: now, missing: None },
            };
            // What came whole from elsewhere need not settle.
            if way.ancestors().any(|moved_there| moved.contains(moved_there)) {
                seen.since = Moment(seen.since.0.min(now.0 - patience.quiet_s));
            }
            if now.0 - seen.since.0 < patience.quiet_s {
                waiting.settling += 1;
                let due = Moment(seen.since.0 + patience.quiet_s);
                self.due = Some(self.due.filter(|&before| before <= due).unwrap_or(due));
            } else {
                match seen.unfinished(now, patience) {
                    // What could not be had before keeps nothing else waiting.
                    None => ready.push((self.left.contains_key(&way), look.changed, way.clone())),
                    Some((unchanged_s, missing)) if unchanged_s >= patience.mention_s => {
                        waiting.unfinished += 1;
                        let reason = format!("{missing} (waiting for the rest of it)");
                        staying.insert(way.clone(), reason);
                    }
                    Some(_) => waiting.unfinished += 1,
                }
            }
            self.seen.insert(way, seen);
        }
        ready.sort();
        let look = |way: &Path| files.look(&folder.join(way)).ok();
        self.resting.retain(|way, _| look(way).is_some());
        self.left.retain(|way, _| self.resting.contains_key(way) || staying.contains_key(way));
        for (way, reason) in staying {
            let photo = way.to_string_lossy().into_owned();
            self.leave(way, Failed { photo, reason });
        }
        let (all, resting) = (ready.len(), &self.resting);
        let rested = |way: &PathBuf| match resting.get(way) {
            Some(resting) => resting.look != look(way) || now >= resting.until,
            None => true,
        };
        let photos: Vec<PathBuf> = ready.into_iter().map(|(.., way)| way).filter(rested).collect();
        waiting.turn = photos.len();
        waiting.retry = all - photos.len() + out_of_reach;
        self.waiting = waiting;
        Ok(Ready { photos, waiting: all })
    }

    /// Whether the photo at `way`, which was ready at the last look, is whole, or has been waited
    /// for long enough. `missing` looks into it and says what it lacks; it is called once for as
    /// long as the file does not change.
    ///
    /// # Errors
    /// Those of `missing`, when nobody can look into it.
    pub(crate) fn may_be_taken<E>(
        &mut self,
        way: &Path,
        now: Moment,
        patience: Patience,
        missing: impl FnOnce() -> Result<Option<String>, E>,
    ) -> Result<bool, E> {
        let Some(seen) = self.seen.get_mut(way) else { return Ok(false) };
        // What is no file is no photo either, and is set aside by whoever takes it.
        if seen.look.kind == FileKind::File && seen.missing.is_none() {
            seen.missing = Some(missing()?);
        }
        Ok(seen.unfinished(now, patience).is_none())
    }

    /// The photo at `way` was put back, for the reason told in `left`: it is not to be tried before
    /// `until` unless it changes.
    pub(crate) fn put_back(
        &mut self,
        folders: &Folders,
        way: PathBuf,
        left: Failed,
        until: Moment,
    ) {
        let look = folders.files().look(&folders.inbox().join(&way)).ok();
        self.resting.insert(way.clone(), Resting { look, until });
        self.waiting.retry += 1;
        self.leave(way, left);
    }

    /// Says of the photo at `way` why it stays, once for as long as it does for one reason.
    fn leave(&mut self, way: PathBuf, left: Failed) {
        let reason = &left.reason;
        if self.left.get(&way).is_none_or(|told| told.reason != *reason) {
            log::warn!("left in the inbox: {reason}");
        }
        self.left.insert(way, left);
    }

    /// A photo that waited for its turn has it, or does not wait for one any more.
    pub(crate) fn has_turn(&mut self) {
        self.waiting.turn = self.waiting.turn.saturating_sub(1);
    }

    /// Those that could be taken wait for what is `awaited`.
    pub(crate) fn held_for(&mut self, awaited: Awaited) {
        self.waiting = self.waiting.held_for(awaited);
    }

    /// How many photos wait, and for what.
    pub(crate) fn waiting(&self) -> Waiting {
        self.waiting
    }

    /// The photo at `way` was taken.
    pub(crate) fn taken(&mut self, way: &Path) {
        self.left.remove(way);
        self.resting.remove(way);
    }

    /// Photos that were put back may be tried at once.
    pub(crate) fn end_rest(&mut self) {
        self.resting.clear();
    }

    /// Photos that stay for now, and why.
    pub(crate) fn left(&self) -> Vec<Failed> {
        self.left.values().cloned().collect()
    }

    /// Whether the photo at `way` could not be had before.
    pub(crate) fn is_left(&self, way: &Path) -> bool {
        self.left.contains_key(way)
    }

    /// When a file that is there will have been quiet for long enough, if nothing happens before.
    pub(crate) fn due(&self) -> Option<Moment> {
        self.due
    }

    /// Whether anything happened in the inbox since this was last asked.
    pub(crate) fn heard(&self) -> bool {
        self.hints.heard()
    }
}

/// What is in the inbox, by the way there.
#[derive(Default)]
struct Collected {
    found: Vec<(PathBuf, Look)>,
    /// What cannot be looked into, and why.
    staying: BTreeMap<PathBuf, String>,
    folders: Vec<PathBuf>,
}

/// Adds the files in `folder/way` and in the folders below it to `all`. A folder moved in brings
/// one event and none for its files, so its files are looked for and not waited for.
fn collect(
    files: &Files,
    folder: &Path,
    way: &Path,
    depth: usize,
    all: &mut Collected,
) -> Result<(), FileError> {
    let at = if depth == 0 { folder.to_owned() } else { folder.join(way) };
    let listed = match files.list(&at) {
        Err(error) if depth > 0 => {
            // Else gone again, or changed into a link, since it was seen.
            if error.kind() == ErrorKind::PermissionDenied {
                all.staying.insert(way.to_owned(), error.of_photo());
            }
            return Ok(());
        }
        listed => listed?,
    };
    for (name, kind) in listed {
        if is_junk(&name) {
            continue;
        }
        let way = way.join(&name);
        if kind == FileKind::Folder {
            if depth < DEPTH_MAX {
                collect(files, folder, &way, depth + 1, all)?;
                all.folders.push(way);
            }
            continue;
        }
        match files.look(&folder.join(&way)) {
            Ok(look) if look.kind != FileKind::Folder => all.found.push((way, look)),
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => {
                all.staying.insert(way, error.of_photo());
            }
        }
    }
    Ok(())
}

/// Names that begin with a dot.
pub(crate) fn is_hidden(name: &OsStr) -> bool {
    name.as_bytes().starts_with(b".")
}

/// Names that systems, shares and uploaders leave behind, and those of uploads under way.
pub(crate) fn is_junk(name: &OsStr) -> bool {
    const NAMES: [&str; 10] = [
        "thumbs.db",
        "ehthumbs.db",
        "desktop.ini",
        "@eadir",
        "@recycle",
        "#recycle",
        "__macosx",
        "$recycle.bin",
        "system volume information",
        "lost+found",
    ];
    const ENDINGS: [&str; 11] = [
        ".part",
        ".partial",
        ".tmp",
        ".temp",
        ".crdownload",
        ".download",
        ".filepart",
        ".tacitpart",
        ".opdownload",
        ".swp",
        "~",
    ];
    let lower = name.to_string_lossy().to_lowercase();
    is_hidden(name)
        || lower.starts_with("~$")
        || NAMES.contains(&lower.as_str())
        || ENDINGS.iter().any(|ending| lower.ends_with(ending))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn junk_and_half_uploads_are_not_photos() {
        for junk in
            [".DS_Store", "._a.jpg", "Thumbs.db", "a.jpg.part", "a.jpg~", ".a.jpg.Xy12", "~$a.docx"]
        {
            assert!(is_junk(OsStr::new(junk)), "{junk}");
        }
        assert!(!is_junk(OsStr::new("partial eclipse.jpg")));
    }

    #[test]
    fn a_file_is_ready_once_it_has_been_quiet_and_whole() {
        let root = tempfile::tempdir().unwrap();
        let folders = Folders::open(root.path()).unwrap();
        let file = folders.inbox().join("a.jpg");
        std::fs::write(&file, b"one").unwrap();
        let mut inbox = Inbox::new(Hints::none());
        let patience =
            Patience { quiet_s: 5.0, mention_s: 60.0, unfinished_s: 900.0, by_its_record: None };
        let looks = std::cell::Cell::new(0);
        let mut at = |s: f64| {
            let now = Moment(s);
            let mut ready = inbox.look(&folders, now, patience).unwrap().photos;
            ready.retain(|way| {
                let taken = inbox.may_be_taken(way, now, patience, || {
                    looks.set(looks.get() + 1);
                    let bytes = std::fs::read(folders.inbox().join(way))?;
                    Ok::<_, std::io::Error>(
                        (!bytes.ends_with(b"two")).then(|| "its end".to_owned()),
                    )
                });
                taken.unwrap()
            });
            (ready.len(), inbox.left().len())
        };
        assert_eq!((at(0.0), at(4.9), at(6.0), at(59.0)), ((0, 0), (0, 0), (0, 0), (0, 0)));
        assert_eq!((at(60.0), at(899.0), at(900.0)), ((0, 1), (0, 1), (1, 0)));
        assert_eq!(looks.get(), 1, "looked into once for as long as it stays as it is");
        std::fs::write(&file, b"one and two").unwrap();
        assert_eq!((at(901.0), at(905.9), at(906.1)), ((0, 0), (0, 0), (1, 0)));
    }
}
