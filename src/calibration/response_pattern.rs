//! Response of each sensor site relative to its surroundings, and hot and dead sites.
//!
//! Flats are divided by their smooth part pixel by pixel. The mean of N flats of light L_f adds
//! noise to a photo of light L, √(L / (L_f·N)) times the photo's own: a tenth for N = 100 and L =
//! L_f, and less for darker photos or with read noise.
//!
//! A flat is uneven where the lens resolves the panel's pixels, whose grating beats with the
//! sensor's. So the smooth part includes a wave in phase with the panel's columns, along which the
//! stripes of three colours lie.

use serde::{Deserialize, Serialize};

use crate::deconvolution::panel_beat::ColumnWave;
use crate::frame::{Channel, Frame, Mosaic, Plane, Size, Work};

/// Quantisation of a response: 0.1 %, with an RMS error of 0.03 %, a twentieth of a usual sensor's
/// noise in white.
pub const STEP: f32 = 1.0 / 1024.0;
pub(super) const BAD: i8 = i8::MIN;
/// Largest deviation of a good site, in steps (12 %): industrial sensors differ by 1 % (EMVA 1288
/// data sheets).
const STEPS_MAX: f32 = 127.0;
/// Threshold of a hot site in the dark, in σ: none by chance among a million sites.
const HOT_SIGMAS: f32 = 6.0;
/// Half the side of the square of surroundings: 156 sites of red for three parameters, so that the
/// smooth part errs by a seventh of the sites' RMS deviation. The visibility of the panel's pixels
/// varies over a wider square.
const AROUND_PX: usize = 12;
/// Regularisation of the wave's variance, which is a half for a beat.
const STILL: f64 = 1e-3;
/// Least relative light of a measured site. Guess.
const LEAST_SHARE: f32 = 0.05;
/// Largest share of bad sites. Guess: ten times that of a worn sensor.
pub const BAD_SHARE_MAX: f64 = 0.02;

/// Responses of the sensor's sites, on the canvas.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ResponsePattern {
    /// Deviations from 1 in units of [`STEP`], row by row: one plane behind colour filters, three
    /// without, none if not measured.
    planes: Vec<Vec<i8>>,
}

/// Flats and darks, canvas-sized.
pub struct EvenlyLit<'a> {
    /// Mean counts over dark relative to their smooth part; about 1.
    pub ratio: &'a Frame<Work>,
    /// Illumination relative to the mean.
    pub share: &'a Frame<Work>,
    /// The wave of the panel's columns.
    pub wave: &'a ColumnWave,
    /// Mean counts of the dark minus their smooth part.
    pub dark: &'a Frame<Work>,
    /// Colour filters over the canvas, if any.
    pub mosaic: Option<Mosaic>,
    /// Width of the canvas's unmeasured border, where the panel ends.
    pub rim_px: usize,
}

impl ResponsePattern {
    /// Fits the pattern to `seen`.
    ///
    /// # Errors
    /// Returns the share of bad sites if it is above [`BAD_SHARE_MAX`].
    pub fn fit(seen: &EvenlyLit<'_>) -> Result<ResponsePattern, f64> {
        let size = seen.ratio.size();
        let mut planes = vec![vec![BAD; size.area()]; if seen.mosaic.is_some() { 1 } else { 3 }];
        let (mut bad, mut all) = (0usize, 0usize);
        for c in Channel::ALL {
            let own = |x: usize, y: usize| seen.mosaic.is_none_or(|m| m.colour_at(x, y) == c);
            let to = if seen.mosaic.is_some() { 0 } else { c.index() };
            for (n, steps) in fit_channel(seen, c, &own).into_iter().enumerate() {
                let Some(steps) = steps else { continue };
                planes[to][n] = steps;
                (bad, all) = (bad + usize::from(steps == BAD), all + 1);
            }
        }
        let share = bad as f64 / all.max(1) as f64;
        if share > BAD_SHARE_MAX {
            return Err(share);
        }
        Ok(ResponsePattern { planes })
    }

    /// The planes: none, one, or three.
    pub(super) fn planes(&self) -> &[Vec<i8>] {
        &self.planes
    }

    /// Checks that the pattern fits a canvas of this size; the error describes the fault.
    pub(super) fn check(&self, canvas: Size) -> Result<(), String> {
        let sites = canvas.width.checked_mul(canvas.height);
        let fits = |plane: &Vec<i8>| Some(plane.len()) == sites;
        if matches!(self.planes.len(), 0 | 1 | 3) && self.planes.iter().all(fits) {
            return Ok(());
        }
        let found: Vec<usize> = self.planes.iter().map(Vec::len).collect();
        Err(format!(
            "a response pattern with planes of {found:?} sites; allowed are none, one or \
             three planes of {canvas}"
        ))
    }
}

