//! A drawing as pixels, for whoever cannot show SVG.

use super::{Anchor, Colour, Drawing, Mark, Stroke};
use crate::frame::{Frame, Plane, Size, Work};
use crate::kiosk::lettering;

/// Ascent and descent of the face, of its size: height of its letters.
const LETTER_HEIGHT: f64 = 1.164;
/// Ascent of the face, of its size.
const ASCENT: f64 = 0.928;
/// Dash and gap, in units of the sheet; as in the SVG.
const DASH: [f64; 2] = [6.0, 4.0];

impl Drawing {
    /// The drawing as codes 0..255, `scale` pixels for a unit of the sheet.
    pub fn pixels(&self, scale: f64) -> Frame<Work> {
        let size =
            Size::new((self.width * scale).ceil() as usize, (self.height * scale).ceil() as usize);
        let mut canvas = Canvas { codes: Frame::filled(size, 255.0), scale };
        self.marks.iter().for_each(|mark| canvas.draw(mark));
        canvas.codes
    }
}

struct Canvas {
    codes: Frame<Work>,
    scale: f64,
}

impl Canvas {
    fn draw(&mut self, mark: &Mark) {
        match mark {
            Mark::Line(points, stroke) => self.line(points, *stroke),
            Mark::Area(corners, fill, opacity, _) => self.area(corners, *fill, *opacity),
            Mark::Disc(centre, radius, fill, _) => {
                let (centre, radius) = (*centre, *radius);
                self.cover(&[centre], radius, *fill, |at| radius - distance(at, centre));
            }
            Mark::Ring(centre, radius, stroke) => {
                let (centre, radius, half) = (*centre, *radius, stroke.width / 2.0);
                self.cover(&[centre], radius + half, stroke.colour, |at| {
                    half - (distance(at, centre) - radius).abs()
                });
            }
            Mark::Words(words, [x, y], anchor, size) => {
                let before = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => 0.5,
                    Anchor::End => 1.0,
                };
                let start = (x - before * self.width_of(words, *size)) * self.scale;
                let top = (y - ASCENT * size) * self.scale;
                self.letters(words, *size, |u, v| [start + u, top + v]);
            }
            Mark::Upwards(words, [x, y], size) => {
                let left = (x - ASCENT * size) * self.scale;
                let start = (y + 0.5 * self.width_of(words, *size)) * self.scale;
                self.letters(words, *size, |u, v| [left + v, start - u]);
            }
        }
    }

    /// Width of words in units of the sheet.
    fn width_of(&self, words: &str, size: f64) -> f64 {
        f64::from(lettering::width(words, (size * LETTER_HEIGHT) as f32))
    }

    /// Sets words; `place` turns pixels of the line into pixels of the canvas.
    fn letters(&mut self, words: &str, size: f64, place: impl Fn(f64, f64) -> [f64; 2]) {
        let height = (size * LETTER_HEIGHT * self.scale) as f32;
        lettering::set(words, (0.0, 0.0), height, &mut |u, v, share| {
            let [x, y] = place(f64::from(u), f64::from(v));
            self.blend(x.round() as i64, y.round() as i64, Colour(0, 0, 0), f64::from(share));
        });
    }

    fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let half = stroke.width / 2.0;
        let mut walked = 0.0;
        for ends in points.windows(2) {
            let (from, to) = (ends[0], ends[1]);
            let length = distance(from, to);
            let piece = |canvas: &mut Canvas, start: f64, end: f64| {
                let at = |way: f64| {
                    let share = if length > 0.0 { way / length } else { 0.0 };
                    [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
                };
                let (a, b) = (at(start), at(end));
                canvas.cover(&[a, b], half, stroke.colour, |at| half - to_segment(at, a, b));
            };
            if stroke.dashed {
                let period = DASH[0] + DASH[1];
                let mut start = -(walked % period);
                while start < length {
                    let (a, b) = (start.max(0.0), (start + DASH[0]).min(length));
                    if b > a {
                        piece(self, a, b);
                    }
                    start += period;
                }
            } else {
                piece(self, 0.0, length);
            }
            walked += length;
        }
    }

    fn area(&mut self, corners: &[[f64; 2]], fill: Colour, opacity: f64) {
        let (scale, samples) = (self.scale, [0.125, 0.375, 0.625, 0.875]);
        self.each_pixel(corners, 0.0, |x, y| {
            let mut hits = 0;
            for dy in samples {
                for dx in samples {
                    let at = [(x as f64 + dx) / scale, (y as f64 + dy) / scale];
                    hits += usize::from(inside(at, corners));
                }
            }
            (fill, opacity * hits as f64 / 16.0)
        });
    }

    /// Covers every pixel near `points` by how deep (in units of the sheet) its centre lies inside
    /// a shape.
    fn cover(
        &mut self,
        points: &[[f64; 2]],
        reach: f64,
        ink: Colour,
        depth: impl Fn([f64; 2]) -> f64,
    ) {
        let scale = self.scale;
        self.each_pixel(points, reach, |x, y| {
            let centre = [(x as f64 + 0.5) / scale, (y as f64 + 0.5) / scale];
            (ink, (depth(centre) * scale + 0.5).clamp(0.0, 1.0))
        });
    }

    fn each_pixel(
        &mut self,
        points: &[[f64; 2]],
        reach: f64,
        ink: impl Fn(i64, i64) -> (Colour, f64),
    ) {
        let range = |axis: usize| {
            let ends = points.iter().map(|p| p[axis]);
            let (low, high) = ends.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
            let low = ((low - reach) * self.scale).floor() as i64 - 1;
            (low.max(0), ((high + reach) * self.scale).ceil() as i64 + 1)
        };
        let ((left, right), (top, bottom)) = (range(0), range(1));
        let size = self.codes.size();
        for y in top..bottom.min(size.height as i64) {
            for x in left..right.min(size.width as i64) {
                let (colour, share) = ink(x, y);
                self.blend(x, y, colour, share);
            }
        }
    }

    fn blend(&mut self, x: i64, y: i64, colour: Colour, share: f64) {
        let size = self.codes.size();
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if share <= 0.0 || x >= size.width || y >= size.height {
            return;
        }
        let over = [colour.0, colour.1, colour.2];
        for (plane, ink) in self.codes.planes_mut().iter_mut().zip(over) {
            let under: f32 = Plane::at(plane, x, y);
            plane.set(x, y, under + (f32::from(ink) - under) * share as f32);
        }
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn to_segment(at: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let way = [to[0] - from[0], to[1] - from[1]];
    let squared = way[0] * way[0] + way[1] * way[1];
    let along = (at[0] - from[0]) * way[0] + (at[1] - from[1]) * way[1];
    let share = if squared > 0.0 { (along / squared).clamp(0.0, 1.0) } else { 0.0 };
    distance(at, [from[0] + share * way[0], from[1] + share * way[1]])
}

/// Whether a ray to the right crosses the rim an odd number of times.
fn inside(at: [f64; 2], corners: &[[f64; 2]]) -> bool {
    let next = corners.iter().cycle().skip(1);
    let crossings = corners.iter().zip(next).filter(|(a, b)| {
        (a[1] > at[1]) != (b[1] > at[1])
            && at[0] < a[0] + (at[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    });
    crossings.count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Channel;

    #[test]
    fn areas_lines_discs_and_words_put_their_ink_where_they_are() {
        let mut drawing = Drawing::new(60.0, 40.0);
        drawing.rectangle([2.0, 2.0], [6.0, 8.0], Colour(255, 0, 0), 1.0);
        drawing.line([[10.0, 5.0], [50.0, 5.0]], Stroke::new(Colour(0, 0, 0), 2.0));
        drawing.marks.push(Mark::Disc([30.0, 20.0], 4.0, Colour(0, 0, 255), String::new()));
        drawing.words("II", [5.0, 30.0], Anchor::Start, 10.0);
        drawing.marks.push(Mark::Upwards("II".to_owned(), [50.0, 20.0], 10.0));
        let pixels = drawing.pixels(2.0);
        assert_eq!(pixels.size(), Size::new(120, 80));
        let at =
            |c: Channel, x: f64, y: f64| pixels.plane(c).at((2.0 * x) as usize, (2.0 * y) as usize);
        assert_eq!((at(Channel::Red, 4.0, 5.0), at(Channel::Green, 4.0, 5.0)), (255.0, 0.0));
        assert_eq!(at(Channel::Green, 7.0, 5.0), 255.0);
        assert_eq!(at(Channel::Green, 30.0, 5.0), 0.0);
        assert_eq!((at(Channel::Blue, 30.0, 20.0), at(Channel::Red, 30.0, 20.0)), (255.0, 0.0));
        let ink = |x: usize, y: usize, width: usize, height: usize| {
            let part = crate::frame::Rect { x, y, size: Size::new(width, height) };
            pixels
                .plane(Channel::Green)
                .crop(part)
                .map(|v: f32| 255.0 - v)
                .data()
                .iter()
                .sum::<f32>()
        };
        // The capitals stand on the base line at 30 and reach up 7; the others lie on their side
        // left of 50.
        assert!(ink(10, 46, 12, 14) > 2000.0 && ink(10, 62, 12, 10) == 0.0);
        assert!(ink(86, 30, 14, 20) > 2000.0 && ink(102, 30, 10, 20) == 0.0);
    }

    #[test]
    fn a_dashed_line_has_gaps_as_long_as_said() {
        let mut drawing = Drawing::new(40.0, 4.0);
        drawing.line([[0.0, 2.0], [40.0, 2.0]], Stroke::new(Colour(0, 0, 0), 2.0).dashed());
        let pixels = drawing.pixels(1.0);
        let row = pixels.plane(Channel::Green).row(1);
        let dark: Vec<usize> = (0..40).filter(|&x| row[x] < 128.0).collect();
        assert!(
            dark.contains(&3) && dark.contains(&13) && !dark.contains(&8) && !dark.contains(&18)
        );
    }
}
