//! What a change of the lens is made of: bands of a picture, and small slopes and stretches of
//! each.
//!
//! A picture smoothed again and again with B-splines of doubled spacing (Holschneider's "à trous"
//! scheme, 1989) falls into bands S₀ − S₁, S₁ − S₂, …, and a lens that was changed lets another
//! share of each band through, moved a little or stretched along a direction. Each of these is a
//! picture made by adding a few shifted ones, and at the same time a handful of taps
//! ([`Bands::taps`]). What is wider than the functions' support is fitted along ([`WIDE`]), so that
//! it is not taken for anything narrow, and is no part of the taps.

use rayon::prelude::*;

use crate::frame::{Plane, Size};

/// Members of each narrow band: its share, slopes along x and y, and two stretches.
pub(super) const MEMBERS: usize = 5;
/// Bands wider than the support, then a constant.
pub(super) const WIDE: usize = 3;
/// Narrow smoothings at the most.
const SMOOTHINGS_MAX: usize = 3;
/// The constant, grey levels: a coefficient of 0.1 is 3 of them.
const CONSTANT: f32 = 30.0;
/// Weights of one smoothing: the cubic B-spline.
const SPLINE: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// Which bands there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bands {
    /// Smoothings whose taps lie within the support.
    smoothings: usize,
    support_px: usize,
}

impl Bands {
    /// For functions of `support_px`.
    pub(super) fn within(support_px: usize) -> Bands {
        // Smoothing s reaches 2·(2^s − 1) pixels.
        let fits = |&s: &usize| 2 * ((1 << s) - 1) <= support_px / 2;
        let smoothings = (1..=SMOOTHINGS_MAX).rev().find(fits).unwrap_or(0);
        Bands { smoothings, support_px }
    }

    /// Regressors that are taps; they come first.
    pub(super) fn narrow(self) -> usize {
        MEMBERS * (self.smoothings + 1)
    }

    /// All regressors.
    pub(super) fn count(self) -> usize {
        self.narrow() + WIDE + 1
    }

    /// `picture` smoothed 0, 1, 2, … times, black beyond the border.
    pub(super) fn smoothed(self, picture: &Plane) -> Vec<Plane> {
        let mut all = vec![picture.clone()];
        for s in 0..self.smoothings + WIDE {
            all.push(smooth(&all[s], 1 << s));
        }
        all
    }

    /// All regressors along row `y` of the `smoothed` picture, one after the other, each a row
    /// long, into `out`.
    pub(super) fn row(self, smoothed: &[Plane], y: usize, out: &mut [f32]) {
        let width = smoothed[0].width();
        let mut rows = out.chunks_exact_mut(width);
        let mut next = || rows.next().unwrap_or_default();
        for s in 0..=self.smoothings {
            let plane = &smoothed[s];
            difference(plane.row(y), smoothed[s + 1].row(y), next());
            let apart = spacing(s);
            let dark = vec![0.0; width];
            let above = y.checked_sub(apart).map_or(&dark[..], |y| plane.row(y));
            let below = if y + apart < plane.height() { plane.row(y + apart) } else { &dark[..] };
            let (here, at) =
                (plane.row(y), |row: &[f32], x: usize| row.get(x).copied().unwrap_or(0.0));
            // A column left of the first wraps to a number that no row has.
            for (x, value) in next().iter_mut().enumerate() {
                *value = at(here, x + apart) - at(here, x.wrapping_sub(apart));
            }
            difference(below, above, next());
            for (x, value) in next().iter_mut().enumerate() {
                *value =
                    at(here, x + apart) + at(here, x.wrapping_sub(apart)) - above[x] - below[x];
            }
            for (x, value) in next().iter_mut().enumerate() {
                let (left, right) = (x.wrapping_sub(apart), x + apart);
                *value = at(above, left) + at(below, right) - at(above, right) - at(below, left);
            }
        }
        let widest = self.smoothings + WIDE;
        for s in self.smoothings + 1..widest {
            difference(smoothed[s].row(y), smoothed[s + 1].row(y), next());
        }
        next().copy_from_slice(smoothed[widest].row(y));
        next().fill(CONSTANT);
    }

