//! One photo from claim to outbox.

use std::ffi::{OsStr, OsString};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::picture::{Photo, PictureError, encode, preview};
use crate::remedy::{Remediable, Remedy, full_message};
use crate::rig::Moment;

use super::inbox::Look;
use super::ledger::{ATTEMPTS_MAX, Ledger, id};
use super::report::Circumstances;
use super::run::Daemon;
use super::{DaemonError, Failed, Report, Restored, Step, durable};

/// Times one photo is begun again in one go when the rig stumbles. Guess.
const TRIES_MAX: u32 = 3;

/// Longest side of the gallery's previews in pixels: a 1024×768 photo is shown pixel by pixel.
const PREVIEW_PX: usize = 1280;

/// How long a file that is not whole is watched for growth.
const GROWTH_WATCH_S: f64 = 1.0;

/// What became of a photo.
pub(super) enum Verdict {
    /// Its result is in the outbox.
    Restored {
        /// The report beside it.
        report: Box<Report>,
        /// Name of the original in `done`.
        kept: OsString,
    },
    /// It is in `failed`.
    Failed(Failed),
    /// It is back in the inbox, to be tried later.
    Left(Failed),
    /// It was gone before it could be claimed.
    Gone,
}

/// Why a restoration has no picture.
enum Refusal {
    Skip(String),
    Later(String),
    Hold(String),
}

