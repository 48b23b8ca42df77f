//! Raw photos: a sensor's uncompressed sites in a DNG (1.4, Adobe) or TIFF/EP (ISO 12234-2) file.
//! Other varieties are refused, and a preview is never read in place of the sites.

mod blocks;
mod camera;
mod colours;
mod write;

use std::collections::BTreeSet;

use super::Flaw;
use super::exif::{self, MAKE, MODEL};
use super::metadata::{Lost, Walked};
use super::tiff::{
    BITS_PER_SAMPLE, COMPRESSION, DNG_VERSION, Directory, FILL_ORDER, File, IMAGE_LENGTH,
    IMAGE_WIDTH, IPTC, NEW_SUBFILE_TYPE, PHOTOMETRIC, ROWS_PER_STRIP, SAMPLE_FORMAT,
    SAMPLES_PER_PIXEL, STRIP_BYTE_COUNTS, STRIP_OFFSETS, SUB_DIRECTORIES,
};
use crate::frame::{FULL_SCALE, Mosaic, PhotoGrid, Plane, Rect, Size};
use blocks::SiteBlocks;

pub use camera::{PhotoCamera, RawTags, RigSetting};
pub use colours::CameraColours;
pub use write::Dng;

const XMP: u16 = 700;
const DESCRIPTION: u16 = 270;
const ORIENTATION: u16 = 274;
const CFA_REPEAT: u16 = 33421;
const CFA_PATTERN: u16 = 33422;
const CFA_PLANE_COLOUR: u16 = 50710;
const CFA_LAYOUT: u16 = 50711;
const LINEARIZATION: u16 = 50712;
const BLACK_REPEAT: u16 = 50713;
const BLACK_LEVEL: u16 = 50714;
const BLACK_ALONG: u16 = 50715;
const BLACK_DOWN: u16 = 50716;
const WHITE_LEVEL: u16 = 50717;
const DEFAULT_CROP_ORIGIN: u16 = 50719;
const DEFAULT_CROP_SIZE: u16 = 50720;
const COLOUR_MATRICES: [u16; 2] = [50721, 50722];
const AS_SHOT_NEUTRAL: u16 = 50728;
const SERIAL: u16 = 50735;
const PRIVATE: u16 = 50740;
const CALIBRATION_ILLUMINANTS: [u16; 2] = [50778, 50779];
const ACTIVE_AREA: u16 = 50829;
const NOISE_PROFILE: u16 = 51041;

/// Value of [`PHOTOMETRIC`] for sites behind colour filters.
const SITES: usize = 32803;
/// Value of [`PHOTOMETRIC`] for a demosaiced picture, or a sensor without colour filters.
const LINEAR_RAW: usize = 34892;
/// Value of [`PHOTOMETRIC`] for grey.
const BLACK_IS_ZERO: usize = 1;

/// Value of [`CALIBRATION_ILLUMINANTS`] for D65.
const D65: u16 = 21;

/// Value of [`MAKE`] in relens's own raw photos.
pub(crate) const OUR_MAKE: &str = "relens";

/// Most directories, so that a hostile file does not keep the program busy. Guess.
const DIRECTORIES_MAX: usize = 32;

/// Fields, with their names, that are supported only with the value 1, the default if missing.
const ONLY: [(u16, &str); 5] = [
    (COMPRESSION, "compression"),
    (FILL_ORDER, "order of bits"),
    (SAMPLES_PER_PIXEL, "samples a pixel"),
    (SAMPLE_FORMAT, "sample format"),
    (CFA_LAYOUT, "layout of the colour filters"),
];

/// Fields that are not supported, and their names.
const NEVER: [(u16, &str); 3] = [
    (LINEARIZATION, "a table to make its counts linear"),
    (BLACK_ALONG, "a black level for each column"),
    (BLACK_DOWN, "a black level for each row"),
];

