//! Inner loops compiled for the baseline processor and for AVX2 with FMA, selected at run time.
//!
//! A kernel is written once, as the `run` of a [`Kernel`]. Everything it calls is
//! `#[inline(always)]` and hence compiled again inside the AVX2 form of [`run_fastest`], with eight
//! numbers per instruction instead of four. [`multiply_add`] is one instruction where available; on
//! baseline x86-64 `mul_add` would be a library call. On aarch64 the baseline has all of NEON,
//! including fused products. The calls of the AVX2 forms, of a kernel and of [`transposed`], are
//! the only unsafe lines of the mathematics.

#![allow(unsafe_code)]

/// An inner loop and its data.
pub trait Kernel {
    /// The loop; must be `#[inline(always)]`. `FUSED` is passed to every [`multiply_add`].
    fn run<const FUSED: bool>(self);
}

/// a · b + c, rounded once if `FUSED`, else twice.
#[inline(always)]
pub fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// The transpose of an 8×8 matrix: 24 shuffles with AVX2, where loops compile to 70.
#[inline(always)]
pub fn transposed<const FUSED: bool>(rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
    #[cfg(target_arch = "x86_64")]
    if FUSED {
        assert!(std::arch::is_x86_feature_detected!("avx2"), "fused products come with AVX2");
        // SAFETY: AVX2 was detected above.
        return unsafe { transposed_with_avx2(rows) };
    }
    let mut columns = [[0.0; 8]; 8];
    for (i, row) in rows.iter().enumerate() {
        for (j, column) in columns.iter_mut().enumerate() {
            column[i] = row[j];
        }
    }
    columns
}

/// Exchanges quarters of the matrix, then transposes each.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
#[inline]
fn transposed_with_avx2(rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
    use std::arch::x86_64::{__m256, _mm256_permute2f128_ps, _mm256_shuffle_ps};
    let mut rows: [__m256; 8] = bytemuck::cast(rows);
    for i in [0, 1, 2, 3] {
        let (a, b) = (rows[i], rows[i + 4]);
        rows[i] = _mm256_permute2f128_ps::<0x20>(a, b);
        rows[i + 4] = _mm256_permute2f128_ps::<0x31>(a, b);
    }
    for i in [0, 2, 4, 6] {
        let (a, b) = (rows[i], rows[i + 1]);
        rows[i] = _mm256_shuffle_ps::<0x44>(a, b);
        rows[i + 1] = _mm256_shuffle_ps::<0xee>(a, b);
    }
    for i in [0, 4] {
        let [a, b, c, d] = [rows[i], rows[i + 1], rows[i + 2], rows[i + 3]];
        rows[i] = _mm256_shuffle_ps::<0x88>(a, c);
        rows[i + 1] = _mm256_shuffle_ps::<0xdd>(a, c);
        rows[i + 2] = _mm256_shuffle_ps::<0x88>(b, d);
        rows[i + 3] = _mm256_shuffle_ps::<0xdd>(b, d);
    }
    bytemuck::cast(rows)
}

/// Runs `kernel` with AVX2 and FMA if the processor has them, else as compiled for the baseline.
pub fn run_fastest(kernel: impl Kernel) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: AVX2 and FMA were detected above.
        return unsafe { run_with_avx2(kernel) };
    }
    kernel.run::<{ cfg!(target_arch = "aarch64") }>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_with_avx2(kernel: impl Kernel) {
    kernel.run::<true>();
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Transposition<'a>(&'a mut [[f32; 8]; 8]);

    impl Kernel for Transposition<'_> {
        #[inline(always)]
        fn run<const FUSED: bool>(self) {
            *self.0 = transposed::<FUSED>(*self.0);
        }
    }

    #[test]
    fn rows_become_columns() {
        let matrix: [[f32; 8]; 8] =
            std::array::from_fn(|i| std::array::from_fn(|j| (8 * i + j) as f32));
        let mut fastest = matrix;
        run_fastest(Transposition(&mut fastest));
        for (i, row) in transposed::<false>(matrix).iter().enumerate() {
            assert_eq!(*row, std::array::from_fn(|j| (8 * j + i) as f32));
            assert_eq!(*row, fastest[i]);
        }
    }
}
