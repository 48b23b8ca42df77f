//! `outbox/index.html`: every photo before and after, viewed from disk without server or network.
//!
//! The pictures are files beside the page, loaded when scrolled into view.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::path::Path;

use super::card::{GalleryPhoto, state};
use super::html::harmless;
use super::page;
use super::summary::PhotoCounts;
use crate::daemon::store::companions::is_hidden;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::names::{address, note_name, thumbnail_address};
use crate::daemon::store::report_file::{Failed, Report};
use crate::daemon::store::waiting::Waiting;
use crate::disk::FileError;
use crate::disk::files::json;

/// Photos averaged to estimate the duration of the next.
const USUAL: usize = 8;

const NOTE_BYTES_MAX: u64 = 1 << 20;

/// Folder in the root that may hold the true scenes, under the names of their photos.
pub const SCENES: &str = "scenes";

#[derive(Debug, Default)]
pub(crate) struct Gallery {
    pub(super) reports: Vec<Report>,
    /// Largest number of a report since loading.
    last_number: u64,
    pub(super) failed: Vec<Failed>,
    pub(crate) waiting: Waiting,
    /// Checksums of the photo pages as written.
    written: Vec<u32>,
    /// Number of the last photo page on the disk.
    last_page: usize,
}

impl Gallery {
    /// Reads outbox and `failed`. An unreadable report is skipped with a warning.
    pub(crate) fn load(folders: &Folders) -> Result<Gallery, FileError> {
        let mut gallery = Gallery::default();
        let (files, outbox, failed) = (&folders.files, &folders.outbox, &folders.failed);
        let found = files.list(outbox)?;
        let names: HashSet<&OsStr> = found.iter().map(|(name, _)| name.as_os_str()).collect();
        for name in &names {
            let path = outbox.join(name);
            let result = path.file_stem().unwrap_or_default();
            if path.extension().is_none_or(|e| e != "json") || !names.contains(result) {
                continue;
            }
            match files.read_json::<Report>(&path).ok().flatten() {
                Some(report) => gallery.add(report),
                None => log::warn!(
                    "{} is not a report of relens, skipped in the gallery",
                    path.display()
                ),
            }
        }
        let pages = files.list(&folders.previews)?;
        gallery.last_page =
            pages.iter().filter_map(|(name, _)| page::number(name)).max().unwrap_or(0);
        for (name, _) in files.list(failed)? {
            let note = files.read(&failed.join(note_name(&name)), NOTE_BYTES_MAX);
            let Ok(Some(note)) = note else { continue };
            if !is_hidden(&name) {
                let note = String::from_utf8_lossy(&note);
                gallery.failed.push(Failed::of_note(name.to_string_lossy().into_owned(), &note));
            }
        }
        Ok(gallery)
    }

    pub(crate) fn add(&mut self, report: Report) {
        self.last_number = self.last_number.max(report.number);
        // The iterations stay in the report's file, to save memory.
        self.reports.push(Report { iterations: Vec::new(), ..report });
    }

    pub(crate) fn next_number(&self) -> u64 {
        self.last_number + 1
    }

    pub(crate) fn remove(&mut self, result: &str) {
        self.reports.retain(|report| report.result != result);
    }

    pub(crate) fn counts(&self) -> PhotoCounts {
        let (failed, waiting) = (self.failed.len(), self.waiting);
        let mut counts = PhotoCounts { failed, waiting, ..PhotoCounts::default() };
        self.reports.iter().for_each(|report| counts.add(report.outcome));
        counts
    }

    /// Mean duration of the last photos, seconds.
    pub(crate) fn usual_s(&self) -> Option<f64> {
        let last = &self.reports[self.reports.len().saturating_sub(USUAL)..];
        let seconds = last.iter().map(|report| report.seconds).sum::<f64>();
        (!last.is_empty()).then(|| seconds / last.len() as f64)
    }

    /// Interval between two writes while photos are being restored, seconds; it grows with the
    /// number of photos, as does the time of a write.
    pub(crate) fn period_s(&self) -> f64 {
        10.0 + 0.05 * self.reports.len() as f64
    }

