//! Shrinkage of three channels' details along their colour axes, at one shift or cycle-spun.
//!
//! Levels are transformed one by one. A shift of the plane by s is a shift of the finest level by
//! the last bit of s, of the next level by the bit before, and so on: a detail is then at most its
//! own width away from its axis.

use rayon::prelude::*;

use super::{AxisMap, ColourAxes};
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::wavelet::{Coefficients, Put, Scratch, Sym8};
use crate::deconvolution::wavelet_shrinkage::{EVERYWHERE, SHIFTS};
use crate::frame::instructions::{Kernel, run_fastest};
use crate::frame::{Plane, Size};

/// An operation on one band of the three channels, given its level.
type OnDetails<'a> = &'a (dyn Fn(usize, [&mut Plane; 3]) + Sync);

/// Thresholds of the shrinkage.
///
/// With a step size 1/α for each channel and level the proximal metric is weighted by α: the
/// component along u is Σ αud / Σ αu², and a weight of the prior becomes a threshold divided by
/// Σ αu². The unweighted product u·d would carry noise from the channels with least signal into the
/// others.
#[derive(Debug, Clone, Copy)]
pub struct Thresholds<'a> {
    /// Weights of the prior at each level, finest first.
    pub weights: &'a [AxisWeights],
    /// Power transmission α of each level and channel, finest level first.
    pub passed: &'a [[f32; 3]],
    /// Factors on the thresholds where the photo is flat.
    pub mask: &'a DetailMask,
}

/// Weights of the prior at one level, grey levels times α.
#[derive(Debug, Clone, Copy)]
pub struct AxisWeights {
    /// Weight along the axis.
    pub along: f32,
    /// Weight off the axis, before its factor κ.
    pub off: f32,
}

/// One-level transforms of three channels.
#[derive(Debug)]
pub struct AlongAxes {
    size: Size,
    levels: usize,
}

#[derive(Debug)]
struct OneLevel {
    transform: Sym8,
    channels: [Channelwise; 3],
}

#[derive(Debug)]
struct Channelwise {
    coefficients: Coefficients,
    sum: Plane,
}

impl Channelwise {
    fn bands(&mut self) -> [&mut Plane; 3] {
        self.coefficients.details[0].bands_mut()
    }
}

/// A choice of shifts.
#[derive(Clone, Copy)]
enum SpinShift {
    /// One shift of the whole transform, in columns and rows.
    Shift((usize, usize)),
    /// The shifts of a step: the two quincunxes of the finest level take turns; all shifts of the
    /// second level, and one of each coarser level.
    Spun(usize),
}

impl SpinShift {
    /// The shifts of `level`, each with the choice for the coarser levels.
    fn of(self, level: usize) -> Vec<((usize, usize), SpinShift)> {
        match self {
            SpinShift::Shift((x, y)) => {
                vec![((x & 1, y & 1), SpinShift::Shift((x >> 1, y >> 1)))]
            }
            SpinShift::Spun(step) if level == 0 => {
                let quincunx = SHIFTS.len() / 2;
                let first = quincunx * (step % 2);
                SHIFTS[first..first + quincunx].iter().map(|&shift| (shift, self)).collect()
            }
            SpinShift::Spun(step) if level < EVERYWHERE => {
                let next = |k| if level + 1 == EVERYWHERE { step + k } else { step };
                let shifts = SHIFTS.iter().enumerate();
                shifts.map(|(k, &shift)| (shift, SpinShift::Spun(next(k)))).collect()
            }
            SpinShift::Spun(step) => {
                vec![(SHIFTS[(step >> (2 * (level - EVERYWHERE))) % SHIFTS.len()], self)]
            }
        }
    }
}

impl AlongAxes {
    /// Transforms of planes of `size` in `levels` levels.
    pub fn new(size: Size, levels: usize) -> AlongAxes {
        AlongAxes { size, levels }
    }

