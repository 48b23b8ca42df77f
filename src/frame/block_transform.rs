//! Cosine transform of JPEG blocks (ITU-T T.81, A.3.3); orthonormal, so its transpose is its
//! inverse.

use super::{BLOCK_AREA, BLOCK_PX};

/// The transform's matrix D, one row per frequency: `D[u][x]` = cos((2x + 1)uπ/16)/2, the first row
/// divided by √2.
pub fn cosines() -> [[f32; BLOCK_PX]; BLOCK_PX] {
    let mut matrix = [[0.0; BLOCK_PX]; BLOCK_PX];
    for (u, row) in matrix.iter_mut().enumerate() {
        for (x, value) in row.iter_mut().enumerate() {
            let angle = (2 * x + 1) as f64 * u as f64 * std::f64::consts::PI / 16.0;
            let length = if u == 0 { 0.5f64.sqrt() } else { 1.0 };
            *value = (0.5 * length * angle.cos()) as f32;
        }
    }
    matrix
}

/// Replaces `block` by `rows` · block · `rows`ᵀ: from samples to coefficients with [`cosines`],
/// back with their [`transposed`].
pub fn transform(block: &mut [f32; BLOCK_AREA], rows: &[[f32; BLOCK_PX]; BLOCK_PX]) {
    let mut half = [0.0f32; BLOCK_AREA];
    for (u, row) in rows.iter().enumerate() {
        let mut sum = [0.0f32; BLOCK_PX];
        for (weight, from) in row.iter().zip(block.chunks_exact(BLOCK_PX)) {
            sum.iter_mut().zip(from).for_each(|(sum, v)| *sum += weight * v);
        }
        half[u * BLOCK_PX..][..BLOCK_PX].copy_from_slice(&sum);
    }
    let columns = transposed(rows);
    for (to, from) in block.chunks_exact_mut(BLOCK_PX).zip(half.chunks_exact(BLOCK_PX)) {
        let mut sum = [0.0f32; BLOCK_PX];
        for (v, column) in from.iter().zip(&columns) {
            sum.iter_mut().zip(column).for_each(|(sum, weight)| *sum += v * weight);
        }
        to.copy_from_slice(&sum);
    }
}

/// The transpose.
pub fn transposed(rows: &[[f32; BLOCK_PX]; BLOCK_PX]) -> [[f32; BLOCK_PX]; BLOCK_PX] {
    std::array::from_fn(|x| std::array::from_fn(|u| rows[u][x]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transpose_is_the_adjoint_and_the_inverse() {
        let (there, samples) = (cosines(), |k: usize| {
            std::array::from_fn::<f32, BLOCK_AREA, _>(|n| ((n * k + n * n % 7) % 19) as f32 - 9.0)
        });
        let back = transposed(&there);
        let (x, y) = (samples(5), samples(11));
        let (mut seen, mut shown) = (x, y);
        transform(&mut seen, &there);
        transform(&mut shown, &back);
        let dot = |a: &[f32; BLOCK_AREA], b: &[f32; BLOCK_AREA]| {
            a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>()
        };
        assert!((dot(&seen, &y) - dot(&x, &shown)).abs() < 1e-2);
        transform(&mut seen, &back);
        assert!(seen.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-4));
        // A block of ones has a first coefficient of eight.
        let mut even = [1.0; BLOCK_AREA];
        transform(&mut even, &there);
        assert!((even[0] - 8.0).abs() < 1e-5 && even[1..].iter().all(|v| v.abs() < 1e-5));
    }
}
