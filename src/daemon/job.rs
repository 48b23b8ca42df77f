//! One photo from claim to outbox.

use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use super::error::DaemonError;
use super::setting::DaemonSetting;
use super::store::claim::{Claim, Claimed, JobStep, claim};
use super::store::deliver::{Delivery, Encoded};
use super::store::folders::Folders;
use super::store::ledger::ATTEMPTS_MAX;
use super::store::recover::settle;
use super::store::report_file::{Delivered, Failed, Report};
use super::watcher::Watcher;
use crate::disk::{FileError, FileKind};
use crate::frame::Size;
use crate::picture::{Growth, Photo, PictureError};
use crate::pipeline::Outcome;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::restorer::{Progress, Restorer};
use crate::rig::{Clock, Moment};

/// Times one photo is begun again in one go when the rig stumbles. Guess.
const TRIES_MAX: u32 = 3;

/// A damaged file that changed within as many seconds is watched for growth. Guess.
const LATELY_S: i64 = 10;

/// How long it is.
const GROWTH_WATCH_S: f64 = 1.0;

/// What became of a photo.
#[derive(Debug)]
pub enum JobEnd {
    /// Its result is in the outbox.
    Done {
        /// The report beside it.
        report: Box<Report>,
        /// Name of the original in `done`, and of the result in the outbox.
        delivered: Delivered,
    },
    /// It is in `failed`.
    Failed(Failed),
    /// It is back in the inbox, to be tried later.
    Left {
        /// The way to it from the inbox.
        way: PathBuf,
        /// Why.
        left: Failed,
    },
    /// It was removed from the inbox before it could be claimed.
    Gone,
}

/// Why a photo has no result.
#[derive(Debug, thiserror::Error)]
enum JobError {
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error("{0} (it is still being written)")]
    Growing(String),
    #[error("{0}")]
    Kept(String),
    #[error(
        "{photo}: the program ended while it worked on this photo: found {attempts} such \
         attempts, allowed {ATTEMPTS_MAX}"
    )]
    Interrupted { photo: String, attempts: u32 },
    #[error("{}; found {ATTEMPTS_MAX} such attempts, allowed {ATTEMPTS_MAX}", full_message(source))]
    Died { source: PictureError },
    #[error("{photo}: a mistake of relens: found a result of {found}, allowed {allowed}")]
    WrongSize { photo: String, found: Size, allowed: Size },
    #[error("{photo}: a mistake of relens: found a panic while restoring, allowed none")]
    Panicked { photo: String },
    #[error("{}", named(photo, full_message(&**failure)))]
    Rig { photo: String, failure: AnyFailure },
    #[error("{}: {}", mending(&**failure), full_message(&**failure))]
    Mending { remedy: Remedy, failure: AnyFailure },
    #[error(transparent)]
    Files(#[from] FileError),
}

/// `words` with the `photo`'s name before them, once.
fn named(photo: &str, words: String) -> String {
    let has_name = words.strip_prefix(photo).is_some_and(|rest| rest.starts_with(": "));
    if has_name { words } else { format!("{photo}: {words}") }
}

/// What became of putting the rig right.
fn mending(failure: &dyn Remediable) -> &'static str {
    match failure.was_asked_for() {
        true => "the rig was being put right for this photo",
        false => "the rig cannot be put right",
    }
}

impl Remediable for JobError {
    fn remedy(&self) -> Remedy {
        match self {
            JobError::Picture(error) => error.remedy(),
            JobError::Growing(_) | JobError::Kept(_) => Remedy::RetryLater,
            JobError::Interrupted { .. }
            | JobError::Died { .. }
            | JobError::WrongSize { .. }
            | JobError::Panicked { .. } => Remedy::SkipPhoto,
            JobError::Rig { failure, .. } => failure.remedy(),
            JobError::Mending { failure, .. } if failure.was_asked_for() => Remedy::RetryLater,
            JobError::Mending { .. } => Remedy::CallOperator,
            JobError::Files(error) => error.remedy(),
        }
    }
}

impl JobError {
    /// The same for the whole daemon, which holds for it.
    fn holds(self) -> DaemonError {
        match self {
            JobError::Files(error) => error.into(),
            JobError::Rig { photo, failure } => {
                DaemonError::Rig { about: format!("{photo}: "), failure }
            }
            JobError::Mending { remedy: Remedy::Recalibrate, failure } => {
                DaemonError::Calibration { why: "the rig ".to_owned(), failure }
            }
            JobError::Mending { failure, .. } => DaemonError::Rig { about: String::new(), failure },
            error => DaemonError::Rig { about: String::new(), failure: Box::new(error) },
        }
    }
}

