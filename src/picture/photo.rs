//! A customer's photo in linear light, with the format and metadata of its result.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::frame::resample::resize;
use crate::frame::{
    Channel, Channels, Coding, Frame, PhotoGrid, Plane, RawSites, Rect, Size, Work,
};

use super::decode::{Heading, Limits, Raster, bits_of, decode, walk};
use super::dng::RawFile;
use super::kind::{Content, Format, is_raw_name, misnamed, tiff_of_a_camera};
use super::metadata::Lost;
use super::reading::bytes_of;
use super::tone::StatedColours;
use super::turn::turn;
use super::{
    CameraColours, ColorType, Flaw, Orientation, PhotoCamera, PictureError, Tone, exif, shape,
};
use crate::config::Curve;

/// How a picture is written: format, depth, curve and metadata.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manner {
    /// File format.
    pub format: Format,
    /// Channels of a pixel, with 8 or 16 bits a sample.
    pub colour: ColorType,
    /// The transfer curve, undone on reading and redone on writing.
    pub tone: Tone,
    /// How the stored pixels are turned upright when written.
    pub orientation: Orientation,
    /// The ICC profile, carried byte by byte.
    pub icc: Option<Vec<u8>>,
    /// The EXIF block with the orientation cleared.
    pub exif: Option<Vec<u8>>,
    /// The alpha plane as stored, 0..1, in stored orientation.
    #[serde(skip)]
    pub alpha: Option<Plane>,
    /// Conversion of a raw photo's light to sRGB; `None` where its channels are sRGB's.
    pub colours: Option<CameraColours>,
}

impl Manner {
    /// A plain RGB file of 8 or 16 `bits` a sample, without metadata.
    pub fn plain(format: Format, bits: u8, curve: Curve) -> Manner {
        Manner {
            format,
            colour: if bits > 8 { ColorType::Rgb16 } else { ColorType::Rgb8 },
            tone: Tone::of_curve(curve, bits),
            orientation: Orientation::NoTransforms,
            icc: None,
            exif: None,
            alpha: None,
            colours: None,
        }
    }
}

/// Facts about the file of a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileFacts {
    /// CRC-32 of the bytes.
    pub crc32: u32,
    /// Length in bytes.
    pub bytes: u64,
    /// Format, if results can be written in it.
    pub format: Option<Format>,
}

/// A photo: **B** of the paper, in linear light.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Photo {
    /// The file's name, for messages and results.
    pub name: String,
    /// Linear light 0..255, stored orientation. Grey photos have the green plane alone, and the
    /// others black. Raw photos are interpolated between their sites.
    #[serde(skip, default = "no_light")]
    pub light: Frame<Work>,
    /// The sensor's sites of a raw photo; only the samples at these are data.
    pub raw: Option<RawSites>,
    /// Quantised coefficients, if the photo is a JPEG or was saved again from one; `None` once it
    /// was resampled, cut or turned.
    pub coding: Option<Coding>,
    /// The camera, as far as the file states it.
    pub camera: Option<PhotoCamera>,
    /// The channels that hold data.
    pub channels: Channels,
    /// How its result is written.
    pub manner: Manner,
    /// Width and height of the file's picture as stored, before any resampling.
    pub stored: Size,
    /// Whether the photo, stored upright in portrait, was laid on one of its two sides by guess.
    pub is_side_guessed: bool,
    /// Facts about the photo's file.
    pub file: FileFacts,
    /// Notes on what a result lacks of the file: pixels, metadata. They do not apply if the file
    /// itself is returned.
    pub losses: Vec<String>,
    /// Further notes on the file, for the report.
    pub notes: Vec<String>,
}

/// Note for a file whose pixels are those of a JPEG.
const ONCE_A_JPEG: &str =
    "its pixels are those of a JPEG that was saved again; drop the JPEG itself if you have it";

/// A placeholder for light that is transferred separately.
fn no_light() -> Frame<Work> {
    Frame::zeros(Size::new(0, 0))
}

