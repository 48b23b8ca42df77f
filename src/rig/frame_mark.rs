//! Frame marks: the number of the picture shown, in strips at the sensor's upper and lower edge.
//!
//! A number has eight bits and four check bits. Each bit is a light and a dark cell (Manchester
//! code), so that a strip's brightness, and its glare on the picture, is constant. Both strips
//! carry the same number, which reveals frames that mix two pictures, by rows or by time.

use std::ops::Range;

use super::coarse_geometry::CoarseGeometry;
use crate::config;
use crate::frame::{Channel, Codes, Counts, Plane, Size};

/// Bits of a picture's number. Numbers repeat after 256 pictures, more than any buffer holds.
const NUMBER_BITS: usize = 8;
const BITS: usize = NUMBER_BITS + 4;
const CELLS: usize = 2 * BITS;
/// Panel code of light cells, below white so that the sensor does not saturate.
const LIGHT_CODE: u8 = 200;
/// Value in place of a cell's index for a pixel of the black guard.
const BLACK: u8 = u8::MAX;
/// Minimum contrast of a bit relative to its usual contrast: rejects frames to which another
/// picture with the opposite bit contributes more than a tenth.
const CONTRAST_SHARE_MIN: f32 = 0.8;
/// Bands of a strip, each checked for remains of a mark, since a torn frame may show part of one.
const BANDS: usize = 4;
/// Maximum remains of a vanished mark in any band, as a share of the mark's contrast. On small
/// simulated rigs with glare, noise and other tone curves, pictures that resemble marks stay below
/// it and marks exceed 0.9 (`exposure_tests.rs`); mixtures are in between.
const REMAINS_MAX: f32 = 0.2;

/// Standard errors subtracted from estimated remains: one estimate in a thousand is off by more by
/// chance (Student's distribution, eleven degrees of freedom).
const ERRORS: f32 = 4.0;

/// Reading of the mark in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkReading {
    /// Both strips carry this number.
    Number(u8),
    /// The strips differ, or bits are between light and dark: the frame mixes two pictures.
    Mixed,
    /// No mark is visible.
    Nothing,
}

impl std::fmt::Display for MarkReading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            MarkReading::Number(number) => write!(f, "picture number {number} of 256"),
            MarkReading::Mixed => f.write_str("a mixture of two pictures"),
            MarkReading::Nothing => f.write_str("a frame without a readable mark"),
        }
    }
}

/// Place of the strips on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MarkPlace {
    /// Size of the sensor in pixels.
    pub sensor: Size,
    /// Distance from the upper or lower edge to the strip.
    pub from_edge_px: usize,
    /// Height of a strip.
    pub height_px: usize,
    /// Black border around the strips, so that no picture lights one cell of a bit more than the
    /// other.
    pub guard_px: usize,
    /// Whether the strips vanish before the capture.
    vanish: bool,
}

/// A place in a strip: its cell and the position within that, 0..1.
struct MarkCell {
    strip: usize,
    cell: usize,
    share: f64,
}

impl MarkPlace {
    /// Creates the place of strips that do not vanish.
    pub const fn still(
        sensor: Size,
        from_edge_px: usize,
        height_px: usize,
        guard_px: usize,
    ) -> MarkPlace {
        MarkPlace { sensor, from_edge_px, height_px, guard_px, vanish: false }
    }

    /// Place of a rig file's strips; `None` without `[marks]`.
    pub fn of(rig: &config::RigFile) -> Option<MarkPlace> {
        let marks = rig.marks.as_ref()?;
        let sensor = rig.camera.size();
        let (from_edge_px, height_px) = (marks.from_edge_px, marks.height_px);
        if marks.vanish {
            let radius = rig.calibration.function_support_px / 2;
            let place = MarkPlace::still(sensor, from_edge_px, height_px, radius);
            return Some(MarkPlace { vanish: true, ..place });
        }
        // The guard fills the space up to the canvas.
        let canvas = rig.canvas_on_sensor();
        let room = canvas.y.min(sensor.height - canvas.y - canvas.size.height);
        let guard_px = room.saturating_sub(from_edge_px + height_px);
        Some(MarkPlace::still(sensor, from_edge_px, height_px, guard_px))
    }

