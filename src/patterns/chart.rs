//! A resolution chart in the style of ISO 12233, drawn from definitions (its figure is not copied):
//! hyperbolic wedges, slanted edges, line pairs, Siemens stars, frame arrows, digits.

use crate::frame::{Plane, Size};

/// Light of the chart's ink, like printed charts' (guess: reflectances of about 4 % and 94 %).
const INK: f32 = 10.0;
/// Light of the chart's paper.
const PAPER: f32 = 240.0;
/// Subsamples per pixel in each direction.
const SUBSAMPLES: usize = 4;

/// The chart, light 0..255, at any size; lengths scale with the height.
pub fn chart(size: Size) -> Plane {
    let mut plane = Plane::filled(size, PAPER);
    let scale = size.height as f64;
    let width = size.width as f64 / scale;
    for mark in marks(width) {
        mark.draw(&mut plane, scale);
    }
    plane
}

struct InkMark {
    x: f64,
    y: f64,
    shape: Shape,
    light: f32,
}

/// Shapes about their centre; lengths in picture heights.
#[derive(Clone, Copy)]
enum Shape {
    /// A square of half side `half`, rotated by `slant` (tangent).
    SlantedSquare { half: f64, slant: f64 },
    /// A rectangle.
    Bar { half_width: f64, half_height: f64 },
    /// Converging lines, `first` to `last` line widths per picture height (LW/PH of ISO 12233) over
    /// `length`; along y if `upright`, else along x.
    Wedge { lines: usize, first: f64, last: f64, length: f64, upright: bool },
    /// Line pairs of `pitch`, along y if `upright`.
    Pairs { half: f64, pitch: f64, upright: bool },
    /// A Siemens star.
    Star { radius: f64, spokes: usize },
    /// A zone plate: rings whose pitch shrinks to `pitch` at the rim.
    Zone { radius: f64, pitch: f64 },
    /// A triangle pointing along (dx, dy).
    Arrow { length: f64, dx: f64, dy: f64 },
    /// A digit on 3 × 5 cells of `cell`.
    Digit { digit: usize, cell: f64 },
    /// A ring.
    Ring { radius: f64, half_width: f64 },
}

impl Shape {
    /// Half the side of a square around the shape.
    fn reach(self) -> f64 {
        match self {
            Shape::SlantedSquare { half, slant } => half * (1.0 + slant.abs()),
            Shape::Bar { half_width, half_height } => half_width.max(half_height),
            Shape::Wedge { lines, first, length, .. } => (length / 2.0).max(lines as f64 / first),
            Shape::Pairs { half, .. } => half,
            Shape::Star { radius, .. } | Shape::Zone { radius, .. } => radius,
            Shape::Arrow { length, .. } => length,
            Shape::Digit { cell, .. } => 2.5 * cell,
            Shape::Ring { radius, half_width } => radius + half_width,
        }
    }

