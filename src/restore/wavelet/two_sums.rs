//! Two weighted sums over the same sixteen rows: the one inner loop of the wavelet transform.
//!
//! Analysis and synthesis, along rows and along columns, all come down to it. It is written once in plain
//! Rust, and compiled a second time for processors with AVX2, chosen at run time. The call of that second form
//! is the only unsafe line.

#![allow(unsafe_code)]

/// `out[c][i]` = Σⱼ `taps[c][j]` · `rows[j][i]` for c = 0, 1. Rows must be at least as long as the outputs, which have
/// one length.
pub(super) fn two_sums(rows: &[&[f32]; 16], taps: &[[f32; 16]; 2], first: &mut [f32], second: &mut [f32]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has just been asked whether it has AVX2.
        return unsafe { two_sums_avx2(rows, taps, first, second) };
    }
    plain(rows, taps, first, second);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn two_sums_avx2(rows: &[&[f32]; 16], taps: &[[f32; 16]; 2], first: &mut [f32], second: &mut [f32]) {
    plain(rows, taps, first, second);
}

/// Pixels summed at a time, so that both sums stay in registers.
const LANES: usize = 16;

#[inline(always)]
fn plain(rows: &[&[f32]; 16], taps: &[[f32; 16]; 2], first: &mut [f32], second: &mut [f32]) {
    let length = first.len();
    let second = &mut second[..length];
    let rows = rows.map(|row| &row[..length]);
    let whole = length - length % LANES;
    for start in (0..whole).step_by(LANES) {
        let mut sums = [[0.0f32; LANES]; 2];
        for j in 0..16 {
            let row = &rows[j][start..start + LANES];
            for lane in 0..LANES {
                sums[0][lane] += taps[0][j] * row[lane];
                sums[1][lane] += taps[1][j] * row[lane];
            }
        }
        first[start..start + LANES].copy_from_slice(&sums[0]);
        second[start..start + LANES].copy_from_slice(&sums[1]);
    }
    for i in whole..length {
        let mut sums = [0.0f32; 2];
        for j in 0..16 {
            sums[0] += taps[0][j] * rows[j][i];
            sums[1] += taps[1][j] * rows[j][i];
        }
        (first[i], second[i]) = (sums[0], sums[1]);
    }
}
