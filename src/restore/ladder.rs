//! Model no more than a scene needs: how much of the machinery a photo called for (design §5).

use serde::{Deserialize, Serialize};

use super::data_term::{MISSING, noise_of};
use super::method::Certificate;
use crate::frame::Plane;

/// How much model a photo needed; it stops at the first rung whose residual is at the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rung {
    /// Nothing to restore: the photo is blank.
    LeaveIt,
    /// The measured lens sufficed; the light found nothing to correct.
    LensModel,
    /// Captures measured what the lens model missed, and it was corrected.
    Captures,
}

impl Rung {
    /// The rung that a finished picture stands on.
    pub fn of(certificate: &Certificate) -> Rung {
        if certificate.corrections > 0 { Rung::Captures } else { Rung::LensModel }
    }

    /// Number of the rung as in the design: 0, 2, 3.
    pub const fn number(self) -> u8 {
        match self {
            Rung::LeaveIt => 0,
            Rung::LensModel => 2,
            Rung::Captures => 3,
        }
    }

    /// Why a photo stands on this rung, for a person.
    pub const fn reason(self) -> &'static str {
        match self {
            Rung::LeaveIt => "the photo is blank: nothing in it rises above its noise",
            Rung::LensModel => "the measured lens explains the photo; captures found nothing to correct",
            Rung::Captures => "captures showed what the measured lens misses, and it was corrected",
        }
    }
}

/// Deviation from its own broad shading, in standard deviations of noise, up to which a photo is blank.
const BLANK_DEVIATIONS: f32 = 4.0;
/// Side of the blocks whose means are compared, pixels: wide enough to average the noise away.
const BLOCK_PX: usize = 8;

/// Whether nothing in `photo` rises above its noise: the means of its blocks differ from their
/// neighbours' by no more than noise explains.
pub fn is_blank(photo: &Plane, trust: &Plane<u8>) -> bool {
    let noise = noise_of(photo).max(0.29);
    let (columns, rows) = (photo.width() / BLOCK_PX, photo.height() / BLOCK_PX);
    let mut means = vec![None; columns * rows];
    for row in 0..rows {
        for column in 0..columns {
            let (mut sum, mut count) = (0.0f64, 0u32);
            for y in row * BLOCK_PX..(row + 1) * BLOCK_PX {
                for x in column * BLOCK_PX..(column + 1) * BLOCK_PX {
                    if trust.at(x, y) != MISSING {
                        sum += f64::from(photo.at(x, y));
                        count += 1;
                    }
                }
            }
            if count as usize == BLOCK_PX * BLOCK_PX {
                means[row * columns + column] = Some(sum / f64::from(count));
            }
        }
    }
    // The difference of two block means has √2 the deviation of one, noise / BLOCK_PX.
    let limit = f64::from(BLANK_DEVIATIONS * noise) * std::f64::consts::SQRT_2 / BLOCK_PX as f64;
    let quiet = |a: Option<f64>, b: Option<f64>| a.zip(b).is_none_or(|(a, b)| (a - b).abs() <= limit);
    (0..rows).all(|row| {
        (0..columns).all(|column| {
            let here = means[row * columns + column];
            (column + 1 == columns || quiet(here, means[row * columns + column + 1]))
                && (row + 1 == rows || quiet(here, means[(row + 1) * columns + column]))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::data_term::TRUSTED;
    use super::*;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn noisy(mut scene: impl FnMut(usize, usize) -> f32) -> (Plane, Plane<u8>) {
        let size = Size::new(160, 120);
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(3);
        let photo = Plane::from_fn(size, |x, y| {
            let noise: f32 = StandardNormal.sample(&mut random);
            scene(x, y) + noise
        });
        (photo, Plane::filled(size, TRUSTED))
    }

    #[test]
    fn a_flat_wall_is_blank_and_a_faint_disc_is_not() {
        let (wall, trust) = noisy(|_, _| 90.0);
        assert!(is_blank(&wall, &trust));
        let (disc, trust) =
            noisy(|x, y| if (x as f32 - 80.0).hypot(y as f32 - 60.0) < 20.0 { 94.0 } else { 90.0 });
        assert!(!is_blank(&disc, &trust));
    }
}