impl Photo {
    /// Reads the photo in `path`. `curve` is the rig's, for files without a usable ICC profile.
    ///
    /// Links, pipes and devices are refused without waiting.
    ///
    /// # Errors
    /// [`PictureError::Read`] when the file cannot be read, [`PictureError::Refused`] with its
    /// [`Flaw`].
    pub fn read(path: &Path, curve: Curve, limits: &Limits) -> Result<Photo, PictureError> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        Photo::from_bytes(&name, &bytes_of(path, limits)?, curve, limits)
    }

    /// Its light in three channels: a grey photo's green plane in all of them.
    pub fn in_colour(&self) -> Frame<Work> {
        let source = |c| if self.channels == Channels::Green { Channel::Green } else { c };
        Frame::from_fn(|c| self.light.plane(source(c)).clone())
    }

    /// The photo in `bytes`, called `name`.
    pub fn from_bytes(
        name: &str,
        bytes: &[u8],
        curve: Curve,
        limits: &Limits,
    ) -> Result<Photo, PictureError> {
        let refused = |flaw: Flaw| flaw.of(name);
        // A maker's raw photo gets a message of its own, not one about the shape of its preview.
        let grid = limits.grid.filter(|_| !is_raw_name(name));
        let limits = Limits { grid, ..*limits };
        let heading = walk(bytes, &limits).map_err(refused)?;
        let format = match heading.content {
            Content::Written(format) if heading.raw.is_none() => Some(format),
            _ => None,
        };
        let (crc32, length) = (crc32fast::hash(bytes), bytes.len() as u64);
        let file = FileFacts { crc32, bytes: length, format };
        let misnamed = misnamed(name, heading.content, heading.raw.is_some());
        let mut photo = match heading {
            Heading { raw: Some(raw), .. } => Photo::of_raw(name, raw.on(grid), bytes, curve, file),
            _ if format == Some(Format::Tiff) && is_raw_name(name) => {
                return Err(refused(tiff_of_a_camera()));
            }
            heading => {
                let raster = heading.decode(bytes, &limits).map_err(refused)?;
                Photo::of_samples(name, raster, curve, file)
            }
        };
        photo.notes.extend(misnamed);
        Ok(photo)
    }

    /// The photo of `raw` in `bytes`, a grey one where the sensor has no colour filters.
    fn of_raw(name: &str, raw: RawFile, bytes: &[u8], curve: Curve, file: FileFacts) -> Photo {
        let (light, mosaic) = (raw.sites.light(raw.size, &raw.counts(bytes)), raw.sites.mosaic);
        let sites = mosaic.map(|mosaic| RawSites {
            noise: raw.noise,
            ..RawSites::new(mosaic, raw.sites.counts_per_level())
        });
        let (light, channels, colour) = match mosaic {
            Some(mosaic) => (mosaic.interpolated(&light), Channels::Colour, ColorType::Rgb16),
            None => {
                let [red, blue] = [(); 2].map(|()| Plane::zeros(raw.size));
                let grey = Frame::from_planes([red, light, blue]);
                (grey, Channels::Green, ColorType::L16)
            }
        };
        let note =
            "a raw photo of a sensor without colour filters, which is restored as a grey one";
        // Viewers take a picture without a profile for sRGB.
        let linear = || StatedColours::LINEAR.profile(mosaic.is_none());
        Photo {
            name: name.to_owned(),
            light,
            raw: sites,
            coding: None,
            camera: raw.camera,
            channels,
            manner: Manner {
                colour,
                orientation: Orientation::from_exif(raw.orientation)
                    .unwrap_or(Orientation::NoTransforms),
                icc: (curve == Curve::Linear).then(linear).flatten(),
                exif: raw.exif,
                colours: raw.colours,
                ..Manner::plain(Format::Tiff, 16, curve)
            },
            stored: raw.size,
            is_side_guessed: false,
            file,
            losses: raw.lost.into_iter().map(Lost::note).collect(),
            notes: mosaic.is_none().then(|| note.to_owned()).into_iter().collect(),
        }
    }

    fn of_samples(name: &str, mut raster: Raster, curve: Curve, file: FileFacts) -> Photo {
        let mut notes = Vec::new();
        let tone = raster.tone(curve, &mut notes);
        let is_grey = raster.is_grey();
        let place = |channel| if raster.colour.has_color() { channel } else { 0 };
        let plane = |channel| raster.plane(place(channel), |code| tone.light(channel, code));
        let size = raster.size;
        let light = match is_grey {
            true => Frame::from_planes([Plane::zeros(size), plane(1), Plane::zeros(size)]),
            false => Frame::from_planes([plane(0), plane(1), plane(2)]),
        };
        let alpha = raster.alpha();
        if let Some(exif) = &mut raster.exif {
            // The result is upright.
            let _ = Orientation::remove_from_exif_chunk(exif);
        }
        let Raster { content, colour, orientation, icc, exif, coding, lost, .. } = raster;
        let format = content.written();
        if coding.is_some() && content != Content::Written(Format::Jpeg) {
            notes.push(ONCE_A_JPEG.to_owned());
        }
        let named = exif.as_deref().and_then(exif::camera);
        Photo {
            name: name.to_owned(),
            light,
            raw: None,
            coding,
            camera: named.map(|name| PhotoCamera { name, serial: None, setting: None }),
            channels: if is_grey { Channels::Green } else { Channels::Colour },
            manner: Manner { format, colour, tone, orientation, icc, exif, alpha, colours: None },
            stored: size,
            is_side_guessed: false,
            file,
            losses: lost.into_iter().map(Lost::note).collect(),
            notes,
        }
    }

    /// Fits the photo to the rig's grid: unchanged if it has the size of the rig's photos or is a
    /// part of one, cut if it shows the whole sensor, resampled if only its size differs.
    ///
    /// # Errors
    /// [`Flaw::Shape`] for a photo of another shape, [`Flaw::RawSize`] for a raw photo of another
    /// size.
    pub fn fit(mut self, grid: impl Into<PhotoGrid>) -> Result<Photo, PictureError> {
        let grid = grid.into();
        if self.raw.is_none() && shape::is_upright(self.light.size(), self.manner.orientation, grid)
        {
            self.lay_on_side();
        }
        let PhotoGrid { sensor, photo, .. } = grid;
        let (found, allowed) = (self.light.size(), photo.size);
        if found == allowed {
            let ours = self.camera.as_ref().is_some_and(|camera| camera.setting.is_some());
            if self.raw.is_some() && found != sensor && !ours {
                self.notes.push(format!(
                    "the raw photo does not record which part of the sensor its {found} sites are; \
                     they were taken for the rig's photo"
                ));
            }
            return Ok(self);
        }
        if self.raw.is_none() && shape::is_part(found, grid) {
            return Ok(self);
        }
        // The coefficients hold for the whole picture at its stored size only.
        self.coding = None;
        if found == sensor {
            self.cut(photo);
            return Ok(self);
        }
        if self.raw.is_some() {
            return Err(Flaw::RawSize { found, allowed, sensor }.of(&self.name));
        }
        let checked = shape::check(found, self.manner.orientation, grid);
        checked.map_err(|flaw| flaw.of(&self.name))?;
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

    /// Lays a photo in portrait on its side, as if the camera had been turned clockwise.
    fn lay_on_side(&mut self) {
        let on_side = Orientation::Rotate270;
        self.light = Frame::from_fn(|channel| turn(self.light.plane(channel), on_side));
        self.manner.alpha = self.manner.alpha.as_ref().map(|alpha| turn(alpha, on_side));
        self.manner.orientation = Orientation::Rotate90;
        (self.stored, self.coding) = (self.light.size(), None);
        self.is_side_guessed = true;
    }

    /// Turns the photo by half a turn, and changes its orientation so that its result has the same
    /// side up. A JPEG's coefficients are dropped.
    pub fn turn_by_half(&mut self) {
        // Tags 1 and 3, 2 and 4, 5 and 7, 6 and 8 of EXIF differ by half a turn.
        let tag = ((self.manner.orientation.to_exif() - 1) ^ 2) + 1;
        self.manner.orientation = Orientation::from_exif(tag).unwrap_or(Orientation::NoTransforms);
        self.light.turn_by_half();
        self.manner.alpha.iter_mut().for_each(Plane::turn_by_half);
        self.coding = None;
    }

    fn cut(&mut self, rect: Rect) {
        let all = self.light.size();
        self.light = Frame::from_fn(|channel| self.light.plane(channel).crop(rect));
        self.manner.alpha = self.manner.alpha.as_ref().map(|alpha| alpha.crop(rect));
        if let Some(raw) = &mut self.raw {
            raw.mosaic = raw.mosaic.from_place(rect.x, rect.y);
        }
        let kept = rect.size;
        // `stored` is compared to find lost resolution, and a cut loses none.
        self.stored = kept;
        self.losses.push(format!(
            "the photo was cropped from the whole sensor, {all}, to the rig's photo, {kept}"
        ));
    }

    /// Why a photo with fewer pixels than the rig's is returned as it is; `None` for others.
    pub fn why_too_small(&self) -> Option<String> {
        let (found, allowed) = (self.stored, self.light.size());
        (found.area() < allowed.area()).then(|| {
            format!(
                "the photo has fewer pixels than this rig's photos, {found} in place of {allowed}: \
                 if it were enlarged, its own blur and blocks would be taken for the lens's blur; \
                 drop the camera's original file"
            )
        })
    }

    /// Notes on the file for the report of a result of the format `result`; `None` where the file
    /// itself is returned.
    pub fn report_notes(&self, result: Option<Format>) -> Vec<String> {
        let Some(format) = result else { return self.notes.clone() };
        let mut notes = self.losses.clone();
        if self.file.format.is_none() && self.raw.is_none() {
            notes.push(format!("a photo of this kind comes back as {}", format.name()));
        }
        if self.manner.alpha.is_some() && format == Format::Jpeg {
            notes.push("not in the result: transparency, which a JPEG cannot hold".to_owned());
        }
        notes.extend(self.notes.clone());
        notes
    }

    /// The EXIF orientation by which the result is turned; `None` when it is delivered as stored.
    pub fn turned(&self) -> Option<u8> {
        Some(self.manner.orientation.to_exif()).filter(|&tag| tag != 1)
    }
}

