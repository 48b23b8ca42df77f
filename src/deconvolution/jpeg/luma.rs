//! The prior along the code's luma: a JPEG keeps the brightness of a detail.
//!
//! Chroma is stored in long steps and at half the size. Since each channel is deconvolved with its
//! own blur, chroma's quantisation errors become noise of brightness. So the part of a detail along
//! the code's luma is shrunk by itself, and the part off it jointly over the channels and more
//! strongly:
//!
//! ```text
//! n_i = (.299, .587, .114)_i enc'(light about the place)_i,  n·u = 1,  u = (1, 1, 1)/√3
//! y = n·d;  r = d − u y;  d ← u y by the threshold's share of y's power in the 3×3 about it
//!                             + r by eight times that of the three planes of r together
//! ```

use rayon::prelude::*;

use super::curve::CodeCurve;
use crate::deconvolution::colour_axis::AlongAxes;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::smoothing::{blur, halve};
use crate::frame::{Frame, Plane, Size, TO_YCC, Work};

/// Factor on the threshold off luma; the independent study uses 3. Set on coffee and rocket, where
/// 6 and 8 reduce ΔE by 0.1 to 0.4; more was not tried.
const LUMA_STRICTNESS: f32 = 8.0;
/// σ of the Gaussian that gives the local brightness, pixels: the independent study's.
const ABOUT_PX: f32 = 3.0;
/// Least light at which the curve's slope is taken, grey levels.
const DARKEST: f32 = 0.8;

/// Weight of each channel in luma, per 2×2 pixels of `photo`.
pub(super) fn directions(curves: &[CodeCurve; 3], photo: &Frame<Work>) -> [Plane; 3] {
    let of = |n: usize| {
        let about = halve(&blur(&photo.planes()[n], ABOUT_PX));
        about.map(|v: f32| TO_YCC[0][n] * curves[n].slope(v.max(DARKEST)))
    };
    let planes: Vec<Plane> = (0..3).into_par_iter().map(of).collect();
    <[Plane; 3]>::try_from(planes).unwrap_or_else(|_| [(); 3].map(|()| Plane::zeros(photo.size())))
}

/// Prior along luma over the details of three planes.
pub struct AlongLuma {
    transforms: AlongAxes,
    /// n at each level, finest first.
    levels: Vec<[Plane; 3]>,
    /// The threshold of each level, grey levels.
    thresholds: Vec<f32>,
}

impl AlongLuma {
    /// The prior for planes of `size` with luma along `luma` and the `thresholds` of each level,
    /// finest first.
    pub(super) fn new(size: Size, luma: &[Plane; 3], thresholds: Vec<f32>) -> AlongLuma {
        let mut of_level = luma.clone();
        let mut levels = Vec::with_capacity(thresholds.len());
        for _ in &thresholds {
            let coarser = of_level.each_ref().map(halve);
            levels.push(of_unit_sum(std::mem::replace(&mut of_level, coarser)));
        }
        AlongLuma { transforms: AlongAxes::new(size, thresholds.len()), levels, thresholds }
    }

    /// Shrinks the details of `planes`, at `shift` if one is given, otherwise averaged over the
    /// shifts of step `step`.
    pub(in crate::deconvolution) fn shrink(
        &self,
        planes: &mut [Plane; 3],
        mask: &DetailMask,
        (shift, step): (Option<(usize, usize)>, usize),
    ) {
        let (levels, thresholds) = (&self.levels, &self.thresholds);
        let draw = |level: usize, bands: [&mut Plane; 3]| {
            draw_band(bands, &levels[level], thresholds[level], mask.factors(level));
        };
        match shift {
            Some(shift) => self.transforms.at_shift(planes, shift, &draw),
            None => self.transforms.spun(planes, step, &draw),
        }
    }
}

/// `n` scaled so that n·u = 1.
fn of_unit_sum(mut n: [Plane; 3]) -> [Plane; 3] {
    let [r, g, b] = &mut n;
    let rows = r.data_mut().iter_mut().zip(g.data_mut()).zip(b.data_mut());
    for ((r, g), b) in rows {
        let times = 3.0f32.sqrt() / (*r + *g + *b).max(f32::MIN_POSITIVE);
        (*r, *g, *b) = (times * *r, times * *g, times * *b);
    }
    n
}

/// Shrinks the details of one band by the rule in the module's documentation. Powers are means over
/// the periodised band with weights (1 2 1)/4 in both directions. The threshold is multiplied by
/// `factors`, pixel by pixel.
pub(super) fn draw_band(
    bands: [&mut Plane; 3],
    n: &[Plane; 3],
    threshold: f32,
    factors: Option<&Plane>,
) {
    let size = bands[0].size();
    let Size { width, height } = size;
    if threshold <= 0.0 || size.area() == 0 {
        return;
    }
    let u = (1.0f32 / 3.0).sqrt();
    let [red, green, blue] = bands;
    let factors = factors.filter(|factors| factors.size() == size);
    let [mut along, mut off] = [(); 2].map(|()| Plane::zeros(size));
    for y in 0..height {
        let (r, g, b) = (red.row(y), green.row(y), blue.row(y));
        let [nr, ng, nb] = n.each_ref().map(|n| n.row(y));
        let (along, off) = (along.row_mut(y), off.row_mut(y));
        for x in 0..width {
            let luma = nr[x] * r[x] + ng[x] * g[x] + nb[x] * b[x];
            let [r, g, b] = [r[x], g[x], b[x]].map(|d| d - u * luma);
            (along[x], off[x]) = (luma, r * r + g * g + b * b);
        }
    }
    let ones = vec![1.0; width];
    let mut sums = [(); 2].map(|()| vec![0.0f32; width + 2]);
    for y in 0..height {
        let (above, below) = ((y + height - 1) % height, (y + 1) % height);
        let [a, h, b] = [above, y, below].map(|y| along.row(y));
        for (x, sum) in sums[0][1..=width].iter_mut().enumerate() {
            *sum = a[x] * a[x] + 2.0 * h[x] * h[x] + b[x] * b[x];
        }
        let [a, h, b] = [above, y, below].map(|y| off.row(y));
        for (x, sum) in sums[1][1..=width].iter_mut().enumerate() {
            *sum = a[x] + 2.0 * h[x] + b[x];
        }
        sums.iter_mut().for_each(|row| (row[0], row[width + 1]) = (row[width], row[1]));
        let factors = factors.map_or(&ones[..], |factors| factors.row(y));
        let luma = along.row(y);
        let (r, g, b) = (red.row_mut(y), green.row_mut(y), blue.row_mut(y));
        for x in 0..width {
            let kept = |power: &[f32], threshold: f32| {
                let power = (power[x] + 2.0 * power[x + 1] + power[x + 2]) * (1.0 / 16.0);
                (1.0 - threshold / power.max(f32::MIN_POSITIVE).sqrt()).max(0.0)
            };
            let threshold = threshold * factors[x];
            let along = kept(&sums[0], threshold);
            let off = kept(&sums[1], LUMA_STRICTNESS * threshold);
            let more = (along - off) * u * luma[x];
            r[x] = off * r[x] + more;
            g[x] = off * g[x] + more;
            b[x] = off * b[x] + more;
        }
    }
}
