//! One photo from claim to outbox.

use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use crate::picture::{Growth, Photo, PictureError};
use crate::remedy::{Remediable, Remedy, full_message};
use crate::rig::Moment;

use super::ledger::{ATTEMPTS_MAX, Ledger};
use super::run::Daemon;
use super::withdrawal::Delivered;
use super::{DaemonError, Failed, Report, Step, atomic_file};
use crate::disk::Kind;
use crate::pipeline::Outcome;

/// Times one photo is begun again in one go when the rig stumbles. Guess.
const TRIES_MAX: u32 = 3;

/// How long a file that is damaged is watched for growth.
const GROWTH_WATCH_S: f64 = 1.0;

/// What became of a photo.
pub(super) enum Verdict {
    /// Its result is in the outbox.
    Restored {
        /// The report beside it.
        report: Box<Report>,
        /// Name of the original in `done`, and of the result.
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
    /// It was gone before it could be claimed.
    Gone,
}

/// Why a restoration has no picture.
pub(super) enum Refusal {
    Skip(String),
    Later(String),
    Hold(String),
    /// Its worker died.
    Died(String),
    /// Another box took it over.
    Lost,
}

/// A photo in `working`.
pub(super) struct Claimed {
    pub(super) path: PathBuf,
    pub(super) name: OsString,
    pub(super) ledger: Ledger,
    /// Its result is in the outbox, and safe.
    pub(super) delivered: bool,
}

impl Claimed {
    pub(super) fn shown(&self) -> String {
        self.name.to_string_lossy().into_owned()
    }
}

impl Daemon<'_> {
    /// Takes the photo at `way` from the inbox through the whole job.
    ///
    /// # Errors
    /// When the folders or the rig need help; the photo is then back in the inbox if that was
    /// possible, and in `working` otherwise, from where the next start takes it back.
    pub(super) fn job(&mut self, way: &Path) -> Result<Verdict, DaemonError> {
        let path = match self.folders.claim(way) {
            Ok(path) => path,
            Err(DaemonError::Files { source, .. }) if source.kind() == ErrorKind::NotFound => {
                return Ok(Verdict::Gone);
            }
            Err(error) => return Err(error),
        };
        self.watcher.step(Step::Claimed);
        let name = path.file_name().unwrap_or(path.as_os_str()).to_owned();
        let mut delivered = false;
        self.work_on(path, &name, &mut delivered).inspect_err(|_| {
            // The first error is the one to tell. If this meets another, it is tried again at the
            // next look.
            if self.settle(&name, delivered).is_err() {
                self.unsettled.push((name.clone(), delivered));
            }
        })
    }

    fn work_on(
        &mut self,
        path: PathBuf,
        name: &OsStr,
        delivered: &mut bool,
    ) -> Result<Verdict, DaemonError> {
        let look = self.folders.disk().look(&path).map_err(DaemonError::files("look at", &path))?;
        let ledger = Ledger::of(&self.folders, name, look)?;
        let mut photo = Claimed { path, name: name.to_owned(), ledger, delivered: false };
        if photo.ledger.attempts() >= ATTEMPTS_MAX {
            let reason = format!(
                "{}: the program ended while it worked on this photo: found {} such attempts, \
                 allowed {ATTEMPTS_MAX}",
                photo.shown(),
                photo.ledger.attempts()
            );
            return self.fail(&photo, reason);
        }
        let result = match look.kind {
            Kind::File => self.attempt(&mut photo),
            kind => Ok(Err(no_file(&photo, kind))),
        };
        *delivered = photo.delivered;
        match result? {
            Ok(report) => self.close(&photo, report),
            Err(Refusal::Skip(reason) | Refusal::Died(reason)) => self.fail(&photo, reason),
            Err(Refusal::Later(reason)) => {
                let left = Failed { photo: photo.shown(), reason };
                let way = self.settle(name, false)?.unwrap_or_else(|| PathBuf::from(name));
                Ok(Verdict::Left { way, left })
            }
            Err(Refusal::Lost) => {
                log::warn!("{}: given up, for another box took it over meanwhile", photo.shown());
                photo.ledger.close(&self.folders)?;
                Ok(Verdict::Gone)
            }
            // The error below puts it back.
            Err(Refusal::Hold(reason)) => Err(DaemonError::Held { reason }),
        }
    }

