//! The orthonormal transform of a group: the cosine transform of each 8×8 block, and the Haar
//! transform along the group.
//!
//! Coefficients are stored transposed, which saves a transposition and does not change the result.

use crate::frame::instructions::{multiply_add, transposed};

/// Side of a block, pixels.
pub(super) const SIDE: usize = 8;
/// Pixels of a block.
pub(super) const AREA: usize = SIDE * SIDE;

/// Pixels or coefficients of one block, row-major.
pub(super) type Block = [f32; AREA];

/// The cosine transform (type II, orthonormal): basis √(2/8) cᵢ cos(π(2k+1)i/16), c₀ = √½.
#[derive(Debug, Clone)]
pub(super) struct Cosines {
    /// `[i][k]` for the four samples of the first half; the second half is its mirror image, with
    /// the opposite sign for odd i.
    half: [[f32; SIDE / 2]; SIDE],
}

impl Cosines {
    pub(super) fn new() -> Self {
        Cosines { half: std::array::from_fn(|i| std::array::from_fn(|k| basis(i, k) as f32)) }
    }

    /// Pixels to coefficients.
    #[inline(always)]
    pub(super) fn analyse<const FUSED: bool>(&self, block: &mut Block) {
        self.analyse_columns::<FUSED>(block);
        turn::<FUSED>(block);
        self.analyse_columns::<FUSED>(block);
    }

    /// Coefficients to pixels.
    #[inline(always)]
    pub(super) fn synthesise<const FUSED: bool>(&self, block: &mut Block) {
        self.synthesise_columns::<FUSED>(block);
        turn::<FUSED>(block);
        self.synthesise_columns::<FUSED>(block);
    }

    /// Pixels to coefficients along each column: even basis functions see the sums of mirrored
    /// samples, odd ones their differences.
    #[inline(always)]
    fn analyse_columns<const FUSED: bool>(&self, block: &mut Block) {
        let mut mirrored = [[[0.0; SIDE]; SIDE / 2]; 2];
        let rows = block.as_chunks::<SIDE>().0;
        for k in 0..SIDE / 2 {
            for x in 0..SIDE {
                let (first, last) = (rows[k][x], rows[SIDE - 1 - k][x]);
                (mirrored[0][k][x], mirrored[1][k][x]) = (first + last, first - last);
            }
        }
        for (i, out) in block.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
            let mut sums = [0.0; SIDE];
            for (weight, values) in self.half[i].iter().zip(&mirrored[i % 2]) {
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum = multiply_add::<FUSED>(*weight, *value, *sum);
                }
            }
            *out = sums;
        }
    }

    /// The transpose of [`Cosines::analyse_columns`].
    #[inline(always)]
    fn synthesise_columns<const FUSED: bool>(&self, block: &mut Block) {
        let from = *block;
        let (from, rows) = (from.as_chunks::<SIDE>().0, block.as_chunks_mut::<SIDE>().0);
        for k in 0..SIDE / 2 {
            let mut sums = [[0.0; SIDE]; 2];
            for i in 0..SIDE {
                for x in 0..SIDE {
                    let sum = &mut sums[i % 2][x];
                    *sum = multiply_add::<FUSED>(self.half[i][k], from[i][x], *sum);
                }
            }
            for x in 0..SIDE {
                rows[k][x] = sums[0][x] + sums[1][x];
                rows[SIDE - 1 - k][x] = sums[0][x] - sums[1][x];
            }
        }
    }
}

/// Value of basis function `i` at sample `k`.
pub(super) fn basis(i: usize, k: usize) -> f64 {
    let angle = std::f64::consts::PI * (2 * k + 1) as f64 * i as f64 / (2 * SIDE) as f64;
    let share = if i == 0 { 1.0 } else { 2.0 };
    (share / SIDE as f64).sqrt() * angle.cos()
}

/// Transposes a block.
#[inline(always)]
fn turn<const FUSED: bool>(block: &mut Block) {
    let mut rows = [[0.0; SIDE]; SIDE];
    rows.copy_from_slice(block.as_chunks().0);
    block.as_chunks_mut().0.copy_from_slice(&transposed::<FUSED>(rows));
}

/// The Haar transform along a group of 2ⁿ parts of blocks, in place, the mean in the first one.
#[inline(always)]
pub(super) fn haar<const N: usize>(group: &mut [[f32; N]]) {
    let mut apart = 1;
    while apart < group.len() {
        pairs(group, apart);
        apart *= 2;
    }
}

/// The inverse of [`haar`].
#[inline(always)]
pub(super) fn haar_inverse<const N: usize>(group: &mut [[f32; N]]) {
    let mut apart = group.len() / 2;
    while apart > 0 {
        pairs(group, apart);
        apart /= 2;
    }
}

/// (a, b) → ((a + b)/√2, (a − b)/√2) for parts at a distance of `apart`; its own inverse.
#[inline(always)]
fn pairs<const N: usize>(group: &mut [[f32; N]], apart: usize) {
    let mut first = 0;
    while first + apart < group.len() {
        let (a, b) = (group[first], group[first + apart]);
        // Two separate loops, or the compiler interleaves the two vectors.
        let (mut sum, mut difference) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            sum[i] = (a[i] + b[i]) * std::f32::consts::FRAC_1_SQRT_2;
        }
        for i in 0..N {
            difference[i] = (a[i] - b[i]) * std::f32::consts::FRAC_1_SQRT_2;
        }
        (group[first], group[first + apart]) = (sum, difference);
        first += 2 * apart;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(seed: usize) -> Block {
        std::array::from_fn(|n| ((n * (7 + seed) + n * n * (3 + seed)) % 251) as f32)
    }

    #[test]
    fn both_transforms_are_orthonormal() {
        let cosines = Cosines::new();
        let blocks: Vec<Block> = (0..8).map(block).collect();
        let mut changed = blocks.clone();
        changed.iter_mut().for_each(|block| cosines.analyse::<false>(block));
        haar(&mut changed);
        let power = |group: &[Block]| group.iter().flatten().map(|v| f64::from(v * v)).sum::<f64>();
        assert!((power(&changed) / power(&blocks) - 1.0).abs() < 1e-5);
        haar_inverse(&mut changed);
        changed.iter_mut().for_each(|block| cosines.synthesise::<true>(block));
        for (a, b) in changed.iter().flatten().zip(blocks.iter().flatten()) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }

    #[test]
    fn coefficients_match_the_definition() {
        let source = block(1);
        let mut found = source;
        Cosines::new().analyse::<true>(&mut found);
        for (v, u) in [(0, 0), (3, 1), (7, 6)] {
            let mut sum = 0.0;
            for y in 0..SIDE {
                for x in 0..SIDE {
                    sum += basis(v, y) * basis(u, x) * f64::from(source[y * SIDE + x]);
                }
            }
            assert!((f64::from(found[u * SIDE + v]) - sum).abs() < 1e-3);
        }
    }

    #[test]
    fn equal_blocks_have_only_a_mean() {
        let mut group = vec![block(2); 4];
        haar(&mut group);
        assert!(group[1..].iter().flatten().all(|v| v.abs() < 1e-4));
        assert!((group[0][5] - 2.0 * block(2)[5]).abs() < 1e-3);
    }
}
