//! A restored photo on its way to the outbox: report, pictures for the gallery, and last the result
//! itself.

use std::ffi::{OsStr, OsString};
use std::io::Read;
use std::path::Path;

use crate::frame::Channels;
use crate::picture::{Photo, PictureError, encode, preview};
use crate::remedy::{Remediable, full_message};

use super::job::{Claimed, Refusal, refusal, report_name};
use super::ledger::id;
use super::report::Circumstances;
use super::run::Daemon;
use super::{DaemonError, Report, Step, atomic_file};
use crate::pipeline::{Outcome, Verdict};

/// Longest side of the gallery's previews in pixels: a 1024×768 photo is shown pixel by pixel.
const PREVIEW_PX: usize = 1280;

/// Longest side of the small pictures by which one finds a photo.
const SMALL_PX: usize = 160;

/// A restored photo in the bytes of files.
struct Encoded {
    before: Vec<u8>,
    after: Vec<u8>,
    /// The result in the size of a stamp.
    small: Vec<u8>,
    /// `None` when the photo's own file is the result.
    result: Option<Vec<u8>>,
}

impl Daemon<'_> {
    /// Puts the result and all that belongs to it into the outbox; the result itself comes last.
    pub(super) fn deliver(
        &mut self,
        claimed: &mut Claimed,
        photo: &Photo,
        outcome: &Outcome,
    ) -> Result<Result<Report, Refusal>, DaemonError> {
        let encoded = match encoded(photo, outcome) {
            Ok(encoded) => encoded,
            Err(error) => return Ok(Err(refusal(error.remedy(), full_message(&error)))),
        };
        loop {
            let name = free_name(self, &claimed.name, photo.manner.format.extension())?;
            match self.deliver_as(&name, claimed, photo, outcome, &encoded) {
                // Another box took the name since the look.
                Err(error) if error.is_taken() => {}
                delivered => return Ok(delivered?.ok_or(Refusal::Lost)),
            }
        }
    }

    /// The report; none when the photo has become another box's.
    fn deliver_as(
        &mut self,
        result: &OsStr,
        claimed: &mut Claimed,
        photo: &Photo,
        outcome: &Outcome,
        encoded: &Encoded,
    ) -> Result<Option<Report>, DaemonError> {
        if !self.is_ours(claimed)? {
            return Ok(None);
        }
        claimed.ledger.name_result(&self.folders, result)?;
        self.watcher.step(Step::Named);
        let (disk, outbox, previews) =
            (self.folders.disk(), self.folders.outbox(), self.folders.previews());
        let picture = |what: &str| picture(result, what);
        let report = Report::new(
            photo,
            outcome,
            Circumstances {
                rig: &self.setting.rig,
                result,
                before: format!("gallery/{}", picture("before")),
                after: format!("gallery/{}", picture("after")),
                finished_unix_s: self.unix_s(),
            },
        );
        let json = serde_json::to_vec_pretty(&report).map_err(std::io::Error::other);
        let json = json.map_err(DaemonError::files("write the report of", result.as_ref()))?;
        let report_name = report_name(result);
        // The report comes first: it reserves the name, and the names of the pictures with it.
        atomic_file::write_new(disk, outbox, &report_name, &mut &json[..])?;
        atomic_file::replace(disk, previews, picture("before").as_ref(), &encoded.before)?;
        atomic_file::replace(disk, previews, picture("after").as_ref(), &encoded.after)?;
        atomic_file::sync_folder(disk, previews)?;
        // Not synchronised: where a cut has taken it, the page shows the large one instead.
        atomic_file::replace_for_now(disk, previews, picture("small").as_ref(), &encoded.small)?;
        self.watcher.step(Step::Reported);
        if !self.is_ours(claimed)? {
            disk.remove(&outbox.join(&report_name))
                .map_err(DaemonError::files("remove", outbox))?;
            // Or a cut brings it back, when nothing is known of it any more.
            atomic_file::sync_folder(disk, outbox)?;
            return Ok(None);
        }
        let mut original;
        let mut bytes = encoded.result.as_deref().unwrap_or_default();
        let content: &mut dyn Read = match encoded.result {
            Some(_) => &mut bytes,
            None => {
                original =
                    disk.open(&claimed.path).map_err(DaemonError::files("open", &claimed.path))?;
                &mut original
            }
        };
        atomic_file::write_new(disk, outbox, result, content).inspect_err(|error| {
            // Somebody put a file of that name there meanwhile: another name, and another report.
            if error.is_taken() {
                let _ = disk.remove(&outbox.join(&report_name));
            }
        })?;
        claimed.delivered = true;
        self.watcher.step(Step::Delivered);
        Ok(Some(report))
    }
}

fn encoded(photo: &Photo, outcome: &Outcome) -> Result<Encoded, PictureError> {
    let grey = photo.channels == Channels::Green;
    Ok(Encoded {
        before: preview(&photo.name, &photo.light, &photo.manner, grey, PREVIEW_PX)?,
        after: preview(&photo.name, &outcome.picture, &photo.manner, grey, PREVIEW_PX)?,
        small: preview(&photo.name, &outcome.picture, &photo.manner, grey, SMALL_PX)?,
        result: match outcome.verdict {
            Verdict::Untouched => None,
            Verdict::Sound | Verdict::Replaced => {
                Some(encode(&photo.name, &outcome.picture, &photo.manner, grey)?)
            }
        },
    })
}

/// Name of the gallery's picture of the result `name`: `before`, `after` or `small`.
pub(super) fn picture(name: &OsStr, what: &str) -> String {
    format!("{}-{what}.jpg", id(name))
}

/// The photo's name, with an ending if it has none, and a number if result or report exist already.
fn free_name(daemon: &Daemon<'_>, name: &OsStr, extension: &str) -> Result<OsString, DaemonError> {
    let mut wanted = name.to_owned();
    if Path::new(name).extension().is_none() {
        wanted.push(".");
        wanted.push(extension);
    }
    let taken = atomic_file::Taken::of(daemon.folders.disk(), daemon.folders.outbox())?;
    let names = (1..).map(|number| atomic_file::numbered(&wanted, number));
    let mut free = names.filter(|name| !taken.holds(name) && !taken.holds(&report_name(name)));
    Ok(free.next().unwrap_or(wanted))
}
