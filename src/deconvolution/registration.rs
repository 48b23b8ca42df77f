//! Registration of a capture to its prediction: shift, gain and, on request, added light.
//!
//! A panel that is knocked, drifts or flickers moves and dims whole captures, all colours alike;
//! the photo was taken without it. The capture y is modelled as g·P(x − s) + o with the prediction
//! P = K̂L. The prediction is moved, never the capture, so the capture's noise stays as it is.
//!
//! All fits solve the same normal equations of y − P on P, 1 and −∇P (Lucas & Kanade 1981), over
//! means of square cells. Cells half a lens function wide make s a shift of centroids: a lens that
//! came off its axis throws fine detail aside without moving the centroid of its light.
//!
//! Without o, g is the ratio of the sums of light: a lens that scatters more than measured
//! preserves them, whereas least squares on P would mistake its veil for less light. Shift and gain
//! are applied only if significant against their standard error, taken from parts of the photo (the
//! jackknife, Quenouille 1956), because errors of the lens model differ from part to part.

use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

use super::data_term::{MISSING, TRUSTED};
use super::forward_convolution::Seen;
use crate::frame::resample::translate;
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};

/// Parts of the photo along its width and height.
const PARTS: (usize, usize) = (6, 4);
/// Minimum ratio of a significant shift or gain to its standard error.
const SIGNIFICANT: f64 = 3.0;
/// Largest shift of a capture, pixels; a larger one indicates another fault. Guess.
const SHIFT_MAX_PX: f64 = 2.5;
/// Largest relative change of light by an unsteady backlight; a larger one indicates another fault
/// and must stay visible. Guess.
const GAIN_MAX: f64 = 0.01;
/// Maximum rounds of least squares; they end early at a step below both limits that follow, in
/// pixels and as a share of the light.
const ROUNDS: usize = 6;
const ENOUGH_PX: f64 = 5e-4;
const ENOUGH_GAIN: f64 = 1e-4;

/// A capture and its prediction, to be compared.
pub struct Comparison<'a> {
    /// The captured light.
    pub seen: &'a Frame<Work>,
    /// The light predicted for it.
    pub predicted: &'a Frame<Work>,
    /// [`TRUSTED`] at the pixels to compare.
    pub mask: &'a Frame<Work, u8>,
    /// The part of the canvas to compare.
    pub area: Rect,
    /// The channels to compare, taken together.
    pub channels: &'a [Channel],
}

/// Shift and gain of a capture against its prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// Displacement of the capture to the right and down, pixels.
    pub shift_px: (f64, f64),
    /// Light of the capture over that of the prediction.
    pub gain: f64,
}

/// Mask that is [`TRUSTED`] where `trust` has data and `seen` is trusted.
pub fn common_mask(trust: &Frame<Work, u8>, seen: &Frame<Work, u8>) -> Frame<Work, u8> {
    Frame::from_fn(|c| {
        let mut mask = trust.plane(c).clone();
        mask.update(seen.plane(c), |mask, seen| {
            *mask = if *mask != MISSING && seen == TRUSTED { TRUSTED } else { MISSING };
        });
        mask
    })
}

impl Registration {
    /// The registration of a capture that equals its prediction.
    pub const IN_PLACE: Registration = Registration { shift_px: (0.0, 0.0), gain: 1.0 };

    /// Fits shift and gain, each only if it is significant; the lens blurs over `blur_px` pixels.
    pub fn fit(comparison: &Comparison<'_>, blur_px: usize) -> Registration {
        let cell_px = (blur_px / 2).max(1);
        let mut found = Registration::IN_PLACE;
        for _ in 0..ROUNDS {
            let moved = found.apply(comparison.predicted, comparison.channels);
            let predicted = moved.as_ref().unwrap_or(comparison.predicted);
            let parts = Comparison { predicted, ..*comparison }.parts(cell_px);
            let before = found;
            found = found.and(total(&parts).shift_and_gain()).significant(jackknife(&parts));
            let (x, y) = found.shift_px;
            // Negated so that NaN is rejected too.
            let plausible = x.hypot(y) <= SHIFT_MAX_PX;
            if !plausible {
                return Registration::IN_PLACE;
            }
            let (dx, dy) = (x - before.shift_px.0, y - before.shift_px.1);
            if dx.hypot(dy) < ENOUGH_PX && (found.gain - before.gain).abs() < ENOUGH_GAIN {
                break;
            }
        }
        found
    }

    /// Fits shift, gain and added light, grey levels, to first order, pixel by pixel. All NaN
    /// without data.
    pub fn fit_with_offset(comparison: &Comparison<'_>) -> (Registration, f64) {
        let RegistrationSums { normal, right } = total(&comparison.parts(1));
        let found = normal.lu().solve(&right).unwrap_or(Vector4::from_element(f64::NAN));
        let gain = 1.0 + found[0];
        // g·P(x − s) has the gradient term g·s.
        (Registration { shift_px: (found[2] / gain, found[3] / gain), gain }, found[1])
    }