    /// The levels, with buffers as large as eight planes, which are freed after each operation.
    fn levels(&self) -> Vec<OneLevel> {
        let mut of_level = self.size;
        let levels = (0..self.levels).map(|_| {
            let transform = Sym8::new(of_level, 1).parallel();
            let channels = [(); 3]
                .map(|()| Channelwise { coefficients: transform.zeros(), sum: Plane::default() });
            of_level = Size::new(of_level.width.div_ceil(2), of_level.height.div_ceil(2));
            OneLevel { transform, channels }
        });
        levels.collect()
    }

    /// Shrinks the details of `planes`, shifted by `shift`.
    ///
    /// # Panics
    /// When a plane has another size.
    pub fn shrink(
        &self,
        planes: &mut [Plane; 3],
        axes: &ColourAxes,
        thresholds: Thresholds<'_>,
        shift: (usize, usize),
    ) {
        self.at_shift(planes, shift, &|level, bands| shrink(bands, axes, thresholds, level));
    }

    /// Replaces `planes` by the mean of their shrunk versions over half of the finest level's
    /// shifts (the next step takes the other half), all of the second level's, and one of each
    /// coarser level's, chosen by `step_index`.
    ///
    /// Taking all shifts of the finest level at each step costs twice the time and gains at most
    /// 0.0001 SSIM.
    pub fn shrink_spun(
        &self,
        planes: &mut [Plane; 3],
        axes: &ColourAxes,
        thresholds: Thresholds<'_>,
        step_index: usize,
    ) {
        self.spun(planes, step_index, &|level, bands| shrink(bands, axes, thresholds, level));
    }

    /// Applies `operation` to the details of `planes`, averaged over the shifts of
    /// [`AlongAxes::shrink_spun`].
    pub(in crate::deconvolution) fn spun(
        &self,
        planes: &mut [Plane; 3],
        step_index: usize,
        operation: OnDetails<'_>,
    ) {
        apply(&mut self.levels(), 0, planes, SpinShift::Spun(step_index), operation);
    }

    /// Applies `operation` to the details of `planes`, shifted by `shift`.
    pub(in crate::deconvolution) fn at_shift(
        &self,
        planes: &mut [Plane; 3],
        shift: (usize, usize),
        operation: OnDetails<'_>,
    ) {
        apply(&mut self.levels(), 0, planes, SpinShift::Shift(shift), operation);
    }
}

/// Applies `operation` to the details of `planes`, the input of `level`, and of all coarser levels;
/// `planes` become the mean over the shifts of `spin`.
fn apply(
    levels: &mut [OneLevel],
    level: usize,
    planes: &mut [Plane; 3],
    spin: SpinShift,
    operation: OnDetails<'_>,
) {
    let Some((here, deeper)) = levels.split_first_mut() else { return };
    let shifts = spin.of(level);
    let transform = &here.transform;
    for (k, &(shift, coarser)) in shifts.iter().enumerate() {
        here.channels.par_iter_mut().zip(&*planes).for_each(|(own, plane)| {
            let scratch = &mut Scratch::default();
            transform.analyse_shifted(plane, shift, &mut own.coefficients, scratch);
        });
        let [r, g, b] = &mut here.channels;
        let bands: Vec<_> = r.bands().into_iter().zip(g.bands()).zip(b.bands()).collect();
        bands.into_par_iter().with_max_len(1).for_each(|((r, g), b)| operation(level, [r, g, b]));
        let taken = |own: &mut Channelwise| std::mem::take(&mut own.coefficients.approximation);
        let mut coarse = here.channels.each_mut().map(taken);
        apply(deeper, level + 1, &mut coarse, coarser, operation);
        for (own, coarse) in here.channels.iter_mut().zip(coarse) {
            own.coefficients.approximation = coarse;
        }
        let (is_only, is_last) = (shifts.len() == 1, k + 1 == shifts.len());
        here.channels.par_iter_mut().zip(&mut *planes).for_each(|(own, plane)| {
            let (Channelwise { coefficients, sum }, scratch) = (own, &mut Scratch::default());
            if is_only {
                let out = (plane, Put::Set);
                return transform.synthesise_shifted(coefficients, shift, out, scratch);
            }
            if sum.size() != plane.size() {
                *sum = plane.clone();
            }
            let put = if k == 0 { Put::Set } else { Put::Add };
            transform.synthesise_shifted(coefficients, shift, (sum, put), scratch);
            if is_last {
                let mean = 1.0 / shifts.len() as f32;
                let sums = sum.data().iter();
                plane.data_mut().iter_mut().zip(sums).for_each(|(v, sum)| *v = mean * sum);
            }
        });
    }
}