    /// Whether sensor row `row` is reserved for lasting marks and their guard.
    pub fn reserves(&self, row: usize) -> bool {
        !self.vanish && self.covers(row as f64)
    }

    fn first_row(&self, strip: usize) -> usize {
        match strip {
            0 => self.from_edge_px,
            _ => self.sensor.height - self.from_edge_px - self.height_px,
        }
    }

    /// Whether a row, on the sensor or beyond it, belongs to a strip or its guard.
    fn covers(&self, y: f64) -> bool {
        let begin = -((self.height_px + self.guard_px) as f64);
        let end = (self.from_edge_px + self.height_px + self.guard_px) as f64 - 0.5;
        let from_below = self.sensor.height as f64 - 1.0 - y;
        (begin..end).contains(&y) || (begin..end).contains(&from_below)
    }

    /// Cell at a sensor place, if any. Strips end a cell's width before the sensor's sides.
    fn cell_at(&self, [x, y]: [f64; 2]) -> Option<MarkCell> {
        let row = y + 0.5;
        let strip = (0..2).find(|&strip| {
            let first = self.first_row(strip) as f64;
            (first..first + self.height_px as f64).contains(&row)
        })?;
        let along = (x + 0.5) / self.sensor.width as f64 * (CELLS + 2) as f64 - 1.0;
        let inside = (0.0..CELLS as f64).contains(&along);
        inside.then_some(MarkCell { strip, cell: along as usize, share: along.fract() })
    }

    /// Sensor rows of a band of a strip.
    fn band(&self, strip: usize, band: usize) -> Range<usize> {
        let first = self.first_row(strip);
        let edge = |n: usize| first + n * self.height_px / BANDS;
        edge(band)..edge(band + 1)
    }
}

/// The bits of a number and its check bits, a weighted sum of its halves. No single flipped bit
/// gives another valid number.
fn bits(number: u8) -> [bool; BITS] {
    let check = u16::from(number >> 4).wrapping_mul(3).wrapping_add(u16::from(number & 15)) & 15;
    let word = u16::from(number) | check << NUMBER_BITS;
    std::array::from_fn(|n| word >> n & 1 == 1)
}

/// Mean difference of each bit's two cells in counts, for both strips; positive if the bit is set.
type Contrasts = [[f32; BITS]; 2];

/// Contrast of each bit, per band of both strips; 1 as in a mark, 0 without one.
pub(super) type MarkShares = [[[f32; BITS]; BANDS]; 2];

/// Frame marks of a rig.
#[derive(Debug, Clone)]
pub struct FrameMarks {
    place: MarkPlace,
    /// Panel pixels of the strips and the guard: (index, cell), with [`BLACK`] for the guard.
    pixels: Vec<(u32, u8)>,
    /// Panel pixels in the middle half of cells: `(index, [strip, band, cell])`.
    middles: Vec<(u32, [u8; 3])>,
    /// Usual contrast of each bit in counts.
    usual: Contrasts,
}

impl FrameMarks {
    /// Marks of a rig with this geometry and a panel of `panel` pixels; `None` if the strips are
    /// not entirely on the panel. [`FrameMarks::learn`] must follow.
    pub fn new(place: MarkPlace, geometry: &CoarseGeometry, panel: Size) -> Option<Self> {
        let (mut pixels, mut middles) = (Vec::new(), Vec::new());
        for y in 0..panel.height {
            for x in 0..panel.width {
                let at = geometry.sensor_at([x as f64, y as f64]);
                if place.covers(at[1]) {
                    let (index, found) = ((y * panel.width + x) as u32, place.cell_at(at));
                    pixels.push((index, found.as_ref().map_or(BLACK, |at| at.cell as u8)));
                    let is_middle = |at: &MarkCell| (0.25..0.75).contains(&at.share);
                    if let Some(MarkCell { strip, cell, .. }) = found.filter(is_middle) {
                        let row = (at[1] + 0.5) as usize;
                        let band = (0..BANDS).find(|&n| place.band(strip, n).contains(&row));
                        let band = band.unwrap_or(BANDS - 1);
                        middles.push((index, [strip, band, cell].map(|n| n as u8)));
                    }
                }
            }
        }
        let right = place.sensor.width as f64 - 1.0;
        let inside = (0..2).all(|strip| {
            let first = place.first_row(strip) as f64;
            let end = first + place.height_px as f64;
            [[0.0, first], [right, first], [0.0, end], [right, end]].into_iter().all(|corner| {
                let [x, y] = geometry.panel_at(corner);
                (0.0..panel.width as f64).contains(&x) && (0.0..panel.height as f64).contains(&y)
            })
        });
        (inside && !pixels.is_empty()).then_some(FrameMarks {
            place,
            pixels,
            middles,
            usual: [[0.0; BITS]; 2],
        })
    }

