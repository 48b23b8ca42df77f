//! Whether a JPEG was made of a JPEG: the coarser steps of the first leave gaps. Blocks that lie
//! elsewhere, of a picture cut and coded again, are not told.
//!
//! A coefficient that was rounded to long steps and then to short ones falls on few of the short
//! ones' multiples. How often a value comes falls as it grows; where a value comes far more often
//! than a smaller one, the smaller one is a gap (Popescu & Farid 2004, "Statistical tools for
//! digital forensics", look for the same period by its spectrum).

use crate::frame::{BLOCK_AREA, Coding};

/// Coefficients that are looked at, row by row of a block: those of the lowest frequencies, for
/// which there are enough values.
const LOOKED_AT: [usize; 9] = [1, 8, 16, 9, 2, 3, 10, 17, 24];
/// Values that are counted.
const VALUES: usize = 48;
/// How often a value must come before a smaller one that is rarer says anything.
const OFTEN: u32 = 16;
/// A gap comes at most so often, as a share of a larger value: by chance hardly any of
/// [`OFTEN`] does.
const GAP: f32 = 0.25;
/// Share of the coefficients with enough values that have gaps. Set on photos coded once at
/// qualities of 50 to 98, which have none, and at 60 or 75 before 85 or 95.
const SHARE: f32 = 0.5;

/// Whether gaps in its brightness say that the picture was coded before, in longer steps.
pub fn coded_twice(coding: &Coding) -> bool {
    let Some(first) = coding.components.first() else { return false };
    let (mut told, mut gaps) = (0, 0);
    for k in LOOKED_AT {
        let mut counts = [0u32; VALUES];
        for block in first.coefficients.chunks_exact(BLOCK_AREA) {
            if let Some(count) = counts.get_mut(usize::from(block[k].unsigned_abs())) {
                *count += 1;
            }
        }
        // Zero counts once and others twice; it is no gap.
        let later = |from: usize| counts[from + 1..].iter().copied().max().unwrap_or(0);
        let speaks = |value: &usize| later(*value) >= OFTEN;
        told += u32::from((1..VALUES - 1).any(|value| speaks(&value)));
        let is_gap = |value: usize| (counts[value] as f32) < GAP * later(value) as f32;
        gaps += u32::from((1..VALUES - 1).filter(speaks).any(is_gap));
    }
    told > 1 && gaps as f32 >= SHARE * told as f32
}