impl Raster {
    /// The curve of the ICC profile, or else `curve`, with a note on a profile that is not used.
    fn tone(&self, curve: Curve, notes: &mut Vec<String>) -> Tone {
        // A file that states sRGB's curve keeps it on a linear rig, too.
        let curve = if self.is_srgb { Curve::Srgb } else { curve };
        let bits = bits_of(self.colour);
        let tone = Tone::of_curve(curve, bits);
        let Some(icc) = &self.icc else { return tone };
        Tone::of_profile(icc, bits, !self.colour.has_color()).unwrap_or_else(|why| {
            notes.push(format!(
                "the embedded ICC profile was not used, {why}; {} was assumed",
                tone.origin()
            ));
            tone
        })
    }

    /// Whether every pixel is grey. Equal samples under a profile need not be.
    fn is_grey(&self) -> bool {
        let equal = |p: &[u16]| p[0] == p[1] && p[1] == p[2];
        let mut pixels = self.samples.chunks_exact(self.step());
        !self.colour.has_color() || (self.icc.is_none() && pixels.all(equal))
    }

    /// The plane of the samples at index `at` of each pixel, converted by `value`.
    fn plane(&self, at: usize, value: impl Fn(u16) -> f32) -> Plane {
        let own = self.samples.iter().skip(at).step_by(self.step());
        let values = own.map(|&code| value(code)).collect();
        Plane::from_vec(self.size, values).unwrap_or_else(|| Plane::zeros(self.size))
    }