    /// Writes the pages that have changed, and the data beside them.
    pub(crate) fn write(
        &mut self,
        folders: &Folders,
        rig: &str,
        deferred: &[Failed],
        now_unix_s: u64,
    ) -> Result<(), FileError> {
        let (files, outbox, previews) = (&folders.files, &folders.outbox, &folders.previews);
        // Pages are filled from the oldest photo on, so that a full page no longer changes.
        let order = |report: &Report| (report.number, report.finished_unix_s, report.photo.clone());
        self.reports.sort_by_cached_key(order);
        let found = files.list(outbox)?;
        let found: HashSet<_> = found.iter().map(|(name, _)| name.to_string_lossy()).collect();
        self.reports.retain(|report| found.contains(&*report.result));
        let names = |folder: &Path| -> HashSet<OsString> {
            files.list(folder).unwrap_or_default().into_iter().map(|(name, _)| name).collect()
        };
        let (done, scenes) = (names(&folders.done), names(&folders.root.join(SCENES)));
        // Pages show the newest photo first.
        let shown: Vec<GalleryPhoto<'_>> = (self.reports.iter().enumerate().rev())
            .map(|(number, report)| {
                let original = original_address(report, folders, &done);
                let scene = scene_address(report, &scenes);
                GalleryPhoto { report, number, original, scene }
            })
            .collect();
        self.last_page = write_photo_pages(folders, &shown, &mut self.written, self.last_page)?;
        let overview = page::Overview {
            rig,
            written_unix_s: now_unix_s,
            counts: self.counts(),
            photos: &self.reports,
            failed: &self.failed,
            deferred,
        };
        files.replace_for_now(&previews.join("report.json"), &json(&overview, outbox)?)?;
        let names = names_script(&self.reports, outbox)?;
        files.replace_for_now(&previews.join("names.js"), &names)?;
        let html = page::first_page(&overview, &shown);
        files.replace(&outbox.join("index.html"), html.as_bytes())
    }
}

/// Address of the original relative to the outbox, if it still exists: under the photo's name or
/// the result's, whichever of the files `done` has the photo's length.
fn original_address(
    report: &Report,
    folders: &Folders,
    done: &HashSet<OsString>,
) -> Option<String> {
    let has_length = |name: &OsString| {
        let found = folders.files.metadata(&folders.done.join(name));
        found.is_ok_and(|found| found.size == report.photo_bytes)
    };
    let mut names = [&report.photo, &report.result].map(OsString::from).into_iter();
    let name = names.find(|name| done.contains(name) && has_length(name))?;
    Some(format!("../done/{}", address(&name)))
}

/// Address of the scene of a photo, if it is among `scenes`.
fn scene_address(report: &Report, scenes: &HashSet<OsString>) -> Option<String> {
    // The scene of a raw photo is a PNG.
    let png = Path::new(&report.photo).with_extension("png").into_os_string();
    let names = [OsString::from(&report.photo), png];
    let name = names.into_iter().find(|name| scenes.contains(name))?;
    Some(format!("../{SCENES}/{}", address(&name)))
}

/// Writes the photo pages whose checksum differs from that in `written`, and removes superfluous
/// ones up to `old_last_page`; returns the number of the last page.
fn write_photo_pages(
    folders: &Folders,
    shown: &[GalleryPhoto<'_>],
    written: &mut Vec<u32>,
    old_last_page: usize,
) -> Result<usize, FileError> {
    let pages = shown.len().div_ceil(page::PHOTOS);
    written.resize(pages, 0);
    for (n, chunk) in shown.rchunks(page::PHOTOS).enumerate() {
        let html = page::photo_page(n + 1, pages, chunk);
        let sum = crc32fast::hash(html.as_bytes());
        if pages > 1 && written[n] != sum {
            let path = folders.outbox.join(page::page_address(n + 1));
            folders.files.replace(&path, html.as_bytes())?;
            written[n] = sum;
        }
    }
    let last_page = if pages > 1 { pages } else { 0 };
    for n in last_page + 1..=old_last_page {
        let _ = folders.files.remove(&folders.outbox.join(page::page_address(n)));
    }
    Ok(last_page)
}

/// Data for the search, as a script: pages opened from a disk may not read data files.
fn names_script(reports: &[Report], outbox: &Path) -> Result<Vec<u8>, FileError> {
    let rows: Vec<_> = reports
        .iter()
        .map(|r| {
            let name: String = r.photo.chars().map(harmless).collect();
            (name, state(r.outcome), thumbnail_address(&r.after))
        })
        .collect();
    Ok([b"relensNames(", &json(&rows, outbox)?[..], b");\n"].concat())
}
