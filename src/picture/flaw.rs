//! What can be wrong with a photo file, each in its own sentence: what, found, allowed.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::frame::{Mosaic, Size};
use crate::remedy::{Remediable, Remedy};

/// What is wrong with the content of a file. The file's name is added by [`PictureError`].
#[derive(Debug, thiserror::Error)]
pub enum Flaw {
    /// Zero bytes long.
    #[error("the file is empty: found 0 bytes, allowed a whole photo")]
    Empty,
    /// Not a plain file.
    #[error("this is no plain file: found {found}, allowed a photo itself, not a way to one")]
    NotAFile {
        /// What it is.
        found: &'static str,
    },
    /// Longer than the box is prepared to read.
    #[error("the file is too long: found {found} bytes, allowed {allowed}")]
    TooLong {
        /// Its length.
        found: u64,
        /// The limit.
        allowed: u64,
    },
    /// Zeros where the picture should be, as a copy leaves that reserved the space and never filled
    /// it.
    #[error(
        "the file was never filled: found nothing but zero bytes from byte {from} to byte {to} of \
         {length}, allowed picture data; copy it again"
    )]
    ZeroFilled {
        /// First zero byte.
        from: usize,
        /// One past the last zero byte.
        to: usize,
        /// Length of the file.
        length: usize,
    },
    /// Some other kind of file.
    #[error("this is not a photo: found {found}, allowed JPEG, PNG, TIFF, WebP, BMP or GIF")]
    NotAPhoto {
        /// What the content says it is.
        found: String,
    },
    /// A photo of a kind that is not read.
    #[error(
        "this kind of photo is not read: found {found}, allowed JPEG, PNG, TIFF, WebP, BMP or GIF; \
         {to_do}"
    )]
    Unread {
        /// What the content says it is.
        found: &'static str,
        /// What to do with it.
        to_do: &'static str,
    },
    /// The file ends before the picture does.
    #[error(
        "the {kind} file is cut short: found {found}, allowed a file that goes on to {end}; copy \
         it again"
    )]
    Truncated {
        /// Kind of file.
        kind: &'static str,
        /// Where it stops.
        found: String,
        /// What a whole file ends with.
        end: &'static str,
    },
    /// The file is complete but something in it is not as written.
    #[error("the {kind} file is damaged: found {found}, allowed {allowed}")]
    Damaged {
        /// Kind of file.
        kind: &'static str,
        /// What was found.
        found: String,
        /// What should have been there.
        allowed: String,
    },
    /// More pixels than the box is prepared to hold; read from the header, before anything is
    /// allocated.
    #[error(
        "the picture is too large: found {found} pixels by its header, allowed {allowed} pixels \
         in all; save it smaller, in the same shape"
    )]
    Oversized {
        /// Width and height by the header.
        found: Size,
        /// Largest area.
        allowed: u64,
    },
    /// A variety of the format that is not read.
    #[error("this variety of {kind} is not read: found {found}, allowed {allowed}")]
    Unsupported {
        /// Kind of file.
        kind: &'static str,
        /// What was found.
        found: String,
        /// What is read.
        allowed: &'static str,
    },
    /// The decoder refused it.
    #[error(
        "the {kind} data cannot be decoded, allowed are whole and valid files; copy it again, or \
         save it anew in an image program"
    )]
    Undecodable {
        /// Kind of file.
        kind: &'static str,
    },
    /// Its result would be smaller, and the rig file will have none that are.
    #[error(
        "the result would be smaller than the photo: found {found}, allowed at most {allowed}, for \
         the rig file says run.larger-photos = \"refuse\"; save the photo at that size, or take \
         the line out"
    )]
    Larger {
        /// Width and height as stored.
        found: Size,
        /// The rig's photo size.
        allowed: Size,
    },
    /// The decoder panicked, which hostile or damaged files can make it do.
    #[error(
        "the {kind} decoder gave up on this file: found data that broke it, allowed are valid files"
    )]
    BrokeTheDecoder {
        /// Kind of file.
        kind: &'static str,
    },
    /// Not the rig's shape.
    #[error(
        "the photo has not this rig's shape: found {found}{held}, allowed {allowed} or the same \
         shape at another size; set the camera to that shape and take the photo again, whole and \
         not cropped: a lens blurs each place in its own way, and a crop does not say where it was"
    )]
    Shape {
        /// Width and height as stored.
        found: Size,
        /// A remark on how the camera was held, or nothing.
        held: &'static str,
        /// The rig's photo size.
        allowed: Size,
    },
    /// A raw photo that is not the rig's, site for site.
    #[error(
        "a raw photo is not resampled: found {found} sites, allowed the rig's whole sensor, \
         {sensor}, or its photo, {allowed}"
    )]
    RawSize {
        /// Sites of the file.
        found: Size,
        /// The rig's photo size.
        allowed: Size,
        /// The rig's sensor's.
        sensor: Size,
    },
    /// A raw photo that another rig took.
    #[error(
        "this raw photo was taken by another rig, whose lens is another: found {found}, allowed \
         {allowed}"
    )]
    OtherRig {
        /// Maker and model.
        found: String,
        /// This rig's.
        allowed: String,
    },
    /// A raw photo that this rig took at another focus or aperture, or with another camera.
    #[error(
        "this raw photo was taken otherwise than the lens was measured: {what} found {found}, \
         allowed {allowed}; see camera.focus in the rig file"
    )]
    OtherSetting {
        /// What differs.
        what: &'static str,
        /// The photo's.
        found: String,
        /// The rig's.
        allowed: String,
    },
    /// A raw photo of a sensor that is not the rig's.
    #[error(
        "this raw photo is of another sensor: found colour filters {}, allowed {}", .found.name(),
        .allowed.map_or("photos that are not raw, for the rig's camera gives no raw sites",
                        Mosaic::name)
    )]
    OtherSensor {
        /// The photo's.
        found: Mosaic,
        /// Those of the rig's photos, if its sensor has any.
        allowed: Option<Mosaic>,
    },
}

