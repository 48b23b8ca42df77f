//! `outbox/index.html`: every photo before and after, from disk, with no server and no network.
//!
//! The page holds words; the pictures lie beside it as files and are loaded when scrolled to.

mod page;

use std::collections::HashSet;
use std::ffi::OsStr;

use super::report::{Failed, Report};
use super::{DaemonError, Folders, durable, inbox};

/// Longer files are no reports or notes of ours.
const REPORT_BYTES_MAX: u64 = 1 << 20;

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
        let (disk, outbox, failed) = (folders.disk(), folders.outbox(), folders.failed());
        let list = |folder| disk.list(folder).map_err(DaemonError::files("read the folder", folder));
        let found = list(outbox)?;
        let names: HashSet<&OsStr> = found.iter().map(|(name, _)| name.as_os_str()).collect();
        for name in &names {
            let path = outbox.join(name);
            let result = path.file_stem().unwrap_or_default();
            if path.extension().is_none_or(|e| e != "json") || !names.contains(result) {
                continue;
            }
            let read = durable::read(disk, &path, REPORT_BYTES_MAX).ok().flatten();
            match read.and_then(|bytes| serde_json::from_slice::<Report>(&bytes).ok()) {
                Some(report) => gallery.add(&report),
                None => log::warn!("{} is no report of relens and is not in the gallery", path.display()),
            }
        }
        for (name, _) in list(failed)? {
            let mut note = name.clone();
            note.push(".txt");
            let Ok(Some(note)) = durable::read(disk, &failed.join(note), REPORT_BYTES_MAX) else { continue };
            if !inbox::is_hidden(&name) {
                let note = String::from_utf8_lossy(&note);
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

    /// Leaves out the result `result`.
    pub(super) fn remove(&mut self, result: &str) {
        self.reports.retain(|report| report.result != result);
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
        durable::replace(folders.disk(), folders.outbox(), "index.html".as_ref(), page.as_bytes())
    }
}
