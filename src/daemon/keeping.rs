//! How long results and originals are kept: by age and by size, as the rig file's `[keep]` has it,
//! the oldest first.
//!
//! ```text
//! outbox/a.jpg ─► (safe) ─► outbox/gallery/…-before.jpg, -after.jpg, -small.jpg ─► (safe) ─► outbox/a.jpg.json
//! done/a.jpg
//! ```
//!
//! The report goes last: for as long as it is there, what a cut left of its result is found again
//! by the next look. What was withdrawn goes by the same limits. Nothing else is ever removed: not
//! what waits, is under way, or was set aside; no file in the outbox that has no report of ours; no
//! photo that a night may still ask back. A report whose result somebody has fetched goes with the
//! others of its age.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::gallery::Gallery;
use super::job::report_name;
use super::ledger::Ledger;
use super::run::Daemon;
use super::withdrawal::WITHDRAWN;
use super::{DaemonError, Delivered, Folders, Report, atomic_file, delivery, inbox, nightly};
use crate::config::Keep;
use crate::disk::{Disk, Kind};
use crate::remedy::full_message;
use crate::rig::Moment;

/// Seconds between two looks. Guess: limits are days.
const LOOK_S: f64 = 3600.0;

/// Removed in one go at most; whoever supervises the loop must see it come round. Guess.
const AT_ONCE_MAX: usize = 500;

/// Longest report there is, and longest record of what was removed.
const BYTES_MAX: u64 = 1 << 20;

const DAY_S: f64 = 86_400.0;
const MIB: f64 = (1 << 20) as f64;

/// Name of the record among the gallery's pictures.
const NAME: &str = "removed.json";

/// What was removed so far, for the morning report.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) struct Removed {
    /// Results, reports and pictures included.
    pub(super) results: u64,
    /// Originals.
    pub(super) originals: u64,
    /// All of them together.
    pub(super) bytes: u64,
    /// When the last one was, seconds since 1970 UTC.
    pub(super) last_unix_s: u64,
}