    /// Whether there is ink at (`x`, `y`) from the centre.
    fn inked(self, x: f64, y: f64) -> bool {
        match self {
            Shape::SlantedSquare { half, slant } => {
                (x - slant * y).abs() < half && (y + slant * x).abs() < half
            }
            Shape::Bar { half_width, half_height } => x.abs() < half_width && y.abs() < half_height,
            Shape::Wedge { lines, first, last, length, upright } => {
                let (along, across) = if upright { (y, x) } else { (x, y) };
                let place = along / length + 0.5;
                if !(0.0..1.0).contains(&place) {
                    return false;
                }
                // Line widths from the first line's edge; the frequency grows linearly along the
                // wedge, so every edge is a hyperbola.
                let widths =
                    across * (first + (last - first) * place) + (2 * lines - 1) as f64 / 2.0;
                (0.0..(2 * lines - 1) as f64).contains(&widths)
                    && (widths as usize).is_multiple_of(2)
            }
            Shape::Pairs { half, pitch, upright } => {
                let across = if upright { x } else { y };
                x.abs() < half && y.abs() < half && ((across + half) / pitch).fract() < 0.5
            }
            Shape::Star { radius, spokes } => {
                let turns = || y.atan2(x) / std::f64::consts::TAU + 0.5;
                x * x + y * y < radius * radius && (turns() * spokes as f64).fract() < 0.5
            }
            Shape::Zone { radius, pitch } => {
                let squared = x * x + y * y;
                // The phase has a slope of one turn per pitch at the rim.
                squared < radius * radius && (squared / (2.0 * radius * pitch)).fract() < 0.5
            }
            Shape::Arrow { length, dx, dy } => {
                let (along, across) = (x * dx + y * dy, x * dy - y * dx);
                (0.0..length).contains(&(along + length / 2.0))
                    && across.abs() < (length / 2.0 - along) / 2.0
            }
            Shape::Digit { digit, cell } => {
                let (column, row) = ((x / cell + 1.5).floor(), (y / cell + 2.5).floor());
                (0.0..3.0).contains(&column)
                    && (0.0..5.0).contains(&row)
                    && DIGITS[digit % 10][row as usize] >> (2 - column as usize) & 1 == 1
            }
            Shape::Ring { radius, half_width } => (x.hypot(y) - radius).abs() < half_width,
        }
    }
}

/// Bitmaps of the digits on 3 × 5 cells: one number per row, with the left cell in the highest bit.
const DIGITS: [[u8; 5]; 10] = [
    [0b111, 0b101, 0b101, 0b101, 0b111],
    [0b010, 0b110, 0b010, 0b010, 0b111],
    [0b111, 0b001, 0b111, 0b100, 0b111],
    [0b111, 0b001, 0b111, 0b001, 0b111],
    [0b101, 0b101, 0b111, 0b001, 0b001],
    [0b111, 0b100, 0b111, 0b001, 0b111],
    [0b111, 0b100, 0b111, 0b101, 0b111],
    [0b111, 0b001, 0b010, 0b010, 0b010],
    [0b111, 0b101, 0b111, 0b101, 0b111],
    [0b111, 0b101, 0b111, 0b001, 0b111],
];

impl InkMark {
    fn draw(&self, plane: &mut Plane, scale: f64) {
        let reach = self.shape.reach();
        let first = |at: f64| ((at - reach) * scale).floor().max(0.0) as usize;
        let last =
            |at: f64, limit: usize| (((at + reach) * scale).ceil().max(0.0) as usize).min(limit);
        let (right, bottom) = (last(self.x, plane.width()), last(self.y, plane.height()));
        let step = 1.0 / SUBSAMPLES as f64;
        let places = |pixel: usize, centre: f64| -> [f64; SUBSAMPLES] {
            std::array::from_fn(|n| (pixel as f64 + step * (n as f64 + 0.5)) / scale - centre)
        };
        for py in first(self.y)..bottom {
            let down = places(py, self.y);
            for px in first(self.x)..right {
                let across = places(px, self.x);
                let inked = |&y: &f64| across.iter().filter(|&&x| self.shape.inked(x, y)).count();
                let covered: usize = down.iter().map(inked).sum();
                let share = covered as f32 / (SUBSAMPLES * SUBSAMPLES) as f32;
                let paper = plane.at(px, py);
                plane.set(px, py, paper + share * (self.light - paper));
            }
        }
    }
}

fn marks(width: f64) -> Vec<InkMark> {
    let mut marks = ChartMarks { width, all: Vec::new() };
    marks.put_middle();
    marks.put_edges_and_corners();
    marks.put_line_pairs_and_numbers();
    marks.put_border();
    marks.put_text();
    marks.put_lines_and_greys();
    marks.all
}

/// Marks of a chart `width` picture heights wide, in drawing order.
struct ChartMarks {
    width: f64,
    all: Vec<InkMark>,
}