    /// Whether the strips vanish before the capture.
    pub(super) fn vanish(&self) -> bool {
        self.place.vanish
    }

    /// Likeness of `codes`, which carry no mark, to the mark `number`.
    pub(super) fn own_shares(&self, codes: &Codes, number: u8) -> MarkShares {
        let mut cells = [[[(0.0f32, 0.0f32); CELLS]; BANDS]; 2];
        // Approximate response of a panel.
        let light = |code: u8| (f32::from(code) / f32::from(LIGHT_CODE)).powf(2.2);
        let data = codes.plane(Channel::Green).data();
        for &(index, [strip, band, cell]) in &self.middles {
            let to = &mut cells[usize::from(strip)][usize::from(band)][usize::from(cell)];
            *to = (to.0 + light(data[index as usize]), to.1 + 1.0);
        }
        let mean = |(sum, pixels): (f32, f32)| sum / pixels.max(1.0);
        cells.map(|strip| {
            strip.map(|cells| {
                shares_of(number, |bit| mean(cells[2 * bit]) - mean(cells[2 * bit + 1]))
            })
        })
    }

    /// Whether the frame shows no remains of the mark `number`, given the picture's `own` likeness.
    pub(super) fn is_gone(&self, counts: &Counts, number: u8, own: &MarkShares) -> bool {
        self.remains(counts, number, own).all(|share| share < REMAINS_MAX)
    }

    /// Significant remains of the mark `number` in each band of both strips; 1 is a whole mark.
    pub(super) fn remains(
        &self,
        counts: &Counts,
        number: u8,
        own: &MarkShares,
    ) -> impl Iterator<Item = f32> {
        let plane = counts.plane(Channel::Green);
        let bands = (0..2).flat_map(|strip| (0..BANDS).map(move |band| (strip, band)));
        bands.filter_map(move |(strip, band)| {
            let rows = self.place.band(strip, band);
            let share =
                |bit: usize| self.contrast(plane, rows.clone(), bit) / self.usual[strip][bit];
            let seen = (!rows.is_empty()).then(|| shares_of(number, share))?;
            Some(significant_part(seen, own[strip][band]))
        })
    }

    /// Paints the mark `number` into `codes`.
    pub fn paint(&self, codes: &mut Codes, number: u8) {
        let bits = bits(number);
        for plane in codes.planes_mut() {
            let data = plane.data_mut();
            for &(index, cell) in &self.pixels {
                let light = cell != BLACK && bits[usize::from(cell / 2)] == (cell % 2 == 0);
                data[index as usize] = if light { LIGHT_CODE } else { 0 };
            }
        }
    }

    /// Learns the usual contrast of every bit as the median over `frames`, each with its number.
    /// Returns false if some bit has too little contrast to be read.
    pub fn learn(&mut self, frames: &[(u8, Counts)]) -> bool {
        let as_set = |(number, counts): &(u8, Counts)| {
            self.contrasts(counts).map(|strip| shares_of(*number, |bit| strip[bit]))
        };
        let seen: Vec<Contrasts> = frames.iter().map(as_set).collect();
        for strip in 0..2 {
            for bit in 0..BITS {
                let mut values: Vec<f32> =
                    seen.iter().map(|contrasts| contrasts[strip][bit]).collect();
                values.sort_by(f32::total_cmp);
                self.usual[strip][bit] = values.get(values.len() / 2).copied().unwrap_or(0.0);
            }
        }
        let strongest = self.usual.iter().flatten().copied().fold(0.0, f32::max);
        // Dark corners and blur reduce the contrast to half at worst; less than a fifth is noise.
        strongest > 0.0 && self.usual.iter().flatten().all(|&contrast| contrast > 0.2 * strongest)
    }

