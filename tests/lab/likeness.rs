//! Likeness of a picture to its scene, in luma and in colour, and limits of harm.

use relens::chart::test_rig::seen;
use relens::config::RigFile;
use relens::deconvolution::quality::ssim;
use relens::frame::{Channels, Frame, Plane, Work};
use relens::picture::Tone;

use crate::appearance::Appearance;

/// Loss of SSIM from which a picture harms its photo; smaller losses mean nothing (study).
pub(crate) const HARM: f64 = 0.002;
/// Increase of mean ΔE from which a picture harms its photo: a twentieth of what is just visible.
pub(crate) const HARM_IN_COLOUR: f64 = 0.05;

/// Likeness of a picture to its scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Likeness {
    /// SSIM of luminance.
    pub(crate) ssim: f64,
    /// Mean ΔE (CIEDE2000); `None` if only green is scored.
    pub(crate) difference: Option<f64>,
}

impl std::fmt::Display for Likeness {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.4}", self.ssim)?;
        self.difference.map_or(Ok(()), |difference| write!(f, "/{difference:.2}"))
    }
}

impl Likeness {
    /// Mean of `all`; `None` if empty.
    pub(crate) fn mean(all: &[Likeness]) -> Option<Likeness> {
        let share = 1.0 / all.len() as f64;
        let mean = |of: &dyn Fn(&Likeness) -> Option<f64>| {
            all.iter().map(of).sum::<Option<f64>>().map(|sum| share * sum)
        };
        (!all.is_empty()).then_some(Likeness {
            ssim: mean(&|one| Some(one.ssim))?,
            difference: mean(&|one| one.difference),
        })
    }

    /// Whether a picture of this likeness is worse than the untouched `photo` in luma.
    pub(crate) fn harms_luma(self, photo: Likeness) -> bool {
        self.ssim < photo.ssim - HARM
    }

    /// Whether a picture of this likeness is worse than the untouched `photo` in colour.
    pub(crate) fn harms_colour(self, photo: Likeness) -> bool {
        let both = self.difference.zip(photo.difference);
        both.is_some_and(|(own, photo)| own > photo + HARM_IN_COLOUR)
    }

    /// Whether a picture of this likeness is worse than `photo` in luma or in colour.
    pub(crate) fn harms(self, photo: Likeness) -> bool {
        self.harms_luma(photo) || self.harms_colour(photo)
    }
}

/// A scene to compare pictures with.
pub(crate) struct Truth {
    tone: Tone,
    curve: relens::config::Curve,
    channels: Channels,
    luma: Plane,
    appearance: Option<Appearance>,
}

impl Truth {
    /// The scene with this `light`, for photos of `rig` in `channels`.
    pub(crate) fn of(rig: &RigFile, channels: Channels, light: &Frame<Work>) -> Truth {
        let curve = rig.photo.curve;
        let tone = Tone::of_curve(curve, 8);
        let appearance = (channels == Channels::Colour).then(|| Appearance::new(&tone, light));
        Truth { curve, channels, luma: seen(curve, channels, light), appearance, tone }
    }

    /// Likeness of `picture` to the scene.
    pub(crate) fn likeness(&self, picture: &Frame<Work>) -> Likeness {
        let of = |scene: &Appearance| Appearance::new(&self.tone, picture).scores(scene).difference;
        Likeness {
            ssim: ssim(&seen(self.curve, self.channels, picture), &self.luma),
            difference: self.appearance.as_ref().map(of),
        }
    }
}