impl ChartMarks {
    fn put(&mut self, x: f64, y: f64, shape: Shape) {
        self.all.push(InkMark { x, y, shape, light: INK });
    }

    fn centre(&self) -> f64 {
        self.width / 2.0
    }

    fn put_middle(&mut self) {
        // Wedges in the middle: coarse and fine, upright and level.
        let coarse =
            |upright| Shape::Wedge { lines: 5, first: 60.0, last: 300.0, length: 0.28, upright };
        let fine =
            |upright| Shape::Wedge { lines: 9, first: 250.0, last: 800.0, length: 0.28, upright };
        self.put(self.centre() - 0.20, 0.31, coarse(true));
        self.put(self.centre() + 0.20, 0.31, fine(true));
        self.put(self.centre() - 0.275, 0.5, coarse(false));
        self.put(self.centre() + 0.275, 0.5, fine(false));
        // The middle: a zone plate with a ring, stars above and below.
        self.put(self.centre(), 0.5, Shape::Zone { radius: 0.095, pitch: 0.008 });
        self.put(self.centre(), 0.5, Shape::Ring { radius: 0.12, half_width: 0.004 });
        self.put(self.centre(), 0.245, Shape::Star { radius: 0.085, spokes: 36 });
        self.put(self.centre(), 0.755, Shape::Star { radius: 0.085, spokes: 72 });
    }

    fn put_edges_and_corners(&mut self) {
        // Slanted edges, 5° as in the standard: tan 5° = 0.0875.
        for (x, y) in [
            (self.centre() - 0.24, 0.72),
            (self.centre() + 0.24, 0.72),
            (0.13, 0.32),
            (self.width - 0.13, 0.32),
            (0.13, 0.68),
            (self.width - 0.13, 0.68),
        ] {
            self.put(x, y, Shape::SlantedSquare { half: 0.062, slant: 0.0875 });
        }
        // Stars in the corners.
        for (x, y) in
            [(0.13, 0.13), (self.width - 0.13, 0.13), (0.13, 0.87), (self.width - 0.13, 0.87)]
        {
            self.put(x, y, Shape::Star { radius: 0.07, spokes: 24 });
        }
    }

    fn put_line_pairs_and_numbers(&mut self) {
        // Line pairs of several pitches along the bottom and the top, with their number.
        let pitches = [24.0, 16.0, 12.0, 9.0, 7.0, 5.5, 4.5, 3.5];
        for (n, pixels_at_768) in pitches.into_iter().enumerate() {
            let x = self.centre() + (n as f64 - 3.5) * (self.width - 0.62) / 8.0;
            let pitch = pixels_at_768 / 768.0;
            self.put(x, 0.93, Shape::Pairs { half: 0.032, pitch, upright: true });
            self.put(x, 0.07, Shape::Pairs { half: 0.032, pitch, upright: false });
            self.put(x, 0.873, Shape::Digit { digit: n + 1, cell: 0.005 });
            self.put(x, 0.127, Shape::Digit { digit: n + 1, cell: 0.004 });
        }
        // Numbers beside the wedges, as the standard prints them (hundreds of LW/PH).
        for n in 1..=3 {
            let y = 0.31 + 0.28 * (((100 * n) as f64 - 60.0) / 240.0 - 0.5);
            self.put(self.centre() - 0.27, y, Shape::Digit { digit: n, cell: 0.005 });
        }
        for n in 3..=8 {
            let y = 0.31 + 0.28 * (((100 * n) as f64 - 250.0) / 550.0 - 0.5);
            self.put(self.centre() + 0.26, y, Shape::Digit { digit: n, cell: 0.004 });
        }
    }