    /// Reads the mark in a frame.
    pub fn read(&self, counts: &Counts) -> MarkReading {
        let contrasts = self.contrasts(counts);
        let share = |strip: usize, bit: usize| contrasts[strip][bit] / self.usual[strip][bit];
        let shares: Contrasts = [0, 1].map(|strip| std::array::from_fn(|bit| share(strip, bit)));
        let all = shares.as_flattened();
        // Less than a quarter of the usual contrast is no mark: dark, another screen, panel off.
        if all.iter().map(|share| share.abs()).sum::<f32>() < 0.25 * all.len() as f32 {
            return MarkReading::Nothing;
        }
        if all.iter().any(|share| share.abs() < CONTRAST_SHARE_MIN) {
            return MarkReading::Mixed;
        }
        let [upper, lower] = shares.map(|strip| strip.map(|share| share > 0.0));
        let low_to_high = upper[..NUMBER_BITS].iter().rev();
        let number = low_to_high.fold(0u8, |number, &bit| number << 1 | u8::from(bit));
        if upper == lower && upper == bits(number) {
            MarkReading::Number(number)
        } else {
            MarkReading::Mixed
        }
    }

    fn contrasts(&self, counts: &Counts) -> Contrasts {
        let plane = counts.plane(Channel::Green);
        std::array::from_fn(|strip| {
            // The middle half of a strip.
            let (first, height_px) = (self.place.first_row(strip), self.place.height_px);
            let rows = first + height_px / 4..first + height_px - height_px / 4;
            std::array::from_fn(|bit| self.contrast(plane, rows.clone(), bit))
        })
    }

    /// Difference of a bit's first and second cell over `rows`, in counts.
    fn contrast(&self, plane: &Plane<u16>, rows: Range<usize>, bit: usize) -> f32 {
        let pitch = self.place.sensor.width as f32 / (CELLS + 2) as f32;
        let cell = |n: usize| mean_of_cell(plane, rows.clone(), (n + 1) as f32 * pitch, pitch);
        cell(2 * bit) - cell(2 * bit + 1)
    }
}

/// Contrast of each bit, positive where it agrees with the mark `number`.
fn shares_of(number: u8, contrast: impl Fn(usize) -> f32) -> [f32; BITS] {
    let bits = bits(number);
    std::array::from_fn(|bit| if bits[bit] { contrast(bit) } else { -contrast(bit) })
}

/// Share of a mark in `seen`, modelled as a mixture of the mark and the picture's `own` shares:
/// least-squares estimate over the bits, less [`ERRORS`] standard errors. A mark adds to all bits
/// alike; the picture's own blurred bars do not.
fn significant_part(seen: [f32; BITS], own: [f32; BITS]) -> f32 {
    let pairs = || seen.iter().zip(&own).map(|(seen, own)| (seen - own, 1.0 - own));
    let square = pairs().map(|(_, away)| away * away).sum::<f32>();
    let part = pairs().map(|(excess, away)| excess * away).sum::<f32>() / square;
    let error = pairs().map(|(excess, away)| (excess - part * away).powi(2)).sum::<f32>();
    part - ERRORS * (error / ((BITS - 1) as f32 * square)).sqrt()
}

/// Mean count of a cell over `rows` and the middle half of its columns.
fn mean_of_cell(plane: &Plane<u16>, rows: Range<usize>, left: f32, width: f32) -> f32 {
    let first = (left + 0.25 * width).round() as usize;
    let last = ((left + 0.75 * width).round() as usize).max(first + 1).min(plane.width());
    let (mut sum, mut pixels) = (0u64, 0u64);
    for row in rows {
        let row = &plane.row(row)[first..last];
        sum += row.iter().map(|&count| u64::from(count)).sum::<u64>();
        pixels += row.len() as u64;
    }
    sum as f32 / pixels.max(1) as f32
}

#[cfg(test)]
#[path = "frame_mark_tests.rs"]
mod tests;