/// Why a photo could not be read or a result not be encoded.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file system did not hand the file over.
    #[error("cannot read the photo {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The file's content is no photo that this rig can restore.
    #[error("{name}: {flaw}")]
    Refused {
        /// The file's name.
        name: String,
        /// What is wrong with it.
        #[source]
        flaw: Flaw,
    },
    /// The same, told by the worker that read the file.
    #[error("{words}")]
    Told {
        /// Its whole message.
        words: String,
        /// Whether more of the file may be to come.
        growth: Growth,
    },
    /// The worker that read the file died of it.
    #[error("{name}: reading this photo killed the worker that read it: {how}")]
    Died {
        /// The file's name.
        name: String,
        /// What is known of how it died.
        how: String,
    },
    /// There is no worker to read the file.
    #[error("cannot start a worker to read photos")]
    NoWorker {
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The result could not be encoded, which is a bug of ours: it has the photo's own format.
    #[error("cannot encode the result for {name}")]
    Encode {
        /// The file's name.
        name: String,
        /// The encoder's words.
        #[source]
        source: image::ImageError,
    },
}

impl PictureError {
    /// The refusal of something that is no plain file but `found`.
    pub fn not_a_file(name: &str, found: &'static str) -> PictureError {
        PictureError::Refused { name: name.to_owned(), flaw: Flaw::NotAFile { found } }
    }

    /// Whether more of the file may be to come.
    pub fn growth(&self) -> Growth {
        match self {
            PictureError::Refused { flaw, .. } => flaw.growth(),
            PictureError::Told { growth, .. } => *growth,
            PictureError::Read { .. }
            | PictureError::Died { .. }
            | PictureError::NoWorker { .. }
            | PictureError::Encode { .. } => Growth::None,
        }
    }
}

impl Flaw {
    fn growth(&self) -> Growth {
        match self {
            Flaw::Empty | Flaw::ZeroFilled { .. } | Flaw::Truncated { .. } => Growth::Likely,
            Flaw::Damaged { .. } | Flaw::Undecodable { .. } => Growth::Possible,
            _ => Growth::None,
        }
    }
}

/// Whether a file that was refused may simply not be there in full yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Growth {
    /// It is what it is.
    None,
    /// Copies that fill a file in no order look like this for a moment; damaged files do for ever.
    Possible,
    /// Its end is missing: it is worth waiting for.
    Likely,
}

impl Remediable for PictureError {
    fn remedy(&self) -> Remedy {
        match self {
            PictureError::Read { .. } | PictureError::NoWorker { .. } => Remedy::RetryLater,
            PictureError::Refused { .. }
            | PictureError::Told { .. }
            | PictureError::Died { .. }
            | PictureError::Encode { .. } => Remedy::SkipPhoto,
        }
    }
}
