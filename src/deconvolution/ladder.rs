//! Model no more than a scene needs: how much of the machinery a photo called for (design §5).

use serde::{Deserialize, Serialize};

use super::detail_mask::{DetailMask, NoisyPlane};
use super::method::Certificate;

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
            Rung::LensModel => {
                "the measured lens explains the photo; captures found nothing to correct"
            }
            Rung::Captures => "captures showed what the measured lens misses, and it was corrected",
        }
    }
}

/// Whether nothing in a photo of `planes` rises above its noise: flat everywhere, whatever its
/// broad shading. `raw` planes are known at a mosaic's sites.
pub fn is_blank(planes: &[NoisyPlane<'_>], raw: bool) -> bool {
    DetailMask::of(planes, 1, raw).is_flat()
}

#[cfg(test)]
mod tests {
    use super::super::data_term::TRUSTED;
    use super::*;
    use crate::frame::{Plane, Size};
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

    fn plane<'a>(light: &'a Plane, trust: &'a Plane<u8>) -> NoisyPlane<'a> {
        NoisyPlane { light, trust, noise: 1.0, dark_light: f32::INFINITY }
    }

    #[test]
    fn a_shaded_wall_is_blank_and_a_faint_disc_is_not() {
        let (wall, trust) = noisy(|x, y| 90.0 + 0.05 * (x + y) as f32);
        assert!(is_blank(&[plane(&wall, &trust)], false));
        let (disc, trust) =
            noisy(|x, y| if (x as f32 - 80.0).hypot(y as f32 - 60.0) < 20.0 { 94.0 } else { 90.0 });
        assert!(!is_blank(&[plane(&wall, &trust), plane(&disc, &trust)], false));
    }
}