    /// Fits the gain alone, as a ratio of sums of light; 1 if that differs from 1 by more
    /// than `most`.
    pub fn fit_gain(comparison: &Comparison<'_>, most: f64) -> f64 {
        let (mut seen, mut predicted) = (0.0f64, 0.0f64);
        for &c in comparison.channels {
            for row in comparison.area.rows() {
                let columns = comparison.area.columns();
                let light = &comparison.seen.plane(c).row(row)[columns.clone()];
                let expected = &comparison.predicted.plane(c).row(row)[columns.clone()];
                let mask = &comparison.mask.plane(c).row(row)[columns];
                for ((&light, &expected), &mask) in light.iter().zip(expected).zip(mask) {
                    if mask == TRUSTED {
                        (seen, predicted) =
                            (seen + f64::from(light), predicted + f64::from(expected));
                    }
                }
            }
        }
        let gain = seen / predicted;
        if (gain - 1.0).abs() <= most { gain } else { 1.0 }
    }

    /// Combines `self` with a further `step`.
    fn and(self, step: Registration) -> Registration {
        let shift_px = (self.shift_px.0 + step.shift_px.0, self.shift_px.1 + step.shift_px.1);
        Registration { shift_px, gain: self.gain * step.gain }
    }

    /// Resets shift or gain if it is not significant, given the standard `error`.
    fn significant(self, error: Registration) -> Registration {
        let length = |(x, y): (f64, f64)| x.hypot(y);
        let mut significant = Registration::IN_PLACE;
        if length(self.shift_px) > SIGNIFICANT * length(error.shift_px) {
            significant.shift_px = self.shift_px;
        }
        let off = (self.gain - 1.0).abs();
        if off > SIGNIFICANT * error.gain && off <= GAIN_MAX {
            significant.gain = self.gain;
        }
        significant
    }

    /// Moves and scales `predicted`; `None` if that changes nothing.
    fn apply(&self, predicted: &Frame<Work>, channels: &[Channel]) -> Option<Frame<Work>> {
        if *self == Registration::IN_PLACE {
            return None;
        }
        let mut all = Frame::zeros(predicted.size());
        let moved = channels.par_iter().map(|&c| (c, self.apply_to_plane(predicted.plane(c))));
        let moved: Vec<(Channel, Plane)> = moved.collect();
        moved.into_iter().for_each(|(c, plane)| *all.plane_mut(c) = plane);
        Some(all)
    }

    fn apply_to_plane(&self, plane: &Plane) -> Plane {
        let ((x, y), gain) = (self.shift_px, self.gain as f32);
        let mut out = match (x, y) {
            (0.0, 0.0) => plane.clone(),
            (x, y) => translate(plane, x as f32, y as f32),
        };
        out.scale(gain);
        out
    }

    /// Removes from `seen` the change that shift and gain make to `predicted`.
    pub fn undo(&self, seen: &mut Seen, predicted: &Frame<Work>, channels: &[Channel]) {
        let Some(moved) = self.apply(predicted, channels) else { return };
        for &c in channels {
            let light = seen.light.plane_mut(c);
            light.add_scaled(1.0, predicted.plane(c));
            light.add_scaled(-1.0, moved.plane(c));
        }
    }
}

/// Normal equations of y − P on P, 1, −∂P/∂x and −∂P/∂y, in means over cells.
#[derive(Clone, Copy, Default)]
struct RegistrationSums {
    normal: Matrix4<f64>,
    right: Vector4<f64>,
}

