//! What is written beside a result, and beside a photo that has none.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::deconvolution::stage::ResultStage;
use crate::disk::{FileError, Files};
use crate::frame::{Channels, Size};
use crate::picture::{Format, Photo};
use crate::pipeline::{Iteration, OpticalResidual, Outcome, Verdict};

/// A longer file is no report of ours.
pub(crate) const BYTES_MAX: u64 = 1 << 20;

/// What a result is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResultKind {
    /// The result is the restored picture.
    Restored,
    /// The result is the photo itself; the notes say why.
    Untouched,
}

/// The report beside a result, `NAME.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Report {
    /// Name of the photo as it was dropped.
    pub photo: String,
    /// Name of the result in the outbox.
    pub result: String,
    /// The same as a relative address, each byte that needs it escaped.
    pub result_address: String,
    /// What became of it.
    pub outcome: ResultKind,
    /// Name of the rig.
    pub rig: String,
    /// Name of the method.
    pub method: String,
    /// ResultStage that produced the result.
    pub stage: ResultStage,
    /// Why this stage.
    pub reason: String,
    /// Captures made.
    pub captures: usize,
    /// Seconds it took, captures included.
    pub seconds: f64,
    /// The optical residual, if a capture of the result was made.
    pub certificate: Option<OpticalResidual>,
    /// What the certificate means.
    pub meaning: Option<String>,
    /// Width and height restored, the rig's photo size.
    pub size: Size,
    /// Width and height of the photo as stored.
    pub stored: Size,
    /// Where the transfer curve came from.
    pub curve: String,
    /// Whether one channel was worked on, not three.
    pub grey: bool,
    /// EXIF orientation that was applied to the result; `None` when it is delivered as stored.
    pub turned: Option<u8>,
    /// Sentences for the customer.
    pub notes: Vec<String>,
    /// The method's record.
    pub iterations: Vec<Iteration>,
    /// CRC-32 of the photo's file, hexadecimal, and its length: which file this was made of.
    pub photo_crc32: String,
    /// Length of the photo's file in bytes.
    pub photo_bytes: u64,
    /// When it was finished, seconds since 1970 UTC by the box's calendar.
    pub finished_unix_s: u64,
    /// Address of the preview of the photo.
    pub before: String,
    /// Address of the preview of the result.
    pub after: String,
}

/// What the report needs beyond the photo and its restoration.
pub(crate) struct Circumstances<'a> {
    pub(crate) rig: &'a str,
    pub(crate) result: &'a OsStr,
    /// The result's format; of the photo's file itself there is none.
    pub(crate) format: Option<Format>,
    pub(crate) before: String,
    pub(crate) after: String,
    pub(crate) finished_unix_s: u64,
}

impl Report {
    pub(crate) fn new(photo: &Photo, outcome: &Outcome, about: Circumstances<'_>) -> Report {
        Report {
            photo: photo.name.clone(),
            result: about.result.to_string_lossy().into_owned(),
            result_address: address(about.result),
            outcome: match outcome.verdict {
                Verdict::Untouched => ResultKind::Untouched,
                Verdict::Sound | Verdict::Replaced => ResultKind::Restored,
            },
            rig: about.rig.to_owned(),
            method: outcome.method.to_owned(),
            stage: outcome.stage,
            reason: outcome.reason.clone(),
            captures: outcome.captures,
            seconds: outcome.seconds,
            certificate: outcome.certificate,
            meaning: outcome.certificate.map(|c| c.meaning()),
            size: photo.light.size(),
            stored: photo.stored,
            curve: photo.manner.tone.origin().to_owned(),
            grey: photo.channels == Channels::Green,
            turned: photo.turned(),
            notes: photo
                .report_notes(about.format)
                .into_iter()
                .chain(outcome.notes.clone())
                .collect(),
            iterations: outcome.iterations.clone(),
            photo_crc32: format!("{:08x}", photo.file.crc32),
            photo_bytes: photo.file.bytes,
            finished_unix_s: about.finished_unix_s,
            before: about.before,
            after: about.after,
        }
    }

    /// The report of a photo restored outside a drop folder, with its result of a `format` in
    /// `out`; without a format that is the photo's file itself.
    pub fn single(
        rig: &str,
        photo: &Photo,
        outcome: &Outcome,
        (out, format): (&Path, Option<Format>),
    ) -> Report {
        let result = out.file_name().unwrap_or(out.as_os_str());
        let (before, after) = (String::new(), String::new());
        Report::new(
            photo,
            outcome,
            Circumstances { rig, result, format, before, after, finished_unix_s: 0 },
        )
    }

