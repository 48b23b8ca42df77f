//! Where a capture lies against what the lens model predicts of it, and how bright it is.
//!
//! A panel that wanders, was knocked or flickers moves and dims whole captures, in all colours
//! alike; the photo was taken without it. So y is taken for g·P(x − s) with P = K̂L, and what s and
//! g make of the prediction is taken out of the capture. The prediction is moved, never the
//! capture, whose noise stays as it is.
//!
//! s comes from linear least squares on the gradients of P, repeated with P moved (Lucas & Kanade
//! 1981), both as means over cells as wide as half a lens function: a lens that came off its axis
//! throws fine detail aside and leaves the centroid of its light, and is no shift.
//!
//! g comes from the sums of y and P: a lens that scatters more than was measured keeps them, and
//! least squares on P would take its veil for less light. Either counts only where it stands out of
//! its own uncertainty, which is what parts of the photo say without each other (the jackknife,
//! Quenouille 1956): what a wrong lens pretends differs from part to part.

use std::ops::Range;

use rayon::prelude::*;

use super::data_term::{MISSING, TRUSTED};
use super::forward_convolution::Seen;
use crate::frame::resample::{Outside, warp};
use crate::frame::{Channel, Frame, Plane, Rect, Work};

/// Parts of the photo along its width and height.
const PARTS: (usize, usize) = (6, 4);
/// By how many of its standard errors a shift or a gain must stand out.
const CERTAIN: f64 = 3.0;
/// Farther than this, in pixels, no capture is believed to be the prediction moved. Guess.
const SHIFT_MAX_PX: f64 = 2.5;
/// What a backlight's unsteadiness can change a capture's light by; more is another fault, and not
/// hidden. Guess.
const GAIN_MAX: f64 = 0.01;
/// Rounds of least squares at the most, and the step, pixels and share of the light, that ends
/// them.
const ROUNDS: usize = 6;
const ENOUGH_PX: f64 = 5e-4;
const ENOUGH_GAIN: f64 = 1e-4;

/// A capture as a whole, against its prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// How far to the right and down the capture lies, pixels.
    pub shift_px: (f64, f64),
    /// Its light over the prediction's.
    pub gain: f64,
}

impl Registration {
    /// A capture that lies where it should.
    pub const IN_PLACE: Registration = Registration { shift_px: (0.0, 0.0), gain: 1.0 };

    /// How `seen` lies against what was `predicted` of it, by what is known of the photo (`trust`,
    /// `photo`) in the `channels`; the lens blurs over `blur_px` pixels.
    pub fn of(
        seen: &Seen,
        predicted: &Frame<Work>,
        trust: &Frame<Work, u8>,
        photo: Rect,
        channels: &[Channel],
        blur_px: usize,
    ) -> Registration {
        let mut found = Registration::IN_PLACE;
        for _ in 0..ROUNDS {
            let moved = found.prediction(predicted, channels);
            let known = Known { seen, trust, photo, channels, cell_px: (blur_px / 2).max(1) };
            let sums = known.sums(moved.as_ref().unwrap_or(predicted));
            let (step, uncertain) = step(&sums);
            let before = found;
            found = found.and(step).certain(uncertain);
            let (x, y) = found.shift_px;
            // Written so that a number that is none fails too.
            let believed = x.hypot(y) <= SHIFT_MAX_PX;
            if !believed {
                return Registration::IN_PLACE;
            }
            let (dx, dy) = (x - before.shift_px.0, y - before.shift_px.1);
            if dx.hypot(dy) < ENOUGH_PX && (found.gain - before.gain).abs() < ENOUGH_GAIN {
                break;
            }
        }
        found
    }

    /// This and a further `step`.
    fn and(self, step: Registration) -> Registration {
        let shift_px = (self.shift_px.0 + step.shift_px.0, self.shift_px.1 + step.shift_px.1);
        Registration { shift_px, gain: self.gain * step.gain }
    }

    /// What of it stands out of its uncertainty.
    fn certain(self, uncertain: Registration) -> Registration {
        let length = |(x, y): (f64, f64)| x.hypot(y);
        let mut certain = Registration::IN_PLACE;
        if length(self.shift_px) > CERTAIN * length(uncertain.shift_px) {
            certain.shift_px = self.shift_px;
        }
        let off = (self.gain - 1.0).abs();
        if off > CERTAIN * uncertain.gain && off <= GAIN_MAX {
            certain.gain = self.gain;
        }
        certain
    }