impl RegistrationSums {
    fn add_cell(&mut self, comparison: &Comparison<'_>, channel: Channel, cell: Rect) {
        let (predicted, seen) =
            (comparison.predicted.plane(channel), comparison.seen.plane(channel));
        let mask = comparison.mask.plane(channel);
        let Rect { x, y, size } = cell;
        let (mut gx, mut gy, mut r, mut light, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for v in y.max(1)..(y + size.height).min(predicted.height().saturating_sub(1)) {
            let (above, here, below) =
                (predicted.row(v - 1), predicted.row(v), predicted.row(v + 1));
            let (seen, mask) = (seen.row(v), mask.row(v));
            for u in x.max(1)..(x + size.width).min(predicted.width().saturating_sub(1)) {
                if mask[u] == TRUSTED {
                    gx += f64::from(here[u + 1] - here[u - 1]) / 2.0;
                    gy += f64::from(below[u] - above[u]) / 2.0;
                    r += f64::from(seen[u] - here[u]);
                    light += f64::from(here[u]);
                    count += 1.0;
                }
            }
        }
        if count > 0.0 {
            let row = Vector4::new(light, count, -gx, -gy);
            self.normal += row * row.transpose() / count;
            self.right += row * r / count;
        }
    }

    fn shift_and_gain(&self) -> Registration {
        let RegistrationSums { normal, right } = self;
        let (light, residual) = (normal[(0, 1)], right[1]);
        let more = if light > 0.0 { residual / light } else { 0.0 };
        let (bx, by) = (right[2] - more * normal[(0, 2)], right[3] - more * normal[(0, 3)]);
        let (xx, xy, yy) = (normal[(2, 2)], normal[(2, 3)], normal[(3, 3)]);
        let determinant = xx * yy - xy * xy;
        let shift_px = if determinant > 1e-9 * xx * yy {
            ((yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant)
        } else {
            (0.0, 0.0)
        };
        Registration { shift_px, gain: 1.0 + more }
    }
}

impl Comparison<'_> {
    /// Sums of each part of the area, over cells of `cell_px` pixels.
    fn parts(&self, cell_px: usize) -> Vec<RegistrationSums> {
        let Rect { x, y, size } = self.area;
        let cells = Size::new(size.width.div_ceil(cell_px), size.height.div_ceil(cell_px));
        let add_part = |part: &Rect| {
            let mut sums = RegistrationSums::default();
            for row in part.rows() {
                for column in part.columns() {
                    let (left, top) = (column * cell_px, row * cell_px);
                    let size =
                        Size::new(cell_px.min(size.width - left), cell_px.min(size.height - top));
                    let cell = Rect { x: x + left, y: y + top, size };
                    for &c in self.channels {
                        sums.add_cell(self, c, cell);
                    }
                }
            }
            sums
        };
        let cells = Rect { x: 0, y: 0, size: cells };
        let parts: Vec<Rect> = cells.parts(PARTS.0, PARTS.1).collect();
        parts.par_iter().map(add_part).collect()
    }
}

fn total(parts: &[RegistrationSums]) -> RegistrationSums {
    RegistrationSums {
        normal: parts.iter().map(|part| part.normal).sum(),
        right: parts.iter().map(|part| part.right).sum(),
    }
}

/// Standard errors of shift and gain, from leaving out each part in turn.
fn jackknife(parts: &[RegistrationSums]) -> Registration {
    let all = total(parts);
    let whole = all.shift_and_gain();
    let (mut x, mut y, mut gain) = (0.0, 0.0, 0.0);
    for part in parts {
        let others =
            RegistrationSums { normal: all.normal - part.normal, right: all.right - part.right };
        let one = others.shift_and_gain();
        x += (one.shift_px.0 - whole.shift_px.0).powi(2);
        y += (one.shift_px.1 - whole.shift_px.1).powi(2);
        gain += (one.gain - whole.gain).powi(2);
    }
    let n = parts.len() as f64;
    let error = |square: f64| ((n - 1.0) / n * square).sqrt();
    Registration { shift_px: (error(x), error(y)), gain: error(gain) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const SIZE: Size = Size { width: 256, height: 192 };
    const PHOTO: Rect = Rect { x: 8, y: 8, size: Size { width: 240, height: 176 } };

    /// A soft picture, displaced by (x, y) pixels.
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
        let comparison = Comparison {
            seen: &seen.light,
            predicted: &picture(0.0, 0.0),
            mask: &seen.trusted,
            area: PHOTO,
            channels: &Channel::ALL,
        };
        Registration::fit(&comparison, 13)
    }

    #[test]
    fn shift_and_gain_of_a_capture_are_found_and_removed() {
        for (x, y, gain) in [(0.3, -0.4, 1.0), (0.04, 0.03, 0.997), (-0.9, 0.6, 1.004)] {
            for seed in 0..5 {
                let mut seen = seen(&picture(x, y), gain, 1.0, seed);
                let found = found(&seen);
                let off = (found.shift_px.0 - x).hypot(found.shift_px.1 - y);
                assert!(off < 0.005, "{x} {y}: {found:?}");
                assert!((found.gain - f64::from(gain)).abs() < 5e-4, "{gain}: {found:?}");
                found.undo(&mut seen, &picture(0.0, 0.0), &Channel::ALL);
                let mut residual = seen.light.plane(Channel::Green).clone();
                residual.add_scaled(-1.0, picture(0.0, 0.0).plane(Channel::Green));
                let noise = residual.crop(PHOTO).rms();
                assert!((noise - 1.0).abs() < 0.02, "{noise}");
            }
        }
    }

    #[test]
    fn a_capture_in_place_is_left_unchanged() {
        let out_of = 40;
        let moved = (0..out_of).filter(|&seed| {
            found(&seen(&picture(0.0, 0.0), 1.0, 1.0, seed)) != Registration::IN_PLACE
        });
        assert!(moved.count() <= 1);
    }

    #[test]
    fn scattered_light_does_not_change_the_gain() {
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