    /// One line for the log.
    pub fn line(&self) -> String {
        let captures = if self.captures == 1 {
            "1 capture".into()
        } else {
            format!("{} captures", self.captures)
        };
        let certificate = self.certificate.map_or(String::new(), |c| {
            format!("; its photograph differs from the photo by {}", c.words())
        });
        let Report { size, stored, .. } = self;
        let outcome = match self.outcome {
            ResultKind::Restored if stored.area() > size.area() => {
                &*format!("comes back smaller, {size} for {stored}; restored")
            }
            ResultKind::Restored => "restored",
            ResultKind::Untouched => {
                let reason = &self.reason;
                return format!(
                    "{}: left as it was: {reason} ({captures}, {:.1} s)",
                    self.photo, self.seconds
                );
            }
        };
        format!(
            "{}: {outcome} ({}, {captures}, {:.1} s{certificate})",
            self.photo, self.method, self.seconds
        )
    }
}

/// A reason without its numbers, which stand in brackets at its end.
pub(crate) fn plain(reason: &str) -> &str {
    reason.strip_suffix(')').and_then(|r| r.rsplit_once(" (")).map_or(reason, |(words, _)| words)
}

/// A photo done and its result; names are bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Delivered {
    /// The original's name in `done`.
    pub kept: OsString,
    /// The result's name in the outbox.
    pub result: OsString,
}

/// Name of the report beside a result.
pub(crate) fn report_name(result: &OsStr) -> OsString {
    let mut name = result.to_owned();
    name.push(".json");
    name
}

/// The report `path`; `None` when there is none of ours.
pub(crate) fn read_report(files: &Files, path: &Path) -> Result<Option<Report>, FileError> {
    files.read_json(path, BYTES_MAX)
}

/// A photo without a result, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Failed {
    /// Its name.
    pub photo: String,
    /// What, found, allowed.
    pub reason: String,
}

impl Failed {
    /// The note put beside the photo in `failed/`; the reason is its third line.
    pub(crate) fn note(&self) -> String {
        let one_line = self.reason.replace(['\n', '\r'], " ");
        format!(
            "{} was not restored.\n\n{one_line}\n\nThe file lies beside this note, unchanged. To \
             have it tried again, put it back into the inbox.\n",
            self.photo
        )
    }

    /// Reads a [`note`](Self::note) back.
    pub(crate) fn of_note(photo: String, note: &str) -> Failed {
        let reason = note.lines().nth(2).unwrap_or("the reason is not written down").to_owned();
        Failed { photo, reason }
    }
}

/// A file name as a relative address: every byte that is not unreserved (RFC 3986 §2.3) escaped.
pub(crate) fn address(name: &OsStr) -> String {
    let mut text = String::new();
    for &byte in name.as_bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => {
                text.push(char::from(byte));
            }
            _ => text.push_str(&format!("%{byte:02X}")),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_cannot_leave_the_folder_or_the_attribute() {
        assert_eq!(address(OsStr::new("a b\"><é.jpg")), "a%20b%22%3E%3C%C3%A9.jpg");
        assert_eq!(address(OsStr::new("javascript:x/../y")), "javascript%3Ax%2F..%2Fy");
    }

    #[test]
    fn a_certificate_is_written_as_one_number_and_older_ones_are_read() {
        let of: OpticalResidual =
            serde_json::from_str("{\"residual-grey-levels\": 3.0, \"floor-grey-levels\": 2.0}")
                .unwrap();
        assert_eq!((of.residual_grey_levels, of.floor_grey_levels), (3.0, 2.0));
        let written = serde_json::to_string(&of).unwrap();
        let wanted = "{\"times-noise\":1.5,\"noise-grey-levels\":2.0,\"focus\":\"panel\"}";
        assert_eq!(written, wanted);
        assert_eq!(serde_json::from_str::<OpticalResidual>(&written).unwrap(), of);
    }

    #[test]
    fn a_note_is_read_back() {
        let failed = Failed {
            photo: "a.jpg".into(),
            reason: "cut short: found 3 bytes,\nallowed all".into(),
        };
        let back = Failed::of_note("a.jpg".into(), &failed.note());
        assert_eq!(back.reason, "cut short: found 3 bytes, allowed all");
    }
}
