//! Two weighted sums over the same sixteen rows: the inner loop of analysis and synthesis, along
//! rows and along columns.

use crate::frame::instructions::{Kernel, multiply_add, run_fastest};

/// `out[c][i]` = Σⱼ `taps[c][j]` · `rows[j][i]`, where `out[0]` is `first` and `out[1]` is
/// `second`, both of one length; rows are at least as long.
pub(super) fn two_sums(
    rows: &[&[f32]; 16],
    taps: &[[f32; 16]; 2],
    first: &mut [f32],
    second: &mut [f32],
) {
    run_fastest(TwoSums { rows, taps, first, second });
}

struct TwoSums<'a> {
    rows: &'a [&'a [f32]; 16],
    taps: &'a [[f32; 16]; 2],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

/// Pixels summed at a time: both sums stay in registers.
const LANES: usize = 16;

impl Kernel for TwoSums<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let TwoSums { rows, taps, first, second } = self;
        let length = first.len();
        let second = &mut second[..length];
        let rows = rows.map(|row| &row[..length]);
        let whole = length - length % LANES;
        for start in (0..whole).step_by(LANES) {
            let mut sums = [[0.0f32; LANES]; 2];
            for j in 0..16 {
                let row = &rows[j][start..start + LANES];
                for lane in 0..LANES {
                    sums[0][lane] = multiply_add::<FUSED>(taps[0][j], row[lane], sums[0][lane]);
                    sums[1][lane] = multiply_add::<FUSED>(taps[1][j], row[lane], sums[1][lane]);
                }
            }
            first[start..start + LANES].copy_from_slice(&sums[0]);
            second[start..start + LANES].copy_from_slice(&sums[1]);
        }
        for i in whole..length {
            let mut sums = [0.0f32; 2];
            for j in 0..16 {
                sums[0] = multiply_add::<FUSED>(taps[0][j], rows[j][i], sums[0]);
                sums[1] = multiply_add::<FUSED>(taps[1][j], rows[j][i], sums[1]);
            }
            (first[i], second[i]) = (sums[0], sums[1]);
        }
    }
}
