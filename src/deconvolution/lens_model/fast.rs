//! Forward and adjoint lens model by Fourier transforms of cells.
//!
//! In a cell the weights are separable: (1−v, v) along y times (1−u, u) along x. The weights along
//! y are applied before the transform down the columns, which takes two real pictures as one
//! complex one, and the weights along x between the two transforms. A cell costs one transform
//! along y, four along x, and one inverse along each. The result is exact up to rounding; the
//! adjoint is the transpose of the same steps.

use super::cells::{Cells, ModelCell, Spectrum, Stretch};
use super::fourier::Fourier;
use super::halves::{Part, frequency_groups, inverse, store};
use super::lanes::{ComplexLanes, LANES, Lanes};
use crate::frame::instructions::Kernel;
use crate::frame::{Plane, Size};

/// Buffers of one operation.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    pub(super) data: Vec<ComplexLanes>,
    pub(super) scratch: Vec<ComplexLanes>,
    pub(super) sum: Vec<ComplexLanes>,
    pub(super) halves: [Vec<ComplexLanes>; 3],
    pub(super) corners: [Vec<ComplexLanes>; 4],
}

impl Workspace {
    /// Grows the buffers for transforms of `nx` × `ny`.
    pub(super) fn fit(&mut self, nx: usize, ny: usize, corners: bool) {
        let grow = |buffer: &mut Vec<ComplexLanes>, length: usize| {
            if buffer.len() < length {
                buffer.resize(length, ComplexLanes::default());
            }
        };
        let half = frequency_groups(ny) * pitch(nx);
        for line in [&mut self.data, &mut self.scratch, &mut self.sum] {
            grow(line, nx.max(ny));
        }
        self.halves.iter_mut().for_each(|buffer| grow(buffer, half));
        if corners {
            self.corners.iter_mut().for_each(|buffer| grow(buffer, half));
        }
    }
}

/// Numbers per row of a half spectrum: a multiple of two groups of eight columns.
pub(super) fn pitch(nx: usize) -> usize {
    nx.next_multiple_of(2 * LANES)
}

/// One cell with its transforms and weights.
pub(super) struct Cell<'a> {
    pub(super) x: &'a Stretch,
    pub(super) y: &'a Stretch,
    pub(super) fx: &'a Fourier,
    pub(super) fy: &'a Fourier,
    /// Weights of the second function along x.
    pub(super) u: &'a [f32],
    /// Weights of the second function along y.
    pub(super) v: &'a [f32],
    support_px: usize,
}

impl<'a> Cell<'a> {
    #[inline(always)]
    pub(super) fn of(cells: &'a Cells, place: &ModelCell<'a>) -> Self {
        let ModelCell { along_x: x, along_y: y, .. } = *place;
        Cell {
            x,
            y,
            fx: &cells.along_x.transforms[x.transform],
            fy: &cells.along_y.transforms[y.transform],
            u: &cells.along_x.weight[x.start..x.start + x.length],
            v: &cells.along_y.weight[y.start..y.start + y.length],
            support_px: cells.support_px,
        }
    }

    /// Size of the area that the cell's light reaches.
    pub(super) fn reach(&self) -> Size {
        Size::new(self.x.length + self.support_px - 1, self.y.length + self.support_px - 1)
    }

    /// Computes the half spectra of the cell weighted by 1−v and by v, into `halves[0]` and `[1]`.
    #[inline(always)]
    pub(super) fn weighted_halves<const FUSED: bool>(&self, plane: &Plane, work: &mut Workspace) {
        let pitch = pitch(self.fx.length());
        let [upper, lower, _] = &mut work.halves;
        for column in (0..self.x.length).step_by(LANES) {
            let columns = LANES.min(self.x.length - column);
            let (filled, rest) = work.data[..self.fy.length()].split_at_mut(self.y.length);
            rest.fill(ComplexLanes::default());
            for ((y, value), &v) in (self.y.start..).zip(filled).zip(self.v) {
                let light = lanes(&plane.row(y)[self.x.start + column..], columns);
                *value = ComplexLanes { re: light * (1.0 - v), im: light * v };
            }
            let (found, _) = self.fy.run::<false>(&mut work.data, &mut work.scratch);
            store::<FUSED>(found, self.fy.length(), Part::Real, upper, pitch, column);
            if self.y.functions.len() > 1 {
                store::<FUSED>(found, self.fy.length(), Part::Imaginary, lower, pitch, column);
            }
        }
    }

    /// Computes the half spectrum of the area of `plane` that the cell's light reaches, into
    /// `halves[2]`.
    #[inline(always)]
    pub(super) fn reached_half<const FUSED: bool>(&self, plane: &Plane, work: &mut Workspace) {
        let (pitch, reach, r) = (pitch(self.fx.length()), self.reach(), self.support_px / 2);
        let half = &mut work.halves[2];
        for column in (0..reach.width).step_by(2 * LANES) {
            for (y, value) in work.data[..self.fy.length()].iter_mut().enumerate() {
                *value = ComplexLanes::default();
                let row = (self.y.start + y).wrapping_sub(r);
                if y < reach.height && row < plane.height() {
                    let left = (self.x.start + column) as isize - r as isize;
                    value.re = lanes_at(plane.row(row), left);
                    value.im = lanes_at(plane.row(row), left + LANES as isize);
                }
            }
            let (found, _) = self.fy.run::<false>(&mut work.data, &mut work.scratch);
            store::<FUSED>(found, self.fy.length(), Part::Real, half, pitch, column);
            store::<FUSED>(found, self.fy.length(), Part::Imaginary, half, pitch, column + LANES);
        }
    }

