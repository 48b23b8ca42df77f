//! Removal of old results and originals: by age and by total size, as set in the rig file's
//! `[keep]`, oldest first.
//!
//! ```text
//! outbox/a.jpg ─► (sync) ─► its pictures in outbox/gallery ─► (sync) ─► outbox/a.jpg.json
//! done/a.jpg
//! ```
//!
//! The report is removed last: while it exists, the next sweep finds what a power cut left.
//! Withdrawn results follow the same limits. Nothing else is ever removed: no photo that waits, is
//! under way or was rejected; no file in the outbox without a report; no photo that a night may
//! still restore anew. A report whose result was taken out of the outbox is removed at the same
//! age.

use std::collections::HashSet;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::companions::is_hidden;
use super::error::FolderError;
use super::folders::Folders;
use super::ledger::Ledger;
use super::names::{PictureNames, report_name};
use super::report_file::{Delivered, read_report};
use crate::config::Keep;
use crate::disk::files::json;
use crate::disk::{FileError, FileKind};
use crate::remedy::full_message;
use crate::rig::Moment;

/// Seconds between two sweeps. Guess: limits are days.
const SWEEP_S: f64 = 3600.0;

/// Files of each kind removed in one sweep, so that the watchdog sees the loop advance. Guess.
const REMOVED_MAX: usize = 500;

const DAY_S: f64 = 86_400.0;
const MIB: f64 = (1 << 20) as f64;

/// Name of the totals' file among the gallery's pictures.
const NAME: &str = "removed.json";

/// Totals of removed files, for the morning report.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) struct Removed {
    /// Results, each with its report and pictures.
    pub(crate) results: u64,
    /// Originals.
    pub(crate) originals: u64,
    /// Bytes.
    pub(crate) bytes: u64,
    /// Time of the last removal, seconds since 1970 UTC.
    pub(crate) last_unix_s: u64,
}

impl Removed {
    /// Reads the totals of `folders`.
    pub(crate) fn load(folders: &Folders) -> Removed {
        let path = folders.previews().join(NAME);
        folders.files().read_json(&path).ok().flatten().unwrap_or_default()
    }

    /// Logs these removals and adds them to the totals.
    fn record(self, folders: &Folders) {
        let Removed { results, originals, bytes, last_unix_s } = self;
        log::info!(
            "removed by the limits of [keep]: results {results}, originals {originals}, {} MiB",
            bytes >> 20
        );
        let before = Removed::load(folders);
        let sum = Removed {
            results: before.results + results,
            originals: before.originals + originals,
            bytes: before.bytes + bytes,
            last_unix_s,
        };
        let previews = folders.previews();
        let kept = json(&sum, previews)
            .and_then(|bytes| folders.files().replace_for_now(previews, NAME.as_ref(), &bytes));
        // Losing the count to a power cut or a full disk is harmless.
        if let Err(error) = kept {
            log::debug!("{}", full_message(&error));
        }
    }
}

/// The limits and the time of the next sweep.
pub(crate) struct Keeping<'a> {
    keep: Keep,
    /// Whether the calendar is trusted: ages count only then.
    is_calendar_trusted: &'a dyn Fn() -> bool,
    due: Moment,
    /// The last error, which is logged once.
    trouble: String,
}

/// A file that may be removed.
#[derive(Debug)]
struct Item {
    /// Time of its arrival, seconds since 1970 UTC.
    unix_s: i64,
    bytes: u64,
    /// Name of the result or original.
    name: OsString,
}

/// The current time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Now {
    /// Monotonic.
    pub(crate) moment: Moment,
    /// Calendar, seconds since 1970 UTC.
    pub(crate) unix_s: u64,
}

