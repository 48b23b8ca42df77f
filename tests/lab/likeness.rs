//! How near a picture is to its scene, in luma and in colour, and what counts as harm.

use relens::chart::looks::Looks;
use relens::chart::test_rig::seen;
use relens::config::RigFile;
use relens::deconvolution::quality::ssim;
use relens::frame::{Channels, Frame, Plane, Work};
use relens::picture::Tone;

/// SSIM below the untouched photo's that counts as harm; the study: less means nothing.
pub(crate) const HARM: f64 = 0.002;
/// Mean ΔE above the untouched photo's that counts as harm: a twentieth of what is just seen.
pub(crate) const HARM_IN_COLOUR: f64 = 0.05;

/// How near a picture is to its scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Likeness {
    /// SSIM of luminance.
    pub(crate) ssim: f64,
    /// Mean ΔE (CIEDE2000); of a grey photo none.
    pub(crate) difference: Option<f64>,
}

impl std::fmt::Display for Likeness {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.4}", self.ssim)?;
        self.difference.map_or(Ok(()), |difference| write!(f, "/{difference:.2}"))
    }
}

impl Likeness {
    /// The mean of `all`; there is none of nothing.
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

    /// Whether it is worse than the untouched `photo` in luma.
    pub(crate) fn harms_luma(self, photo: Likeness) -> bool {
        self.ssim < photo.ssim - HARM
    }

    /// Whether it is worse than the untouched `photo` in colour.
    pub(crate) fn harms_colour(self, photo: Likeness) -> bool {
        let both = self.difference.zip(photo.difference);
        both.is_some_and(|(own, photo)| own > photo + HARM_IN_COLOUR)
    }

    /// Whether it is worse than the untouched `photo`, or than any other picture, in either.
    pub(crate) fn harms(self, photo: Likeness) -> bool {
        self.harms_luma(photo) || self.harms_colour(photo)
    }
}

/// A scene that pictures are held against.
pub(crate) struct Truth {
    tone: Tone,
    curve: relens::config::Curve,
    channels: Channels,
    luma: Plane,
    looks: Option<Looks>,
}

impl Truth {
    /// The light of a scene, for photos of `rig` in `channels`.
    pub(crate) fn of(rig: &RigFile, channels: Channels, light: &Frame<Work>) -> Truth {
        let curve = rig.photo.curve;
        let tone = Tone::of_curve(curve, 8);
        let looks = (channels == Channels::Colour).then(|| Looks::of(&tone, light));
        Truth { curve, channels, luma: seen(curve, channels, light), looks, tone }
    }

    /// How near `picture` is.
    pub(crate) fn likeness(&self, picture: &Frame<Work>) -> Likeness {
        let of = |scene: &Looks| Looks::of(&self.tone, picture).scores(scene).difference;
        Likeness {
            ssim: ssim(&seen(self.curve, self.channels, picture), &self.luma),
            difference: self.looks.as_ref().map(of),
        }
    }
}
