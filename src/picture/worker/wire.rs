//! What goes between the daemon and a worker: one question in, one answer out, planes as plain
//! numbers.
//!
//! An answer is a length (u32, little-endian), that many bytes of postcard, and then the planes
//! named in them, row by row, f32 little-endian. Whoever reads it trusts none of it: a worker may
//! have been taken over by the file it read.

use std::io::{self, Read, Write};

use serde::{Deserialize, Serialize};

use super::super::flaw::Growth;
use super::super::{FileFacts, Format, Limits, Manner, Orientation, Photo, PixelLayout, Tone};
use crate::config::Curve;
use crate::frame::{Channels, Frame, PhotoGrid, Plane, RawSites, Size};

/// A question to a worker.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Ask {
    /// The file's name, for messages.
    pub(super) name: String,
    pub(super) limits: Limits,
    /// The photo is wanted, with this curve and on this grid; else only whether the file is whole.
    pub(super) photo: Option<(Curve, PhotoGrid)>,
    pub(super) memory_bytes_max: u64,
    pub(super) processor_s_max: u64,
}

/// A worker's answer.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The file is all there.
    Whole,
    /// The photo; its planes follow.
    Photo(Box<Header>),
    /// The file is refused.
    Refused { words: String, growth: Growth },
    /// The file could not be read.
    Unread { words: String },
}

/// A photo without its planes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Header {
    name: String,
    channels: Channels,
    size: Size,
    format: Format,
    layout: PixelLayout,
    bits: u8,
    tone: Tone,
    orientation: u8,
    icc: Option<Vec<u8>>,
    exif: Option<Vec<u8>>,
    alpha: bool,
    raw: Option<RawSites>,
    camera: Option<String>,
    stored: Size,
    file: FileFacts,
    notes: Vec<String>,
}

/// Longest answer without its planes: curves of 3 × 65536 steps, and 16 MiB each of profile and
/// EXIF. Guess.
const HEADER_BYTES_MAX: u32 = 36 << 20;

/// Most bytes an answer to `ask` may have.
pub(super) fn bytes_max(ask: &Ask) -> u64 {
    let planes = ask.photo.map_or(0, |(_, grid)| 4 * 4 * grid.photo.size.area() as u64);
    4 + u64::from(HEADER_BYTES_MAX) + planes
}

/// Writes an answer without planes.
pub(super) fn write(out: &mut dyn Write, answer: &Answer) -> io::Result<()> {
    let bytes = postcard::to_allocvec(answer).map_err(io::Error::other)?;
    let length = u32::try_from(bytes.len()).ok().filter(|&length| length <= HEADER_BYTES_MAX);
    let length =
        length.ok_or_else(|| io::Error::other(format!("{} bytes of metadata", bytes.len())))?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&bytes)
}

/// Writes a photo.
pub(super) fn write_photo(out: &mut dyn Write, photo: &Photo) -> io::Result<()> {
    let Photo { name, light, raw, camera, channels, manner, stored, file, notes } = photo;
    let Manner { format, layout, bits, tone, orientation, icc, exif, alpha } = manner;
    let header = Header {
        name: name.clone(),
        channels: *channels,
        size: light.size(),
        format: *format,
        layout: *layout,
        bits: *bits,
        tone: tone.clone(),
        orientation: orientation.to_exif(),
        icc: icc.clone(),
        exif: exif.clone(),
        alpha: alpha.is_some(),
        raw: *raw,
        camera: camera.clone(),
        stored: *stored,
        file: *file,
        notes: notes.clone(),
    };
    write(out, &Answer::Photo(Box::new(header)))?;
    for plane in channels.list().iter().map(|&channel| light.plane(channel)).chain(alpha) {
        let bytes: Vec<u8> = plane.data().iter().flat_map(|v| v.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    out.flush()
}

/// Reads an answer from `bytes`, what follows it being left there.
///
/// # Errors
/// A few words on what is wrong with it.
pub(super) fn read(bytes: &mut &[u8]) -> Result<Answer, &'static str> {
    let mut length = [0; 4];
    bytes.read_exact(&mut length).map_err(|_| "no answer")?;
    let length = u32::from_le_bytes(length) as usize;
    let (answer, rest) = bytes.split_at_checked(length).ok_or("an answer cut short")?;
    *bytes = rest;
    postcard::from_bytes(answer).map_err(|_| "an answer that cannot be read")
}

/// The photo of `header` on the grid `allowed`, its planes read from `bytes`.
///
/// # Errors
/// A few words on what is wrong with it.
pub(super) fn read_photo(
    header: Header,
    bytes: &mut &[u8],
    allowed: Size,
) -> Result<Photo, &'static str> {
    let steps = match header.bits {
        8 => 256,
        16 => 65536,
        _ => return Err("samples of no known depth"),
    };
    if header.size != allowed || !header.tone.has_steps(steps) {
        return Err("a photo of another size");
    }
    let sound = |raw: RawSites| raw.counts_per_level.is_finite() && raw.counts_per_level > 0.0;
    if !header.raw.is_none_or(|raw| sound(raw) && header.channels == Channels::Colour) {
        return Err("raw sites that mean nothing");
    }
    let mut plane = || {
        let (plane, rest) = bytes.split_at_checked(4 * allowed.area()).ok_or("planes cut short")?;
        *bytes = rest;
        let light: Vec<f32> =
            plane.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        if light.iter().any(|v| !v.is_finite()) {
            return Err("light without a value");
        }
        Plane::from_vec(allowed, light).ok_or("planes of another size")
    };
    let light = match header.channels {
        Channels::Colour => Frame::from_planes([plane()?, plane()?, plane()?]),
        Channels::Green => {
            Frame::from_planes([Plane::zeros(allowed), plane()?, Plane::zeros(allowed)])
        }
    };
    let alpha = if header.alpha { Some(plane()?) } else { None };
    if !bytes.is_empty() {
        return Err("more than was asked for");
    }
    Ok(Photo {
        name: header.name,
        light,
        raw: header.raw,
        camera: header.camera,
        channels: header.channels,
        manner: Manner {
            format: header.format,
            layout: header.layout,
            bits: header.bits,
            tone: header.tone,
            orientation: Orientation::from_exif(header.orientation)
                .ok_or("no known orientation")?,
            icc: header.icc,
            exif: header.exif,
            alpha,
        },
        stored: header.stored,
        file: header.file,
        notes: header.notes,
    })
}