    /// What was `predicted`, moved and scaled; nothing of a capture in place.
    fn prediction(&self, predicted: &Frame<Work>, channels: &[Channel]) -> Option<Frame<Work>> {
        if *self == Registration::IN_PLACE {
            return None;
        }
        let mut all = Frame::zeros(predicted.size());
        let moved = channels.par_iter().map(|&c| (c, self.moved(predicted.plane(c))));
        let moved: Vec<(Channel, Plane)> = moved.collect();
        moved.into_iter().for_each(|(c, plane)| *all.plane_mut(c) = plane);
        Some(all)
    }

    fn moved(&self, plane: &Plane) -> Plane {
        let ((x, y), gain) = (self.shift_px, self.gain as f32);
        let mut out = plane.clone();
        if (x, y) != (0.0, 0.0) {
            let map_x = Plane::from_fn(plane.size(), |u, _| (u as f64 - x) as f32);
            let map_y = Plane::from_fn(plane.size(), |_, v| (v as f64 - y) as f32);
            warp(plane, &map_x, &map_y, Outside::Edge, &mut out);
        }
        out.data_mut().iter_mut().for_each(|v| *v *= gain);
        out
    }

    /// Takes what shift and gain make of what was `predicted` out of `seen`.
    pub fn undo(&self, seen: &mut Seen, predicted: &Frame<Work>, channels: &[Channel]) {
        let Some(moved) = self.prediction(predicted, channels) else { return };
        for &c in channels {
            let light = seen.light.plane_mut(c);
            light.add_scaled(1.0, predicted.plane(c));
            light.add_scaled(-1.0, moved.plane(c));
        }
    }
}

/// Sums over a part of the photo: products of the gradient (x, y) with itself, with the residual
/// and with the prediction; residual and prediction. Of means over cells.
type PartSums = [f64; 9];

/// What a prediction is held against.
struct Known<'a> {
    seen: &'a Seen,
    trust: &'a Frame<Work, u8>,
    photo: Rect,
    channels: &'a [Channel],
    cell_px: usize,
}

impl Known<'_> {
    /// The sums part by part.
    fn sums(&self, predicted: &Frame<Work>) -> Vec<PartSums> {
        let Rect { x, y, size } = self.photo;
        let cells = (size.width.div_ceil(self.cell_px), size.height.div_ceil(self.cell_px));
        let of_part = |n: usize| {
            let (i, j) = (n % PARTS.0, n / PARTS.0);
            let span =
                |n: usize, parts: usize, cells: usize| n * cells / parts..(n + 1) * cells / parts;
            let mut sums = [0.0; 9];
            for row in span(j, PARTS.1, cells.1) {
                for column in span(i, PARTS.0, cells.0) {
                    let (left, top) = (column * self.cell_px, row * self.cell_px);
                    let columns = x + left..x + (left + self.cell_px).min(size.width);
                    let rows = y + top..y + (top + self.cell_px).min(size.height);
                    for &c in self.channels {
                        self.add_cell(predicted, c, columns.clone(), rows.clone(), &mut sums);
                    }
                }
            }
            sums
        };
        (0..PARTS.0 * PARTS.1).into_par_iter().map(of_part).collect()
    }

    fn add_cell(
        &self,
        predicted: &Frame<Work>,
        c: Channel,
        columns: Range<usize>,
        rows: Range<usize>,
        sums: &mut PartSums,
    ) {
        let (p, y) = (predicted.plane(c), self.seen.light.plane(c));
        let (known, trusted) = (self.trust.plane(c), self.seen.trusted.plane(c));
        let (mut gx, mut gy, mut r, mut light, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for v in rows.start.max(1)..rows.end.min(p.height() - 1) {
            let (above, here, below) = (p.row(v - 1), p.row(v), p.row(v + 1));
            let (y, known, trusted) = (y.row(v), known.row(v), trusted.row(v));
            for u in columns.start.max(1)..columns.end.min(p.width() - 1) {
                if known[u] != MISSING && trusted[u] == TRUSTED {
                    gx += f64::from(here[u + 1] - here[u - 1]) / 2.0;
                    gy += f64::from(below[u] - above[u]) / 2.0;
                    r += f64::from(y[u] - here[u]);
                    light += f64::from(here[u]);
                    count += 1.0;
                }
            }
        }
        if count > 0.0 {
            let more = [gx * gx, gx * gy, gy * gy, gx * r, gy * r, gx * light, gy * light];
            sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more / count);
            (sums[7], sums[8]) = (sums[7] + r, sums[8] + light);
        }
    }
}

