//! Complex Fourier transforms of eight lines at once, one line per SIMD lane.
//!
//! Stockham's self-sorting algorithm in passes of radix 4, 2 and 3. With one line per lane the code
//! vectorises without shuffles, and transforms down the columns of a picture cost no more than
//! along its rows; a library that transforms line by line has to transpose first.

use super::lanes::ComplexLanes;
use crate::frame::instructions::{Kernel, run_fastest};
use std::f64::consts::TAU;

/// A transform of one length.
#[derive(Debug, Clone)]
pub(super) struct Fourier {
    length: usize,
    passes: Vec<Pass>,
}

#[derive(Debug, Clone)]
struct Pass {
    radix: usize,
    /// Groups of butterflies, each with its own factors.
    groups: usize,
    /// Butterflies per group, adjacent in memory.
    stride: usize,
    /// w^(p·j) for p in 0..groups, j in 1..radix; w = e^(−2πi / (groups · radix)).
    factors: Vec<[f32; 2]>,
}

impl Fourier {
    /// The transform of `length` numbers, a product of powers of 2 and 3.
    pub(super) fn new(length: usize) -> Self {
        let mut passes = Vec::new();
        let (mut remaining, mut stride) = (length, 1);
        for radix in [4, 2, 3] {
            while remaining.is_multiple_of(radix) && remaining > 1 {
                let groups = remaining / radix;
                let factors = (0..groups)
                    .flat_map(|p| (1..radix).map(move |j| -TAU * (p * j) as f64 / remaining as f64))
                    .map(|angle| [angle.cos() as f32, angle.sin() as f32])
                    .collect();
                passes.push(Pass { radix, groups, stride, factors });
                stride *= radix;
                remaining = groups;
            }
        }
        debug_assert_eq!(remaining, 1, "a product of powers of 2 and 3");
        Fourier { length, passes }
    }

    /// Length of a line.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Transforms `data` with factors e^(−2πi fx/n), or e^(+…) when `INVERSE`, unscaled. Returns
    /// the buffer with the result first; the other one is overwritten.
    pub(super) fn run<'a, const INVERSE: bool>(
        &self,
        data: &'a mut [ComplexLanes],
        scratch: &'a mut [ComplexLanes],
    ) -> (&'a mut [ComplexLanes], &'a mut [ComplexLanes]) {
        let (data, scratch) = (&mut data[..self.length], &mut scratch[..self.length]);
        // Compiled once here rather than into every calling kernel.
        run_fastest(Passes::<INVERSE> { passes: &self.passes, data, scratch });
        if self.passes.len().is_multiple_of(2) { (data, scratch) } else { (scratch, data) }
    }
}

struct Passes<'a, const INVERSE: bool> {
    passes: &'a [Pass],
    data: &'a mut [ComplexLanes],
    scratch: &'a mut [ComplexLanes],
}

impl<const INVERSE: bool> Kernel for Passes<'_, INVERSE> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (mut from, mut to) = (self.data, self.scratch);
        for pass in self.passes {
            match pass.radix {
                2 => pass.run::<2, INVERSE, FUSED>(from, to),
                3 => pass.run::<3, INVERSE, FUSED>(from, to),
                _ => pass.run::<4, INVERSE, FUSED>(from, to),
            }
            std::mem::swap(&mut from, &mut to);
        }
    }
}

impl Pass {
    #[inline(always)]
    fn run<const RADIX: usize, const INVERSE: bool, const FUSED: bool>(
        &self,
        from: &[ComplexLanes],
        to: &mut [ComplexLanes],
    ) {
        let (groups, stride) = (self.groups, self.stride);
        let apart = groups * stride;
        for (p, mut out) in to.chunks_exact_mut(RADIX * stride).enumerate() {
            let mut factors = [[1.0, 0.0]; RADIX];
            for (factor, w) in factors[1..].iter_mut().zip(&self.factors[p * (RADIX - 1)..]) {
                *factor = if INVERSE { [w[0], -w[1]] } else { *w };
            }
            // Slices of one length, so that the inner loop checks no bounds.
            let mut inputs = [&from[..0]; RADIX];
            let mut outputs = [(); RADIX].map(|()| [].as_mut_slice());
            for (j, (input, output)) in inputs.iter_mut().zip(&mut outputs).enumerate() {
                *input = &from[p * stride + j * apart..][..stride];
                (*output, out) = out.split_at_mut(stride);
            }
            for q in 0..stride {
                let mut values = [ComplexLanes::default(); RADIX];
                for (value, input) in values.iter_mut().zip(&inputs) {
                    *value = input[q];
                }
                butterfly::<RADIX, INVERSE, FUSED>(&mut values);
                outputs[0][q] = values[0];
                for j in 1..RADIX {
                    // The factors of the first group are 1.
                    outputs[j][q] =
                        if p == 0 { values[j] } else { values[j].times::<FUSED>(factors[j]) };
                }
            }
        }
    }
}

