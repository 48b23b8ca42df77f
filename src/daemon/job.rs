//! One photo from claim to outbox.

use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use super::clocks::Clocks;
use super::error::DaemonError;
use super::setting::DaemonSetting;
use super::store::claim::{Claimed, JobStep, flat_name};
use super::store::deliver::{Encoded, deliver};
use super::store::folders::Folders;
use super::store::ledger::{ATTEMPTS_MAX, FileIdentity};
use super::store::recover::settle;
use super::store::report_file::{Delivered, Failed, Report};
use super::watcher::Watcher;
use crate::disk::{FileError, FileKind, Metadata, if_found};
use crate::picture::{Growth, Photo, PictureError, result_name};
use crate::pipeline::Outcome;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::restorer::{Progress, Restorer};
use crate::rig::Moment;

/// Attempts at a photo in one job when the rig fails. Guess.
const TRIES_MAX: u32 = 3;

/// A damaged file that changed within this many seconds is checked for growth. Guess.
const RECENT_S: u64 = 10;

/// Duration of the check for growth.
const GROWTH_WATCH_S: f64 = 1.0;

/// Outcome of a job.
#[derive(Debug)]
#[allow(missing_docs)] // Fields are described with their variants.
pub enum JobEnd {
    /// The result is in the outbox; `original` is the photo as it was taken.
    Done { report: Box<Report>, delivered: Delivered, original: Metadata },
    /// The photo is in `failed`.
    Failed(Failed),
    /// The photo is back in the inbox, at a path relative to it, to be tried later.
    Deferred { path: PathBuf, reason: String },
    /// The photo was removed from the inbox before it could be claimed.
    Gone,
}

#[derive(Debug, thiserror::Error)]
enum JobError {
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error("{} (it is still being written)", full_message(.0))]
    Growing(PictureError),
    #[error(
        "{photo}: it was written to while it was restored; it is restored again from the start"
    )]
    Changed { photo: String },
    #[error("{}", .0.message_for_owner())]
    NotDurable(FileError),
    #[error(
        "{photo}: the program ended while it was working on this photo: found {attempts} such \
         attempts, allowed {ATTEMPTS_MAX}"
    )]
    Interrupted { photo: String, attempts: u32 },
    #[error("{}; found {ATTEMPTS_MAX} such attempts, allowed {ATTEMPTS_MAX}", full_message(.0))]
    WorkerDied(PictureError),
    #[error("{photo}: internal error: {what}")]
    Internal { photo: String, what: String },
    #[error("{}", with_name(photo, full_message(&**failure)))]
    Rig { photo: String, failure: AnyFailure },
    #[error("{}: {}", describe_repair(&**failure), full_message(&**failure))]
    Repair { remedy: Remedy, failure: AnyFailure },
    #[error(transparent)]
    Files(#[from] FileError),
}

/// Puts the name of the `photo` before `message`, unless it is there already.
fn with_name(photo: &str, message: String) -> String {
    let has_name = message.strip_prefix(photo).is_some_and(|rest| rest.starts_with(": "));
    if has_name { message } else { format!("{photo}: {message}") }
}

fn describe_repair(failure: &dyn Remediable) -> &'static str {
    match failure.was_asked_for() {
        true => "the repair of the rig for this photo was cancelled",
        false => "the rig cannot be repaired",
    }
}

impl Remediable for JobError {
    fn remedy(&self) -> Remedy {
        match self {
            JobError::Picture(error) => error.remedy(),
            JobError::Growing(_) | JobError::Changed { .. } | JobError::NotDurable(_) => {
                Remedy::RetryLater
            }
            JobError::Interrupted { .. } | JobError::WorkerDied(_) | JobError::Internal { .. } => {
                Remedy::SkipPhoto
            }
            JobError::Rig { failure, .. } => failure.remedy(),
            JobError::Repair { failure, .. } if failure.was_asked_for() => Remedy::RetryLater,
            JobError::Repair { .. } => Remedy::CallOperator,
            JobError::Files(error) => error.remedy(),
        }
    }
}

impl From<JobError> for DaemonError {
    fn from(error: JobError) -> DaemonError {
        match error {
            JobError::Files(error) => error.into(),
            JobError::Rig { photo, failure } => DaemonError::Rig { photo: Some(photo), failure },
            JobError::Repair { remedy: Remedy::Recalibrate, failure } => {
                DaemonError::Calibration { cause: "the rig".to_owned(), failure }
            }
            JobError::Repair { failure, .. } => DaemonError::of_rig(failure),
            error => DaemonError::of_rig(Box::new(error)),
        }
    }
}

