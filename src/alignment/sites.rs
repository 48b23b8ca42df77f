//! The green sites of a sensor, and its division into nine places.

use std::ops::RangeInclusive;

use crate::frame::{Channel, Counts, Mosaic, Plane, Size};

/// Places along a side of the sensor.
const SIDE: usize = 3;
/// Number of places.
pub const PLACES: usize = SIDE * SIDE;
/// Bins of a histogram.
pub(super) const BINS: usize = 32;

/// The place that contains column `x` and row `y`.
pub(super) fn place_of(x: usize, y: usize, size: Size) -> usize {
    (y * SIDE / size.height.max(1)) * SIDE + (x * SIDE / size.width.max(1)).min(SIDE - 1)
}

/// Mean of `light` at each place.
pub(super) fn means(light: &Plane) -> [f64; PLACES] {
    let (mut sums, mut count) = ([0.0; PLACES], [0.0f64; PLACES]);
    for y in 0..light.height() {
        for (x, &light_here) in light.row(y).iter().enumerate() {
            let place = place_of(x, y, light.size());
            sums[place] += f64::from(light_here);
            count[place] += 1.0;
        }
    }
    std::array::from_fn(|n| sums[n] / count[n].max(1.0))
}

/// All sites of a sensor without filters; one of green's two phases behind filters.
#[derive(Debug, Clone, Copy)]
pub struct GreenSites {
    mosaic: Option<Mosaic>,
}

impl GreenSites {
    /// The green sites behind `mosaic`.
    pub fn behind(mosaic: Option<Mosaic>) -> GreenSites {
        GreenSites { mosaic }
    }

    pub(super) fn are_filtered(self) -> bool {
        self.mosaic.is_some()
    }

    /// Spacing along a row or column, pixels.
    pub(super) fn step(self) -> usize {
        1 + usize::from(self.are_filtered())
    }

    /// Rows with green sites.
    pub(super) fn rows(self, size: Size) -> impl Iterator<Item = usize> {
        (0..size.height).step_by(self.step())
    }

    /// The first column with green sites.
    pub(super) fn first_column(self) -> usize {
        usize::from(self.mosaic.is_some_and(|m| m.colour_at(0, 0) != Channel::Green))
    }

    /// Columns of the green sites in one third of row `y`.
    pub(super) fn part_of_row(
        self,
        y: usize,
        part: usize,
        size: Size,
    ) -> std::iter::StepBy<std::ops::Range<usize>> {
        debug_assert!(y.is_multiple_of(self.step()));
        let end = |part: usize| part * size.width / SIDE;
        // The first such column at or after `x`.
        let from = |x: usize| x + (x + self.first_column()) % self.step();
        (from(end(part))..end(part + 1)).step_by(self.step())
    }

    /// Their counts over `black`, as a plane of green sites alone.
    pub(super) fn light(self, counts: &Counts, black: f64) -> Plane {
        let (plane, step) = (counts.plane(Channel::Green), self.step());
        let size = Size::new(plane.width() / step, plane.height() / step);
        let black = black as f32;
        Plane::from_fn(size, |x, y| {
            f32::from(plane.at(self.first_column() + x * step, y * step)) - black
        })
    }

    /// The sensor pixel of pixel (x, y) of that plane.
    pub(super) fn on_sensor(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let step = self.step() as f64;
        [self.first_column() as f64 + x * step, y * step]
    }

    /// Calls `each` with every measured count: one per site behind filters, else three per pixel.
    fn data(self, counts: &Counts, mut each: impl FnMut(u16)) {
        let Some(mosaic) = self.mosaic else {
            counts.planes().iter().flat_map(|plane| plane.data()).for_each(|&count| each(count));
            return;
        };
        for y in 0..counts.size().height {
            for phase in 0..2 {
                let row = counts.plane(mosaic.colour_at(phase, y)).row(y);
                row.iter().skip(phase).step_by(2).for_each(|&count| each(count));
            }
        }
    }

    /// Histogram of the measured counts up to `count_max`, and the saturated share.
    pub fn histogram(self, counts: &Counts, count_max: u16) -> (Histogram, f64) {
        let mut bins = [0u64; BINS];
        let (mut full, mut all) = (0u64, 0u64);
        let width = (usize::from(count_max) + 1).div_ceil(BINS);
        self.data(counts, |count| {
            full += u64::from(count >= count_max);
            all += 1;
            bins[(usize::from(count) / width).min(BINS - 1)] += 1;
        });
        (Histogram(bins), full as f64 / all.max(1) as f64)
    }
}

/// Number of counts in each of [`BINS`] equal parts of the camera's range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Histogram(pub [u64; BINS]);

impl Histogram {
    /// Heights of the bins relative to the highest, 0..1.
    fn heights(&self) -> [f64; BINS] {
        let most = self.0.iter().copied().max().unwrap_or(0).max(1) as f64;
        self.0.map(|count| count as f64 / most)
    }

    /// The histogram as a line of block characters, one per bin.
    pub fn line(&self) -> String {
        const BLOCKS: RangeInclusive<char> = '\u{2581}'..='\u{2588}';
        let block = |height: f64| match height {
            0.0 => ' ',
            height => BLOCKS.clone().nth((height * 7.99) as usize).unwrap_or(*BLOCKS.end()),
        };
        self.heights().into_iter().map(block).collect()
    }
}