impl Daemon<'_> {
    /// Takes the photo `name` from the inbox through the whole job.
    ///
    /// # Errors
    /// When the folders or the rig need help; the photo is then back in the inbox if that was possible, and
    /// in `working` otherwise, from where the next start takes it back.
    pub(super) fn job(&mut self, name: &OsStr) -> Result<Verdict, DaemonError> {
        let look = Look::at(&self.folders.inbox().join(name));
        let stale = Ledger::of(&self.folders, name);
        if stale.result().is_some() {
            // Of a namesake that was delivered; a stop after the claim must not take this photo for it.
            stale.close()?;
        }
        let path = match self.folders.claim(name) {
            Ok(path) => path,
            Err(DaemonError::Files { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Verdict::Gone);
            }
            Err(error) => return Err(error),
        };
        self.watcher.step(Step::Claimed);
        let name = path.file_name().unwrap_or(name).to_owned();
        let mut ledger = Ledger::of(&self.folders, &name);
        if ledger.attempts() >= ATTEMPTS_MAX {
            let reason = format!(
                "{}: the program ended while it worked on this photo: found {} such attempts, allowed {ATTEMPTS_MAX}",
                name.to_string_lossy(),
                ledger.attempts()
            );
            return self.fail(&path, &name, ledger, reason);
        }
        let result = ledger.begin().and_then(|()| {
            self.watcher.step(Step::Recorded);
            self.read_and_restore(&path, &name, look, &mut ledger)
        });
        match result {
            Ok(Ok(report)) => {
                let kept = durable::move_to(&path, &self.folders.done(), &name)?;
                self.watcher.step(Step::Moved);
                ledger.close()?;
                self.watcher.step(Step::Closed);
                let kept = kept.file_name().unwrap_or(&name).to_owned();
                Ok(Verdict::Restored { report: Box::new(report), kept })
            }
            Ok(Err(Refusal::Skip(reason))) => self.fail(&path, &name, ledger, reason),
            Ok(Err(Refusal::Later(reason))) => {
                self.put_back(&path, &name, ledger)?;
                Ok(Verdict::Left(Failed { photo: name.to_string_lossy().into_owned(), reason }))
            }
            Ok(Err(Refusal::Hold(reason))) => {
                self.put_back(&path, &name, ledger)?;
                Err(DaemonError::Held { reason })
            }
            Err(error) => {
                // The first error is the one to tell; where the photo is, the next start finds out.
                let _ = self.put_back(&path, &name, ledger);
                Err(error)
            }
        }
    }

    fn read_and_restore(
        &mut self,
        path: &Path,
        name: &OsStr,
        look: Option<Look>,
        ledger: &mut Ledger,
    ) -> Result<Result<Report, Refusal>, DaemonError> {
        let read = Photo::read(path, self.setting.curve, &self.setting.limits)
            .and_then(|photo| photo.fit(self.setting.photo_size));
        let photo = match read {
            Ok(photo) => photo,
            Err(error) => return Ok(Err(self.refusal_of(&error, path, look))),
        };
        let restored = match self.restore_with_care(&photo) {
            Ok(restored) => restored,
            Err(refusal) => return Ok(Err(refusal)),
        };
        self.watcher.step(Step::Restored);
        let bytes = std::fs::read(path).map_err(DaemonError::files("read", path))?;
        self.deliver(&photo, &restored, &bytes, name, ledger)
    }

    /// A file that is not whole may still be growing: then it is left, not failed.
    fn refusal_of(&self, error: &PictureError, path: &Path, look: Option<Look>) -> Refusal {
        let words = full_message(error);
        if error.may_be_growing() {
            let now = self.clock.now();
            self.clock.wait_until(Moment(now.0 + GROWTH_WATCH_S));
            if Look::at(path) != look {
                return Refusal::Later(format!("{words} (it is still being written)"));
            }
        }
        refusal(error.remedy(), words)
    }

    /// Restores, and on a stumble of the rig does what the failure's remedy says and tries again.
    fn restore_with_care(&mut self, photo: &Photo) -> Result<Restored, Refusal> {
        let mut tries = 1;
        loop {
            let watcher = &mut self.watcher;
            let restorer = &mut self.restorer;
            let restored =
                catch_unwind(AssertUnwindSafe(|| restorer.restore(photo, &mut |p| watcher.progress(p))));
            let error = match restored {
                Ok(Ok(restored)) if restored.picture.size() == photo.light.size() => return Ok(restored),
                Ok(Ok(restored)) => {
                    let found = restored.picture.size();
                    let words = format!("a result of {found}, allowed {}", photo.light.size());
                    log::error!("{}: {words}", photo.name);
                    return Err(Refusal::Skip(format!("{}: a mistake of relens: found {words}", photo.name)));
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
                    log::warn!("{words}; the rig is being put right");
                    if let Err(error) = self.restorer.mend(remedy) {
                        return Err(Refusal::Hold(full_message(&*error)));
                    }
                }
                remedy => return Err(refusal(remedy, words)),
            }
            tries += 1;
        }
    }

    /// Puts the result and all that belongs to it into the outbox; the result itself comes last.
    fn deliver(
        &mut self,
        photo: &Photo,
        restored: &Restored,
        bytes: &[u8],
        name: &OsStr,
        ledger: &mut Ledger,
    ) -> Result<Result<Report, Refusal>, DaemonError> {
        let grey = photo.channels == crate::frame::Channels::Green;
        let encoded = || -> Result<_, PictureError> {
            let before = preview(&photo.name, &photo.light, &photo.manner, grey, PREVIEW_PX)?;
            let after = preview(&photo.name, &restored.picture, &photo.manner, grey, PREVIEW_PX)?;
            let result = match restored.untouched {
                true => bytes.to_vec(),
                false => encode(&photo.name, &restored.picture, &photo.manner, grey)?,
            };
            Ok((before, after, result))
        };
        let (before, after, result) = match encoded() {
            Ok(all) => all,
            Err(error) => return Ok(Err(refusal(error.remedy(), full_message(&error)))),
        };
        let outbox = self.folders.outbox();
        let result_name = free_name(&outbox, name, photo.manner.format.extension());
        ledger.name_result(&result_name)?;
        self.watcher.step(Step::Named);
        let picture = |what: &str| format!("{}-{what}.jpg", id(&result_name));
        let folder = self.folders.previews();
        durable::replace(&folder, picture("before").as_ref(), &before)?;
        durable::replace(&folder, picture("after").as_ref(), &after)?;
        let report = Report::new(
            photo,
            restored,
            Circumstances {
                rig: &self.setting.rig,
                result: &result_name,
                before: format!("gallery/{}", picture("before")),
                after: format!("gallery/{}", picture("after")),
                bytes,
                finished_unix_s: self.unix_s(),
            },
        );
        let json = serde_json::to_vec_pretty(&report).map_err(std::io::Error::other);
        let json = json.map_err(DaemonError::files("write the report of", name.as_ref()))?;
        durable::write_new(&outbox, &report_name(&result_name), &json)?;
        self.watcher.step(Step::Reported);
        durable::write_new(&outbox, &result_name, &result)?;
        self.watcher.step(Step::Delivered);
        Ok(Ok(report))
    }

    /// Sets the photo aside with its reason.
    fn fail(
        &self,
        path: &Path,
        name: &OsStr,
        ledger: Ledger,
        reason: String,
    ) -> Result<Verdict, DaemonError> {
        let failed = Failed { photo: name.to_string_lossy().into_owned(), reason };
        let folder = self.folders.failed();
        let mut number = 1;
        // A note without its photo is what a cut left of us, and is written anew.
        while folder.join(durable::numbered(name, number)).symlink_metadata().is_ok() {
            number += 1;
        }
        let name = durable::numbered(name, number);
        let mut note = name.clone();
        note.push(".txt");
        durable::replace(&folder, &note, failed.note().as_bytes())?;
        durable::move_to(path, &folder, &name)?;
        ledger.close()?;
        Ok(Verdict::Failed(failed))
    }

    fn put_back(&self, path: &Path, name: &OsStr, ledger: Ledger) -> Result<(), DaemonError> {
        if let Some(result) = ledger.result() {
            // Nothing was delivered; a report without a result is no use to anyone.
            let _ = std::fs::remove_file(self.folders.outbox().join(report_name(&result)));
        }
        durable::move_to(path, &self.folders.inbox(), name)?;
        ledger.close()
    }
}

fn refusal(remedy: Remedy, words: String) -> Refusal {
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

/// The photo's name, with an ending if it has none, and a number if result or report exist already.
fn free_name(outbox: &Path, name: &OsStr, extension: &str) -> OsString {
    let mut wanted = name.to_owned();
    if Path::new(name).extension().is_none() {
        wanted.push(".");
        wanted.push(extension);
    }
    let taken = |name: &OsStr| outbox.join(name).symlink_metadata().is_ok();
    let mut number = 1;
    loop {
        let name = durable::numbered(&wanted, number);
        if !taken(&name) && !taken(&report_name(&name)) {
            return name;
        }
        number += 1;
    }
}