    fn attempt(&mut self, photo: &mut Claimed) -> Result<Result<Report, Refusal>, DaemonError> {
        // Whoever dropped it may not have waited until it was on the disk; from here on it is ours
        // to keep.
        let disk = self.folders.disk();
        disk.sync_file(&photo.path).map_err(DaemonError::files("synchronise", &photo.path))?;
        let read = loop {
            photo.ledger.begin(&self.folders)?;
            self.watcher.step(Step::Recorded);
            match self.read(photo) {
                Ok(read) => break read,
                Err(Refusal::Died(words)) if photo.ledger.attempts() < ATTEMPTS_MAX => {
                    log::warn!("{words}")
                }
                Err(Refusal::Died(words)) => {
                    let attempts = photo.ledger.attempts();
                    let reason =
                        format!("{words}; found {attempts} such attempts, allowed {ATTEMPTS_MAX}");
                    return Ok(Err(Refusal::Died(reason)));
                }
                Err(refusal) => return Ok(Err(refusal)),
            }
        };
        let restored = match self.restore_with_care(&read) {
            Ok(restored) => restored,
            Err(refusal) => return Ok(Err(refusal)),
        };
        self.watcher.step(Step::Restored);
        self.deliver(photo, &read, &restored)
    }

    fn read(&self, photo: &Claimed) -> Result<Photo, Refusal> {
        let path = &photo.path;
        let before = self.folders.disk().look(path).ok();
        let opened = self.folders.disk().open(path);
        let read = opened.map_err(|source| PictureError::Read { path: path.clone(), source });
        let error = match read
            .and_then(|file| self.setting.reader.photo(&photo.shown(), file, &self.setting))
        {
            Ok(read) => return Ok(read),
            Err(error) => error,
        };
        let words = full_message(&error);
        if matches!(error, PictureError::Died { .. }) {
            return Err(Refusal::Died(words));
        }
        if error.growth() != Growth::None {
            let now = self.clock.now();
            self.clock.wait_until(Moment(now.0 + GROWTH_WATCH_S));
            if self.folders.disk().look(path).ok() != before {
                return Err(Refusal::Later(format!("{words} (it is still being written)")));
            }
        }
        Err(refusal(error.remedy(), words))
    }

    /// Restores, and on a stumble of the rig does what the failure's remedy says and tries again.
    fn restore_with_care(&mut self, photo: &Photo) -> Result<Outcome, Refusal> {
        let mut tries = 1;
        let mut told_of = None;
        loop {
            let (watcher, restorer) = (&mut self.watcher, &mut self.restorer);
            let (lease, folders, clock) = (&self.lease, &self.folders, self.clock);
            let mut told = |progress| {
                lease.beat(folders, clock.now());
                watcher.progress(progress);
            };
            let restored = catch_unwind(AssertUnwindSafe(|| restorer.restore(photo, &mut told)));
            let error = match restored {
                Ok(Ok(restored)) if restored.picture.size() == photo.light.size() => {
                    return Ok(restored);
                }
                Ok(Ok(restored)) => {
                    let found = restored.picture.size();
                    let words = format!("a result of {found}, allowed {}", photo.light.size());
                    log::error!("{}: {words}", photo.name);
                    return Err(Refusal::Skip(format!(
                        "{}: a mistake of relens: found {words}",
                        photo.name
                    )));
                }
                Ok(Err(error)) => error,
                Err(_) => {
                    log::error!("{}: the restoration panicked", photo.name);
                    let what = "a mistake of relens: found a panic while restoring, allowed none";
                    return Err(Refusal::Skip(format!("{}: {what}", photo.name)));
                }
            };
            let words = format!("{}: {}", photo.name, full_message(&*error));
            match error.remedy() {
                Remedy::ShootAgain if tries < TRIES_MAX => {}
                remedy @ (Remedy::Recalibrate | Remedy::ReopenRig) if tries < TRIES_MAX => {
                    if told_of.as_ref() != Some(&words) {
                        log::warn!("{words}; the rig is being put right");
                    }
                    told_of = Some(words);
                    if let Err(error) = self.restorer.mend(remedy) {
                        return Err(Refusal::Hold(full_message(&*error)));
                    }
                }
                remedy => return Err(refusal(remedy, words)),
            }
            tries += 1;
        }
    }

