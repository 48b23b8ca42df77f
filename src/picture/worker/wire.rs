//! The protocol between daemon and worker: one question, one answer.
//!
//! An answer is a length (u32, little-endian), that many bytes of postcard, and then the planes
//! (f32) and coefficients (i16) that they announce, row by row, in the machine's byte order. It is
//! validated as untrusted, because a hostile file may have taken over the worker.

use std::io::{self, Read, Write};

use bytemuck::{cast_slice, pod_collect_to_vec};
use serde::{Deserialize, Serialize};

use super::super::decode::bits_of;
use super::super::flaw::Growth;
use super::super::shape::is_part;
use super::super::{Limits, Photo};
use crate::config::Curve;
use crate::frame::{BLOCK_AREA, Channels, Coding, Counts, Frame, PhotoGrid, Plane, RawSites, Size};

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Ask {
    /// The file's name, for messages.
    pub(super) name: String,
    pub(super) limits: Limits,
    pub(super) purpose: Purpose,
    pub(super) memory_bytes_max: u64,
    pub(super) processor_s_max: u64,
}

/// The purpose of reading a file.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) enum Purpose {
    /// To check that it is complete and of a kind that is read.
    Whole,
    /// The photo, with this curve and on this grid.
    Photo(Curve, PhotoGrid),
    /// The counts of a camera's frame of this size.
    Frame(Size),
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Answer<P = Box<Photo>> {
    /// The file is complete and of a kind that is read.
    Whole,
    /// The photo; its planes follow.
    Photo(Header<P>),
    /// A camera's frame; its counts follow, a byte each, plane by plane.
    Frame,
    /// The file is refused.
    Refused { message: String, growth: Growth },
    /// The file could not be read.
    Unread { message: String },
}

/// A photo without its planes and coefficients.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Header<P> {
    photo: P,
    size: Size,
    /// Whether a plane of alpha follows.
    alpha: bool,
}

/// Longest answer without its planes: curves of 3 × 65536 steps, and 16 MiB each of profile and
/// EXIF. Guess.
const HEADER_BYTES_MAX: u32 = 36 << 20;

/// Most bytes an answer to `ask` may have.
pub(super) fn bytes_max(ask: &Ask) -> u64 {
    let planes = match ask.purpose {
        Purpose::Whole => 0,
        Purpose::Photo(_, grid) => {
            let Size { width, height } = grid.photo.size;
            // Three components of two bytes a sample, padded to units of 16 pixels.
            let coding = 3 * 2 * width.next_multiple_of(16) * height.next_multiple_of(16);
            4 * 4 * width * height + coding
        }
        Purpose::Frame(size) => 3 * size.area(),
    };
    4 + u64::from(HEADER_BYTES_MAX) + planes as u64
}

pub(super) fn write_frame(out: &mut dyn Write, counts: &Counts) -> io::Result<()> {
    write(out, &Answer::<()>::Frame)?;
    for plane in counts.planes() {
        let bytes: Vec<u8> = plane.data().iter().map(|&count| count as u8).collect();
        out.write_all(&bytes)?;
    }
    out.flush()
}

/// Reads a camera's frame of `size` from `bytes`.
pub(super) fn read_frame(bytes: &[u8], size: Size) -> Result<Counts, &'static str> {
    if bytes.len() != 3 * size.area() {
        return Err("a frame of another size");
    }
    let mut counts = Counts::zeros(size);
    for (plane, from) in counts.planes_mut().iter_mut().zip(bytes.chunks_exact(size.area().max(1)))
    {
        plane.data_mut().iter_mut().zip(from).for_each(|(to, &from)| *to = from.into());
    }
    Ok(counts)
}

/// Writes an answer without planes.
pub(super) fn write(out: &mut dyn Write, answer: &Answer<impl Serialize>) -> io::Result<()> {
    let bytes = postcard::to_allocvec(answer).map_err(io::Error::other)?;
    let length = u32::try_from(bytes.len()).ok().filter(|&length| length <= HEADER_BYTES_MAX);
    let length =
        length.ok_or_else(|| io::Error::other(format!("{} bytes of metadata", bytes.len())))?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&bytes)
}

pub(super) fn write_photo(out: &mut dyn Write, photo: &Photo) -> io::Result<()> {
    let Photo { light, channels, coding, manner, .. } = photo;
    let alpha = manner.alpha.as_ref();
    write(out, &Answer::Photo(Header { photo, size: light.size(), alpha: alpha.is_some() }))?;
    for plane in channels.list().iter().map(|&channel| light.plane(channel)).chain(alpha) {
        out.write_all(cast_slice(plane.data()))?;
    }
    for component in coding.iter().flat_map(|coding| &coding.components) {
        out.write_all(cast_slice(&component.coefficients))?;
    }
    out.flush()
}

/// Reads an answer from the front of `bytes`, and moves `bytes` past it.
pub(super) fn read(bytes: &mut &[u8]) -> Result<Answer, &'static str> {
    let mut length = [0; 4];
    bytes.read_exact(&mut length).map_err(|_| "no answer")?;
    let length = u32::from_le_bytes(length) as usize;
    let (answer, rest) = bytes.split_at_checked(length).ok_or("an answer cut short")?;
    *bytes = rest;
    postcard::from_bytes(answer).map_err(|_| "an answer that cannot be read")
}

