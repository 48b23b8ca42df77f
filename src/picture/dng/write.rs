//! Writing of a sensor's sites as a DNG file.

use std::io::Cursor;

use tiff::TiffResult;
use tiff::encoder::{
    DirectoryEncoder, Rational, SRational, TiffEncoder, TiffKindStandard, TiffValue,
};
use tiff::tags::Tag;

use super::camera::RawTags;
use super::{
    AS_SHOT_NEUTRAL, BITS_PER_SAMPLE, BLACK_LEVEL, CALIBRATION_ILLUMINANTS, CFA_LAYOUT,
    CFA_PATTERN, CFA_PLANE_COLOUR, CFA_REPEAT, COLOUR_MATRICES, COMPRESSION, D65,
    DEFAULT_CROP_ORIGIN, DEFAULT_CROP_SIZE, DESCRIPTION, DNG_VERSION, IMAGE_LENGTH, IMAGE_WIDTH,
    MAKE, MODEL, NEW_SUBFILE_TYPE, NOISE_PROFILE, ORIENTATION, OUR_MAKE, PHOTOMETRIC,
    ROWS_PER_STRIP, SAMPLES_PER_PIXEL, SERIAL, SITES, STRIP_BYTE_COUNTS, STRIP_OFFSETS,
    WHITE_LEVEL, colours,
};
use crate::frame::{Mosaic, Plane, Rect};
use crate::picture::tiff::LETTERS_MAX;

const SOFTWARE: u16 = 305;
const EXPOSURE_TIME: u16 = 33434;
const DNG_BACKWARD_VERSION: u16 = 50707;
const UNIQUE_CAMERA_MODEL: u16 = 50708;

/// A raw photo to be written.
#[derive(Debug, Clone, Copy)]
pub struct Dng<'a> {
    /// Counts of the sensor.
    pub sites: &'a Plane<u16>,
    /// Colour filters of the sites.
    pub mosaic: Mosaic,
    /// Counts without light, 0..65535.
    pub black: f64,
    /// The largest count, above `black`.
    pub white: u16,
    /// Name of the rig, written as the camera's model.
    pub camera: &'a str,
    /// Exposure time, seconds, if known.
    pub exposure_s: Option<f64>,
    /// The rig's photo, where it is a part of the sensor.
    pub crop: Option<Rect>,
    /// Further metadata.
    pub tags: RawTags<'a>,
}

impl Dng<'_> {
    /// The file's bytes: the sites in one strip, then the directory.
    ///
    /// # Panics
    /// When the sites fill more than the 4 GiB of a TIFF file, which no sensor's frame does.
    pub fn bytes(&self) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        self.write(&mut file).expect("memory takes every byte of a sensor's frame");
        file.into_inner()
    }

    fn write(&self, file: &mut Cursor<Vec<u8>>) -> TiffResult<()> {
        let size = self.sites.size();
        let (width, height) = (size.width as u32, size.height as u32);
        let mut encoder = TiffEncoder::new(file)?;
        let mut directory = encoder.image_directory()?;
        let at = directory.write_data(self.sites.data())? as u32;
        let d = &mut directory;
        put(d, NEW_SUBFILE_TYPE, 0u32)?;
        put(d, IMAGE_WIDTH, width)?;
        put(d, IMAGE_LENGTH, height)?;
        put(d, BITS_PER_SAMPLE, 16u16)?;
        put(d, COMPRESSION, 1u16)?;
        put(d, PHOTOMETRIC, SITES as u16)?;
        if let Some(setting) = self.tags.setting {
            put(d, DESCRIPTION, &*plain(&setting.words()))?;
        }
        put(d, MAKE, OUR_MAKE)?;
        put(d, MODEL, &*plain(self.camera))?;
        put(d, STRIP_OFFSETS, at)?;
        put(d, ORIENTATION, 1u16)?;
        put(d, SAMPLES_PER_PIXEL, 1u16)?;
        put(d, ROWS_PER_STRIP, height)?;
        put(d, STRIP_BYTE_COUNTS, 2 * width * height)?;
        put(d, SOFTWARE, concat!("relens ", env!("CARGO_PKG_VERSION")))?;
        put(d, CFA_REPEAT, &[2u16, 2][..])?;
        let colours = [0, 1, 2, 3].map(|n| self.mosaic.colour_at(n % 2, n / 2).index() as u8);
        put(d, CFA_PATTERN, &colours[..])?;
        if let Some(exposure) = self.exposure_s {
            put(d, EXPOSURE_TIME, fraction(exposure, 1_000_000))?;
        }
        put(d, DNG_VERSION, &[1u8, 4, 0, 0][..])?;
        put(d, DNG_BACKWARD_VERSION, &[1u8, 1, 0, 0][..])?;
        put(d, UNIQUE_CAMERA_MODEL, &*super::camera_of(self.camera))?;
        put(d, CFA_PLANE_COLOUR, &[0u8, 1, 2][..])?;
        put(d, CFA_LAYOUT, 1u16)?;
        put(d, BLACK_LEVEL, fraction(self.black, 10_000))?;
        put(d, WHITE_LEVEL, u32::from(self.white))?;
        if let Some(Rect { x, y, size }) = self.crop {
            put(d, DEFAULT_CROP_ORIGIN, &[x as u32, y as u32][..])?;
            put(d, DEFAULT_CROP_SIZE, &[size.width as u32, size.height as u32][..])?;
        }
        let (of_xyz, neutral) = colours::numbers_of(self.tags.gains);
        put(d, COLOUR_MATRICES[0], &of_xyz.map(|n| SRational { n, d: 10_000 })[..])?;
        put(d, AS_SHOT_NEUTRAL, &neutral.map(|v| fraction(v, 10_000))[..])?;
        if let Some(serial) = self.tags.serial {
            put(d, SERIAL, &*plain(serial))?;
        }
        put(d, CALIBRATION_ILLUMINANTS[0], D65)?;
        if let Some(noise) = self.tags.noise {
            put(d, NOISE_PROFILE, noise.as_flattened())?;
        }
        directory.finish()
    }
}

fn put<T: TiffValue>(directory: &mut DirectoryAt<'_>, tag: u16, value: T) -> TiffResult<()> {
    directory.write_tag(Tag::from_u16_exhaustive(tag), value)
}

type DirectoryAt<'a> = DirectoryEncoder<'a, &'a mut Cursor<Vec<u8>>, TiffKindStandard>;

/// `words` in ASCII, as TIFF requires, cut to [`LETTERS_MAX`] letters.
pub(super) fn plain(words: &str) -> String {
    let letter = |c: char| if c.is_ascii_graphic() || c == ' ' { c } else { '_' };
    let plain: String = words.chars().take(LETTERS_MAX).map(letter).collect();
    plain.trim().to_owned()
}

/// `value` as a fraction with the denominator `d`.
fn fraction(value: f64, d: u32) -> Rational {
    Rational { n: (value * f64::from(d)).round() as u32, d }
}
