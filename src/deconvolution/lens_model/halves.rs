//! Transforms down the columns of two real pictures as one complex transform, eight columns at
//! once.
//!
//! Two real pictures are the real and imaginary part of a complex one. Their spectra are separated
//! by Hermitian symmetry and transposed, so that the lanes are eight adjacent *vertical
//! frequencies* and each line of the transform along the rows is contiguous. A half spectrum has
//! rows of `pitch` numbers, one row per group of eight of the frequencies 0..=ny/2. Both spectra
//! come out doubled; the functions' spectra are scaled for that.

use super::fourier::Fourier;
use super::lanes::{ComplexLanes, LANES, Lanes};
use crate::frame::instructions::transposed;

/// Number of groups of eight among the vertical frequencies 0..=ny/2.
pub(super) fn frequency_groups(ny: usize) -> usize {
    (ny / 2 + 1).div_ceil(LANES)
}

/// One of the two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Real,
    Imaginary,
}

/// Stores twice the half spectrum of one part of `found`, which holds transformed columns of length
/// `n`, in `half` from `column` on.
#[inline(always)]
pub(super) fn store<const FUSED: bool>(
    found: &[ComplexLanes],
    n: usize,
    part: Part,
    half: &mut [ComplexLanes],
    pitch: usize,
    column: usize,
) {
    let found = &found[..n];
    for group in 0..frequency_groups(n) {
        store_group::<FUSED>(found, group, part, &mut half[group * pitch + column..][..LANES]);
    }
}

/// Separates and transposes eight frequencies. Those above n/2 repeat n/2 and are never read.
#[inline(always)]
fn store_group<const FUSED: bool>(
    found: &[ComplexLanes],
    group: usize,
    part: Part,
    to: &mut [ComplexLanes],
) {
    let n = found.len();
    let mut re = [[0.0; LANES]; LANES];
    let mut im = [[0.0; LANES]; LANES];
    for i in 0..LANES {
        let f = (group * LANES + i).min(n / 2);
        let (low, high) = (found[f], found[if f == 0 { 0 } else { n - f }]);
        if part == Part::Real {
            re[i] = (low.re + high.re).0;
            im[i] = (low.im - high.im).0;
        } else {
            re[i] = (low.im + high.im).0;
            im[i] = (high.re - low.re).0;
        }
    }
    let (re, im) = (transposed::<FUSED>(re), transposed::<FUSED>(im));
    for i in 0..LANES {
        to[i] = ComplexLanes { re: Lanes(re[i]), im: Lanes(im[i]) };
    }
}

/// The inverse transform of eight columns of two half spectra, from `first_column` of `first` and
/// `second_column` of `second` on: two real pictures as real and imaginary part, scaled by n.
#[inline(always)]
pub(super) fn inverse<'a, const FUSED: bool>(
    fourier: &Fourier,
    (first, first_column): (&[ComplexLanes], usize),
    (second, second_column): (&[ComplexLanes], usize),
    pitch: usize,
    data: &'a mut [ComplexLanes],
    scratch: &'a mut [ComplexLanes],
) -> &'a [ComplexLanes] {
    let n = fourier.length();
    for group in 0..frequency_groups(n) {
        let (p_re, p_im) = load::<FUSED>(&first[group * pitch + first_column..][..LANES]);
        let (q_re, q_im) = load::<FUSED>(&second[group * pitch + second_column..][..LANES]);
        for i in 0..LANES.min(n / 2 + 1 - group * LANES) {
            let f = group * LANES + i;
            data[f] = ComplexLanes { re: p_re[i] - q_im[i], im: p_im[i] + q_re[i] };
            if f > 0 && 2 * f < n {
                data[n - f] = ComplexLanes { re: p_re[i] + q_im[i], im: q_re[i] - p_im[i] };
            }
        }
    }
    fourier.run::<true>(data, scratch).0
}

#[inline(always)]
fn load<const FUSED: bool>(from: &[ComplexLanes]) -> ([Lanes; LANES], [Lanes; LANES]) {
    let mut re = [[0.0; LANES]; LANES];
    let mut im = [[0.0; LANES]; LANES];
    for i in 0..LANES {
        (re[i], im[i]) = (from[i].re.0, from[i].im.0);
    }
    (transposed::<FUSED>(re).map(Lanes), transposed::<FUSED>(im).map(Lanes))
}
