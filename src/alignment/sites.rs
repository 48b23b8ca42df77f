//! The green sites of a sensor, and its division into nine places.

use crate::frame::{Channel, Counts, Mosaic, Plane, Size};

/// Number of places along a side of the sensor.
const SIDE: usize = 3;
/// Number of places.
pub const PLACES: usize = SIDE * SIDE;

/// Index of the place that contains column `x` and row `y`.
pub(super) fn place_of(x: usize, y: usize, size: Size) -> usize {
    (y * SIDE / size.height.max(1)) * SIDE + (x * SIDE / size.width.max(1)).min(SIDE - 1)
}

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

/// Green sites: all sites of a sensor without filters, or one of green's two phases behind filters.
#[derive(Debug, Clone, Copy)]
pub struct GreenSites {
    pub(super) mosaic: Option<Mosaic>,
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

    pub(super) fn rows(self, size: Size) -> impl Iterator<Item = usize> {
        (0..size.height).step_by(self.step())
    }

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
        // The first column of green sites at or after `x`.
        let from = |x: usize| x + (x + self.first_column()) % self.step();
        (from(end(part))..end(part + 1)).step_by(self.step())
    }

    /// Counts of the green sites over `black`, as a plane of these sites alone.
    pub(super) fn light(self, counts: &Counts, black: f64) -> Plane {
        let (plane, step) = (counts.plane(Channel::Green), self.step());
        let size = Size::new(plane.width() / step, plane.height() / step);
        let black = black as f32;
        Plane::from_fn(size, |x, y| {
            f32::from(plane.at(self.first_column() + x * step, y * step)) - black
        })
    }

    /// Sensor position of pixel (x, y) of the plane that [`GreenSites::light`] returns.
    pub(super) fn on_sensor(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let step = self.step() as f64;
        [self.first_column() as f64 + x * step, y * step]
    }
}