/// d ← (1 − l) d + l u Σ αud / Σ αu², with the linearity l and the power transmission α = `passed`.
pub(super) fn project(bands: [&mut Plane; 3], map: &AxisMap, passed: [f32; 3]) {
    let [r, g, b] = bands;
    let mut axes = AxisRow::new(r.width());
    for y in 0..r.height() {
        axes.fill(map, y, &map.line);
        let rows = r.row_mut(y).iter_mut().zip(g.row_mut(y)).zip(b.row_mut(y));
        for (x, ((r, g), b)) in rows.enumerate() {
            let u = axes.direction.each_ref().map(|u| u[x]);
            let d = [*r, *g, *b];
            let (mut along, mut total) = (0.0, f32::MIN_POSITIVE);
            for c in 0..3 {
                along += passed[c] * u[c] * d[c];
                total += passed[c] * u[c] * u[c];
            }
            let line = axes.other[x];
            let at = |c: usize| (1.0 - line) * d[c] + line * u[c] * (along / total);
            (*r, *g, *b) = (at(0), at(1), at(2));
        }
    }
}

/// [`shrink_band`] with the thresholds of `level`.
fn shrink(bands: [&mut Plane; 3], axes: &ColourAxes, thresholds: Thresholds<'_>, level: usize) {
    let (weights, passed) = (thresholds.weights[level], thresholds.passed[level]);
    shrink_band(bands, &axes.levels[level], (weights, passed), thresholds.mask.factors(level));
}

/// Shrinks the details d of one band. With y = Σ αud / Σ αu², r = d − y·u and the thresholds t =
/// `weights` / Σ αu², times `factors` pixel by pixel, y is multiplied by max(0, 1 − t/RMS) with the
/// RMS of y over the 3×3 details about it, and r likewise with κ·t and the RMS length of r.
pub(super) fn shrink_band(
    bands: [&mut Plane; 3],
    map: &AxisMap,
    (weights, passed): (AxisWeights, [f32; 3]),
    factors: Option<&Plane>,
) {
    let size = bands[0].size();
    if weights.along > 0.0 && size.area() > 0 {
        let factors = factors.filter(|factors| factors.size() == size);
        run_fastest(ShrinkAlong { bands, map, weights, passed, factors });
    }
}

struct ShrinkAlong<'a> {
    bands: [&'a mut Plane; 3],
    map: &'a AxisMap,
    weights: AxisWeights,
    passed: [f32; 3],
    factors: Option<&'a Plane>,
}

/// The axes of one row of details.
struct AxisRow {
    direction: [Vec<f32>; 3],
    /// κ or the linearity, as passed to [`AxisRow::fill`].
    other: Vec<f32>,
}

impl AxisRow {
    fn new(width: usize) -> AxisRow {
        AxisRow { direction: [(); 3].map(|()| vec![0.0; width]), other: vec![0.0; width] }
    }

    #[inline(always)]
    fn fill(&mut self, map: &AxisMap, y: usize, other: &Plane) {
        let rows = self.direction.iter_mut().zip(&map.direction);
        for (row, plane) in rows.chain([(&mut self.other, other)]) {
            let from = plane.row((y / map.details).min(plane.height() - 1));
            match map.details {
                1 => row.iter_mut().zip(from).for_each(|(row, &v)| *row = v),
                many => row.chunks_mut(many).zip(from).for_each(|(row, &v)| row.fill(v)),
            }
        }
    }
}

/// One row of details in the coordinates of its axes.
struct PowerRow {
    axes: AxisRow,
    /// αu / Σ αu²: weight of each channel in the component along u.
    counts: [Vec<f32>; 3],
    /// 1/Σ αu².
    each: Vec<f32>,
    /// Power along u.
    along: Vec<f32>,
    /// Power off u.
    off: Vec<f32>,
}