/// Maker and model in photos of the rig `name`.
pub(crate) fn camera_of(name: &str) -> String {
    format!("{OUR_MAKE} {}", write::plain(name))
}

/// A raw photo found in a file, its counts not yet read.
#[derive(Debug)]
pub(super) struct RawFile {
    pub(super) size: Size,
    pub(super) sites: Sites,
    /// Orientation as EXIF's number.
    pub(super) orientation: u8,
    /// Fields that describe the photo, as an EXIF block.
    pub(super) exif: Option<Vec<u8>>,
    pub(super) lost: BTreeSet<Lost>,
    /// The camera, as far as stated.
    pub(super) camera: Option<PhotoCamera>,
    /// Conversion of the camera's colours; `None` if they are sRGB's, or not stated.
    pub(super) colours: Option<CameraColours>,
    /// Stated noise of each channel: variance without light, and variance per grey level, squared
    /// grey levels.
    pub(super) noise: Option<[[f32; 2]; 3]>,
    blocks: SiteBlocks,
    /// The part of the sites that sees light.
    active: Rect,
    /// The part of the active sites that the file proposes to show (DNG 1.4, DefaultCropOrigin).
    crop: Option<Rect>,
}

/// Scale of a sensor's counts, and pattern of its colour filters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sites {
    /// `None` for a sensor without colour filters.
    pub(super) mosaic: Option<Mosaic>,
    /// Counts without light, for two rows and columns of the pattern.
    black: [[f32; 2]; 2],
    /// The largest count.
    white: f32,
}

/// The raw photo in a TIFF's `bytes`; `None` for a TIFF without one.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`], [`Flaw::Damaged`], or [`Flaw::Unsupported`] for a raw
/// photo of another variety.
pub(super) fn find(bytes: &[u8]) -> Result<Option<RawFile>, Flaw> {
    let file = File::new(bytes);
    // The place of each directory, and whether the file is invalid without it: what follows a plain
    // TIFF's picture may be damaged.
    let mut waiting = vec![(file.u32(4)? as usize, true)];
    let mut all: Vec<Directory> = Vec::new();
    let mut declared = false;
    while let Some((at, needed)) = waiting.pop() {
        if all.len() == DIRECTORIES_MAX || all.iter().any(|known| known.at == at) {
            continue;
        }
        let read = Directory::read(&file, at).and_then(|directory| {
            let next = directory.next()?;
            let below = directory.numbers(SUB_DIRECTORIES)?.unwrap_or_default();
            waiting.extend(below.into_iter().take(DIRECTORIES_MAX).map(|at| (at, true)));
            Ok((directory, next))
        });
        match read {
            Ok((directory, next)) => {
                declared |= directory.find(DNG_VERSION).is_some() || directory.is_raw();
                waiting.extend((next > 0).then_some((next, false)));
                all.push(directory);
            }
            Err(flaw) if needed || declared => return Err(flaw),
            Err(_) => {}
        }
    }
    if !declared {
        return Ok(None);
    }
    let is_main = |d: &&Directory<'_>| matches!(d.number(NEW_SUBFILE_TYPE), Ok(None | Some(0)));
    let is_grey = |d: &&Directory<'_>| matches!(d.number(PHOTOMETRIC), Ok(Some(BLACK_IS_ZERO)));
    let mut main = all.iter().filter(is_main);
    let directory = main.clone().find(|d| d.is_raw()).or_else(|| main.find(is_grey));
    let directory =
        directory.ok_or_else(|| unsupported("no picture of a sensor's sites".to_owned()))?;
    let table = [(XMP, Lost::XMP), (IPTC, Lost::IPTC), (PRIVATE, Lost::MAKER_NOTES)];
    let held = |tag: &u16| all.iter().any(|d| d.find(*tag).is_some());
    let mut raw = directory.raw_file(&all[0])?;
    raw.exif = exif::of_tiff(&file, &[all[0].at, directory.at]);
    raw.lost = table.into_iter().filter(|(tag, _)| held(tag)).map(|(_, lost)| lost).collect();
    raw.lost.extend(all.iter().any(Directory::has_maker_notes).then_some(Lost::MAKER_NOTES));
    Ok(Some(raw))
}

