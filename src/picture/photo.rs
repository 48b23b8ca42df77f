//! A customer's photo in linear light, with all that its result must be given back.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use rustix::fs::{Mode, OFlags};
use serde::{Deserialize, Serialize};

use crate::frame::resample::resize;
use crate::frame::{
    Channel, Channels, Coding, Frame, PhotoGrid, Plane, RawSites, Rect, Size, Work,
};

use super::decode::{Limits, Raster, decode, walk};
use super::kind::{Content, Format, misnamed};
use super::losses::EXIF_LOST;
use super::{
    CameraColours, Flaw, Growth, Orientation, PhotoCamera, PictureError, PixelLayout, Tone, shape,
    tone, turn,
};
use crate::config::{Curve, RawResults};

/// How a picture is written: format, depth, curve, and what the photo carried.
#[derive(Debug, Clone, PartialEq)]
pub struct Manner {
    /// File format.
    pub format: Format,
    /// Samples of a pixel.
    pub layout: PixelLayout,
    /// Bits a sample: 8 or 16.
    pub bits: u8,
    /// The transfer curve, undone on reading and redone on writing.
    pub tone: Tone,
    /// How the stored pixels are turned upright when written.
    pub orientation: Orientation,
    /// The ICC profile, passed on byte by byte.
    pub icc: Option<Vec<u8>>,
    /// The EXIF block with the orientation cleared.
    pub exif: Option<Vec<u8>>,
    /// The alpha plane as stored, 0..1, in stored orientation.
    pub alpha: Option<Plane>,
    /// How the light of a raw photo becomes sRGB, where its channels are not.
    pub colours: Option<CameraColours>,
}

impl Manner {
    /// A plain RGB file with nothing carried along.
    pub fn plain(format: Format, bits: u8, curve: Curve) -> Manner {
        Manner {
            format,
            layout: PixelLayout::Rgb,
            bits,
            tone: Tone::of_curve(curve, bits),
            orientation: Orientation::NoTransforms,
            icc: None,
            exif: None,
            alpha: None,
            colours: None,
        }
    }
}

/// Which file a photo was made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileFacts {
    /// CRC-32 of its bytes.
    pub crc32: u32,
    /// Its length.
    pub bytes: u64,
    /// Its format, where that is one of results.
    pub format: Option<Format>,
}

/// A photo: **B** of the paper, in linear light.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The file's name, for messages and results.
    pub name: String,
    /// Linear light 0..255, stored orientation. For grey photos the green plane alone, the others
    /// black. Between the sites of a raw photo, what its neighbours hold on the average.
    pub light: Frame<Work>,
    /// Which of that light is data, of a raw photo; of any other all of it.
    pub raw: Option<RawSites>,
    /// What a JPEG states of the light, where it has the rig's own size and was not cut.
    pub coding: Option<Coding>,
    /// The camera, as far as a raw photo says.
    pub camera: Option<PhotoCamera>,
    /// Whether all channels carry something of their own.
    pub channels: Channels,
    /// How its result is written.
    pub manner: Manner,
    /// Width and height of the file's picture as stored, before any resampling.
    pub stored: Size,
    /// Which file it was.
    pub file: FileFacts,
    /// What a result has not of the file: its size, metadata that cannot be carried, … Nothing is
    /// lost where the file itself is returned.
    pub losses: Vec<String>,
    /// What else the report should say about the file.
    pub notes: Vec<String>,
}