impl<'a> Keeping<'a> {
    /// The limits `keep`. Ages count while `is_calendar_trusted`: to a board that boots in the
    /// wrong year everything would look old.
    pub(crate) fn new(keep: Keep, is_calendar_trusted: &'a dyn Fn() -> bool) -> Keeping<'a> {
        Keeping {
            keep,
            is_calendar_trusted,
            due: Moment(f64::NEG_INFINITY),
            trouble: String::new(),
        }
    }

    /// Ensures `floor_bytes` of free space, with a sweep at once if there is less. Returns whether
    /// anything was removed.
    ///
    /// # Errors
    /// [`FolderError::Full`].
    pub(crate) fn make_room(
        &mut self,
        folders: &Folders,
        unproven: &[Delivered],
        now: Now,
        floor_bytes: u64,
    ) -> Result<bool, FolderError> {
        if folders.check_free_space(floor_bytes).is_ok() {
            return Ok(false);
        }
        self.due = now.moment;
        let removed = self.sweep(folders, unproven, now);
        folders.check_free_space(floor_bytes).map(|()| removed)
    }

    /// Removes files past their limits, when a sweep is due; `unproven` photos stay. Errors are
    /// logged and the removal repeated at the next sweep. Returns whether anything was removed.
    pub(crate) fn sweep(&mut self, folders: &Folders, unproven: &[Delivered], now: Now) -> bool {
        if self.keep == Keep::default() || now.moment.0 < self.due.0 {
            return false;
        }
        self.due = Moment(now.moment.0 + SWEEP_S);
        let calendar = (self.is_calendar_trusted)().then_some(now.unix_s as i64);
        let swept = Past::find(folders, &self.keep, unproven, calendar)
            .and_then(|past| past.remove(folders).map(|()| past));
        let trouble = swept.as_ref().err().map(|e| full_message(e)).unwrap_or_default();
        if self.trouble != trouble && !trouble.is_empty() {
            log::warn!("files past the limits of [keep] cannot be removed: {trouble}");
        }
        self.trouble = trouble;
        // Some may have been removed before the error.
        let Ok(Past { results, withdrawn, originals, more }) = swept else { return true };
        if more {
            self.due = now.moment;
        }
        let all = results.iter().chain(&withdrawn).chain(&originals);
        let removed = Removed {
            bytes: all.map(|item| item.bytes).sum(),
            results: (results.len() + withdrawn.len()) as u64,
            originals: originals.len() as u64,
            last_unix_s: now.unix_s,
        };
        let any = removed.results + removed.originals > 0;
        if any {
            removed.record(folders);
        }
        any
    }
}

/// Files past their limits.
struct Past {
    results: Vec<Item>,
    withdrawn: Vec<Item>,
    originals: Vec<Item>,
    /// Whether more are past their limits.
    more: bool,
}

/// The limits of one kind of file.
struct Limit {
    days_max: f64,
    mib_max: f64,
    /// The current time, seconds since 1970; `None` when unknown.
    calendar: Option<i64>,
}

impl Past {
    fn find(
        folders: &Folders,
        keep: &Keep,
        unproven: &[Delivered],
        calendar: Option<i64>,
    ) -> Result<Past, FileError> {
        let mut reserved: HashSet<OsString> = Ledger::reserved(folders)?.into_iter().collect();
        reserved.extend(unproven.iter().map(|delivered| delivered.result.clone()));
        let kept = unproven.iter().map(|delivered| delivered.kept.clone()).collect();
        let of_results =
            Limit { days_max: keep.results_days_max, mib_max: keep.results_mib_max, calendar };
        let of_originals =
            Limit { days_max: keep.originals_days_max, mib_max: keep.originals_mib_max, calendar };
        let mut past = Past {
            results: of_results.past(reported(folders, folders.outbox())?, &reserved),
            withdrawn: of_results.past(reported(folders, &folders.withdrawn())?, &HashSet::new()),
            originals: of_originals.past(done(folders)?, &kept),
            more: false,
        };
        for items in [&mut past.results, &mut past.withdrawn, &mut past.originals] {
            past.more |= items.len() > REMOVED_MAX;
            items.truncate(REMOVED_MAX);
        }
        Ok(past)
    }

    fn remove(&self, folders: &Folders) -> Result<(), FileError> {
        let (files, previews) = (folders.files(), folders.previews());
        for (folder, results) in
            [(folders.outbox(), &self.results), (&*folders.withdrawn(), &self.withdrawn)]
        {
            if results.is_empty() {
                continue;
            }
            for result in results {
                files.remove(&folder.join(&result.name))?;
            }
            // A result without its report or pictures is useless.
            files.sync_folder(folder)?;
            // A withdrawn result's pictures belong to the result that replaced it.
            if folder == folders.outbox() {
                for picture in results.iter().flat_map(|r| PictureNames::of(&r.name).all()) {
                    files.remove(&previews.join(picture))?;
                }
                // Without the report they would never be found again.
                files.sync_folder(previews)?;
            }
            for result in results {
                files.remove(&folder.join(report_name(&result.name)))?;
            }
        }
        let mut originals = self.originals.iter();
        originals.try_for_each(|original| files.remove(&folders.done().join(&original.name)))
    }
}

impl Limit {
    /// The items past the limit, oldest first, except those in `kept`.
    fn past(&self, mut items: Vec<Item>, kept: &HashSet<OsString>) -> Vec<Item> {
        let mut bytes = items.iter().map(|item| item.bytes).sum::<u64>();
        items.sort_by(|a, b| (a.unix_s, &a.name).cmp(&(b.unix_s, &b.name)));
        items.retain(|item| {
            let age_s = self.calendar.map(|now| (now - item.unix_s) as f64);
            let old = age_s.is_some_and(|age_s| age_s >= self.days_max * DAY_S);
            let goes = (old || bytes as f64 > self.mib_max * MIB) && !kept.contains(&item.name);
            bytes -= if goes { item.bytes } else { 0 };
            goes
        });
        items
    }
}

/// The results in `folder` that have a report, present or not.
fn reported(folders: &Folders, folder: &Path) -> Result<Vec<Item>, FileError> {
    let (files, previews) = (folders.files(), folders.previews());
    let mut items = Vec::new();
    let found = match files.list(folder) {
        // No result was ever withdrawn.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(items),
        found => found?,
    };
    for (name, kind) in found {
        let path = folder.join(&name);
        if kind != FileKind::File || path.extension().is_none_or(|ending| ending != "json") {
            continue;
        }
        let Some(report) = read_report(files, &path)? else { continue };
        let name = path.file_stem().unwrap_or_default().to_owned();
        let pictures: Vec<_> =
            PictureNames::of(&name).all().map(|picture| previews.join(picture)).collect();
        let result = folder.join(&name);
        let all = pictures.iter().chain([&path, &result]);
        let bytes = all.map(|path| files.metadata(path).map_or(0, |metadata| metadata.size)).sum();
        items.push(Item { unix_s: report.finished_unix_s as i64, bytes, name });
    }
    Ok(items)
}

/// The originals in `done`.
fn done(folders: &Folders) -> Result<Vec<Item>, FileError> {
    let (files, done) = (folders.files(), folders.done());
    let mut items = Vec::new();
    for (name, kind) in files.list(done)? {
        if kind == FileKind::File
            && !is_hidden(&name)
            && let Ok(metadata) = files.metadata(&done.join(&name))
        {
            // The move set this time; the time of change is the photo's own.
            items.push(Item { unix_s: metadata.touched_unix_s, bytes: metadata.size, name });
        }
    }
    Ok(items)
}