impl RawFile {
    /// Result of the walk over the file, with the size of all sites, masked ones included.
    pub(super) fn walked(&self) -> Walked {
        Walked { size: Some(self.blocks.size), ..Walked::default() }
    }

    /// Cuts the photo to the part that the file proposes to show, if that part has a size of the
    /// rig's `grid` and the whole photo does not.
    pub(super) fn on(mut self, grid: Option<PhotoGrid>) -> RawFile {
        let fits = |size| grid.is_some_and(|grid| [grid.sensor, grid.photo.size].contains(&size));
        let crop = self.crop.filter(|crop| !fits(self.size) && fits(crop.size));
        if let Some(Rect { x, y, size }) = crop {
            let Sites { mosaic, black, .. } = &mut self.sites;
            *mosaic = mosaic.map(|mosaic| mosaic.from_place(x, y));
            let all = *black;
            *black = [0, 1].map(|j| [0, 1].map(|i| all[(y + j) % 2][(x + i) % 2]));
            self.active = Rect { x: self.active.x + x, y: self.active.y + y, size };
            self.size = size;
        }
        self
    }

    /// The counts of the photo, row by row, in the `bytes` of its file.
    pub(super) fn counts(&self, bytes: &[u8]) -> Vec<u16> {
        self.blocks.counts(bytes, self.active)
    }
}

impl Sites {
    pub(super) fn counts_per_level(&self) -> f32 {
        let black = self.black.as_flattened().iter().sum::<f32>() / 4.0;
        (self.white - black) / FULL_SCALE
    }

    /// The light of `counts`: white is 255, and noise may be below 0.
    pub(super) fn light(&self, size: Size, counts: &[u16]) -> Plane {
        let (per_level, width) = (self.counts_per_level(), size.width);
        Plane::from_fn(size, |x, y| {
            (f32::from(counts[y * width + x]) - self.black[y % 2][x % 2]) / per_level
        })
    }
}

