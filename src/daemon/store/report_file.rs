//! The report beside a result and the note beside a rejected photo.

use std::ffi::{OsStr, OsString};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::names::address;
use crate::deconvolution::stage::ResultStage;
use crate::frame::{Channels, Rect, Size};
use crate::picture::{Format, Photo};
use crate::pipeline::{Iteration, OpticalResidual, Outcome, Verdict, areas, counted};

/// Content of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResultKind {
    /// The restored picture.
    Restored,
    /// The photo itself; [`Report::reason`] states why.
    Untouched,
}

/// A rectangle of the upright picture, in shares of its width and height, 0..1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)] // The names describe them.
pub struct RelativeRect {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

fn left_as_they_were(photo: &Photo, outcome: &Outcome) -> Vec<RelativeRect> {
    let Some(outliers) = &outcome.outliers else { return Vec::new() };
    let weight = photo.upright(&outliers.weight);
    let of_width = |px: usize| px as f64 / weight.width() as f64;
    let of_height = |px: usize| px as f64 / weight.height() as f64;
    let areas = areas(&weight).into_iter().map(|Rect { x, y, size }| RelativeRect {
        x: of_width(x),
        y: of_height(y),
        width: of_width(size.width),
        height: of_height(size.height),
    });
    areas.collect()
}

/// The report beside a result, `NAME.json`. Addresses are relative URLs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // The names describe them.
pub struct Report {
    /// File name of the photo as dropped.
    pub photo: String,
    /// File name of the result in the outbox.
    pub result: String,
    pub result_address: String,
    pub outcome: ResultKind,
    pub rig: String,
    pub method: String,
    /// Stage that produced the result.
    pub stage: ResultStage,
    /// Why the result is of this stage.
    pub reason: String,
    pub captures: usize,
    /// Duration in seconds, captures included.
    pub seconds: f64,
    /// Optical residual, if the result was captured.
    pub certificate: Option<OpticalResidual>,
    /// The certificate in words.
    pub meaning: Option<String>,
    /// Size of the restored picture.
    pub size: Size,
    /// Size of the photo as stored.
    pub stored: Size,
    /// Source of the transfer curve.
    pub curve: String,
    /// Whether a single channel was restored.
    pub grey: bool,
    /// EXIF orientation applied to the result; `None` when it is delivered as stored.
    pub turned: Option<u8>,
    /// Areas delivered as in the photo, because no scene could give them through the lens.
    #[serde(default)]
    pub left_as_they_were: Vec<RelativeRect>,
    pub notes: Vec<String>,
    /// Record of the method's steps.
    pub iterations: Vec<Iteration>,
    /// CRC-32 of the photo's file, hexadecimal.
    pub photo_crc32: String,
    /// Length of the photo's file in bytes.
    pub photo_bytes: u64,
    /// Time of completion, seconds since 1970 UTC by the box's calendar.
    pub finished_unix_s: u64,
    /// Position in the order of results, which times do not give if the calendar was set; 0 in
    /// reports of older versions.
    #[serde(default)]
    pub number: u64,
    pub before: String,
    pub after: String,
}

impl Report {
    /// Creates the report of a photo restored into the file `out`, outside a gallery. `format` is
    /// `None` if the result is the photo's own file.
    pub fn single(
        rig: &str,
        photo: &Photo,
        outcome: &Outcome,
        out: &Path,
        format: Option<Format>,
    ) -> Report {
        let result = out.file_name().unwrap_or(out.as_os_str());
        Report {
            photo: photo.name.clone(),
            result: result.to_string_lossy().into_owned(),
            result_address: address(result),
            outcome: match outcome.verdict {
                Verdict::Untouched => ResultKind::Untouched,
                Verdict::Sound | Verdict::Replaced => ResultKind::Restored,
            },
            rig: rig.to_owned(),
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
            left_as_they_were: left_as_they_were(photo, outcome),
            notes: photo.report_notes(format).into_iter().chain(outcome.notes.clone()).collect(),
            iterations: outcome.iterations.clone(),
            photo_crc32: format!("{:08x}", photo.file.crc32),
            photo_bytes: photo.file.bytes,
            finished_unix_s: 0,
            number: 0,
            before: String::new(),
            after: String::new(),
        }
    }

    /// Copy of the report for the file `result`, with its `previews` in the gallery.
    pub(super) fn named(&self, result: &OsStr, previews: &[String; 2]) -> Report {
        let [before, after] = previews;
        Report {
            result: result.to_string_lossy().into_owned(),
            result_address: address(result),
            before: format!("gallery/{before}"),
            after: format!("gallery/{after}"),
            ..self.clone()
        }
    }

    /// Line for the log.
    pub fn line(&self) -> String {
        let Report { photo, method, reason, seconds, size, stored, .. } = self;
        let captures = counted(self.captures, "capture");
        if self.outcome == ResultKind::Untouched {
            return format!("{photo}: returned unchanged: {reason} ({captures}, {seconds:.1} s)");
        }
        let smaller = match stored.area() > size.area() {
            true => format!(" smaller, {size} instead of {stored}"),
            false => String::new(),
        };
        let certificate = self.certificate.map_or(String::new(), |c| {
            format!("; captured again, it differs from the photo by {}", c.words())
        });
        format!("{photo}: restored{smaller} ({method}, {captures}, {seconds:.1} s{certificate})")
    }
}

/// Removes the numbers in brackets at the end of `reason`.
pub(crate) fn without_numbers(reason: &str) -> &str {
    reason.strip_suffix(')').and_then(|r| r.rsplit_once(" (")).map_or(reason, |(words, _)| words)
}

/// File names of a delivered photo; names are bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Delivered {
    /// The original in `done`.
    pub kept: OsString,
    /// The result in the outbox.
    pub result: OsString,
}

/// A photo without a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // The names describe them.
pub struct Failed {
    pub photo: String,
    pub reason: String,
}

impl Failed {
    /// The note beside the photo in `failed`; its third line is the reason.
    pub(crate) fn note(&self) -> String {
        let one_line = self.reason.replace(['\n', '\r'], " ");
        format!(
            "{} was not restored.\n\n{one_line}\n\nThe photo is beside this note, unchanged. To \
             try again, put it back into the inbox.\n",
            self.photo
        )
    }

    /// Parses a [`note`](Self::note).
    pub(crate) fn of_note(photo: String, note: &str) -> Failed {
        let reason = note.lines().nth(2).unwrap_or("the note holds no reason").to_owned();
        Failed { photo, reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::CertifiedFocus;

    #[test]
    fn a_certificate_is_written_as_one_number_and_read_back() {
        let of = OpticalResidual {
            residual_grey_levels: 3.0,
            floor_grey_levels: 2.0,
            focus: CertifiedFocus::Panel,
            of_any_sensor: false,
        };
        let written = serde_json::to_string(&of).unwrap();
        let wanted = "{\"times-noise\":1.5,\"noise-grey-levels\":2.0,\"focus\":\"panel\",\
             \"of-any-sensor\":false}";
        assert_eq!(written, wanted);
        assert_eq!(serde_json::from_str::<OpticalResidual>(&written).unwrap(), of);
    }

    #[test]
    fn the_reason_in_a_note_is_read_back() {
        let failed = Failed {
            photo: "a.jpg".into(),
            reason: "cut short: found 3 bytes,\nallowed all".into(),
        };
        let back = Failed::of_note("a.jpg".into(), &failed.note());
        assert_eq!(back.reason, "cut short: found 3 bytes, allowed all");
    }
}