impl Photo {
    /// Reads the photo in `path`. `curve` is the rig's, for files without a usable ICC profile.
    ///
    /// Links, pipes and devices are not followed or waited for.
    ///
    /// # Errors
    /// [`PictureError::Read`] when the file cannot be had, [`PictureError::Refused`] with its
    /// [`Flaw`].
    pub fn read(path: &Path, curve: Curve, limits: &Limits) -> Result<Photo, PictureError> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let file = open(path, &name)?;
        Photo::of_file(&name, file, curve, limits)
    }

    /// The photo in the plain file `file`, called `name`.
    ///
    /// # Errors
    /// As [`Photo::read`].
    pub fn of_file(
        name: &str,
        file: File,
        curve: Curve,
        limits: &Limits,
    ) -> Result<Photo, PictureError> {
        Photo::from_bytes(name, &read_bytes(file, name, limits)?, curve, limits)
    }

    /// Its light in three channels: a grey photo's green plane in all of them.
    pub fn in_colour(&self) -> Frame<Work> {
        let source = |c| if self.channels == Channels::Green { Channel::Green } else { c };
        Frame::from_fn(|c| self.light.plane(source(c)).clone())
    }

    /// The photo in `bytes`, called `name`.
    ///
    /// # Errors
    /// [`PictureError::Refused`] with its [`Flaw`].
    pub fn from_bytes(
        name: &str,
        bytes: &[u8],
        curve: Curve,
        limits: &Limits,
    ) -> Result<Photo, PictureError> {
        let refused = |flaw| PictureError::Refused { name: name.to_owned(), flaw };
        let raster = decode(bytes, limits).map_err(refused)?;
        let format = match raster.content {
            Content::Written(format) if raster.sites.is_none() => Some(format),
            _ => None,
        };
        let (crc32, length) = (crc32fast::hash(bytes), bytes.len() as u64);
        let file = FileFacts { crc32, bytes: length, format };
        let misnamed = misnamed(name, raster.content, raster.sites.is_some());
        let mut photo = Photo::of_raster(name, raster, curve, file);
        photo.notes.extend(misnamed);
        Ok(photo)
    }

    fn of_raster(name: &str, raster: Raster, curve: Curve, file: FileFacts) -> Photo {
        if let Some(sites) = raster.sites {
            let known = RawSites::new(sites.mosaic, sites.counts_per_level());
            let raw = RawSites { noise: raster.noise, ..known };
            let plain = Manner::plain(raster.content.written(), raster.bits, curve);
            // Viewers take what says nothing for sRGB.
            let icc = (curve == Curve::Linear).then(tone::linear_profile).flatten();
            let colours = raster.colours;
            return Photo {
                name: name.to_owned(),
                light: raw.mosaic.interpolated(&sites.light(raster.size, &raster.samples)),
                raw: Some(raw),
                coding: None,
                camera: raster.camera,
                channels: Channels::Colour,
                manner: Manner { orientation: raster.orientation, icc, colours, ..plain },
                stored: raster.size,
                file,
                losses: raster.losses,
                notes: Vec::new(),
            };
        }
        let Raster { content, size, layout, bits, samples, orientation, icc, mut exif, .. } =
            raster;
        let format = content.written();
        let (losses, mut notes) = (raster.losses, Vec::new());
        let tone = icc.as_deref().map(|icc| Tone::of_profile(icc, bits, layout.is_grey()));
        let tone = match tone {
            Some(Ok(tone)) => tone,
            Some(Err(why)) => {
                let tone = Tone::of_curve(curve, bits);
                notes.push(format!(
                    "the embedded ICC profile was not used, {why}; {} was assumed",
                    tone.origin()
                ));
                tone
            }
            None => Tone::of_curve(curve, bits),
        };
        if let Some(exif) = &mut exif {
            // The answer is known already: `orientation`.
            let _ = Orientation::remove_from_exif_chunk(exif);
        }
        let step = layout.samples();
        let pixel = |channel: usize| {
            let at = if layout.is_grey() { 0 } else { channel };
            let light = samples
                .iter()
                .skip(at)
                .step_by(step)
                .map(|&code| tone.light(channel, code))
                .collect();
            Plane::from_vec(size, light).unwrap_or_else(|| Plane::zeros(size))
        };
        let equal = |p: &[u16]| p[0] == p[1] && p[1] == p[2];
        let grey = layout.is_grey() || (icc.is_none() && samples.chunks_exact(step).all(equal));
        let light = match grey {
            true => Frame::from_planes([Plane::zeros(size), pixel(1), Plane::zeros(size)]),
            false => Frame::from_planes([pixel(0), pixel(1), pixel(2)]),
        };
        let alpha = layout.has_alpha().then(|| {
            let top = if bits == 8 { 255.0 } else { 65535.0 };
            let alpha =
                samples.iter().skip(step - 1).step_by(step).map(|&a| f32::from(a) / top).collect();
            Plane::from_vec(size, alpha).unwrap_or_else(|| Plane::filled(size, 1.0))
        });
        Photo {
            name: name.to_owned(),
            light,
            raw: None,
            coding: raster.coding,
            camera: None,
            channels: if grey { Channels::Green } else { Channels::Colour },
            manner: Manner {
                format,
                layout,
                bits,
                tone,
                orientation,
                icc,
                exif,
                alpha,
                colours: None,
            },
            stored: size,
            file,
            losses,
            notes,
        }
    }

    /// The photo on the rig's grid: itself, its part of the whole sensor's, or resampled when it
    /// has the same shape at another size.
    ///
    /// # Errors
    /// [`Flaw::Shape`] when its shape is another, [`Flaw::RawSize`] when it is raw and its size is.
    pub fn fit(mut self, grid: impl Into<PhotoGrid>) -> Result<Photo, PictureError> {
        let PhotoGrid { sensor, photo } = grid.into();
        let (found, allowed) = (self.light.size(), photo.size);
        if found == allowed {
            let ours = self.camera.as_ref().is_some_and(|camera| camera.setting.is_some());
            if self.raw.is_some() && found != sensor && !ours {
                self.notes.push(format!(
                    "nothing says where on the sensor this photo's {found} sites lie: they are \
                     taken for the rig's photo"
                ));
            }
            return Ok(self);
        }
        // Blocks are the whole picture's.
        self.coding = None;
        if found == sensor {
            self.cut(photo);
            return Ok(self);
        }
        if self.raw.is_some() {
            let flaw = Flaw::RawSize { found, allowed, sensor };
            return Err(PictureError::Refused { name: self.name, flaw });
        }
        if !shape::same_shape(found, allowed) {
            let turned = Size::new(found.height, found.width);
            let held = match shape::same_shape(turned, allowed) {
                true if turn::swaps(self.manner.orientation) => " stored on its side",
                true => {
                    " in portrait, stored upright, so that nothing says which way the camera was \
                     turned"
                }
                false => "",
            };
            return Err(PictureError::Refused {
                name: self.name,
                flaw: Flaw::Shape { found, held, allowed },
            });
        }
        self.light = Frame::from_fn(|channel| match self.channels.list().contains(&channel) {
            true => resize(self.light.plane(channel), allowed),
            false => Plane::zeros(allowed),
        });
        self.manner.alpha = self.manner.alpha.as_ref().map(|alpha| resize(alpha, allowed));
        let less = if found.area() > allowed.area() { ": its result is smaller" } else { "" };
        let note = format!("the photo was resampled from {found} to the rig's {allowed}{less}");
        self.losses.insert(0, note);
        Ok(self)
    }

    /// The same photo, whose result is of the format `results` if it is raw.
    #[must_use]
    pub fn with_raw_results(mut self, results: RawResults) -> Photo {
        if self.raw.is_some() {
            self.manner.format = match results {
                RawResults::Tiff => Format::Tiff,
                RawResults::Jpeg => Format::Jpeg,
            };
        }
        self
    }

    /// The same photo, unless its result would be smaller than it is.
    ///
    /// # Errors
    /// [`Flaw::Larger`].
    pub fn no_larger(self) -> Result<Photo, PictureError> {
        let (found, allowed) = (self.stored, self.light.size());
        if found.area() <= allowed.area() {
            return Ok(self);
        }
        Err(PictureError::Refused { name: self.name, flaw: Flaw::Larger { found, allowed } })
    }

    /// Keeps the part `rect` alone.
    fn cut(&mut self, rect: Rect) {
        let all = self.light.size();
        self.light = Frame::from_fn(|channel| self.light.plane(channel).crop(rect));
        self.manner.alpha = self.manner.alpha.as_ref().map(|alpha| alpha.crop(rect));
        if let Some(raw) = &mut self.raw {
            raw.mosaic = raw.mosaic.from_place(rect.x, rect.y);
        }
        let kept = rect.size;
        // What is cut away is no resolution lost.
        self.stored = kept;
        self.losses
            .push(format!("{kept} of the sensor's {all} are the rig's photo; the rest is cut"));
    }

    /// What is to be said of it beside a result of the format `result`; without one the file itself
    /// is returned.
    pub fn told(&self, result: Option<Format>) -> Vec<String> {
        let Some(format) = result else { return self.notes.clone() };
        let mut told = self.losses.clone();
        if self.file.format.is_none() && self.raw.is_none() {
            told.push(format!("a photo of this kind comes back as {}", format.name()));
        }
        if self.manner.exif.is_some() && format == Format::Tiff {
            told.push(EXIF_LOST.to_owned());
        }
        if self.manner.alpha.is_some() && format == Format::Jpeg {
            told.push("what is transparent in the photo cannot be so in a JPEG".to_owned());
        }
        told.extend(self.notes.clone());
        told
    }

    /// How the result is turned, for the report; `None` when it is delivered as stored.
    pub fn turned(&self) -> Option<u8> {
        Some(self.manner.orientation.to_exif()).filter(|&tag| tag != 1)
    }
}

