//! `outbox/index.html`: every photo before and after, from disk, with no server and no network.
//!
//! The page holds words; the pictures lie beside it as files and are loaded when scrolled to.

mod page;

use super::report::{Failed, Report};
use super::{DaemonError, Folders, durable, inbox};

/// What the gallery shows.
#[derive(Debug, Default)]
pub(super) struct Gallery {
    reports: Vec<Report>,
    failed: Vec<Failed>,
}

impl Gallery {
    /// What the outbox and the failed folder hold.
    ///
    /// # Errors
    /// When a folder cannot be read. A report that cannot is left out, with a warning.
    pub(super) fn load(folders: &Folders) -> Result<Gallery, DaemonError> {
        let mut gallery = Gallery::default();
        let outbox = folders.outbox();
        for entry in
            std::fs::read_dir(&outbox).map_err(DaemonError::files("read the folder", &outbox))?.flatten()
        {
            let path = entry.path();
            if path.extension().is_none_or(|e| e != "json") || !path.with_extension("").exists() {
                continue;
            }
            let read =
                std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice::<Report>(&bytes).ok());
            match read {
                Some(report) => gallery.add(&report),
                None => log::warn!("{} is no report of relens and is not in the gallery", path.display()),
            }
        }
        let failed = folders.failed();
        for entry in
            std::fs::read_dir(&failed).map_err(DaemonError::files("read the folder", &failed))?.flatten()
        {
            let name = entry.file_name();
            let note = failed.join({
                let mut note = name.clone();
                note.push(".txt");
                note
            });
            let Ok(note) = std::fs::read_to_string(note) else { continue };
            if !inbox::is_hidden(&name) {
                gallery.failed.push(Failed::of_note(name.to_string_lossy().into_owned(), &note));
            }
        }
        Ok(gallery)
    }

    /// Adds a photo with a result.
    pub(super) fn add(&mut self, report: &Report) {
        // The record of the iterations is in the report's file; thousands of them are not kept in memory.
        let mut report = report.clone();
        report.iterations = Vec::new();
        self.reports.push(report);
    }

    /// Adds a photo without one.
    pub(super) fn add_failed(&mut self, failed: Failed) {
        self.failed.push(failed);
    }

    /// Writes the page, whole.
    pub(super) fn write(
        &mut self,
        folders: &Folders,
        rig: &str,
        left: &[Failed],
        now_unix_s: u64,
    ) -> Result<(), DaemonError> {
        // Newest first.
        self.reports.sort_by(|a, b| (b.finished_unix_s, &a.photo).cmp(&(a.finished_unix_s, &b.photo)));
        let page = page::page(rig, &self.reports, &self.failed, left, now_unix_s);
        durable::replace(&folders.outbox(), "index.html".as_ref(), page.as_bytes())
    }
}