/// Deviations of one channel's sites, row by row; `None` at other sites.
fn fit_channel(
    seen: &EvenlyLit<'_>,
    channel: Channel,
    own: &dyn Fn(usize, usize) -> bool,
) -> Vec<Option<i8>> {
    let (ratio, dark) = (seen.ratio.plane(channel), seen.dark.plane(channel));
    let share = seen.share.plane(channel);
    let size = ratio.size();
    let hot = hot_above(size, dark, own);
    let is_measured = |x: usize, y: usize| {
        let to_border = x.min(y).min(size.width - 1 - x).min(size.height - 1 - y);
        to_border >= seen.rim_px && share.at(x, y) > LEAST_SHARE
    };
    let fit = |x: usize, y: usize| own(x, y) && is_measured(x, y) && dark.at(x, y).abs() <= hot;
    // In two rounds, to exclude dead sites from their neighbours' surroundings.
    let mut good = Plane::from_fn(size, fit);
    let mut response = Plane::zeros(size);
    for _ in 0..2 {
        let around = surroundings(ratio, &good, seen.wave);
        response = Plane::from_fn(size, |x, y| ratio.at(x, y) / around.at(x, y) - 1.0);
        good =
            Plane::from_fn(size, |x, y| fit(x, y) && (response.at(x, y) / STEP).abs() <= STEPS_MAX);
    }
    let steps = |x: usize, y: usize| match (own(x, y), good.at(x, y)) {
        (false, _) => None,
        (true, true) => Some((response.at(x, y) / STEP).round() as i8),
        (true, false) if !is_measured(x, y) && dark.at(x, y).abs() <= hot => Some(0),
        (true, false) => Some(BAD),
    };
    (0..size.area()).map(|n| steps(n % size.width, n / size.width)).collect()
}

/// Largest deviation of a good site in the dark, counts.
fn hot_above(size: Size, dark: &Plane, own: &dyn Fn(usize, usize) -> bool) -> f32 {
    let mut off: Vec<f32> = (0..size.area())
        .filter(|n| own(n % size.width, n / size.width))
        .map(|n| dark.data()[n].abs())
        .collect();
    if off.is_empty() {
        return f32::INFINITY;
    }
    let middle = off.len() / 2;
    // The median of |N(0, 1)| is 0.6745; rounding of counts adds a variance of 1/12.
    let sigma = *off.select_nth_unstable_by(middle, f32::total_cmp).1 / 0.674_5;
    HOT_SIGMAS * sigma.hypot(12.0f32.sqrt().recip())
}

/// Smooth part of `plane` from its `good` sites: a constant and a share of `wave`, by least squares
/// over a square.
fn surroundings(plane: &Plane, good: &Plane<bool>, wave: &ColumnWave) -> Plane {
    let size = plane.size();
    let add = |columns: &mut [Moments], y: usize, weight: f64| {
        for (x, column) in columns.iter_mut().enumerate().filter(|&(x, _)| good.at(x, y)) {
            column.add(f64::from(plane.at(x, y)), wave.at(x, y).map(f64::from), weight);
        }
    };
    // Running sums over the square's rows, and cumulative sums along the row.
    let mut columns = vec![Moments::default(); size.width];
    let mut before = vec![Moments::default(); size.width + 1];
    (0..AROUND_PX.min(size.height)).for_each(|y| add(&mut columns, y, 1.0));
    let mut smooth = Plane::zeros(size);
    for y in 0..size.height {
        if y + AROUND_PX < size.height {
            add(&mut columns, y + AROUND_PX, 1.0);
        }
        if y > AROUND_PX {
            add(&mut columns, y - AROUND_PX - 1, -1.0);
        }
        for (x, column) in columns.iter().enumerate() {
            before[x + 1] = before[x].plus(column, 1.0);
        }
        for (x, smooth) in smooth.row_mut(y).iter_mut().enumerate() {
            let (first, past) = (x.saturating_sub(AROUND_PX), (x + AROUND_PX + 1).min(size.width));
            let square = before[past].plus(&before[first], -1.0);
            *smooth = square.at(wave.at(x, y).map(f64::from)) as f32;
        }
    }
    smooth
}

/// Least-squares sums of values on 1, a cosine and a sine.
#[derive(Debug, Clone, Copy, Default)]
struct Moments([f64; 9]);

impl Moments {
    fn add(&mut self, value: f64, [c, s]: [f64; 2], weight: f64) {
        let terms = [1.0, c, s, c * c, c * s, s * s, value, value * c, value * s];
        self.0.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
    }

