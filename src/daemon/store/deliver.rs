//! A restored photo on its way to the outbox: report, pictures for the gallery, and last the result
//! itself.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::claim::{Claimed, JobStep};
use super::folders::Folders;
use super::ledger::id;
use super::report_file::{Circumstances, Report, report_name};
use crate::disk::FileError;
use crate::disk::files::{json_in_lines, numbered};
use crate::frame::{Channels, Size};
use crate::picture::{Photo, PictureError, encode, preview, result_name};
use crate::pipeline::{Outcome, Verdict};

/// Longest side of the gallery's previews in pixels. Larger pictures lie beside them, for whoever
/// looks at their pixels.
const PREVIEW_PX: usize = 1280;

/// Whether a preview of a picture of `size` has fewer pixels.
pub(crate) fn is_beyond_preview(size: Size) -> bool {
    size.width.max(size.height) > PREVIEW_PX
}

/// Longest side of the small pictures by which one finds a photo.
const SMALL_PX: usize = 160;

/// A restored photo in the bytes of files.
pub(crate) struct Encoded {
    before: Vec<u8>,
    after: Vec<u8>,
    /// The result in the size of a stamp.
    small: Vec<u8>,
    /// Photo and result pixel by pixel, where their previews are not.
    pixels: Option<[Vec<u8>; 2]>,
    /// `None` when the photo's own file is the result.
    result: Option<Vec<u8>>,
}

impl Encoded {
    /// `photo`, restored.
    pub(crate) fn of(photo: &Photo, outcome: &Outcome) -> Result<Encoded, PictureError> {
        let grey = photo.channels == Channels::Green;
        let shown = |picture, px| preview(&photo.name, picture, &photo.manner, grey, px);
        Ok(Encoded {
            before: shown(&photo.light, PREVIEW_PX)?,
            after: shown(&outcome.picture, PREVIEW_PX)?,
            small: shown(&outcome.picture, SMALL_PX)?,
            pixels: match is_beyond_preview(photo.light.size()) {
                true => {
                    Some([shown(&photo.light, usize::MAX)?, shown(&outcome.picture, usize::MAX)?])
                }
                false => None,
            },
            result: match outcome.verdict {
                Verdict::Untouched => None,
                Verdict::Sound | Verdict::Replaced => {
                    Some(encode(&photo.name, &outcome.picture, &photo.manner, grey)?)
                }
            },
        })
    }
}

/// A photo to be delivered.
pub(crate) struct Delivery<'a> {
    pub(crate) folders: &'a Folders,
    pub(crate) photo: &'a Photo,
    pub(crate) outcome: &'a Outcome,
    pub(crate) encoded: &'a Encoded,
    /// Name of the rig.
    pub(crate) rig: &'a str,
    pub(crate) finished_unix_s: u64,
}

impl Delivery<'_> {
    /// Puts the result and all that belongs to it into the outbox; the result itself comes last.
    pub(crate) fn deliver(
        &self,
        claimed: &mut Claimed,
        step: &mut dyn FnMut(JobStep),
    ) -> Result<Report, FileError> {
        loop {
            let name = self.free_name(&claimed.name)?;
            match self.deliver_as(&name, claimed, step) {
                // The name was taken since the look.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                delivered => return delivered,
            }
        }
    }

    fn deliver_as(
        &self,
        result: &OsStr,
        claimed: &mut Claimed,
        step: &mut dyn FnMut(JobStep),
    ) -> Result<Report, FileError> {
        let &Delivery { folders, photo, outcome, encoded, .. } = self;
        claimed.ledger.name_result(folders, result)?;
        step(JobStep::Named);
        let (files, outbox, previews) = (folders.files(), folders.outbox(), folders.previews());
        let [before, after, small, pixels @ ..] = pictures(result);
        let circumstances = Circumstances {
            rig: self.rig,
            result,
            format: encoded.result.as_ref().map(|_| photo.manner.format),
            before: format!("gallery/{before}"),
            after: format!("gallery/{after}"),
            finished_unix_s: self.finished_unix_s,
        };
        let report = Report::new(photo, outcome, circumstances);
        let report_name = report_name(result);
        let report_path = outbox.join(&report_name);
        // The report comes first: it reserves the name, and the names of the pictures with it.
        let json = json_in_lines(&report, &report_path)?;
        files.write_new(outbox, &report_name, &mut &json[..])?;
        files.replace(previews, before.as_ref(), &encoded.before)?;
        files.replace_for_good(previews, after.as_ref(), &encoded.after)?;
        // Not synchronised: where a cut has taken it, the page shows the large one instead.
        files.replace_for_now(previews, small.as_ref(), &encoded.small)?;
        for (name, bytes) in pixels.iter().zip(encoded.pixels.iter().flatten()) {
            files.replace_for_now(previews, name.as_ref(), bytes)?;
        }
        step(JobStep::Reported);
        let (mut original, mut bytes);
        let content: &mut dyn Read = match &encoded.result {
            Some(encoded) => {
                bytes = &encoded[..];
                &mut bytes
            }
            None => {
                original = files.open(&claimed.path)?;
                &mut original
            }
        };
        files.write_new(outbox, result, content).inspect_err(|error| {
            // Somebody put a file of that name there meanwhile: another name, and another report.
            if error.kind() == ErrorKind::AlreadyExists {
                let _ = files.remove(&report_path);
            }
        })?;
        claimed.delivered = true;
        step(JobStep::Delivered);
        Ok(report)
    }

    /// The photo's name, with an ending if it has none or the result is in another format, and a
    /// number if result or report exist already.
    fn free_name(&self, name: &OsStr) -> Result<OsString, FileError> {
        // The photo's own file keeps the name it came with.
        let keeps = self.encoded.result.is_none() && Path::new(name).extension().is_some();
        let format = self.photo.manner.format;
        let wanted = if keeps { name.to_owned() } else { result_name(name, format) };
        let taken = self.folders.files().taken_names(self.folders.outbox())?;
        let mut names = numbered(&wanted);
        let free = names.find(|name| !taken.holds(name) && !taken.holds(&report_name(name)));
        Ok(free.unwrap_or(wanted))
    }
}

/// Names of the gallery's pictures of the result `name`: before, after and small; before and after
/// pixel by pixel, which large ones have.
pub(super) fn pictures(name: &OsStr) -> [String; 5] {
    ["before", "after", "small", "before-pixels", "after-pixels"]
        .map(|what| format!("{}-{what}.jpg", id(name)))
}