    fn put_border(&mut self) {
        // Frame arrows: at the ends and the middles of the sides, pointing out.
        let out = 0.03;
        for x in [0.26, self.centre(), self.width - 0.26] {
            self.put(x, out / 2.0, Shape::Arrow { length: out, dx: 0.0, dy: -1.0 });
            self.put(x, 1.0 - out / 2.0, Shape::Arrow { length: out, dx: 0.0, dy: 1.0 });
        }
        for y in [0.25, 0.5, 0.75] {
            self.put(out / 2.0, y, Shape::Arrow { length: out, dx: -1.0, dy: 0.0 });
            self.put(self.width - out / 2.0, y, Shape::Arrow { length: out, dx: 1.0, dy: 0.0 });
        }
        // Wedges at the left and right edges of the field, where a cheap lens is worst.
        for x in [0.125, self.width - 0.125] {
            self.put(
                x,
                0.5,
                Shape::Wedge { lines: 5, first: 70.0, last: 300.0, length: 0.17, upright: false },
            );
        }
    }

    fn put_text(&mut self) {
        // Digits to read, in three groups.
        for side in [-1.0, 1.0] {
            self.put_digits((self.centre() + side * 0.345, 0.18), Size::new(4, 6), 0.006);
            self.put_digits((self.centre() + side * 0.335, 0.585), Size::new(6, 2), 0.006);
            self.put_digits((self.centre() + side * 0.255, 0.81), Size::new(13, 1), 0.005);
        }
    }

    /// Puts columns and rows of digits on cells of `cell`, centred at x, from y downwards.
    fn put_digits(&mut self, (x, y): (f64, f64), count: Size, cell: f64) {
        for k in 0..count.area() {
            let (column, row) = ((k % count.width) as f64, (k / count.width) as f64);
            // 7 is coprime to 10: all digits occur.
            let digit = Shape::Digit { digit: (7 * k + 3) % 10, cell };
            let middle = (count.width as f64 - 1.0) / 2.0;
            self.put(x + 4.5 * cell * (column - middle), y + 7.0 * cell * row, digit);
        }
    }

    fn put_lines_and_greys(&mut self) {
        // Long fine lines, which show distortion and seams.
        for x in [0.235, self.width - 0.235] {
            self.put(x, 0.5, Shape::Bar { half_width: 0.0015, half_height: 0.33 });
        }
        // Grey steps, which show the effect of shrinkage on flat regions.
        for n in 0..6u8 {
            let x = self.centre() + (f64::from(n) - 2.5) * 0.05;
            let light = INK + (PAPER - INK) * (f32::from(n) + 0.5) / 6.0;
            self.all.push(InkMark {
                x,
                y: 0.655,
                shape: Shape::Bar { half_width: 0.025, half_height: 0.015 },
                light,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chart_has_paper_and_ink_at_any_size() {
        for size in [Size::new(1024, 768), Size::new(256, 192), Size::new(100, 100)] {
            let plane = chart(size);
            let (low, high) =
                plane.data().iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
            assert!(low >= INK - 0.01 && high <= PAPER + 0.01, "{low} {high}");
            let inked = plane.data().iter().filter(|&&v| v < (INK + PAPER) / 2.0).count();
            let share = inked as f64 / size.area() as f64;
            assert!((0.1..0.5).contains(&share), "{share} of the chart is ink");
        }
    }

    #[test]
    fn edges_are_antialiased() {
        let plane = chart(Size::new(512, 384));
        let between = plane.data().iter().filter(|&&v| v > INK + 20.0 && v < PAPER - 20.0).count();
        assert!(between > 2000, "{between} pixels between ink and paper");
    }

    /// Writes the chart as a picture: `RELENS_LOOK=folder cargo test --release -- --ignored
    /// look_at_the_chart`.
    #[test]
    #[ignore = "writes a picture"]
    fn look_at_the_chart() {
        let Ok(folder) = std::env::var("RELENS_LOOK") else { return };
        let plane = chart(Size::new(1024, 768));
        let bytes = plane.data().iter().map(|&v| v as u8).collect();
        let picture = image::GrayImage::from_vec(1024, 768, bytes).unwrap();
        picture.save(std::path::Path::new(&folder).join("chart.png")).unwrap();
    }
}