/// What the sums of all parts say, and its standard errors.
fn step(parts: &[PartSums]) -> (Registration, Registration) {
    let mut all = [0.0; 9];
    parts.iter().for_each(|part| all.iter_mut().zip(part).for_each(|(a, p)| *a += p));
    let whole = solved(&all);
    let n = parts.len() as f64;
    let mut squares = (0.0, 0.0, 0.0);
    for part in parts {
        let mut others = all;
        others.iter_mut().zip(part).for_each(|(a, p)| *a -= p);
        let one = solved(&others);
        squares.0 += (one.shift_px.0 - whole.shift_px.0).powi(2);
        squares.1 += (one.shift_px.1 - whole.shift_px.1).powi(2);
        squares.2 += (one.gain - whole.gain).powi(2);
    }
    let error = |square: f64| ((n - 1.0) / n * square).sqrt();
    let shift_px = (error(squares.0), error(squares.1));
    (whole, Registration { shift_px, gain: error(squares.2) })
}

fn solved(&[xx, xy, yy, xr, yr, xp, yp, r, p]: &PartSums) -> Registration {
    let more = if p > 0.0 { r / p } else { 0.0 };
    // y(x − s) is y less s times its gradient.
    let (bx, by) = (more * xp - xr, more * yp - yr);
    let determinant = xx * yy - xy * xy;
    let shift_px = if determinant > 1e-9 * xx * yy {
        ((yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant)
    } else {
        (0.0, 0.0)
    };
    Registration { shift_px, gain: 1.0 + more }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const SIZE: Size = Size { width: 256, height: 192 };
    const PHOTO: Rect = Rect { x: 8, y: 8, size: Size { width: 240, height: 176 } };

    /// A soft picture, (x, y) pixels aside.
    fn picture(x: f64, y: f64) -> Frame<Work> {
        let light = |u: usize, v: usize| {
            let (u, v) = (u as f64 - x, v as f64 - y);
            let wave = |fx: f64, fy: f64| (u / fx + v / fy).sin();
            (110.0 + 35.0 * wave(4.3, 17.0) + 25.0 * wave(-31.0, 6.1) + 20.0 * wave(55.0, 47.0))
                as f32
        };
        Frame::from_fn(|_| Plane::from_fn(SIZE, light))
    }

    fn seen(light: &Frame<Work>, gain: f32, noise: f32, seed: u64) -> Seen {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        let light = Frame::from_fn(|c| {
            light.plane(c).map(|v: f32| {
                let bell: f32 = StandardNormal.sample(&mut random);
                gain * v + noise * bell
            })
        });
        Seen { light, trusted: Frame::filled(SIZE, TRUSTED) }
    }

    fn found(seen: &Seen) -> Registration {
        let trust = Frame::filled(SIZE, TRUSTED);
        Registration::of(seen, &picture(0.0, 0.0), &trust, PHOTO, &Channel::ALL, 13)
    }

    #[test]
    fn a_capture_moved_and_dimmed_is_found_and_brought_back() {
        for (x, y, gain) in [(0.3, -0.4, 1.0), (0.04, 0.03, 0.997), (-0.9, 0.6, 1.004)] {
            for seed in 0..5 {
                let mut seen = seen(&picture(x, y), gain, 1.0, seed);
                let found = found(&seen);
                let off = (found.shift_px.0 - x).hypot(found.shift_px.1 - y);
                assert!(off < 0.005, "{x} {y}: {found:?}");
                assert!((found.gain - f64::from(gain)).abs() < 5e-4, "{gain}: {found:?}");
                found.undo(&mut seen, &picture(0.0, 0.0), &Channel::ALL);
                let mut left = seen.light.plane(Channel::Green).clone();
                left.add_scaled(-1.0, picture(0.0, 0.0).plane(Channel::Green));
                let left = left.crop(PHOTO).rms();
                assert!((left - 1.0).abs() < 0.02, "{left}");
            }
        }
    }

    #[test]
    fn a_capture_in_place_stays_to_the_bit() {
        let out_of = 40;
        let moved = (0..out_of).filter(|&seed| {
            found(&seen(&picture(0.0, 0.0), 1.0, 1.0, seed)) != Registration::IN_PLACE
        });
        assert!(moved.count() <= 1);
    }

    #[test]
    fn light_that_is_scattered_is_no_gain() {
        let grey: Frame<Work> = Frame::from_fn(|_| Plane::filled(SIZE, 110.0));
        let veiled = Frame::from_fn(|c| {
            let mut plane = picture(0.0, 0.0).plane(c).map(|v: f32| 0.9 * v);
            plane.add_scaled(0.1, grey.plane(c));
            plane
        });
        let found = found(&seen(&veiled, 1.0, 1.0, 1));
        assert!((found.gain - 1.0).abs() < 1e-3, "{found:?}");
    }
}