/// The transform of `RADIX` numbers.
#[inline(always)]
fn butterfly<const RADIX: usize, const INVERSE: bool, const FUSED: bool>(
    v: &mut [ComplexLanes; RADIX],
) {
    let sign = if INVERSE { 1.0 } else { -1.0 };
    match RADIX {
        2 => (v[0], v[1]) = (v[0] + v[1], v[0] - v[1]),
        3 => {
            let (sum, difference) = (v[1] + v[2], v[1] - v[2]);
            let middle = sum.times_plus::<FUSED>(-0.5, v[0]);
            let side = difference * (sign * HALF_ROOT_3);
            (v[0], v[1], v[2]) = (v[0] + sum, middle.plus_i(side), middle.minus_i(side));
        }
        _ => {
            let (even_sum, even_difference) = (v[0] + v[2], v[0] - v[2]);
            let (odd_sum, odd_difference) = (v[1] + v[3], v[1] - v[3]);
            let (ahead, behind) =
                (even_difference.plus_i(odd_difference), even_difference.minus_i(odd_difference));
            let (second, fourth) = if INVERSE { (ahead, behind) } else { (behind, ahead) };
            (v[0], v[1], v[2], v[3]) = (even_sum + odd_sum, second, even_sum - odd_sum, fourth);
        }
    }
}

const HALF_ROOT_3: f32 = 0.866_025_4;

/// Radix of a pass and its nanoseconds per number, measured with AVX2 on lengths from 96 to 256.
/// Radix 5 takes 4.5 ns, because its values do not fit the registers.
const PASS_NS: [(usize, f64); 3] = [(4, 1.8), (2, 0.8), (3, 1.6)];

/// Even length of at least `least` with the fastest transform.
pub(super) fn fast_length(least: usize) -> usize {
    let cost = |n: usize| {
        let (mut remaining, mut ns_per_number) = (n, 0.0);
        for (radix, ns) in PASS_NS {
            while remaining.is_multiple_of(radix) && remaining > 1 {
                ns_per_number += ns;
                remaining /= radix;
            }
        }
        (remaining == 1).then_some(n as f64 * ns_per_number)
    };
    // The range holds a power of two.
    (least.max(2)..=2 * least.max(2))
        .filter(|n| n.is_multiple_of(2))
        .filter_map(|n| cost(n).map(|c| (c, n)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(least, |(_, n)| n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::lanes::LANES;

    #[test]
    fn transforms_match_their_definition_and_invert() {
        for n in [1, 2, 3, 4, 6, 8, 9, 12, 16, 18, 27, 36, 54, 64, 96, 162, 243, 256, 288] {
            let fourier = Fourier::new(n);
            let mut data = vec![ComplexLanes::default(); n];
            let mut random = 1u32;
            for value in &mut data {
                for lane in 0..LANES {
                    random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    value.re.0[lane] = (random >> 16) as f32 / 65536.0 - 0.5;
                    value.im.0[lane] = (random & 0xffff) as f32 / 65536.0 - 0.5;
                }
            }
            let original = data.clone();
            let mut scratch = data.clone();
            let (found, other) = fourier.run::<false>(&mut data, &mut scratch);
            for lane in [0, 7] {
                for (f, value) in found.iter().enumerate() {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (x, v) in original.iter().enumerate() {
                        let (s, c) = (-TAU * (f * x % n) as f64 / n as f64).sin_cos();
                        let (a, b) = (f64::from(v.re.0[lane]), f64::from(v.im.0[lane]));
                        re += a * c - b * s;
                        im += a * s + b * c;
                    }
                    let far =
                        (f64::from(value.re.0[lane]) - re).hypot(f64::from(value.im.0[lane]) - im);
                    assert!(far < 1e-5 * (n as f64).sqrt() + 1e-6, "{n} {f}: {far}");
                }
            }
            let (back, _) = fourier.run::<true>(found, other);
            for (a, b) in back.iter().zip(&original) {
                assert!((a.re.0[3] / n as f32 - b.re.0[3]).abs() < 1e-6, "{n}");
            }
        }
    }

    #[test]
    fn fast_lengths_are_products_of_at_least_the_wanted_length() {
        for least in 1..700 {
            let n = fast_length(least);
            assert!(n >= least && n <= 2 * least.max(2) && n.is_multiple_of(2));
            assert_eq!(Fourier::new(n).length(), n);
        }
    }
}