/// What a job is done with.
pub(super) struct Job<'a> {
    pub(super) folders: &'a Folders,
    pub(super) setting: &'a DaemonSetting,
    pub(super) restorer: &'a mut dyn Restorer,
    pub(super) clock: &'a dyn Clock,
    pub(super) unix_s: &'a dyn Fn() -> u64,
    pub(super) watcher: &'a mut dyn Watcher,
    /// Told how far the restoration is.
    pub(super) further: &'a mut dyn FnMut(Progress),
    /// Photos that an error left in `working`: name, and whether their result was delivered.
    pub(super) unsettled: &'a mut Unsettled,
}

/// Photos that an error left in `working`.
#[derive(Debug, Default)]
pub(super) struct Unsettled(Vec<(std::ffi::OsString, bool)>);

impl Unsettled {
    /// Tries again what could not be made good before.
    pub(super) fn settle(&mut self, folders: &Folders) -> Result<(), FileError> {
        while let Some((name, delivered)) = self.0.last() {
            settle(folders, name, *delivered)?;
            self.0.pop();
        }
        Ok(())
    }
}

impl Job<'_> {
    /// Takes the photo at `way` from the inbox through the whole job.
    ///
    /// # Errors
    /// When the folders or the rig need help; the photo is then back in the inbox if that was
    /// possible, and in `working` otherwise, from where the next look or start takes it back.
    pub(super) fn work(mut self, way: &Path) -> Result<JobEnd, DaemonError> {
        let path = match claim(self.folders, way)? {
            Claim::Path(path) => path,
            Claim::Gone => return Ok(JobEnd::Gone),
            Claim::Refused(error) => {
                let photo = way.to_string_lossy().into_owned();
                let left = Failed { photo, reason: error.of_photo() };
                return Ok(JobEnd::Left { way: way.to_owned(), left });
            }
        };
        self.watcher.step(JobStep::Claimed);
        let name = path.file_name().unwrap_or(path.as_os_str()).to_owned();
        let mut delivered = false;
        self.work_on(path, &mut delivered).inspect_err(|_| {
            // The first error is the one to tell. If this meets another, it is tried again at the
            // next look.
            if settle(self.folders, &name, delivered).is_err() {
                self.unsettled.0.push((name.clone(), delivered));
            }
        })
    }

    fn work_on(&mut self, path: PathBuf, delivered: &mut bool) -> Result<JobEnd, DaemonError> {
        let folders = self.folders;
        let mut photo = match Claimed::at(folders, path) {
            // Taken away again by whoever dropped it.
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(JobEnd::Gone),
            claimed => claimed?,
        };
        let result = self.attempt(&mut photo);
        *delivered = photo.delivered;
        let error = match result {
            Ok(report) => {
                let delivered = photo.close(folders, &mut |step| self.watcher.step(step))?;
                return Ok(JobEnd::Done { report: Box::new(report), delivered });
            }
            Err(JobError::Files(error)) => return Err(error.into()),
            Err(error) => error,
        };
        let reason = full_message(&error);
        match error.remedy() {
            Remedy::SkipPhoto => Ok(JobEnd::Failed(photo.set_aside(folders, reason)?)),
            Remedy::RetryLater => {
                let left = Failed { photo: photo.shown(), reason };
                let way = settle(folders, &photo.name, false)?;
                Ok(JobEnd::Left { way: way.unwrap_or_else(|| PathBuf::from(&photo.name)), left })
            }
            // Tried often enough by now. The error puts the photo back.
            Remedy::ShootAgain | Remedy::Recalibrate | Remedy::ReopenRig | Remedy::CallOperator => {
                Err(error.holds())
            }
        }
    }

    /// Reads, restores and delivers the photo.
    fn attempt(&mut self, photo: &mut Claimed) -> Result<Report, JobError> {
        let attempts = photo.ledger.attempts();
        if attempts >= ATTEMPTS_MAX {
            return Err(JobError::Interrupted { photo: photo.shown(), attempts });
        }
        // A link, a pipe, a device: no photo, and nothing to open.
        let found = match photo.kind {
            FileKind::File => None,
            FileKind::Link => Some("a link"),
            FileKind::Folder => Some("a folder"),
            FileKind::Other => Some("a pipe or device"),
        };
        if let Some(found) = found {
            Err(PictureError::not_a_file(&photo.shown(), found))?;
        }
        // Whoever dropped it may not have waited until it was on the disk; from here on it is ours
        // to keep.
        let home = self.folders.inbox().join(&photo.name);
        self.folders.files().sync_file(&photo.path).map_err(|error| match error.is_of_disk() {
            true => JobError::Files(error),
            false => JobError::Kept(error.now_at(home).of_photo()),
        })?;
        let read = loop {
            photo.ledger.begin(self.folders)?;
            self.watcher.step(JobStep::Recorded);
            match self.read(photo) {
                Err(JobError::Picture(source @ PictureError::Died { .. })) => {
                    if photo.ledger.attempts() >= ATTEMPTS_MAX {
                        return Err(JobError::Died { source });
                    }
                    log::warn!("{}", full_message(&source));
                }
                read => break read?,
            }
        };
        let outcome = self.restore(&read)?;
        self.watcher.step(JobStep::Restored);
        let delivery = Delivery {
            folders: self.folders,
            photo: &read,
            outcome: &outcome,
            encoded: &Encoded::of(&read, &outcome)?,
            rig: &self.setting.rig,
            finished_unix_s: (self.unix_s)(),
        };
        Ok(delivery.deliver(photo, &mut |step| self.watcher.step(step))?)
    }

    fn read(&self, photo: &Claimed) -> Result<Photo, JobError> {
        let (files, path) = (self.folders.files(), &photo.path);
        let before = files.look(path).ok();
        let opened = files.raw().open(path);
        let opened =
            opened.map_err(|source| PictureError::Read { path: photo.shown().into(), source });
        let read = opened.and_then(|file| {
            self.setting.reader.photo(&photo.shown(), file, &self.setting.reading)
        });
        let error = match read {
            Ok(read) => return Ok(read),
            Err(error) => error,
        };
        // What has not changed for a while was waited for before: four hundred damaged photos would
        // keep the next one waiting for as many times the watch.
        let now = (self.unix_s)() as i64;
        let lately = before.is_none_or(|look| now - look.changed.0 < LATELY_S);
        let may_grow = error.growth() != Growth::None && lately;
        if may_grow && !matches!(error, PictureError::Died { .. }) {
            self.clock.wait_until(Moment(self.clock.now().0 + GROWTH_WATCH_S));
            if files.look(path).ok() != before {
                return Err(JobError::Growing(full_message(&error)));
            }
        }
        Err(error.into())
    }

    /// Restores, and on a stumble of the rig does what the failure's remedy says and tries again.
    fn restore(&mut self, photo: &Photo) -> Result<Outcome, JobError> {
        let mut tries = 1;
        let mut told_of = None;
        loop {
            let (watcher, restorer) = (&mut self.watcher, &mut self.restorer);
            let further = &mut self.further;
            let mut told = |progress| {
                watcher.progress(progress);
                further(progress);
            };
            let name = || photo.name.clone();
            let restored = catch_unwind(AssertUnwindSafe(|| restorer.restore(photo, &mut told)));
            let failure = match restored {
                Ok(Ok(restored)) => {
                    let (found, allowed) = (restored.picture.size(), photo.light.size());
                    if found == allowed {
                        return Ok(restored);
                    }
                    let error = JobError::WrongSize { photo: name(), found, allowed };
                    log::error!("{error}");
                    return Err(error);
                }
                Ok(Err(failure)) => failure,
                Err(_) => {
                    log::error!("{}: the restoration panicked", photo.name);
                    return Err(JobError::Panicked { photo: name() });
                }
            };
            let remedy = failure.remedy();
            let mends = matches!(remedy, Remedy::Recalibrate | Remedy::ReopenRig);
            let error = JobError::Rig { photo: name(), failure };
            if tries == TRIES_MAX || !(mends || remedy == Remedy::ShootAgain) {
                return Err(error);
            }
            if mends {
                let words = error.to_string();
                if told_of.as_ref() != Some(&words) {
                    log::warn!("{words}; the rig is being put right");
                }
                told_of = Some(words);
                let mended = self.restorer.mend(remedy);
                mended.map_err(|failure| JobError::Mending { remedy, failure })?;
            }
            tries += 1;
        }
    }
}