impl Directory<'_> {
    fn is_raw(&self) -> bool {
        matches!(self.number(PHOTOMETRIC), Ok(Some(SITES | LINEAR_RAW)))
    }

    /// The raw photo whose sites are in this directory; the `first` directory may describe it, too.
    fn raw_file(&self, first: &Directory<'_>) -> Result<RawFile, Flaw> {
        let is_sites = self.number(PHOTOMETRIC)? == Some(SITES);
        if !is_sites && self.number(SAMPLES_PER_PIXEL)?.unwrap_or(1) > 1 {
            return Err(unsupported("a partly developed picture (linear DNG)".to_owned()));
        }
        for (tag, name) in ONLY {
            match self.number(tag)?.unwrap_or(1) {
                1 => {}
                how if tag == COMPRESSION => {
                    return Err(unsupported(format!("compressed counts (compression {how})")));
                }
                found => return Err(unsupported(format!("{name} {found} in place of 1"))),
            }
        }
        if let Some((_, what)) = NEVER.iter().find(|(tag, _)| self.find(*tag).is_some()) {
            return Err(unsupported((*what).to_owned()));
        }
        let size = Size::new(
            self.number(IMAGE_WIDTH)?.unwrap_or_default(),
            self.number(IMAGE_LENGTH)?.unwrap_or_default(),
        );
        // A TIFF file ends below 4 GiB, and a site has two bytes.
        let holds = |area: usize| area <= u32::MAX as usize / 2;
        if size.width.min(size.height) < 2
            || !size.width.checked_mul(size.height).is_some_and(holds)
        {
            let found = format!("a picture of {size}");
            return Err(self
                .file
                .damaged(&found, "at least 2×2 and no more sites than 4 GiB hold"));
        }
        let bits = self.number(BITS_PER_SAMPLE)?.unwrap_or(1);
        if !blocks::BITS.contains(&bits) {
            return Err(unsupported(format!("bits a sample {bits} in place of 8 to 16")));
        }
        let active = self.active_area(size)?;
        let is_filtered = is_sites || self.find(CFA_PATTERN).is_some();
        let mosaic = if is_filtered { Some(self.mosaic()?) } else { None };
        let sites = Sites { mosaic, ..self.levels(bits)? };
        let blocks = SiteBlocks::of(self, size, bits)?;
        let turned = first.number(ORIENTATION)?.or(self.number(ORIENTATION)?);
        let colours = first.colours().or_else(|| self.colours());
        Ok(RawFile {
            size: active.size,
            sites,
            blocks,
            active,
            crop: self.default_crop(active.size),
            orientation: turned.and_then(|o| u8::try_from(o).ok()).unwrap_or(1),
            exif: None,
            lost: BTreeSet::new(),
            camera: first.camera(),
            colours: colours.filter(|_| mosaic.is_some()),
            noise: self.noise().or_else(|| first.noise()),
        })
    }

    /// The part whose sites see light; the filter pattern and the black levels begin at its corner.
    fn active_area(&self, size: Size) -> Result<Rect, Flaw> {
        let Some(area) = self.numbers(ACTIVE_AREA)? else {
            return Ok(Rect { x: 0, y: 0, size });
        };
        let [top, left, bottom, right] = area[..] else {
            return Err(self.file.damaged(&format!("an active area of {area:?}"), "four sides"));
        };
        let holds = |from: usize, to: usize, side: usize| from + 2 <= to && to <= side;
        if !holds(top, bottom, size.height) || !holds(left, right, size.width) {
            let found = format!("an active area from {left}, {top} to {right}, {bottom} of {size}");
            return Err(self.file.damaged(&found, "a part of the picture"));
        }
        Ok(Rect { x: left, y: top, size: Size::new(right - left, bottom - top) })
    }

    /// The part of a picture of `size` that the file proposes to show, if stated in whole sites.
    fn default_crop(&self, size: Size) -> Option<Rect> {
        let pair = |tag| -> Option<[usize; 2]> {
            let numbers: [f32; 2] = self.reals(tag).ok()??.try_into().ok()?;
            let is_whole = |v: &f32| v.fract() == 0.0 && (0.0..1e6).contains(v);
            numbers.iter().all(is_whole).then(|| numbers.map(|v| v as usize))
        };
        let ([x, y], [width, height]) = (pair(DEFAULT_CROP_ORIGIN)?, pair(DEFAULT_CROP_SIZE)?);
        let is_inside = x + width <= size.width && y + height <= size.height;
        is_inside.then(|| Rect { x, y, size: Size::new(width, height) })
    }

    fn camera(&self) -> Option<PhotoCamera> {
        let text = |tag| self.text(tag).ok().flatten().filter(|text| !text.is_empty());
        let setting = text(DESCRIPTION).and_then(|words| RigSetting::of_words(&words));
        Some(PhotoCamera { name: exif::camera_in(self)?, serial: text(SERIAL), setting })
    }

    /// The camera's colours, if stated and valid; of two matrices, the one for daylight is used.
    fn colours(&self) -> Option<CameraColours> {
        let daylight = |&n: &usize| {
            self.number(CALIBRATION_ILLUMINANTS[n]).is_ok_and(|v| v == Some(D65.into()))
        };
        let [first, second] = COLOUR_MATRICES.map(|tag| self.reals(tag).ok().flatten());
        let chosen = (0..2).find(daylight).unwrap_or(0);
        let of_xyz = if chosen == 1 { second.or(first) } else { first }?;
        let neutral = self.reals(AS_SHOT_NEUTRAL).ok().flatten()?;
        let [red, green, blue] = neutral[..] else { return None };
        let of_xyz: Vec<f64> = of_xyz.into_iter().map(f64::from).collect();
        CameraColours::of_file(&of_xyz, [red, green, blue].map(f64::from))
    }

    /// The stated noise of each channel; the file states it once for all channels, or for each.
    fn noise(&self) -> Option<[[f32; 2]; 3]> {
        let stated = self.reals(NOISE_PROFILE).ok().flatten()?;
        let each = match stated.len() {
            2 => [0; 3],
            6 => [0, 2, 4],
            _ => return None,
        };
        let noise = each.map(|n| [stated[n + 1] * FULL_SCALE.powi(2), stated[n] * FULL_SCALE]);
        noise.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0).then_some(noise)
    }

    fn mosaic(&self) -> Result<Mosaic, Flaw> {
        let of = |tag| self.numbers(tag).map(Option::unwrap_or_default);
        let (repeat, pattern) = (of(CFA_REPEAT)?, of(CFA_PATTERN)?);
        let planes = self.numbers(CFA_PLANE_COLOUR)?.unwrap_or_else(|| vec![0, 1, 2]);
        let is = |mosaic: &Mosaic| {
            let place = |n: usize| mosaic.colour_at(n % 2, n / 2).index();
            repeat == [2, 2] && planes == [0, 1, 2] && pattern == [0, 1, 2, 3].map(place)
        };
        if pattern.is_empty() {
            return Err(unsupported("no colour filters".to_owned()));
        }
        Mosaic::ALL.into_iter().find(is).ok_or_else(|| {
            unsupported(format!(
                "colour filters {:?} repeating by {:?}",
                &pattern[..pattern.len().min(4)],
                &repeat[..repeat.len().min(2)]
            ))
        })
    }

    /// Black and white levels, as [`Sites`] whose mosaic is still to be set.
    fn levels(&self, bits: usize) -> Result<Sites, Flaw> {
        let repeat = self.numbers(BLACK_REPEAT)?.unwrap_or_else(|| vec![1, 1]);
        let [rows @ 1..=2, columns @ 1..=2] = repeat[..] else {
            let found = format!("black levels repeating by {:?}", &repeat[..repeat.len().min(2)]);
            return Err(unsupported(found));
        };
        let black = self.reals(BLACK_LEVEL)?.unwrap_or_else(|| vec![0.0; rows * columns]);
        if black.len() != rows * columns {
            let found = format!("{} black levels for {rows}×{columns} sites", black.len());
            return Err(self.file.damaged(&found, "one for each"));
        }
        let place = |y: usize, x: usize| black[(y % rows) * columns + x % columns];
        let black = [0, 1].map(|y| [0, 1].map(|x| place(y, x)));
        let white = self.number(WHITE_LEVEL)?.unwrap_or((1 << bits) - 1);
        let largest = black.as_flattened().iter().copied().fold(0.0, f32::max);
        let sound = black.as_flattened().iter().all(|b| b.is_finite());
        if !sound || white > 65535 || white as f32 - largest < 1.0 {
            let found = format!("black at {largest} and white at {white} counts");
            return Err(self.file.damaged(&found, "white above black, up to 65535"));
        }
        Ok(Sites { mosaic: None, black, white: white as f32 })
    }
}

fn unsupported(found: String) -> Flaw {
    let allowed = "counts of a sensor's sites, of 8, 10, 12, 14 or 16 bits, behind filters of \
                   three colours that repeat by two or behind none, uncompressed; convert it so, \
                   or develop it with the camera maker's program, without sharpening and lens \
                   corrections, and save it as TIFF of 16 bits; previews are not restored";
    Flaw::Unsupported { kind: "raw photo", found, allowed }
}

#[cfg(test)]
mod foreign_tests;
#[cfg(test)]
mod layout_tests;
#[cfg(test)]
mod tests;
