//! Delivery of a restored photo: report, gallery pictures, and last the result itself.

use std::ffi::OsStr;
use std::io::ErrorKind;

use super::claim::{Claimed, JobStep};
use super::folders::Folders;
use super::names::{full_size_address, preview_names, report_name, thumbnail_address};
use super::report_file::Report;
use crate::disk::FileError;
use crate::disk::files::{TakenNames, json_in_lines};
use crate::frame::{Channels, Size};
use crate::picture::{Photo, PictureError, encode, preview};
use crate::pipeline::{Outcome, Verdict};

/// Longest side of the gallery's previews, pixels. Larger pictures have a full-size copy beside
/// their preview.
const PREVIEW_PX: usize = 1280;

/// Longest side of the thumbnails, pixels.
const THUMBNAIL_PX: usize = 160;

/// Whether a picture of `size` is larger than its preview.
pub(crate) fn is_beyond_preview(size: Size) -> bool {
    size.width.max(size.height) > PREVIEW_PX
}

pub(crate) struct Encoded {
    before: Vec<u8>,
    after: Vec<u8>,
    thumbnail: Vec<u8>,
    /// Photo and result at full size, where their previews are smaller.
    full_size: Option<[Vec<u8>; 2]>,
    /// `None` when the photo's own file is the result.
    pub(crate) result: Option<Vec<u8>>,
}

impl Encoded {
    pub(crate) fn of(photo: &Photo, outcome: &Outcome) -> Result<Encoded, PictureError> {
        let grey = photo.channels == Channels::Green;
        let jpeg = |picture, px| preview(&photo.name, picture, &photo.manner, grey, px);
        let delivered = outcome.delivered(photo);
        let picture = delivered.whole();
        let encoded = Encoded {
            before: jpeg(&photo.light, PREVIEW_PX)?,
            after: jpeg(&picture, PREVIEW_PX)?,
            thumbnail: jpeg(&picture, THUMBNAIL_PX)?,
            full_size: match is_beyond_preview(photo.light.size()) {
                true => Some([jpeg(&photo.light, usize::MAX)?, jpeg(&picture, usize::MAX)?]),
                false => None,
            },
            result: None,
        };
        // Freed first, since the result of a large photo needs the memory.
        drop(picture);
        Ok(Encoded {
            result: match outcome.verdict {
                Verdict::Untouched => None,
                Verdict::Sound | Verdict::Replaced => {
                    Some(encode(&photo.name, delivered, &photo.manner, grey)?)
                }
            },
            ..encoded
        })
    }
}

/// Writes the report, the pictures and last the result of the photo `claimed` into the outbox,
/// under the `wanted` name or a numbered one; returns the report with its names.
pub(crate) fn deliver(
    folders: &Folders,
    wanted: &OsStr,
    report: &Report,
    encoded: &Encoded,
    claimed: &mut Claimed,
    step: &mut dyn FnMut(JobStep),
) -> Result<Report, FileError> {
    let is_taken =
        |taken: &TakenNames, name: &OsStr| taken.holds(name) || taken.holds(&report_name(name));
    let (files, outbox, previews) = (&folders.files, &folders.outbox, &folders.previews);
    files.with_free_name(outbox, wanted, &is_taken, &mut |result| {
        claimed.ledger.name_result(folders, result)?;
        step(JobStep::Named);
        let names = preview_names(result);
        let report = report.named(result, &names);
        let report_name = report_name(result);
        let report_path = outbox.join(&report_name);
        // The report comes first: it reserves the name, and the names of the pictures with it.
        let json = json_in_lines(&report, &report_path)?;
        files.write_new(outbox, &report_name, &mut &json[..])?;
        let [before, after] = &names;
        files.replace(&previews.join(before), &encoded.before)?;
        files.replace_for_good(&previews.join(after), &encoded.after)?;
        // Not synchronised: the page falls back to the preview.
        files.replace_for_now(&previews.join(thumbnail_address(after)), &encoded.thumbnail)?;
        for (name, bytes) in names.iter().zip(encoded.full_size.iter().flatten()) {
            files.replace_for_now(&previews.join(full_size_address(name)), bytes)?;
        }
        step(JobStep::Reported);
        let written = match &encoded.result {
            Some(bytes) => files.write_new(outbox, result, &mut &bytes[..]),
            None => files.write_new(outbox, result, &mut files.open(&claimed.path)?),
        };
        written.inspect_err(|error| {
            // The name was taken meanwhile: the next attempt writes another report.
            if error.kind() == ErrorKind::AlreadyExists {
                let _ = files.remove(&report_path);
            }
        })?;
        claimed.delivered = true;
        step(JobStep::Delivered);
        Ok(report)
    })
}