/// The photo of `header` on `grid`, its planes read from `bytes`.
pub(super) fn read_photo(
    header: Header<Box<Photo>>,
    bytes: &mut &[u8],
    grid: PhotoGrid,
) -> Result<Photo, &'static str> {
    header.validate(grid)?;
    let size = header.size;
    let mut photo = *header.photo;
    let mut plane = || {
        let (plane, rest) = bytes.split_at_checked(4 * size.area()).ok_or("planes cut short")?;
        *bytes = rest;
        let light: Vec<f32> = pod_collect_to_vec(plane);
        if light.iter().any(|v| !v.is_finite()) {
            return Err("light that is not finite");
        }
        Plane::from_vec(size, light).ok_or("planes of another size")
    };
    photo.light = match photo.channels {
        Channels::Colour => Frame::from_planes([plane()?, plane()?, plane()?]),
        Channels::Green => Frame::from_planes([Plane::zeros(size), plane()?, Plane::zeros(size)]),
    };
    photo.manner.alpha = if header.alpha { Some(plane()?) } else { None };
    if let Some(coding) = photo.coding.take() {
        photo.coding = Some(read_coding(coding, bytes, size)?);
    }
    if !bytes.is_empty() {
        return Err("more than the photo");
    }
    Ok(photo)
}

impl Header<Box<Photo>> {
    /// Checks all that reading the planes does not check.
    fn validate(&self, grid: PhotoGrid) -> Result<(), &'static str> {
        let Photo { manner, raw, channels, .. } = &*self.photo;
        let steps = match bits_of(manner.colour) {
            8 => 256,
            16 => 65536,
            _ => return Err("samples of another depth"),
        };
        let is_part = raw.is_none() && is_part(self.size, grid);
        if !(self.size == grid.photo.size || is_part) || !manner.tone.has_steps(steps) {
            return Err("a photo of another size");
        }
        let is_sound = |raw: RawSites| {
            let noise = raw.noise.unwrap_or_default();
            noise.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0)
                && raw.counts_per_level.is_finite()
                && raw.counts_per_level > 0.0
        };
        if !raw.is_none_or(|raw| is_sound(raw) && *channels == Channels::Colour) {
            return Err("invalid raw sites");
        }
        if !manner.colours.is_none_or(|colours| colours.are_sound() && raw.is_some()) {
            return Err("invalid colours");
        }
        Ok(())
    }
}

/// `coding` with its coefficients, read from `bytes`.
fn read_coding(
    mut coding: Coding,
    bytes: &mut &[u8],
    allowed: Size,
) -> Result<Coding, &'static str> {
    let densest = coding.densest();
    for component in &mut coding.components {
        // Checked before any arithmetic on untrusted numbers.
        if component.blocks != Coding::blocks(allowed, densest, component.pixels) {
            return Err("coefficients of another size");
        }
        let length = 2 * component.blocks.area() * BLOCK_AREA;
        let (numbers, rest) = bytes.split_at_checked(length).ok_or("coefficients cut short")?;
        *bytes = rest;
        component.coefficients = pod_collect_to_vec(numbers).into();
    }
    let sound = coding.size == allowed && coding.is_whole();
    if sound { Ok(coding) } else { Err("invalid coefficients") }
}

#[cfg(test)]
mod tests {
    use super::super::photo_of_answer;
    use super::*;

    /// The photo in a JPEG of 75×50.
    fn photo() -> Photo {
        let bytes = include_bytes!("../../../tests/jpegs/progressive-420.jpg");
        Photo::from_bytes("a.jpg", bytes, Curve::Srgb, &Limits::default()).unwrap()
    }

    #[test]
    fn coefficients_are_transferred_and_validated() {
        let (photo, size) = (photo(), Size::new(75, 50));
        let answered = |photo: &Photo| {
            let mut bytes = Vec::new();
            write_photo(&mut bytes, photo).unwrap();
            bytes
        };
        let bytes = answered(&photo);
        assert_eq!(photo_of_answer("a.jpg", &bytes, size).unwrap().coding, photo.coding);
        assert!(photo.coding.is_some());
        assert!(photo_of_answer("a.jpg", &bytes[..bytes.len() - 1], size).is_err());
        let ask = Ask {
            name: String::new(),
            limits: Limits::default(),
            purpose: Purpose::Photo(Curve::Srgb, size.into()),
            memory_bytes_max: 0,
            processor_s_max: 0,
        };
        assert!(bytes.len() as u64 <= bytes_max(&ask));
        type Spoilt = fn(&mut Coding);
        let spoilt: [Spoilt; 5] = [
            |coding| coding.size.width += 1,
            |coding| coding.components[1].pixels = (0, 9),
            |coding| coding.components[0].steps[5] = 0,
            |coding| coding.components[2].blocks.width = usize::MAX,
            |coding| coding.components.truncate(2),
        ];
        for (n, spoil) in spoilt.into_iter().enumerate() {
            let mut other = photo.clone();
            other.coding.as_mut().map(spoil);
            assert!(photo_of_answer("a.jpg", &answered(&other), size).is_err(), "{n}");
        }
        // On another grid, the photo's blocks no longer apply.
        assert!(photo.fit(Size::new(150, 100)).unwrap().coding.is_none());
    }
}
