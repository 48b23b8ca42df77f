//! How long results and originals are kept: by age and by size, as the rig file's `[keep]` has it,
//! the oldest first.
//!
//! ```text
//! outbox/a.jpg ─► (safe) ─► its three pictures in outbox/gallery ─► (safe) ─► outbox/a.jpg.json
//! done/a.jpg
//! ```
//!
//! The report goes last: for as long as it is there, what a cut left of its result is found again
//! by the next look. What was withdrawn goes by the same limits. Nothing else is ever removed: not
//! what waits, is under way, or was set aside; no file in the outbox that has no report of ours; no
//! photo that a night may still ask back. A report whose result somebody has fetched goes with the
//! others of its age.

use std::collections::HashSet;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::deliver::pictures;
use super::error::FolderError;
use super::folders::Folders;
use super::inbox::is_hidden;
use super::ledger::Ledger;
use super::report_file::{Delivered, read_report, report_name};
use crate::config::Keep;
use crate::disk::files::json;
use crate::disk::{FileError, FileKind};
use crate::remedy::full_message;
use crate::rig::Moment;

/// Seconds between two looks. Guess: limits are days.
const LOOK_S: f64 = 3600.0;

/// Removed in one go at most; whoever supervises the loop must see it come round. Guess.
const AT_ONCE_MAX: usize = 500;

/// Longest record of what was removed.
const BYTES_MAX: u64 = 1 << 20;

const DAY_S: f64 = 86_400.0;
const MIB: f64 = (1 << 20) as f64;

/// Name of the record among the gallery's pictures.
const NAME: &str = "removed.json";

/// What was removed so far, for the morning report.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) struct Removed {
    /// Results, reports and pictures included.
    pub(crate) results: u64,
    /// Originals.
    pub(crate) originals: u64,
    /// All of them together.
    pub(crate) bytes: u64,
    /// When the last one was, seconds since 1970 UTC.
    pub(crate) last_unix_s: u64,
}

impl Removed {
    /// What was removed from `folders` so far.
    pub(crate) fn load(folders: &Folders) -> Removed {
        let path = folders.previews().join(NAME);
        folders.files().read_json(&path, BYTES_MAX).ok().flatten().unwrap_or_default()
    }

    /// One line for the log, and the sum for the morning report.
    fn tell(self, folders: &Folders) {
        let Removed { results, originals, bytes, last_unix_s } = self;
        log::info!(
            "removed by the limits: {results} of the results, {originals} of the originals, {} MiB",
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
        // A count that a cut takes, or a full disk, harms nobody.
        if let Err(error) = kept {
            log::debug!("{}", full_message(&error));
        }
    }
}

/// The limits, and when they are looked at.
pub(crate) struct Keeping<'a> {
    keep: Keep,
    /// Whether the calendar is to be believed: ages count only then.
    believed: &'a dyn Fn() -> bool,
    due: Moment,
    /// What went wrong last, which is told once.
    trouble: String,
}

/// One thing that may be removed.
#[derive(Debug)]
struct Item {
    /// When it came to be where it is, seconds since 1970 UTC.
    unix_s: i64,
    bytes: u64,
    /// The result's name, or the original's.
    name: OsString,
}

/// When it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Now {
    /// By the daemon's clock.
    pub(crate) moment: Moment,
    /// By the calendar, seconds since 1970 UTC.
    pub(crate) unix_s: u64,
}

impl<'a> Keeping<'a> {
    /// The limits `keep`. Ages count for as long as the calendar is `believed`: a board that wakes
    /// up in the wrong year would find everything old.
    pub(crate) fn new(keep: Keep, believed: &'a dyn Fn() -> bool) -> Keeping<'a> {
        Keeping { keep, believed, due: Moment(f64::NEG_INFINITY), trouble: String::new() }
    }

    /// Whether the disk has more than `floor_bytes` free for one more photo; if not, what is past
    /// its limit is removed at once. Returns whether anything was.
    pub(crate) fn make_room(
        &mut self,
        folders: &Folders,
        unproven: &[Delivered],
        now: Now,
        floor_bytes: u64,
    ) -> Result<bool, FolderError> {
        if folders.room(floor_bytes).is_ok() {
            return Ok(false);
        }
        self.due = now.moment;
        let removed = self.sweep(folders, unproven, now);
        folders.room(floor_bytes).map(|()| removed)
    }

    /// Removes what is past its limits, when it is time to look; photos that are `unproven` stay.
    /// That something cannot be removed is told and no reason to stop: it is tried again at the
    /// next look. Returns whether anything was removed.
    pub(crate) fn sweep(&mut self, folders: &Folders, unproven: &[Delivered], now: Now) -> bool {
        if self.keep == Keep::default() || now.moment.0 < self.due.0 {
            return false;
        }
        self.due = Moment(now.moment.0 + LOOK_S);
        let calendar = (self.believed)().then_some(now.unix_s as i64);
        let swept = Past::find(folders, &self.keep, unproven, calendar)
            .and_then(|past| past.remove(folders).map(|()| past));
        let trouble = swept.as_ref().err().map(|e| full_message(e)).unwrap_or_default();
        if self.trouble != trouble && !trouble.is_empty() {
            log::warn!("what is past its limit stays for now: {trouble}");
        }
        self.trouble = trouble;
        // Of what could not all be removed, some may be gone.
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
            removed.tell(folders);
        }
        any
    }
}