    /// The result is safe: so is the original, and only then the record goes.
    fn close(&mut self, photo: &Claimed, report: Report) -> Result<Verdict, DaemonError> {
        let (disk, done) = (self.folders.disk(), self.folders.done());
        let kept = atomic_file::move_to(disk, &photo.path, done, &photo.name)?;
        self.watcher.step(Step::Moved);
        // Before the record goes: without it the photo would be restored a second time.
        atomic_file::sync_folder(disk, done)?;
        let result = photo.ledger.result().unwrap_or_default();
        photo.ledger.close(&self.folders)?;
        self.watcher.step(Step::Closed);
        let delivered =
            Delivered { kept: kept.file_name().unwrap_or(&photo.name).to_owned(), result };
        Ok(Verdict::Restored { report: Box::new(report), delivered })
    }

    /// Whether the photo is still this box's, and stays so for a while.
    ///
    /// # Errors
    /// When that cannot be told: the lease cannot be written, or the look meets an error.
    pub(super) fn is_ours(&self, photo: &Claimed) -> Result<bool, DaemonError> {
        self.lease.make_good(&self.folders, self.clock)?;
        match self.folders.disk().look(&photo.path) {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
            Err(error) => Err(DaemonError::files("look at", &photo.path)(error)),
        }
    }

    /// Sets the photo aside with its reason.
    fn fail(&self, photo: &Claimed, reason: String) -> Result<Verdict, DaemonError> {
        let failed = Failed { photo: photo.shown(), reason };
        let (disk, folder) = (self.folders.disk(), self.folders.failed());
        // A note without its photo is what a cut left of us, and is written anew.
        let taken = atomic_file::Taken::of(disk, folder)?;
        for name in (1..).map(|number| atomic_file::numbered(&photo.name, number)) {
            if taken.holds(&name) {
                continue;
            }
            let mut note = name.clone();
            note.push(".txt");
            atomic_file::replace(disk, folder, &note, failed.note().as_bytes())?;
            // The reason first: a photo set aside without one would be a riddle.
            atomic_file::sync_folder(disk, folder)?;
            match disk.rename_new(&photo.path, &folder.join(&name)) {
                Ok(()) => break,
                // Another box set a namesake aside since the look.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(DaemonError::files("move", &photo.path)(error)),
            }
        }
        atomic_file::sync_folder(disk, folder)?;
        photo.ledger.close(&self.folders)?;
        Ok(Verdict::Failed(failed))
    }
}

/// A link, a pipe, a device: no photo, and nothing to open.
fn no_file(photo: &Claimed, kind: Kind) -> Refusal {
    let found = match kind {
        Kind::Link => "a link",
        Kind::Folder => "a folder",
        Kind::File | Kind::Other => "a pipe or device",
    };
    Refusal::Skip(full_message(&PictureError::not_a_file(&photo.shown(), found)))
}

pub(super) fn refusal(remedy: Remedy, words: String) -> Refusal {
    match remedy {
        Remedy::SkipPhoto => Refusal::Skip(words),
        Remedy::RetryLater => Refusal::Later(words),
        // Tried often enough by now.
        Remedy::ShootAgain | Remedy::Recalibrate | Remedy::ReopenRig | Remedy::CallOperator => {
            Refusal::Hold(words)
        }
    }
}

/// Name of the report beside a result.
pub(super) fn report_name(result: &OsStr) -> OsString {
    let mut name = result.to_owned();
    name.push(".json");
    name
}
