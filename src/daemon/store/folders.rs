//! The five folders under one root, and where each thing lies in them.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::FolderError;
use crate::disk::{FileError, FileKind, Files};

/// The folders of a root, in the order of [`Folders`]' fields.
pub(super) const NAMES: [&str; 5] = ["inbox", "working", "outbox", "done", "failed"];

/// Beginning of the name of a box's own folder, when several share a root.
const HOME: &str = "box-";

/// `inbox/ working/ outbox/ done/ failed/` under one root. Each may be a link to a folder elsewhere
/// on the same disk; within them no link is followed.
#[derive(Clone)]
pub struct Folders {
    files: Files,
    root: PathBuf,
    inbox: PathBuf,
    /// Where this box works …
    working: PathBuf,
    /// … and where all boxes do.
    works: PathBuf,
    /// This box's name, when it shares the folders.
    name: Option<OsString>,
    outbox: PathBuf,
    done: PathBuf,
    failed: PathBuf,
    previews: PathBuf,
    /// Held for as long as a copy of this value lives.
    _locks: Arc<Vec<File>>,
}

impl std::fmt::Debug for Folders {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Folders").field("root", &self.root).finish_non_exhaustive()
    }
}

/// Where what is the box `name`'s alone is kept.
pub(super) fn home(root: &Path, name: Option<&OsStr>) -> PathBuf {
    let Some(name) = name else { return root.to_owned() };
    let mut home = OsString::from(HOME);
    home.push(name);
    root.join(home)
}

impl Folders {
    /// The folders at `places`, in the order of [`NAMES`], for the box `name`, while it holds
    /// `locks`.
    pub(super) fn at(
        files: Files,
        root: PathBuf,
        places: [PathBuf; 5],
        name: Option<OsString>,
        locks: Vec<File>,
    ) -> Folders {
        let [inbox, works, outbox, done, failed] = places;
        let working = name.as_ref().map_or_else(|| works.clone(), |name| works.join(name));
        let (previews, _locks) = (outbox.join("gallery"), Arc::new(locks));
        Folders { files, root, inbox, working, works, name, outbox, done, failed, previews, _locks }
    }

    /// The files of the disk they are on.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// The root, absolute.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where what is this box's alone is kept, its calibration and its state: the root, or
    /// `box-NAME` in it when the folders are shared.
    pub fn home(&self) -> PathBuf {
        home(&self.root, self.name.as_deref())
    }

    /// Where photos are dropped.
    pub fn inbox(&self) -> &Path {
        &self.inbox
    }

    /// Photos being restored by this box.
    pub fn working(&self) -> &Path {
        &self.working
    }

    /// Results, their reports and the gallery.
    pub fn outbox(&self) -> &Path {
        &self.outbox
    }

    /// Originals whose result is in the outbox.
    pub fn done(&self) -> &Path {
        &self.done
    }

    /// Originals that could not be restored, each with its reason.
    pub fn failed(&self) -> &Path {
        &self.failed
    }

    /// Pictures the gallery shows.
    pub fn previews(&self) -> &Path {
        &self.previews
    }

    /// All of them, each after the one it lies in.
    pub(super) fn all(&self) -> [&Path; 7] {
        let Folders { inbox, works, outbox, done, failed, working, previews, .. } = self;
        [inbox, works, outbox, done, failed, working, previews]
    }

    /// Where results that were withdrawn lie.
    pub(super) fn withdrawn(&self) -> PathBuf {
        self.outbox.join("withdrawn")
    }

    /// Whether other boxes may work on these folders, too.
    pub(crate) fn shared(&self) -> bool {
        self.name.is_some()
    }

    /// The same folders as each of the other boxes that ever worked here has them, by its name.
    pub(super) fn others(&self) -> Result<Vec<(OsString, Folders)>, FileError> {
        let found = self.files.list(&self.works)?.into_iter();
        let other = |(name, kind): &(OsString, FileKind)| {
            *kind == FileKind::Folder && Some(name) != self.name.as_ref()
        };
        let as_theirs = |(name, _): (OsString, FileKind)| {
            let working = self.works.join(&name);
            (name.clone(), Folders { working, name: Some(name), ..self.clone() })
        };
        Ok(found.filter(other).map(as_theirs).collect())
    }

    /// Whether the disk of the results has more than `floor_bytes` free. A disk that does not tell
    /// has.
    pub(super) fn room(&self, floor_bytes: u64) -> Result<(), FolderError> {
        const MIB: u64 = 1 << 20;
        for folder in [&self.outbox, &self.working] {
            match self.files.free_bytes(folder) {
                Ok(free) if free < floor_bytes => {
                    let (found_mib, floor_mib) = (free / MIB, floor_bytes.div_ceil(MIB));
                    return Err(FolderError::Full { path: folder.clone(), found_mib, floor_mib });
                }
                Ok(_) => {}
                Err(error) => log::debug!("{error}"),
            }
        }
        Ok(())
    }
}
