//! Detection of a JPEG made from another JPEG with coarser steps, on the same block grid.
//!
//! A coefficient that was rounded to multiples of a long step and then of a short one takes few
//! multiples of the short one. The histogram of a natural coefficient falls with its value; where a
//! value is far more frequent than a smaller one, the smaller one is a gap (Popescu & Farid 2004,
//! "Statistical tools for digital forensics", find the same period in its spectrum).

use crate::frame::{BLOCK_AREA, Coding};

/// Indices of the tested coefficients, row by row of a block: the lowest frequencies, which have
/// enough non-zero values.
const TESTED: [usize; 9] = [1, 8, 16, 9, 2, 3, 10, 17, 24];
/// Length of a histogram.
const VALUES: usize = 48;
/// Minimum count of a value for a rarer, smaller value to be a gap.
const FREQUENT: u32 = 16;
/// Maximum count of a gap, as a share of a larger value's; if the latter is at least [`FREQUENT`],
/// chance hardly causes a gap.
const GAP: f32 = 0.25;
/// Minimum share of the tested coefficients with gaps. Set on photos coded once at qualities of 50
/// to 98, which have none, and on photos coded at 60 or 75 and then at 85 or 95.
const SHARE: f32 = 0.5;

/// Whether gaps in the luma coefficients of `coding` show that the picture was coded before, with
/// coarser steps.
pub fn coded_twice(coding: &Coding) -> bool {
    let Some(first) = coding.components.first() else { return false };
    let (mut tested, mut gaps) = (0, 0);
    for k in TESTED {
        let mut counts = [0u32; VALUES];
        for block in first.coefficients.chunks_exact(BLOCK_AREA) {
            if let Some(count) = counts.get_mut(usize::from(block[k].unsigned_abs())) {
                *count += 1;
            }
        }
        // Zero is not tested: every other magnitude collects two values, positive and negative.
        let later = |from: usize| counts[from + 1..].iter().copied().max().unwrap_or(0);
        let is_tested = |value: &usize| later(*value) >= FREQUENT;
        tested += u32::from((1..VALUES - 1).any(|value| is_tested(&value)));
        let is_gap = |value: usize| (counts[value] as f32) < GAP * later(value) as f32;
        gaps += u32::from((1..VALUES - 1).filter(is_tested).any(is_gap));
    }
    tested > 1 && gaps as f32 >= SHARE * tested as f32
}