    /// Multiplies row `group` of a half spectrum by the weights of function `b` along x and
    /// transforms it.
    #[inline(always)]
    pub(super) fn along<'w>(
        &self,
        half: &[ComplexLanes],
        group: usize,
        b: usize,
        data: &'w mut [ComplexLanes],
        scratch: &'w mut [ComplexLanes],
    ) -> (&'w mut [ComplexLanes], &'w mut [ComplexLanes]) {
        let row = &half[group * pitch(self.fx.length())..][..self.u.len()];
        let (filled, rest) = data[..self.fx.length()].split_at_mut(self.u.len());
        for ((value, &light), &u) in filled.iter_mut().zip(row).zip(self.u) {
            *value = light * (if b == 0 { 1.0 - u } else { u });
        }
        rest.fill(ComplexLanes::default());
        self.fx.run::<false>(data, scratch)
    }
}

/// The first `columns` pixels of `row`, at most eight, padded by zeros.
#[inline(always)]
fn lanes(row: &[f32], columns: usize) -> Lanes {
    if columns == LANES
        && let Some(pixels) = row.first_chunk()
    {
        return Lanes(*pixels);
    }
    let mut lanes = Lanes::default();
    lanes.0[..columns].copy_from_slice(&row[..columns]);
    lanes
}

/// Eight pixels of `row` from `left`, zero outside.
#[inline(always)]
pub(super) fn lanes_at(row: &[f32], left: isize) -> Lanes {
    if let Some(pixels) = usize::try_from(left).ok().and_then(|left| row.get(left..)?.first_chunk())
    {
        return Lanes(*pixels);
    }
    let mut lanes = Lanes::default();
    for (i, lane) in lanes.0.iter_mut().enumerate() {
        let column = left + i as isize;
        if column >= 0 && (column as usize) < row.len() {
            *lane = row[column as usize];
        }
    }
    lanes
}

/// Adds eight pixels to `row` from `left`, dropping those outside.
#[inline(always)]
fn add_at(row: &mut [f32], left: isize, lanes: Lanes) {
    if left >= 0
        && let Some(pixels) = row.get_mut(left as usize..).and_then(|row| row.first_chunk_mut())
    {
        *pixels = (Lanes(*pixels) + lanes).0;
        return;
    }
    for (i, lane) in lanes.0.iter().enumerate() {
        let column = left + i as isize;
        if column >= 0 && (column as usize) < row.len() {
            row[column as usize] += lane;
        }
    }
}

/// Sets `products` to `light` times the conjugate of `function`, times the `factors`.
#[inline(always)]
fn conjugate_products<const FUSED: bool>(
    products: &mut [ComplexLanes],
    light: &[ComplexLanes],
    function: &[ComplexLanes],
    factors: Option<&[Lanes]>,
) {
    // Loops rather than closures, which may not be inlined and are then compiled without AVX2.
    let products = products.iter_mut().zip(light).zip(function);
    match factors {
        None => {
            for ((product, &l), &p) in products {
                *product = l.product_conjugate::<FUSED>(p);
            }
        }
        Some(factors) => {
            for (((product, &l), &p), &factor) in products.zip(factors) {
                *product = l.product_conjugate::<FUSED>(p).scaled(factor);
            }
        }
    }
}

/// The contribution of one row of cells to K x.
pub(super) struct Forward<'a> {
    pub(super) cells: &'a Cells,
    pub(super) spectra: &'a [Spectrum],
    pub(super) x: &'a Plane,
    /// Index of the row of cells.
    pub(super) row: usize,
    /// Output within the canvas rows of these cells.
    pub(super) band: &'a mut [f32],
    /// Output beyond the band: support − 1 rows, first those above it, then those below.
    pub(super) spill: &'a mut [f32],
    pub(super) work: &'a mut Workspace,
}