/// The record under the folder of the gallery's pictures.
pub(super) fn removed(disk: &dyn Disk, previews: &Path) -> Removed {
    let read = atomic_file::read(disk, &previews.join(NAME), BYTES_MAX).ok().flatten();
    read.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// The limits, and when they are looked at.
pub(super) struct Keeping<'a> {
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

impl<'a> Daemon<'a> {
    /// The same daemon, which keeps results and originals within `keep`. Ages count for as long as
    /// the calendar is `believed`: a board that wakes up in the wrong year would find everything
    /// old.
    #[must_use]
    pub fn keeping(mut self, keep: Keep, believed: &'a dyn Fn() -> bool) -> Daemon<'a> {
        let (endless, due) = (keep == Keep::default(), self.clock.now());
        self.keeping =
            (!endless).then_some(Keeping { keep, believed, due, trouble: String::new() });
        self
    }

    /// Room on the disk for one more photo, made by the limits if they have something to remove.
    ///
    /// # Errors
    /// [`DaemonError::Full`].
    pub(super) fn make_room(&mut self) -> Result<(), DaemonError> {
        if self.folders.room(self.setting.floor_bytes).is_err()
            && let Some(keeping) = &mut self.keeping
        {
            keeping.due = self.clock.now();
            self.keep_within_limits();
        }
        self.folders.room(self.setting.floor_bytes)
    }

    /// Removes what is past its limits, when it is time to look. That something cannot be removed
    /// is told and no reason to stop: it is tried again at the next look.
    pub(super) fn keep_within_limits(&mut self) {
        let (now, unix_s) = (self.clock.now(), self.unix_s());
        let Some(keeping) = self.keeping.as_mut().filter(|keeping| now.0 >= keeping.due.0) else {
            return;
        };
        keeping.due = Moment(now.0 + LOOK_S);
        let calendar = (keeping.believed)().then_some(unix_s as i64);
        let swept = past_limits(&self.folders, &keeping.keep, self.schedule.unproven(), calendar)
            .and_then(|past| remove(&self.folders, &past).map(|()| past));
        let trouble = swept.as_ref().err().map(|e| full_message(e)).unwrap_or_default();
        if keeping.trouble != trouble && !trouble.is_empty() {
            log::warn!("what is past its limit stays for now: {trouble}");
        }
        keeping.trouble = trouble;
        match swept {
            Ok(Past { more: true, .. }) => keeping.due = now,
            Ok(_) => {}
            // Some of it may be gone.
            Err(_) => self.gallery = Gallery::load(&self.folders).unwrap_or_default(),
        }
        if let Ok(Past { results, withdrawn, originals, .. }) = swept {
            for result in &results {
                self.gallery.remove(&result.name.to_string_lossy());
            }
            let bytes =
                results.iter().chain(&withdrawn).chain(&originals).map(|item| item.bytes).sum();
            let (results, originals) = (results.len() + withdrawn.len(), originals.len());
            if results + originals > 0 {
                self.gallery_stale = true;
                self.tell_removed(Removed {
                    results: results as u64,
                    originals: originals as u64,
                    bytes,
                    last_unix_s: unix_s,
                });
            }
        }
    }

    /// One line for the log, and the sum for the morning report.
    fn tell_removed(&self, now: Removed) {
        let Removed { results, originals, bytes, last_unix_s } = now;
        log::info!(
            "removed by the limits: {results} of the results, {originals} of the originals, {} MiB",
            bytes >> 20
        );
        let (disk, previews) = (self.folders.disk(), self.folders.previews());
        let before = removed(disk, previews);
        let sum = Removed {
            results: before.results + results,
            originals: before.originals + originals,
            bytes: before.bytes + bytes,
            last_unix_s,
        };
        // A count that a cut takes, or a full disk, harms nobody.
        let kept = serde_json::to_vec(&sum)
            .map_err(std::io::Error::other)
            .map_err(DaemonError::files("write", previews))
            .and_then(|bytes| atomic_file::replace_for_now(disk, previews, NAME.as_ref(), &bytes));
        if let Err(error) = kept {
            log::debug!("{}", full_message(&error));
        }
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

/// What is past the limits `keep` at the time `calendar`, which is `None` when nobody knows it.
fn past_limits(
    folders: &Folders,
    keep: &Keep,
    unproven: &[Delivered],
    calendar: Option<i64>,
) -> Result<Past, DaemonError> {
    let mut spared: HashSet<OsString> = Ledger::promised(folders)?.into_iter().collect();
    let mut unproven = unproven.to_vec();
    for other in folders.others()? {
        let theirs = folders.of_box(&other);
        spared.extend(Ledger::promised(&theirs)?);
        unproven.extend(nightly::unproven_at(folders.disk(), &theirs.home())?);
    }
    spared.extend(unproven.iter().map(|delivered| delivered.result.clone()));
    let mut results = reported(folders, folders.outbox())?;
    let more = past(&mut results, keep.results_days_max, keep.results_mib_max, calendar, &spared);
    let mut withdrawn = reported(folders, &folders.outbox().join(WITHDRAWN))?;
    let more = past(
        &mut withdrawn,
        keep.results_days_max,
        keep.results_mib_max,
        calendar,
        &HashSet::new(),
    ) || more;
    let spared = unproven.into_iter().map(|delivered| delivered.kept).collect();
    let mut originals = done(folders)?;
    let even_more =
        past(&mut originals, keep.originals_days_max, keep.originals_mib_max, calendar, &spared);
    Ok(Past { results, withdrawn, originals, more: more || even_more })
}

/// Leaves of `items` those that are past a limit, and says whether there were too many for one go.
fn past(
    items: &mut Vec<Item>,
    days_max: f64,
    mib_max: f64,
    calendar: Option<i64>,
    spared: &HashSet<OsString>,
) -> bool {
    let mut bytes = items.iter().map(|item| item.bytes).sum::<u64>();
    items.sort_by(|a, b| (a.unix_s, &a.name).cmp(&(b.unix_s, &b.name)));
    items.retain(|item| {
        let old = calendar.is_some_and(|now| (now - item.unix_s) as f64 >= days_max * DAY_S);
        let goes = (old || bytes as f64 > mib_max * MIB) && !spared.contains(&item.name);
        bytes -= if goes { item.bytes } else { 0 };
        goes
    });
    let more = items.len() > AT_ONCE_MAX;
    items.truncate(AT_ONCE_MAX);
    more
}

/// The results in `folder` with a report of ours, whether they are still there or not.
fn reported(folders: &Folders, folder: &Path) -> Result<Vec<Item>, DaemonError> {
    let (disk, previews) = (folders.disk(), folders.previews());
    let mut items = Vec::new();
    let found = match disk.list(folder) {
        // Nothing was ever withdrawn.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(items),
        found => found.map_err(DaemonError::files("read the folder", folder))?,
    };
    for (name, kind) in found {
        let path = folder.join(&name);
        if kind != Kind::File || path.extension().is_none_or(|ending| ending != "json") {
            continue;
        }
        let report = atomic_file::read(disk, &path, BYTES_MAX)?;
        let Some(report) = report.and_then(|bytes| serde_json::from_slice::<Report>(&bytes).ok())
        else {
            continue;
        };
        let name = path.file_stem().unwrap_or_default().to_owned();
        let pictures = pictures(&name).map(|picture| previews.join(picture));
        let result = folder.join(&name);
        let all = pictures.iter().chain([&path, &result]);
        let bytes = all.map(|path| disk.look(path).map_or(0, |look| look.size)).sum();
        items.push(Item { unix_s: report.finished_unix_s as i64, bytes, name });
    }
    Ok(items)
}

/// The originals whose result was delivered.
fn done(folders: &Folders) -> Result<Vec<Item>, DaemonError> {
    let (disk, done) = (folders.disk(), folders.done());
    let mut items = Vec::new();
    for (name, kind) in disk.list(done).map_err(DaemonError::files("read the folder", done))? {
        if kind == Kind::File
            && !inbox::is_hidden(&name)
            && let Ok(look) = disk.look(&done.join(&name))
        {
            // Moving it here touched it; when the photo says it was made is its owner's business.
            items.push(Item { unix_s: look.touched_unix_s, bytes: look.size, name });
        }
    }
    Ok(items)
}

/// Names of the gallery's pictures of the result `name`.
fn pictures(name: &OsStr) -> [String; 3] {
    ["before", "after", "small"].map(|what| delivery::picture(name, what))
}

fn remove(folders: &Folders, past: &Past) -> Result<(), DaemonError> {
    let (disk, outbox, previews) = (folders.disk(), folders.outbox(), folders.previews());
    let remove = |path: &Path| match disk.remove(path) {
        // Its owner was quicker, or another box.
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(DaemonError::files("remove", path)(error))
        }
        _ => Ok(()),
    };
    for (folder, results) in [(outbox, &past.results), (&outbox.join(WITHDRAWN), &past.withdrawn)] {
        if results.is_empty() {
            continue;
        }
        for result in results {
            remove(&folder.join(&result.name))?;
        }
        // A result without report or pictures is nothing anybody could use.
        atomic_file::sync_folder(disk, folder)?;
        // The pictures under a withdrawn result's name are those of the one that took its place.
        if folder == outbox {
            for picture in results.iter().flat_map(|result| pictures(&result.name)) {
                remove(&previews.join(picture))?;
            }
            // Without the report nobody would find them any more.
            atomic_file::sync_folder(disk, previews)?;
        }
        for result in results {
            remove(&folder.join(report_name(&result.name)))?;
        }
    }
    past.originals.iter().try_for_each(|original| remove(&folders.done().join(&original.name)))
}