/// What is past its limits.
struct Past {
    results: Vec<Item>,
    withdrawn: Vec<Item>,
    originals: Vec<Item>,
    /// There is more than is removed in one go.
    more: bool,
}

/// The limits of one kind of things.
struct Limit {
    days_max: f64,
    mib_max: f64,
    /// The time, seconds since 1970; `None` when nobody knows it.
    calendar: Option<i64>,
}

impl Past {
    fn find(
        folders: &Folders,
        keep: &Keep,
        unproven: &[Delivered],
        calendar: Option<i64>,
    ) -> Result<Past, FileError> {
        let mut promised: HashSet<OsString> = Ledger::promised(folders)?.into_iter().collect();
        promised.extend(unproven.iter().map(|delivered| delivered.result.clone()));
        let kept = unproven.iter().map(|delivered| delivered.kept.clone()).collect();
        let of_results =
            Limit { days_max: keep.results_days_max, mib_max: keep.results_mib_max, calendar };
        let of_originals =
            Limit { days_max: keep.originals_days_max, mib_max: keep.originals_mib_max, calendar };
        let mut past = Past {
            results: of_results.past(reported(folders, folders.outbox())?, &promised),
            withdrawn: of_results.past(reported(folders, &folders.withdrawn())?, &HashSet::new()),
            originals: of_originals.past(done(folders)?, &kept),
            more: false,
        };
        for items in [&mut past.results, &mut past.withdrawn, &mut past.originals] {
            past.more |= items.len() > AT_ONCE_MAX;
            items.truncate(AT_ONCE_MAX);
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
            // A result without report or pictures is nothing anybody could use.
            files.sync_folder(folder)?;
            // The pictures under a withdrawn result's name are those of the one that took its
            // place.
            if folder == folders.outbox() {
                for picture in results.iter().flat_map(|result| pictures(&result.name)) {
                    files.remove(&previews.join(picture))?;
                }
                // Without the report nobody would find them any more.
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
    /// Those of `items` that are past the limit, the oldest first, without those that are `spared`.
    fn past(&self, mut items: Vec<Item>, spared: &HashSet<OsString>) -> Vec<Item> {
        let mut bytes = items.iter().map(|item| item.bytes).sum::<u64>();
        items.sort_by(|a, b| (a.unix_s, &a.name).cmp(&(b.unix_s, &b.name)));
        items.retain(|item| {
            let age_s = self.calendar.map(|now| (now - item.unix_s) as f64);
            let old = age_s.is_some_and(|age_s| age_s >= self.days_max * DAY_S);
            let goes = (old || bytes as f64 > self.mib_max * MIB) && !spared.contains(&item.name);
            bytes -= if goes { item.bytes } else { 0 };
            goes
        });
        items
    }
}

/// The results in `folder` with a report of ours, whether they are still there or not.
fn reported(folders: &Folders, folder: &Path) -> Result<Vec<Item>, FileError> {
    let (files, previews) = (folders.files(), folders.previews());
    let mut items = Vec::new();
    let found = match files.list(folder) {
        // Nothing was ever withdrawn.
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
        let pictures = pictures(&name).map(|picture| previews.join(picture));
        let result = folder.join(&name);
        let all = pictures.iter().chain([&path, &result]);
        let bytes = all.map(|path| files.look(path).map_or(0, |look| look.size)).sum();
        items.push(Item { unix_s: report.finished_unix_s as i64, bytes, name });
    }
    Ok(items)
}

/// The originals whose result was delivered.
fn done(folders: &Folders) -> Result<Vec<Item>, FileError> {
    let (files, done) = (folders.files(), folders.done());
    let mut items = Vec::new();
    for (name, kind) in files.list(done)? {
        if kind == FileKind::File
            && !is_hidden(&name)
            && let Ok(look) = files.look(&done.join(&name))
        {
            // Moving it here touched it; when the photo says it was made is its owner's business.
            items.push(Item { unix_s: look.touched_unix_s, bytes: look.size, name });
        }
    }
    Ok(items)
}
