//! Estimate of a JPEG's coding error from the decoded photo: steps at the borders of its 8×8
//! blocks.
//!
//! Coding removes the noise that [`super::data_term::noise_of`] measures and leaves errors that are
//! constant within a block and independent between blocks. Third differences across block borders
//! have the variance of those inside blocks plus that of the steps.

use crate::frame::Plane;

/// Side of a block, pixels (ITU-T T.81).
const BLOCK_PX: usize = 8;
/// Minimum ratio of the variance of third differences at block borders to that inside blocks; by
/// chance it differs from 1 by a few hundredths.
const STEPS_RATIO: f32 = 1.25;
/// Variance of a border's third difference per variance of a block's error, 2² · 2: a step of
/// height h has a third difference of 2h, and h is the difference of two independent errors.
const VARIANCE_PER_ERROR: f32 = 8.0;
/// Median of |N(0, 1)|.
const MEDIAN: f32 = 0.674_5;

/// Standard deviation of the coding error of `photo`, in its units; 0 if it shows no blocks,
/// because it never was a JPEG or was rotated, resized or cropped off the block grid since.
pub fn blocking_of(photo: &Plane) -> f32 {
    let (width, height) = (photo.width(), photo.height());
    if width < 2 * BLOCK_PX || height < 2 * BLOCK_PX {
        return 0.0;
    }
    // Third differences at block borders, and half a block away from them.
    let mut across: [Vec<f32>; 2] = [Vec::new(), Vec::new()];
    let mut put = |four: [f32; 4], at: usize| {
        let which = match at % BLOCK_PX {
            0 => 0,
            n if n == BLOCK_PX / 2 => 1,
            _ => return,
        };
        across[which].push((four[3] - four[0] - 3.0 * (four[2] - four[1])).abs());
    };
    for y in 0..height {
        let row = photo.row(y);
        let mut x = BLOCK_PX / 2;
        while x + 1 < width {
            put([row[x - 2], row[x - 1], row[x], row[x + 1]], x);
            x += BLOCK_PX / 2;
        }
    }
    let mut y = BLOCK_PX / 2;
    while y + 1 < height {
        let rows = [photo.row(y - 2), photo.row(y - 1), photo.row(y), photo.row(y + 1)];
        for x in 0..width {
            put(rows.map(|row| row[x]), y);
        }
        y += BLOCK_PX / 2;
    }
    let [at_borders, inside] = across.map(|mut all| {
        let middle = all.len() / 2;
        (*all.select_nth_unstable_by(middle, f32::total_cmp).1 / MEDIAN).powi(2)
    });
    if at_borders <= STEPS_RATIO * inside {
        return 0.0;
    }
    ((at_borders - inside) / VARIANCE_PER_ERROR).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// A smooth picture with noise of one grey level, and errors of `coding` grey levels that are
    /// constant within a block.
    fn photo(coding: f32, size: Size, offset: usize) -> Plane {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(9);
        let mut normal = || -> f32 { StandardNormal.sample(&mut random) };
        let blocks = Plane::from_fn(
            Size::new(size.width / BLOCK_PX + 2, size.height / BLOCK_PX + 2),
            |_, _| normal(),
        );
        Plane::from_fn(size, |x, y| {
            let error = blocks.at((x + offset) / BLOCK_PX, (y + offset) / BLOCK_PX);
            100.0 + 40.0 * (x as f32 / 23.0).sin() + 0.2 * y as f32 + coding * error + normal()
        })
    }

    #[test]
    fn the_coding_error_is_estimated_and_noise_has_none() {
        let size = Size::new(192, 144);
        assert_eq!(blocking_of(&photo(0.0, size, 0)), 0.0);
        for coding in [1.0, 3.0] {
            let found = blocking_of(&photo(coding, size, 0));
            assert!((0.7..1.3).contains(&(found / coding)), "{found} of {coding}");
        }
    }

    #[test]
    fn blocks_off_the_grid_and_small_planes_have_no_coding_error() {
        assert_eq!(blocking_of(&photo(3.0, Size::new(192, 144), BLOCK_PX / 2)), 0.0);
        assert_eq!(blocking_of(&photo(3.0, Size::new(15, 144), 0)), 0.0);
        assert_eq!(blocking_of(&Plane::zeros(Size::new(16, 16))), 0.0);
        assert_eq!(blocking_of(&Plane::zeros(Size::new(0, 0))), 0.0);
    }
}