pub(super) struct Job<'a> {
    pub(super) folders: &'a Folders,
    pub(super) setting: &'a DaemonSetting,
    pub(super) restorer: &'a mut dyn Restorer,
    pub(super) clocks: &'a Clocks<'a>,
    /// Number of the job's report.
    pub(super) number: u64,
    pub(super) watcher: &'a mut dyn Watcher,
    pub(super) on_progress: &'a mut dyn FnMut(Progress),
    pub(super) unsettled: &'a mut Unsettled,
    /// Flaw for which the completeness check refused the photo, with the checked file's metadata.
    pub(super) refusal: Option<(Metadata, PictureError)>,
}

/// Photos left in `working` by an error: name, and whether the result was delivered.
#[derive(Debug, Default)]
pub(super) struct Unsettled(Vec<(std::ffi::OsString, bool)>);

impl Unsettled {
    pub(super) fn settle(&mut self, folders: &Folders) -> Result<(), FileError> {
        while let Some((name, delivered)) = self.0.last() {
            settle(folders, name, *delivered)?;
            self.0.pop();
        }
        Ok(())
    }
}

impl Job<'_> {
    /// Takes the photo at `path`, relative to the inbox, through the whole job.
    ///
    /// # Errors
    /// When the folders or the rig need help; the photo is then back in the inbox where possible,
    /// else in `working` until the next scan or start.
    pub(super) fn run(mut self, path: &Path) -> Result<JobEnd, DaemonError> {
        let (files, from) = (&self.folders.files, self.folders.inbox.join(path));
        let claimed = match files.move_to_own(&from, &self.folders.working, &flat_name(path)) {
            // The other cause of `NotFound` is a missing `working`.
            Err(error) if error.kind() == ErrorKind::NotFound && !files.exists(&from)? => {
                return Ok(JobEnd::Gone);
            }
            // This photo cannot be moved; others may.
            Err(error) if error.is_about(&from) && !error.is_of_disk() => {
                let reason = error.message_for_owner();
                return Ok(JobEnd::Deferred { path: path.to_owned(), reason });
            }
            moved => moved?,
        };
        self.watcher.step(JobStep::Claimed);
        let name = claimed.file_name().unwrap_or(claimed.as_os_str()).to_owned();
        let mut delivered = false;
        self.run_claimed(claimed, &mut delivered).inspect_err(|_| {
            // Only the job's error is reported; if settling fails, the next scan repeats it.
            if settle(self.folders, &name, delivered).is_err() {
                self.unsettled.0.push((name.clone(), delivered));
            }
        })
    }

    fn run_claimed(&mut self, path: PathBuf, delivered: &mut bool) -> Result<JobEnd, DaemonError> {
        let folders = self.folders;
        let Some(mut photo) = if_found(Claimed::at(folders, path))? else {
            // Removed by its owner, or `working` went away.
            folders.files.sync_folder(&folders.working)?;
            return Ok(JobEnd::Gone);
        };
        let result = self.attempt(&mut photo);
        *delivered = photo.delivered;
        let error = match result {
            Ok(report) => {
                let delivered = photo.close(folders, &mut |step| self.watcher.step(step))?;
                let original = photo.metadata;
                return Ok(JobEnd::Done { report: Box::new(report), delivered, original });
            }
            Err(JobError::Files(error)) => return Err(error.into()),
            Err(error) => error,
        };
        let reason = full_message(&error);
        match error.remedy() {
            Remedy::SkipPhoto => Ok(JobEnd::Failed(photo.reject(folders, reason)?)),
            Remedy::RetryLater => {
                let path = settle(folders, &photo.name, false)?;
                let path = path.unwrap_or_else(|| PathBuf::from(&photo.name));
                Ok(JobEnd::Deferred { path, reason })
            }
            // Retried often enough. The caller puts the photo back.
            Remedy::ShootAgain | Remedy::Recalibrate | Remedy::ReopenRig | Remedy::CallOperator => {
                Err(error.into())
            }
        }
    }

    fn attempt(&mut self, photo: &mut Claimed) -> Result<Report, JobError> {
        let attempts = photo.ledger.attempts();
        if attempts >= ATTEMPTS_MAX {
            return Err(JobError::Interrupted { photo: photo.display_name(), attempts });
        }
        let not_a_file = |found| PictureError::not_a_file(&photo.display_name(), found);
        match photo.metadata.kind {
            FileKind::File => {}
            FileKind::Link => Err(not_a_file("a link"))?,
            FileKind::Folder => Err(not_a_file("a folder"))?,
            FileKind::Other => Err(not_a_file("a pipe or device"))?,
        }
        let same = |(about, _): &_| FileIdentity::from(*about) == photo.metadata.into();
        if let Some((_, flaw)) = self.refusal.take_if(|refused| same(refused)) {
            Err(flaw)?;
        }
        // The writer may not have synchronised the file; from here on the daemon is responsible.
        let home = self.folders.inbox.join(&photo.name);
        self.folders.files.sync_file(&photo.path).map_err(|error| match error.is_of_disk() {
            true => JobError::Files(error),
            false => JobError::NotDurable(error.with_path(home)),
        })?;
        let read = loop {
            photo.ledger.begin(self.folders)?;
            self.watcher.step(JobStep::Recorded);
            match self.read(photo) {
                Err(JobError::Picture(error @ PictureError::Died { .. })) => {
                    if photo.ledger.attempts() >= ATTEMPTS_MAX {
                        return Err(JobError::WorkerDied(error));
                    }
                    log::warn!("{}", full_message(&error));
                }
                read => break read?,
            }
        };
        let outcome = self.restore(&read)?;
        self.watcher.step(JobStep::Restored);
        let files = &self.folders.files;
        if files.metadata(&photo.path)? != photo.metadata
            || files.checksum(&photo.path)? != (read.file.crc32, read.file.bytes)
        {
            return Err(JobError::Changed { photo: photo.display_name() });
        }
        let encoded = Encoded::of(&read, &outcome)?;
        let format = encoded.result.as_ref().map(|_| read.manner.format);
        // The photo's own name if its file is the result, else one with the format's extension.
        let wanted = match format.is_none() && Path::new(&photo.name).extension().is_some() {
            true => photo.name.clone(),
            false => result_name(&photo.name, read.manner.format),
        };
        let report = Report {
            finished_unix_s: self.clocks.unix_s(),
            number: self.number,
            ..Report::single(&self.setting.rig, &read, &outcome, wanted.as_ref(), format)
        };
        let step = &mut |step| self.watcher.step(step);
        Ok(deliver(self.folders, &wanted, &report, &encoded, photo, step)?)
    }

    fn read(&self, photo: &Claimed) -> Result<Photo, JobError> {
        let (files, path, name) = (&self.folders.files, &photo.path, photo.display_name());
        let before = files.metadata(path).ok();
        let unread =
            |error: FileError| PictureError::Read { path: (&name).into(), source: error.into() };
        let opened = files.open(path).map_err(unread);
        let error = match opened.and_then(|file| self.setting.photo(&name, file)) {
            Ok(read) => return Ok(read),
            Err(error) => error,
        };
        // Only recent files are watched: to wait for hundreds of damaged photos would delay others.
        let now = self.clocks.unix_s() as i64;
        // The time of change lies in the future if the calendar was set back since.
        let is_recent = |metadata: Metadata| now.abs_diff(metadata.changed.0) < RECENT_S;
        let is_recent = before.is_none_or(is_recent);
        if error.growth() != Growth::None && is_recent {
            self.clocks.clock.wait_until(Moment(self.clocks.moment().0 + GROWTH_WATCH_S));
            if files.metadata(path).ok() != before {
                return Err(JobError::Growing(error));
            }
        }
        Err(error.into())
    }

    /// Restores the photo, repairing the rig and retrying as a failure's remedy demands.
    fn restore(&mut self, photo: &Photo) -> Result<Outcome, JobError> {
        let mut tries = 1;
        loop {
            let error = match self.try_to_restore(photo) {
                Ok(restored) => return Ok(restored),
                Err(error) => error,
            };
            let remedy = error.remedy();
            let repairs = matches!(remedy, Remedy::Recalibrate | Remedy::ReopenRig);
            if tries == TRIES_MAX || !(repairs || remedy == Remedy::ShootAgain) {
                return Err(error);
            }
            if repairs {
                log::warn!("{error}; repairing the rig");
                let repaired = self.restorer.mend(remedy);
                repaired.map_err(|failure| JobError::Repair { remedy, failure })?;
            }
            tries += 1;
        }
    }

    fn try_to_restore(&mut self, photo: &Photo) -> Result<Outcome, JobError> {
        let (watcher, restorer) = (&mut self.watcher, &mut self.restorer);
        let on_progress = &mut self.on_progress;
        let mut report = |progress| {
            watcher.progress(progress);
            on_progress(progress);
        };
        let restored = catch_unwind(AssertUnwindSafe(|| restorer.restore(photo, &mut report)));
        let what = match restored {
            Ok(Ok(restored)) if restored.delivered(photo).size() != photo.light.size() => {
                let (found, allowed) = (restored.delivered(photo).size(), photo.light.size());
                format!("the result has {found} pixels, expected {allowed}")
            }
            Ok(restored) => {
                let of_rig = |failure| JobError::Rig { photo: photo.name.clone(), failure };
                return restored.map_err(of_rig);
            }
            Err(_) => "the restoration panicked".to_owned(),
        };
        let error = JobError::Internal { photo: photo.name.clone(), what };
        log::error!("{error}");
        Err(error)
    }
}
