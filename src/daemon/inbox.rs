//! What is waiting in the inbox, and whether it has come to rest.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use crate::rig::Moment;

use super::DaemonError;

/// What changes while a file is being written. Size alone does not: some copies set it first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look {
    size: u64,
    changed: (i64, i64),
    inode: u64,
}

impl Look {
    /// A look at `path` itself, links not followed; `None` when it is gone.
    pub(super) fn at(path: &Path) -> Option<Look> {
        let about = path.symlink_metadata().ok()?;
        Some(Look { size: about.len(), changed: (about.mtime(), about.mtime_nsec()), inode: about.ino() })
    }
}

/// Looks at the inbox over time.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    seen: HashMap<OsString, (Look, Moment)>,
    /// Folders and the like that were already spoken about.
    ignored: Vec<OsString>,
}

impl Inbox {
    /// The names of photos in `folder` that have not changed for `quiet_s`, oldest first.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub(super) fn ready(
        &mut self,
        folder: &Path,
        now: Moment,
        quiet_s: f64,
    ) -> Result<Vec<OsString>, DaemonError> {
        let mut waiting = Vec::new();
        let mut seen = HashMap::new();
        let entries = std::fs::read_dir(folder).map_err(DaemonError::files("read the folder", folder))?;
        for entry in entries.flatten() {
            let name = entry.file_name();
            if is_junk(&name) {
                continue;
            }
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                if !self.ignored.contains(&name) {
                    log::warn!(
                        "inbox/{} is a folder and is left alone; drop the photos in it",
                        name.to_string_lossy()
                    );
                    self.ignored.push(name);
                }
                continue;
            }
            let Some(look) = Look::at(&entry.path()) else { continue };
            let since = match self.seen.get(&name) {
                Some(&(before, since)) if before == look => since,
                _ => now,
            };
            if now.0 - since.0 >= quiet_s {
                waiting.push((look.changed, name.clone()));
            }
            seen.insert(name, (look, since));
        }
        self.seen = seen;
        waiting.sort();
        Ok(waiting.into_iter().map(|(_, name)| name).collect())
    }
}

/// Names that begin with a dot.
pub(super) fn is_hidden(name: &OsStr) -> bool {
    name.as_bytes().starts_with(b".")
}

/// Names that systems, shares and uploaders leave behind, and those of uploads under way.
pub(super) fn is_junk(name: &OsStr) -> bool {
    const NAMES: [&str; 8] = [
        "thumbs.db",
        "ehthumbs.db",
        "desktop.ini",
        "@eadir",
        "__macosx",
        "$recycle.bin",
        "system volume information",
        "lost+found",
    ];
    const ENDINGS: [&str; 9] =
        [".part", ".partial", ".tmp", ".temp", ".crdownload", ".download", ".filepart", ".swp", "~"];
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
        for junk in [".DS_Store", "._a.jpg", "Thumbs.db", "a.jpg.part", "a.jpg~", ".a.jpg.Xy12", "~$a.docx"] {
            assert!(is_junk(OsStr::new(junk)), "{junk}");
        }
        assert!(!is_junk(OsStr::new("partial eclipse.jpg")));
    }

    #[test]
    fn a_file_is_ready_once_it_has_been_quiet() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.jpg");
        std::fs::write(&file, b"one").unwrap();
        let mut inbox = Inbox::default();
        let mut ready = |s: f64| inbox.ready(folder.path(), Moment(s), 5.0).unwrap().len();
        assert_eq!((ready(0.0), ready(4.9)), (0, 0));
        std::fs::write(&file, b"one and two").unwrap();
        assert_eq!((ready(5.0), ready(9.9), ready(10.1)), (0, 0, 1));
    }
}
