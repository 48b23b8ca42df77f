//! Agreement of a JPEG's coefficients with its decoded picture.

use super::super::Flaw;
use super::unsupported;
use crate::frame::block_transform::{cosines, transform, transposed};
use crate::frame::{BLOCK_AREA, BLOCK_PX, Coding, TO_YCC};

/// Largest median difference in brightness of pictures that agree, codes. Rounding to whole colours
/// and back makes half a code. Guess.
const APART: f32 = 1.5;
/// Median difference above which the decoder has misread the file, codes: such pictures differ by
/// tens. Guess.
const MISREAD: f32 = 15.0;

/// Whether `coding` and the decoded `samples`, `step` a pixel, agree in brightness.
///
/// # Errors
/// [`Flaw::Unsupported`] where the decoder has misread the file.
pub(crate) fn agree(coding: &Coding, samples: &[u16], step: usize) -> Result<bool, Flaw> {
    let size = coding.size;
    let Some(first) = coding.components.first() else { return Ok(false) };
    if samples.len() != size.area() * step {
        return Ok(false);
    }
    let back = transposed(&cosines());
    let mut apart: Vec<f32> = Vec::with_capacity(size.area());
    for (n, block) in first.coefficients.chunks_exact(BLOCK_AREA).enumerate() {
        let (x0, y0) = (n % first.blocks.width * BLOCK_PX, n / first.blocks.width * BLOCK_PX);
        let mut light: [f32; BLOCK_AREA] =
            std::array::from_fn(|k| f32::from(block[k]) * f32::from(first.steps[k]));
        transform(&mut light, &back);
        for (k, v) in light.iter().enumerate() {
            let (x, y) = (x0 + k % BLOCK_PX, y0 + k / BLOCK_PX);
            if x < size.width && y < size.height {
                let pixel = &samples[(y * size.width + x) * step..][..step];
                let code = |at: usize| f32::from(pixel[at]);
                let shown = match step {
                    1 => code(0),
                    _ => (0..3).map(|c| TO_YCC[0][c] * code(c)).sum(),
                };
                apart.push((v + 128.0 - shown).abs());
            }
        }
    }
    if apart.is_empty() {
        return Ok(false);
    }
    let middle = apart.len() / 2;
    let median = *apart.select_nth_unstable_by(middle, f32::total_cmp).1;
    if median > MISREAD {
        return Err(unsupported("scans in a rare order, such as one for each colour"));
    }
    Ok(median <= APART)
}