/// The samples, as code values 0..255 with no curve undone, of a picture that is part of the
/// program.
///
/// # Panics
/// When `bytes` are no whole JPEG, PNG or TIFF, which a test of the embedded pictures rules out.
pub fn embedded(bytes: &'static [u8]) -> [Plane; 3] {
    let raster =
        decode(bytes, &Limits::default()).expect("pictures that are part of the program decode");
    let step = raster.layout.samples();
    let scale = if raster.bits == 8 { 1.0 } else { 1.0 / 257.0 };
    [0, 1, 2].map(|channel| {
        let at = if raster.layout.is_grey() { 0 } else { channel };
        let codes = raster
            .samples
            .iter()
            .skip(at)
            .step_by(step)
            .map(|&code| f32::from(code) * scale)
            .collect();
        Plane::from_vec(raster.size, codes).unwrap_or_else(|| Plane::zeros(raster.size))
    })
}

/// Whether `file`, called `name`, is all there: a JPEG to its end marker, a PNG to its end chunk, a
/// TIFF to its last strip, none with a hole of zeros in it. Whatever else may be wrong with it is
/// no business of this.
///
/// # Errors
/// [`PictureError::Refused`] with what is missing, always of [`Growth::Likely`];
/// [`PictureError::Read`].
pub fn whole(name: &str, file: File, limits: &Limits) -> Result<(), PictureError> {
    let walked = read_bytes(file, name, limits).and_then(|bytes| {
        walk(&bytes, limits).map_err(|flaw| PictureError::Refused { name: name.to_owned(), flaw })
    });
    match walked {
        Err(error)
            if error.growth() == Growth::Likely || matches!(error, PictureError::Read { .. }) =>
        {
            Err(error)
        }
        _ => Ok(()),
    }
}