impl PowerRow {
    fn new(width: usize) -> PowerRow {
        let row = || vec![0.0; width];
        PowerRow {
            axes: AxisRow::new(width),
            counts: [row(), row(), row()],
            each: row(),
            along: row(),
            off: row(),
        }
    }

    #[inline(always)]
    fn fill(&mut self, bands: &[&mut Plane; 3], map: &AxisMap, passed: [f32; 3], y: usize) {
        self.axes.fill(map, y, &map.strictness);
        let width = self.along.len();
        let [u, v, w] = self.axes.direction.each_ref().map(|row| &row[..width]);
        let [r, g, b] = [0, 1, 2].map(|c| &bands[c].row(y)[..width]);
        let [cr, cg, cb] = self.counts.each_mut().map(|row| &mut row[..width]);
        let (powers, off) = (&mut self.along[..width], &mut self.off[..width]);
        let each = &mut self.each[..width];
        for x in 0..width {
            let (pr, pg, pb) = (passed[0] * u[x], passed[1] * v[x], passed[2] * w[x]);
            let one = 1.0 / (pr * u[x] + pg * v[x] + pb * w[x]);
            each[x] = one;
            (cr[x], cg[x], cb[x]) = (pr * one, pg * one, pb * one);
            let along = cr[x] * r[x] + cg[x] * g[x] + cb[x] * b[x];
            let (r, g, b) = (r[x] - along * u[x], g[x] - along * v[x], b[x] - along * w[x]);
            powers[x] = along * along;
            off[x] = r * r + g * g + b * b;
        }
    }
}

impl Kernel for ShrinkAlong<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let ShrinkAlong { mut bands, map, weights, passed, factors } = self;
        let (width, height) = (bands[0].width(), bands[0].height());
        let ones = vec![1.0; width];
        let [mut above, mut here, mut below] = [(); 3].map(|()| PowerRow::new(width));
        let mut sums = [(); 2].map(|()| vec![0.0f32; width + 2]);
        above.fill(&bands, map, passed, height - 1);
        here.fill(&bands, map, passed, 0);
        let first = (here.along.clone(), here.off.clone());
        for y in 0..height {
            if y + 1 < height {
                below.fill(&bands, map, passed, y + 1);
            } else {
                below.along.copy_from_slice(&first.0);
                below.off.copy_from_slice(&first.1);
            }
            let rows =
                [[&above.along, &here.along, &below.along], [&above.off, &here.off, &below.off]];
            for (sums, [a, h, b]) in sums.iter_mut().zip(rows) {
                let of = sums[1..=width].iter_mut().zip(a).zip(h).zip(b);
                of.for_each(|(((sum, a), h), b)| *sum = a + 2.0 * h + b);
                (sums[0], sums[width + 1]) = (sums[width], sums[1]);
            }
            let factors = &factors.map_or(&ones[..], |factors| factors.row(y))[..width];
            let [along, off] = sums.each_ref().map(|row| &row[..width + 2]);
            let strictness = &here.axes.other[..width];
            let [u, v, w] = here.axes.direction.each_ref().map(|row| &row[..width]);
            let [cr, cg, cb] = here.counts.each_ref().map(|row| &row[..width]);
            let each = &here.each[..width];
            let [r, g, b] = bands.each_mut().map(|band| &mut band.row_mut(y)[..width]);
            for x in 0..width {
                let kept = |power: &[f32], threshold: f32| {
                    let power = (power[x] + 2.0 * power[x + 1] + power[x + 2]) * (1.0 / 16.0);
                    (1.0 - threshold / power.max(f32::MIN_POSITIVE).sqrt()).max(0.0)
                };
                let threshold = |weight: f32| weight * factors[x] * each[x];
                let kept_along = kept(along, threshold(weights.along));
                let kept_off = kept(off, strictness[x] * threshold(weights.off));
                let more = (kept_along - kept_off) * (cr[x] * r[x] + cg[x] * g[x] + cb[x] * b[x]);
                r[x] = kept_off * r[x] + more * u[x];
                g[x] = kept_off * g[x] + more * v[x];
                b[x] = kept_off * b[x] + more * w[x];
            }
            std::mem::swap(&mut above, &mut here);
            std::mem::swap(&mut here, &mut below);
        }
    }
}
