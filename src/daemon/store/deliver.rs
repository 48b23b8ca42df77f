//! Delivery of a restored photo: report, gallery pictures, and last the result itself.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::claim::{Claimed, JobStep};
use super::folders::Folders;
use super::names::{PictureNames, free_result_name, report_name};
use super::report_file::Report;
use crate::disk::FileError;
use crate::disk::files::json_in_lines;
use crate::frame::{Channels, Size};
use crate::picture::{Photo, PictureError, encode, preview, result_name};
use crate::pipeline::{Outcome, Verdict};

/// Longest side of the gallery's previews, pixels. Larger pictures have a full-size copy beside
/// them.
const PREVIEW_PX: usize = 1280;

/// Longest side of the thumbnails, pixels.
const THUMBNAIL_PX: usize = 160;

/// Whether a picture of `size` is larger than its preview.
pub(crate) fn is_beyond_preview(size: Size) -> bool {
    size.width.max(size.height) > PREVIEW_PX
}

/// Encoded files of a restored photo.
pub(crate) struct Encoded {
    before: Vec<u8>,
    after: Vec<u8>,
    thumbnail: Vec<u8>,
    /// Photo and result at full size, where their previews are smaller.
    full_size: Option<[Vec<u8>; 2]>,
    /// `None` when the photo's own file is the result.
    result: Option<Vec<u8>>,
}

impl Encoded {
    pub(crate) fn of(photo: &Photo, outcome: &Outcome) -> Result<Encoded, PictureError> {
        let grey = photo.channels == Channels::Green;
        let jpeg = |picture, px| preview(&photo.name, picture, &photo.manner, grey, px);
        Ok(Encoded {
            before: jpeg(&photo.light, PREVIEW_PX)?,
            after: jpeg(&outcome.picture, PREVIEW_PX)?,
            thumbnail: jpeg(&outcome.picture, THUMBNAIL_PX)?,
            full_size: match is_beyond_preview(photo.light.size()) {
                true => {
                    Some([jpeg(&photo.light, usize::MAX)?, jpeg(&outcome.picture, usize::MAX)?])
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

pub(crate) struct Delivery<'a> {
    pub(crate) folders: &'a Folders,
    pub(crate) photo: &'a Photo,
    pub(crate) outcome: &'a Outcome,
    pub(crate) encoded: &'a Encoded,
    pub(crate) rig: &'a str,
    pub(crate) finished_unix_s: u64,
    pub(crate) number: u64,
}

impl Delivery<'_> {
    /// Writes the report, the pictures and last the result into the outbox; returns the report.
    pub(crate) fn deliver(
        &self,
        claimed: &mut Claimed,
        step: &mut dyn FnMut(JobStep),
    ) -> Result<Report, FileError> {
        let wanted = self.wanted_name(&claimed.name);
        let (files, outbox) = (&self.folders.files, &self.folders.outbox);
        loop {
            let name = free_result_name(files, outbox, wanted.clone())?;
            match self.deliver_as(&name, claimed, step) {
                // The name was taken since the check.
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
        let (folders, encoded) = (self.folders, self.encoded);
        claimed.ledger.name_result(folders, result)?;
        step(JobStep::Named);
        let (files, outbox, previews) = (&folders.files, &folders.outbox, &folders.previews);
        let names = PictureNames::of(result);
        let report = self.report(result, &names);
        let report_name = report_name(result);
        let report_path = outbox.join(&report_name);
        // The report comes first: it reserves the name, and the names of the pictures with it.
        let json = json_in_lines(&report, &report_path)?;
        files.write_new(outbox, &report_name, &mut &json[..])?;
        files.replace(previews, names.before.as_ref(), &encoded.before)?;
        files.replace_for_good(previews, names.after.as_ref(), &encoded.after)?;
        // Not synchronised: the page falls back to the preview.
        files.replace_for_now(previews, names.thumbnail.as_ref(), &encoded.thumbnail)?;
        for (name, bytes) in names.full_size.iter().zip(encoded.full_size.iter().flatten()) {
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
            // The name was taken meanwhile: the next attempt writes another report.
            if error.kind() == ErrorKind::AlreadyExists {
                let _ = files.remove(&report_path);
            }
        })?;
        claimed.delivered = true;
        step(JobStep::Delivered);
        Ok(report)
    }

    fn report(&self, result: &OsStr, names: &PictureNames) -> Report {
        let format = self.encoded.result.as_ref().map(|_| self.photo.manner.format);
        Report {
            before: format!("gallery/{}", names.before),
            after: format!("gallery/{}", names.after),
            finished_unix_s: self.finished_unix_s,
            number: self.number,
            ..Report::single(self.rig, self.photo, self.outcome, result.as_ref(), format)
        }
    }

    /// The photo's own name where its file is the result, else the name in the result's format.
    fn wanted_name(&self, name: &OsStr) -> OsString {
        match self.encoded.result.is_none() && Path::new(name).extension().is_some() {
            true => name.to_owned(),
            false => result_name(name, self.photo.manner.format),
        }
    }
}