    /// The taps `[v][u]` of a change with the narrow `coefficients`.
    ///
    /// In the last band, what the next smoothing throws beyond the support is drawn into it: no
    /// change makes all brighter.
    pub(super) fn taps(self, coefficients: &[f64]) -> Vec<f32> {
        let k = self.support_px;
        // Smoothed dots, on a square that holds all that is made of them.
        let r = k / 2 + spacing(self.smoothings);
        let size = Size::new(2 * r + 1, 2 * r + 1);
        let dot = Plane::from_fn(size, |x, y| if (x, y) == (r, r) { 1.0 } else { 0.0 });
        let smoothed = self.smoothed(&dot);
        let mut rows = vec![0.0; self.count() * size.width];
        let mut taps = vec![0.0; k * k];
        let inset = r - k / 2;
        let wide = &smoothed[self.smoothings + 1];
        let within: f32 =
            (0..k).map(|v| wide.row(v + inset)[inset..][..k].iter().sum::<f32>()).sum();
        for (v, taps) in taps.chunks_exact_mut(k.max(1)).enumerate() {
            self.row(&smoothed, v + inset, &mut rows);
            let last = MEMBERS * self.smoothings;
            let (narrow, next) = (smoothed[self.smoothings].row(v + inset), wide.row(v + inset));
            let band = rows[last * size.width..][..size.width].iter_mut();
            band.zip(narrow)
                .zip(next)
                .for_each(|((value, narrow), next)| *value = narrow - next / within);
            for (row, &c) in rows.chunks_exact(size.width).zip(&coefficients[..self.narrow()]) {
                taps.iter_mut()
                    .zip(&row[inset..])
                    .for_each(|(tap, &v)| *tap += (c * f64::from(v)) as f32);
            }
        }
        taps
    }
}

/// Pixels between the places compared in band `s`: about its smoothing's deviation.
fn spacing(s: usize) -> usize {
    1 << s.saturating_sub(1)
}

fn difference(a: &[f32], b: &[f32], out: &mut [f32]) {
    out.iter_mut().zip(a).zip(b).for_each(|((o, a), b)| *o = a - b);
}

/// `plane` smoothed once along both sides, with `apart` pixels between the weights.
fn smooth(plane: &Plane, apart: usize) -> Plane {
    let (width, height) = (plane.width(), plane.height());
    let mut along: Plane = Plane::zeros(plane.size());
    along.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let row = plane.row(y);
        for (n, weight) in SPLINE.iter().enumerate() {
            let (far, left) = (n.abs_diff(2) * apart, n < 2);
            if far >= width {
                continue;
            }
            let (to, from) =
                if left { (&mut out[far..], row) } else { (&mut out[..width - far], &row[far..]) };
            to.iter_mut().zip(from).for_each(|(o, v)| *o += weight * v);
        }
    });
    let mut both: Plane = Plane::zeros(plane.size());
    both.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (n, weight) in SPLINE.iter().enumerate() {
            let from = (y + n * apart).checked_sub(2 * apart).filter(|&y| y < height);
            if let Some(from) = from {
                out.iter_mut().zip(along.row(from)).for_each(|(o, v)| *o += weight * v);
            }
        }
    });
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_add_up_to_the_picture() {
        let bands = Bands::within(33);
        assert_eq!((bands.narrow(), bands.count()), (20, 24));
        let picture = Plane::from_fn(Size::new(40, 30), |x, y| ((7 * x + 3 * y) % 31) as f32);
        let smoothed = bands.smoothed(&picture);
        let mut rows = vec![0.0; bands.count() * 40];
        bands.row(&smoothed, 13, &mut rows);
        let shares: Vec<usize> = (0..4).map(|s| MEMBERS * s).chain(20..23).collect();
        for x in 0..40 {
            let sum: f32 = shares.iter().map(|n| rows[n * 40 + x]).sum();
            assert!((sum - picture.at(x, 13)).abs() < 1e-4, "{x}: {sum}");
        }
    }

    #[test]
    fn taps_do_what_the_regressors_do() {
        let bands = Bands::within(33);
        // Nothing in the last band, whose taps leave out what is wide.
        let coefficients: Vec<f64> =
            (0..24).map(|n| if n < 15 { 0.3 - 0.05 * n as f64 } else { 0.0 }).collect();
        let taps = bands.taps(&coefficients);
        let picture = Plane::from_fn(Size::new(70, 60), |x, y| ((x * y + 5 * x) % 17) as f32);
        let smoothed = bands.smoothed(&picture);
        let mut rows = vec![0.0; bands.count() * 70];
        bands.row(&smoothed, 30, &mut rows);
        for x in 20..50 {
            let by_rows: f64 = (0..24).map(|n| coefficients[n] * f64::from(rows[n * 70 + x])).sum();
            let by_taps: f32 =
                (0..33 * 33).map(|t| taps[t] * picture.at(x + 16 - t % 33, 30 + 16 - t / 33)).sum();
            assert!((by_rows as f32 - by_taps).abs() < 1e-2, "{x}: {by_rows} {by_taps}");
        }
    }
}