    fn plus(&self, other: &Moments, weight: f64) -> Moments {
        Moments(std::array::from_fn(|n| self.0[n] + weight * other.0[n]))
    }

    /// The fitted value at these values of the wave; 1 without data.
    fn at(&self, [c, s]: [f64; 2]) -> f64 {
        let [n, c1, s1, cc, cs, ss, v, vc, vs] = self.0;
        if n < 0.5 {
            return 1.0;
        }
        // Centred means; a constant wave leaves the mean alone.
        let (c1, s1, v) = (c1 / n, s1 / n, v / n);
        let (cc, ss) = (cc / n - c1 * c1 + STILL, ss / n - s1 * s1 + STILL);
        let (cs, vc, vs) = (cs / n - c1 * s1, vc / n - v * c1, vs / n - v * s1);
        let determinant = cc * ss - cs * cs;
        let (a, b) = ((vc * ss - vs * cs) / determinant, (vs * cc - vc * cs) / determinant);
        v + a * (c - c1) + b * (s - s1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use std::f32::consts::TAU;

    const SIZE: Size = Size::new(120, 90);

    fn normal(seed: u64) -> Plane {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        Plane::from_fn(SIZE, |_, _| StandardNormal.sample(&mut random))
    }

    fn all(plane: &Plane) -> Frame<Work> {
        Frame::from_fn(|_| plane.clone())
    }

    #[test]
    fn responses_and_hot_and_dead_sites_are_found() {
        let truth = normal(1).map(|v: f32| 1.0 + 0.01 * v);
        let noise = normal(2);
        let column = |x: usize, y: usize| 1.163 * x as f32 + 0.01 * y as f32;
        let mut ratio = Plane::from_fn(SIZE, |x, y| {
            let beat = 0.01 * (TAU * (column(x, y) + 0.3)).cos();
            let uneven = 1.0 + 0.0002 * x as f32 + beat;
            truth.at(x, y) * (1.0 + 0.0006 * noise.at(x, y)) * uneven
        });
        let mut dark = normal(3).map(|v: f32| 0.3 * v);
        dark.set(40, 31, 12.0);
        ratio.set(71, 50, 0.1);
        ratio.set(3, 80, 1.3);
        let share = all(&Plane::filled(SIZE, 1.0));
        for mosaic in [None, Some(Mosaic::Grbg)] {
            let (ratio, dark) = (all(&ratio), all(&dark));
            let wave = &ColumnWave::of(&Plane::from_fn(SIZE, column));
            let seen =
                EvenlyLit { ratio: &ratio, share: &share, wave, dark: &dark, mosaic, rim_px: 0 };
            let found = ResponsePattern::fit(&seen).unwrap();
            found.check(SIZE).unwrap();
            let expected = [(40, 31), (71, 50), (3, 80)].map(|(x, y)| y * SIZE.width + x);
            for steps in found.planes() {
                let bad: Vec<usize> = (0..SIZE.area()).filter(|&n| steps[n] == BAD).collect();
                let mut expected = expected;
                expected.sort_unstable();
                assert_eq!(bad, expected);
                let off = |n: usize| f64::from(STEP * f32::from(steps[n]) + 1.0 - truth.data()[n]);
                let good = (0..SIZE.area()).filter(|n| !expected.contains(n));
                let rms = (good.map(|n| off(n).powi(2)).sum::<f64>() / SIZE.area() as f64).sqrt();
                // Allows for the flat's noise, rounding and the error of the smooth part.
                assert!(rms < 0.0016, "{rms}");
            }
        }
    }

    #[test]
    fn too_many_bad_sites_are_refused_and_a_dark_border_is_accepted() {
        let ratio = Plane::from_fn(SIZE, |x, y| if (x + 3 * y) % 25 == 0 { 0.2 } else { 1.0 });
        let (ratio, dark) = (all(&ratio), all(&Plane::zeros(SIZE)));
        let light = all(&Plane::filled(SIZE, 1.0));
        let (ratio, dark, wave) = (&ratio, &dark, &ColumnWave::of(&Plane::zeros(SIZE)));
        let seen = EvenlyLit { ratio, share: &light, wave, dark, mosaic: None, rim_px: 0 };
        let share = ResponsePattern::fit(&seen).unwrap_err();
        assert!((share - 0.04).abs() < 0.001, "{share}");
        let unlit = all(&Plane::filled(SIZE, 0.01));
        let found = ResponsePattern::fit(&EvenlyLit { share: &unlit, ..seen }).unwrap();
        assert!(found.planes().iter().flatten().all(|&steps| steps == 0));
    }
}
