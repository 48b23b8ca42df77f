//! Flaws of photo files; each message states what is wrong, what was found and what is allowed.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::metadata::HOLE_BYTES;
use crate::frame::Size;
use crate::remedy::{Remediable, Remedy};

/// A flaw of a file's content; [`PictureError`] adds the file's name.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum Flaw {
    #[error("the file is empty: found 0 bytes, allowed a whole photo")]
    Empty,
    #[error("this is no plain file: found {found}, allowed a photo file")]
    NotAFile { found: &'static str },
    #[error("the file is too long: found {found} bytes, allowed {allowed}")]
    TooLong { found: u64, allowed: u64 },
    /// Zeros in place of the picture, as in a copy whose space was reserved but not filled.
    #[error(
        "the file was never filled: found nothing but zero bytes from byte {from} to byte {to} of \
         {length}, allowed picture data; copy it again"
    )]
    ZeroFilled { from: usize, to: usize, length: usize },
    #[error(
        "this is not a photo: found {found}, allowed JPEG, PNG, TIFF, WebP, BMP, GIF or PPM; if an \
         image program opens it, save it there as JPEG or PNG"
    )]
    NotAPhoto { found: String },
    #[error(
        "this kind of photo is not read: found {found}, allowed JPEG, PNG, TIFF, WebP, BMP, GIF or \
         PPM; {to_do}"
    )]
    Unread { found: &'static str, to_do: &'static str },
    #[error(
        "the {kind} file is cut short: found {found}, allowed a file that goes on to {end}; copy \
         it again"
    )]
    Truncated { kind: &'static str, found: String, end: &'static str },
    #[error(
        "the {kind} file is damaged: found {found}, allowed {allowed}; copy it again, or save it \
         anew in an image program"
    )]
    Damaged { kind: &'static str, found: String, allowed: String },
    /// More pixels than the limit, by the header; found before anything is allocated.
    #[error(
        "the picture is too large: found {found} pixels by its header, allowed {allowed} pixels \
         in all; save it smaller, in the same shape"
    )]
    Oversized { found: Size, allowed: u64 },
    #[error("this variety of {kind} is not read: found {found}, allowed {allowed}")]
    Unsupported { kind: &'static str, found: String, allowed: &'static str },
    /// The decoder refused the file, or panicked.
    #[error(
        "the {kind} data cannot be decoded: found an incomplete or invalid file, allowed whole and \
         valid ones; copy the file again, or save it anew in an image program"
    )]
    Undecodable { kind: &'static str },
    /// The result would be smaller than the photo, which the rig file forbids.
    #[error(
        "the result would be smaller than the photo: found {found}, allowed at most {allowed} by \
         run.larger-photos = \"refuse\" in the rig file; save the photo at that size, or remove \
         that line"
    )]
    Larger { found: Size, allowed: Size },
    #[error(
        "the photo does not have this rig's shape: found {found}{held}, allowed {allowed} or the \
         same shape at another size; take the photo again in that shape and do not crop it: the \
         lens's blur varies across the sensor, and a cropped file does not record which part it \
         shows"
    )]
    Shape { found: Size, held: &'static str, allowed: Size },
    /// A raw photo of another size than the rig's sensor and photo.
    #[error(
        "a raw photo is not resampled: found {found} sites, allowed the rig's whole sensor, \
         {sensor}, or its photo, {allowed}; set the camera to raw photos of one of these sizes, \
         or develop it and save it as TIFF of 16 bits"
    )]
    RawSize { found: Size, allowed: Size, sensor: Size },
    /// A raw photo that this rig's camera, as it is set, cannot have taken; the text states what
    /// was found and what is allowed.
    #[error("this raw photo {0}")]
    OtherCamera(String),
}

/// Why a photo could not be read, or a result not encoded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum PictureError {
    #[error("cannot read the photo {path}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{name}: {flaw}")]
    Refused {
        name: String,
        #[source]
        flaw: Flaw,
    },
    #[error("{message}")]
    RefusedByWorker { message: String, growth: Growth },
    #[error("{name}: the worker process died while reading this photo: {how}")]
    Died { name: String, how: String },
    #[error("cannot start a worker to read photos")]
    NoWorker { source: std::io::Error },
    /// The result could not be encoded, which is a bug.
    #[error("cannot encode the result for {name}")]
    Encode { name: String, source: image::ImageError },
}

impl PictureError {
    /// The refusal of the file `name`, which is no plain file but `found`.
    pub fn not_a_file(name: &str, found: &'static str) -> PictureError {
        Flaw::NotAFile { found }.of(name)
    }

    /// Whether the refusal is final: more data would not change it.
    pub fn is_final(&self) -> bool {
        use PictureError::{Refused, RefusedByWorker};
        matches!(self, Refused { .. } | RefusedByWorker { .. }) && self.growth() == Growth::None
    }

    /// Whether more of the file may still arrive.
    pub fn growth(&self) -> Growth {
        match self {
            PictureError::Refused { flaw, .. } => flaw.growth(),
            PictureError::RefusedByWorker { growth, .. } => *growth,
            PictureError::Read { .. }
            | PictureError::Died { .. }
            | PictureError::NoWorker { .. }
            | PictureError::Encode { .. } => Growth::None,
        }
    }
}

impl Flaw {
    /// The refusal of the photo called `name`.
    pub(super) fn of(self, name: &str) -> PictureError {
        PictureError::Refused { name: name.to_owned(), flaw: self }
    }

    /// [`Flaw::ZeroFilled`] if `bytes` end in a hole of zeros, or else `other`.
    pub(super) fn hole_or(bytes: &[u8], other: Flaw) -> Flaw {
        let length = bytes.len();
        let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
        match zeros >= HOLE_BYTES {
            true => Flaw::ZeroFilled { from: length - zeros, to: length, length },
            false => other,
        }
    }

    fn growth(&self) -> Growth {
        match self {
            Flaw::Empty | Flaw::ZeroFilled { .. } | Flaw::Truncated { .. } => Growth::Likely,
            Flaw::Damaged { .. } | Flaw::Undecodable { .. } => Growth::Possible,
            _ => Growth::None,
        }
    }
}

/// Whether a refused file may still be incomplete.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Growth {
    /// No: more data would not change the refusal.
    None,
    /// Perhaps: copies that fill a file out of order look like damage meanwhile.
    Possible,
    /// Very likely: data are missing.
    Likely,
}

impl Remediable for PictureError {
    fn remedy(&self) -> Remedy {
        match self {
            PictureError::Read { .. } | PictureError::NoWorker { .. } => Remedy::RetryLater,
            PictureError::Refused { .. }
            | PictureError::RefusedByWorker { .. }
            | PictureError::Died { .. }
            | PictureError::Encode { .. } => Remedy::SkipPhoto,
        }
    }
}