/// The bytes of the photo in `path`, which is no link, pipe or device.
///
/// # Errors
/// As [`Photo::read`].
pub fn bytes_of(path: &Path, limits: &Limits) -> Result<Vec<u8>, PictureError> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    read_bytes(open(path, &name)?, &name, limits)
}

/// Opens a plain file.
fn open(path: &Path, name: &str) -> Result<File, PictureError> {
    // A pipe would block the open and a link may lead anywhere: neither is a photo.
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    match rustix::fs::open(path, flags, Mode::empty()) {
        Ok(fd) => Ok(File::from(fd)),
        Err(rustix::io::Errno::LOOP) => Err(PictureError::not_a_file(name, "a link")),
        Err(errno) => Err(PictureError::Read { path: path.to_owned(), source: errno.into() }),
    }
}

/// The bytes of a plain file no longer than the limit.
pub(super) fn read_bytes(file: File, name: &str, limits: &Limits) -> Result<Vec<u8>, PictureError> {
    let read = |source: std::io::Error| PictureError::Read { path: name.into(), source };
    let about = file.metadata().map_err(read)?;
    if !about.is_file() {
        let found = if about.is_dir() { "a folder" } else { "a pipe or device" };
        return Err(PictureError::not_a_file(name, found));
    }
    let too_long = |found: u64| {
        let flaw = Flaw::TooLong { found, allowed: limits.bytes_max };
        PictureError::Refused { name: name.to_owned(), flaw }
    };
    if about.len() > limits.bytes_max {
        return Err(too_long(about.len()));
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    file.take(limits.bytes_max + 1).read_to_end(&mut bytes).map_err(read)?;
    if bytes.len() as u64 > limits.bytes_max {
        Err(too_long(bytes.len() as u64))
    } else {
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pictures_that_are_part_of_the_program_decode() {
        for bytes in [
            &include_bytes!("../../tests/scenes/astronaut.png")[..],
            include_bytes!("../../tests/scenes/coffee.png"),
            include_bytes!("../../tests/scenes/rocket.jpg"),
        ] {
            let planes = embedded(bytes);
            assert!(planes[0].size().area() > 100_000 && planes.iter().all(|p| p.mean() > 5.0));
        }
    }
}