    /// The alpha plane, 0..1.
    fn alpha(&self) -> Option<Plane> {
        let top = if bits_of(self.colour) == 8 { 255.0 } else { 65535.0 };
        let last = self.step() - 1;
        self.colour.has_alpha().then(|| self.plane(last, |alpha| f32::from(alpha) / top))
    }
}

/// The samples of a picture embedded in the program, as codes 0..255 with no curve undone.
///
/// # Panics
/// When `bytes` are no whole JPEG, PNG or TIFF, which a test of the embedded pictures rules out.
pub fn embedded(bytes: &'static [u8]) -> [Plane; 3] {
    let raster = decode(bytes, &Limits::default()).expect("embedded pictures decode");
    let scale = if bits_of(raster.colour) == 8 { 1.0 } else { 1.0 / 257.0 };
    let place = |channel| if raster.colour.has_color() { channel } else { 0 };
    [0, 1, 2].map(|channel| raster.plane(place(channel), |code| f32::from(code) * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photo_with_fewer_pixels_than_the_rig_s_is_too_small() {
        let bytes = include_bytes!("../../tests/jpegs/grey.jpg");
        let photo = Photo::from_bytes("a.jpg", bytes, Curve::Srgb, &Limits::default()).unwrap();
        let why = |size| photo.clone().fit(size).unwrap().why_too_small();
        assert_eq!((why(Size::new(75, 50)), why(Size::new(45, 30))), (None, None));
        let words = why(Size::new(150, 100)).unwrap();
        assert!(words.contains("75×50 in place of 150×100"), "{words}");
    }

    #[test]
    fn a_jpeg_saved_again_as_png_has_its_coefficients_and_a_note() {
        let jpeg = include_bytes!("../../tests/scenes/rocket.jpg");
        let decoded = image::load_from_memory(jpeg).unwrap();
        let mut png = std::io::Cursor::new(Vec::new());
        decoded.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let of = |name, bytes: &[u8]| {
            Photo::from_bytes(name, bytes, Curve::Srgb, &Limits::default()).unwrap()
        };
        let (first, again) = (of("a.jpg", jpeg), of("a.png", png.get_ref()));
        let steps = |photo: &Photo| photo.coding.as_ref().unwrap().components[0].steps.clone();
        assert_eq!(steps(&first), steps(&again));
        assert!(!first.notes.contains(&ONCE_A_JPEG.to_owned()));
        assert!(again.notes.contains(&ONCE_A_JPEG.to_owned()));
        // A grey one with transparency.
        let grey = decoded.to_luma8();
        let (width, height) = (grey.width() as u16, grey.height() as u16);
        let (mut jpeg, mut png) = (Vec::new(), std::io::Cursor::new(Vec::new()));
        let encoder = jpeg_encoder::Encoder::new(&mut jpeg, 85);
        encoder.encode(&grey, width, height, jpeg_encoder::ColorType::Luma).unwrap();
        let decoded = image::load_from_memory(&jpeg).unwrap().into_luma_alpha8();
        decoded.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let (first, again) = (of("grey.jpg", &jpeg), of("grey.png", png.get_ref()));
        assert_eq!(steps(&first), steps(&again));
        assert_eq!(again.coding.map(|coding| coding.components.len()), Some(1));
    }

    #[test]
    fn another_shape_is_refused_by_the_header_alone() {
        let mut bytes = include_bytes!("../../tests/scenes/astronaut.png").to_vec();
        let data = bytes.windows(4).position(|of| of == b"IDAT").unwrap() + 4;
        // A broken stream with a valid checksum, which only decoding would notice.
        bytes[data..data + 100].fill(0x55);
        let length = u32::from_be_bytes(bytes[data - 8..data - 4].try_into().unwrap()) as usize;
        let crc = crc32fast::hash(&bytes[data - 4..data + length]);
        bytes[data + length..][..4].copy_from_slice(&crc.to_be_bytes());
        let words = |limits: Limits| {
            Photo::from_bytes("a.png", &bytes, Curve::Srgb, &limits).unwrap_err().to_string()
        };
        let limits = Limits::default();
        let shape = words(limits.on(Size::new(256, 192).into()));
        assert!(shape.contains("512×512") && shape.contains("256×192"), "{shape}");
        assert!(!words(limits.on(Size::new(256, 256).into())).contains("256×256"));
        assert!(!words(limits).contains("512×512"));
    }

    #[test]
    fn embedded_pictures_decode() {
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
