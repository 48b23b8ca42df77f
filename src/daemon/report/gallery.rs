//! `outbox/index.html`: every photo before and after, from disk, with no server and no network.
//!
//! The page holds words; the pictures lie beside it as files and are loaded when scrolled to.

use std::collections::{HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::path::Path;

use serde::Serialize;

use super::card::{GalleryPhoto, stamp_address, state};
use super::html::harmless;
use super::page;
use super::summary::PhotoCounts;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::inbox::is_hidden;
use crate::daemon::store::limits::Removed;
use crate::daemon::store::pilots::{self, PilotEntry};
use crate::daemon::store::report_file::{BYTES_MAX, Failed, Report, address, read_report};
use crate::daemon::store::waiting::Waiting;
use crate::disk::FileError;
use crate::disk::files::json;

/// Photos by which is judged how long the next will take.
const USUAL: usize = 8;

/// Folder in the root that may hold scenes as they are, under the names of their photos: where the
/// truth is known, one sees how near a result came.
pub const SCENES: &str = "scenes";

/// What the gallery shows.
#[derive(Debug, Default)]
pub(crate) struct Gallery {
    reports: Vec<Report>,
    failed: Vec<Failed>,
    /// Photos that wait in the inbox.
    pub(crate) waiting: Waiting,
    /// Names that originals have in `done`, by the name of the result.
    originals: HashMap<String, OsString>,
    /// Checksums of the photo pages as written.
    written: Vec<u32>,
    /// Number of the last photo page there is.
    last_page: usize,
}

impl Gallery {
    /// What the outbox and the failed folder hold. A report that cannot be read is left out, with
    /// a warning.
    pub(crate) fn load(folders: &Folders) -> Result<Gallery, FileError> {
        let mut gallery = Gallery::default();
        let (files, outbox, failed) = (folders.files(), folders.outbox(), folders.failed());
        let found = files.list(outbox)?;
        let names: HashSet<&OsStr> = found.iter().map(|(name, _)| name.as_os_str()).collect();
        for name in &names {
            let path = outbox.join(name);
            let result = path.file_stem().unwrap_or_default();
            if path.extension().is_none_or(|e| e != "json") || !names.contains(result) {
                continue;
            }
            match read_report(files, &path).ok().flatten() {
                Some(report) => gallery.add(&report),
                None => log::warn!(
                    "{} is no report of relens and is not in the gallery",
                    path.display()
                ),
            }
        }
        let pages = files.list(folders.previews())?;
        gallery.last_page =
            pages.iter().filter_map(|(name, _)| page::number(name)).max().unwrap_or(0);
        for (name, _) in files.list(failed)? {
            let mut note = name.clone();
            note.push(".txt");
            let Ok(Some(note)) = files.read(&failed.join(note), BYTES_MAX) else { continue };
            if !is_hidden(&name) {
                let note = String::from_utf8_lossy(&note);
                gallery.failed.push(Failed::of_note(name.to_string_lossy().into_owned(), &note));
            }
        }
        Ok(gallery)
    }

    /// Adds a photo with a result.
    pub(crate) fn add(&mut self, report: &Report) {
        // The record of the iterations is in the report's file; thousands of them are not kept in
        // memory.
        let mut report = report.clone();
        report.iterations = Vec::new();
        // A name that is used again is another photo's.
        self.originals.remove(&report.result);
        self.reports.push(report);
    }

    /// Leaves out the result `result`.
    pub(crate) fn remove(&mut self, result: &str) {
        self.reports.retain(|report| report.result != result);
    }

    /// How many photos came to what end, by what is there.
    pub(crate) fn counts(&self) -> PhotoCounts {
        let (failed, waiting) = (self.failed.len(), self.waiting);
        let mut counts = PhotoCounts { failed, waiting, ..PhotoCounts::default() };
        self.reports.iter().for_each(|report| counts.add(report.outcome));
        counts
    }

    /// Seconds that the photos done last took, on average.
    pub(crate) fn usual_s(&self) -> Option<f64> {
        let last = &self.reports[self.reports.len().saturating_sub(USUAL)..];
        let seconds = last.iter().map(|report| report.seconds).sum::<f64>();
        (!last.is_empty()).then(|| seconds / last.len() as f64)
    }

    /// Adds a photo without one.
    pub(crate) fn add_failed(&mut self, failed: Failed) {
        self.failed.push(failed);
    }

    /// Learns under which names the originals are kept: the photo's own or the result's, whichever
    /// file has the photo's length.
    fn find_originals(&mut self, folders: &Folders) {
        let (files, done) = (folders.files(), folders.done());
        let found: HashSet<OsString> =
            files.list(done).unwrap_or_default().into_iter().map(|(name, _)| name).collect();
        self.originals.retain(|_, name| found.contains(name));
        for report in &self.reports {
            if self.originals.contains_key(&report.result) {
                continue;
            }
            let names = [&report.photo, &report.result].map(OsString::from);
            let is_it = |name: &OsString| {
                found.contains(name)
                    && files.look(&done.join(name)).is_ok_and(|l| l.size == report.photo_bytes)
            };
            if let Some(name) = names.into_iter().find(is_it) {
                self.originals.insert(report.result.clone(), name);
            }
        }
    }

    /// Address of the original from the outbox, if it is still there.
    fn original(&self, report: &Report) -> Option<String> {
        let name = self.originals.get(&report.result)?;
        Some(format!("../done/{}", address(name)))
    }

    /// Seconds between two writings while photos come one after another: more of them take longer
    /// to write.
    pub(crate) fn period_s(&self) -> f64 {
        10.0 + 0.05 * self.reports.len() as f64
    }

    /// Writes the pages that have changed, and the data beside them.
    pub(crate) fn write(
        &mut self,
        folders: &Folders,
        rig: &str,
        left: &[Failed],
        attention: &[String],
        now_unix_s: u64,
    ) -> Result<(), FileError> {
        let (files, outbox) = (folders.files(), folders.outbox());
        // Oldest first, sixty a page: a full page does not change any more.
        self.reports
            .sort_by(|a, b| (a.finished_unix_s, &a.photo).cmp(&(b.finished_unix_s, &b.photo)));
        self.find_originals(folders);
        let originals: Vec<Option<String>> =
            self.reports.iter().map(|r| self.original(r)).collect();
        let scenes = files.list(&folders.root().join(SCENES)).unwrap_or_default();
        let scenes: HashSet<OsString> = scenes.into_iter().map(|(name, _)| name).collect();
        // Newest first.
        let numbered = self.reports.iter().zip(&originals).enumerate().rev();
        let shown: Vec<GalleryPhoto<'_>> = numbered
            .map(|(number, (report, original))| {
                let original = original.as_deref();
                // A raw photo's scene is no raw photo.
                let picture = Path::new(&report.photo).with_extension("png").into_os_string();
                let scene = [OsString::from(&report.photo), picture]
                    .into_iter()
                    .find(|name| scenes.contains(name))
                    .map(|name| format!("../scenes/{}", address(&name)));
                GalleryPhoto { report, number, original, scene }
            })
            .collect();
        let pages = shown.len().div_ceil(page::PHOTOS);
        self.written.resize(pages, 0);
        for (n, chunk) in shown.rchunks(page::PHOTOS).enumerate() {
            let html = page::photo_page(n + 1, pages, chunk);
            let sum = crc32fast::hash(html.as_bytes());
            if pages > 1 && self.written[n] != sum {
                let name = page::page_address(n + 1);
                let path = outbox.join(&name);
                let (folder, name) =
                    (path.parent().unwrap_or(outbox), path.file_name().unwrap_or_default());
                files.replace(folder, name, html.as_bytes())?;
                self.written[n] = sum;
            }
        }
        // Results that were removed leave fewer.
        let last_page = if pages > 1 { pages } else { 0 };
        for n in last_page + 1..=self.last_page {
            let _ = files.remove(&outbox.join(page::page_address(n)));
        }
        self.last_page = last_page;
        let removed = Removed::load(folders);
        let pilots = pilots::load(folders);
        let data = Data {
            rig,
            written_unix_s: now_unix_s,
            counts: self.counts(),
            photos: &self.reports,
            failed: &self.failed,
            left,
            attention,
            removed,
            pilots: &pilots,
        };
        let (previews, json) = (folders.previews(), json(&data, outbox)?);
        files.replace_for_now(previews, "report.json".as_ref(), &json)?;
        let names = names_script(&self.reports, outbox)?;
        files.replace_for_now(previews, "names.js".as_ref(), &names)?;
        let html = page::first_page(&page::Overview {
            rig,
            photos: &shown,
            failed: &self.failed,
            left,
            waiting: self.waiting,
            now: super::now::address(folders).as_deref(),
            attention,
            removed,
            pilots: &pilots,
            now_unix_s,
        });
        files.replace(outbox, "index.html".as_ref(), html.as_bytes())
    }
}

/// What the search looks through, as a script: pages opened from a disk may not read data.
fn names_script(reports: &[Report], outbox: &Path) -> Result<Vec<u8>, FileError> {
    let rows: Vec<_> = reports
        .iter()
        .map(|r| {
            let name: String = r.photo.chars().map(harmless).collect();
            (name, state(r.outcome), stamp_address(r))
        })
        .collect();
    Ok([b"relensNames(", &json(&rows, outbox)?[..], b");\n"].concat())
}

/// Writes the report of the rig called `rig` over `folders` while there is no daemon to do it: what
/// lies there, and what the operator should know, a sentence each.
///
/// # Errors
/// When a folder cannot be read or written.
pub fn write_report(
    folders: &Folders,
    rig: &str,
    attention: &[String],
    now_unix_s: u64,
) -> Result<(), FileError> {
    Gallery::load(folders)?.write(folders, rig, &[], attention, now_unix_s)
}

/// The report as data, for other programs.
#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
struct Data<'a> {
    rig: &'a str,
    written_unix_s: u64,
    counts: PhotoCounts,
    photos: &'a [Report],
    failed: &'a [Failed],
    left: &'a [Failed],
    attention: &'a [String],
    removed: Removed,
    pilots: &'a [PilotEntry],
}