impl Kernel for Forward<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Forward { cells, spectra, x, row, band, spill, work } = self;
        band.fill(0.0);
        spill.fill(0.0);
        let (r, canvas_width) = (cells.support_px / 2, x.width());
        for place in cells.row(row) {
            let cell = Cell::of(cells, &place);
            let ModelCell { along_y, along_x, spectra: of } = place;
            let (nx, ny) = (cell.fx.length(), cell.fy.length());
            let pitch = pitch(nx);
            work.fit(nx, ny, false);
            cell.weighted_halves::<FUSED>(x, work);
            let Workspace { data, scratch, sum, halves: [upper, lower, seen], .. } = &mut *work;
            for group in 0..frequency_groups(ny) {
                for a in 0..along_y.functions.len() {
                    let half = if a == 0 { &*upper } else { &*lower };
                    for b in 0..along_x.functions.len() {
                        let (found, _) = cell.along(half, group, b, data, scratch);
                        let function = &spectra[of[2 * a + b]][group * nx..][..nx];
                        let terms = sum[..nx].iter_mut().zip(&*found).zip(function);
                        if a + b == 0 {
                            for ((sum, &light), &p) in terms {
                                *sum = light.product::<FUSED>(p);
                            }
                        } else {
                            for ((sum, &light), &p) in terms {
                                *sum = light.product_plus::<FUSED>(p, *sum);
                            }
                        }
                    }
                }
                let (found, _) = cell.fx.run::<true>(sum, scratch);
                let row = &mut seen[group * pitch..][..pitch];
                row[..nx].copy_from_slice(found);
                row[nx..].fill(ComplexLanes::default());
            }
            let reach = cell.reach();
            for column in (0..reach.width).step_by(2 * LANES) {
                let (first, second) = ((&seen[..], column), (&seen[..], column + LANES));
                let both = inverse::<FUSED>(cell.fy, first, second, pitch, data, scratch);
                let left = (along_x.start + column) as isize - r as isize;
                for (y, light) in both[..reach.height].iter().enumerate() {
                    let (rows, place) = match y {
                        above if above < r => (&mut *spill, above),
                        inside if inside < r + along_y.length => (&mut *band, inside - r),
                        below => (&mut *spill, below - along_y.length),
                    };
                    let row = &mut rows[place * canvas_width..][..canvas_width];
                    add_at(row, left, light.re);
                    add_at(row, left + LANES as isize, light.im);
                }
            }
        }
    }
}

/// Kᵀ y on one row of cells.
pub(super) struct Adjoint<'a> {
    pub(super) cells: &'a Cells,
    pub(super) spectra: &'a [Spectrum],
    /// Real factors on the products with the conjugate spectra, if any.
    pub(super) factors: Option<&'a [Vec<Lanes>]>,
    pub(super) y: &'a Plane,
    /// Index of the row of cells.
    pub(super) row: usize,
    /// Output, the canvas rows of these cells.
    pub(super) band: &'a mut [f32],
    pub(super) work: &'a mut Workspace,
}

impl Kernel for Adjoint<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Adjoint { cells, spectra, factors, y, row, band, work } = self;
        let canvas_width = y.width();
        for place in cells.row(row) {
            let cell = Cell::of(cells, &place);
            let ModelCell { along_y, along_x, spectra: of } = place;
            let (nx, ny) = (cell.fx.length(), cell.fy.length());
            let (pitch, width) = (pitch(nx), along_x.length);
            work.fit(nx, ny, false);
            cell.reached_half::<FUSED>(y, work);
            let Workspace { data, scratch, sum, halves: [upper, lower, seen], .. } = &mut *work;
            for group in 0..frequency_groups(ny) {
                data[..nx].copy_from_slice(&seen[group * pitch..][..nx]);
                data[cell.reach().width..nx].fill(ComplexLanes::default());
                let (light, free) = cell.fx.run::<false>(data, scratch);
                for a in 0..along_y.functions.len() {
                    let row = &mut (if a == 0 { &mut *upper } else { &mut *lower })
                        [group * pitch..][..pitch];
                    row[width..].fill(ComplexLanes::default());
                    for b in 0..along_x.functions.len() {
                        let which = of[2 * a + b];
                        let function = &spectra[which][group * nx..][..nx];
                        let factors = factors.map(|all| &all[which][group * nx..][..nx]);
                        conjugate_products::<FUSED>(&mut sum[..nx], light, function, factors);
                        let (found, _) = cell.fx.run::<true>(sum, free);
                        for ((value, &l), &u) in row.iter_mut().zip(&*found).zip(cell.u) {
                            if b == 0 {
                                *value = l * (1.0 - u);
                            } else {
                                *value = l.times_plus::<FUSED>(u, *value);
                            }
                        }
                    }
                }
            }
            if along_y.functions.len() == 1 {
                // The lower half has weight 0, but stale values of an earlier cell would leave
                // rounding errors.
                lower.fill(ComplexLanes::default());
            }
            for column in (0..width).step_by(LANES) {
                let (first, second) = ((&upper[..], column), (&lower[..], column));
                let both = inverse::<FUSED>(cell.fy, first, second, pitch, data, scratch);
                let columns = LANES.min(width - column);
                for (i, (light, &v)) in both.iter().zip(cell.v).enumerate() {
                    let values = light.im.times_plus::<FUSED>(Lanes::all(v), light.re * (1.0 - v));
                    let row = &mut band[i * canvas_width + along_x.start + column..][..columns];
                    // A constant length needs no call to memcpy.
                    match row.first_chunk_mut() {
                        Some(row) => *row = values.0,
                        None => row.copy_from_slice(&values.0[..columns]),
                    }
                }
            }
        }
    }
}
