//! Focus of a photo's colour channels relative to each other.
//!
//! The lens is measured in the panel's narrow light, at the panel's distance. Through a lens with
//! longitudinal chromatic aberration, a scene somewhat nearer or farther, or lit by a broader
//! spectrum, is blurred in each channel by a function between those measured for neighbouring
//! channels, or just beyond them:
//!
//! ```text
//! H′_R = H_R + r (H_G − H_R)    H′_G = H_G + g (H_R − H_G)    H′_B = H_B + b (H_G − H_B)
//! ```
//!
//! Two parameters of a photo give the three shares, `ColourFocus::at`: how broad its light is, and
//! how much nearer than the panel its scene. Green, the sharpest, is not extrapolated to a sharper
//! one, which would amplify noise.
//!
//! The channels y_R = H′_R z and y_G = H′_G z of one scene z agree once each is blurred by the
//! other's function. Where a scene's red is locally a linear function of its green,
//! H′_G y_R = α H′_R y_G + β with local α and β. Light and distance change red against green
//! alike, but light alone changes blue against green: the regression of blue on green gives the
//! light, then that of red on green the distance.

use super::colour_axis::width_px;
use super::colour_lines::{ChannelPair, ColourPlaces, Moving};
use super::lens_model::{Halo, LensFunctions, LensModel};
use super::level_norms::LevelNorms;
use super::observation::{DataKind, Observation};
use super::smoothing::halve;
use crate::frame::{Channel, Channels, Frame, Plane, SquarePlace, Work};

/// Shares in a scene's broad light at the panel's focus. Fitted to photos of six scenes on
/// `simulated.toml` and `truthful.toml`, whose light and filters are guesses: red 0.10 to 0.16,
/// green 0.03 to 0.05, blue 0.08 to 0.11. In the panel's own light all are below 0.06.
const BROAD_LIGHT: ColourFocus = ColourFocus { red: 0.12, green: 0.03, blue: 0.095 };
/// Changes of the shares of green and blue while that of red falls by 1, as the scene comes nearer.
/// Fitted to the same photos of scenes at −0.013 to 0.026 dioptres from the panel.
const GREEN_PER_RED: f32 = 0.5;
const BLUE_PER_RED: f32 = 0.55;
/// Multiples of [`BROAD_LIGHT`] found by regression of blue on green in the panel's and in broad
/// light, whatever the distance: not 0 and 1, since broad light blurs blue otherwise than
/// interpolation does (six scenes, `simulated.toml`; within 0.4 on `truthful.toml`).
const BLUE_ON_GREEN: [f32; 2] = [0.2, 1.75];
/// Prior σ of the light, from the panel's to broad. Guess: most scenes are in broad light.
const LIGHT_SIGMA: f32 = 0.5;
/// Prior σ of the change of focus: a distance that differs by 5 % changes it by 0.15 to 0.2
/// (`simulated.toml`, `truthful.toml`).
const FOCUS_SIGMA: f32 = 0.18;

/// Width of the lens functions from which the channels are blurred on pixels binned by two.
const WIDE_PX: f32 = 4.0;

/// Interpolation shares between the lens functions of neighbouring channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourFocus {
    /// r: share from red's function towards green's; negative beyond red's.
    pub red: f32,
    /// g: share from green's function towards red's, at least 0.
    pub green: f32,
    /// b: share from blue's function towards green's; negative beyond blue's.
    pub blue: f32,
}

impl ColourFocus {
    /// Shares for a scene nearer than the panel by a change of focus `nearer` that lowers the share
    /// of red by as much, in light between the panel's (`broad` 0) and broad light (1).
    fn at(broad: f32, nearer: f32) -> ColourFocus {
        ColourFocus {
            red: broad * BROAD_LIGHT.red - nearer,
            green: (broad * BROAD_LIGHT.green + GREEN_PER_RED * nearer).max(0.0),
            blue: broad * BROAD_LIGHT.blue + BLUE_PER_RED * nearer,
        }
    }

    /// Estimates the shares of `photo`, taken through `model`. `None` for grey photos, for JPEGs,
    /// and if too little of the photo has details.
    ///
    /// # Panics
    /// When the photo does not have the model's canvas.
    pub fn of(model: &LensModel, photo: &Observation) -> Option<ColourFocus> {
        // A JPEG's colour coding would be mistaken for blur.
        if photo.channels == Channels::Green || photo.sampling.kind() == DataKind::Jpeg {
            return None;
        }
        let light = match photo.sampling.mosaic() {
            Some(mosaic) => {
                &Frame::from_fn(|c| mosaic.interpolated_finely(c, photo.light.plane(c)))
            }
            None => &photo.light,
        };
        let [red, green, blue] = Channel::ALL;
        // After two blurs nothing finer than the coarser pixels remains; after one, little behind a
        // wide lens.
        let places = Channel::each(|_| SquarePlace::pixels());
        let is_wide = width_px(model.functions()) >= WIDE_PX;
        let binned = is_wide.then(|| model.binned(&places).ok()).flatten();
        let coarse =
            binned.as_ref().map(|model| (model, Frame::<Work>::from_fn(|c| halve(light.plane(c)))));
        let through = |lens: Channel, of: Channel| match &coarse {
            Some((model, light)) => {
                let mut seen = Plane::zeros(model.canvas());
                model.forward(lens, light.plane(of), &mut seen);
                seen
            }
            None => {
                let mut seen = Plane::zeros(light.size());
                model.forward(lens, light.plane(of), &mut seen);
                halve(&seen)
            }
        };
        let crossed = |of: Channel, [own, other]: [Channel; 2], share: f32, per_unit: f32| {
            let mut expected = through(own, of);
            let mut change = through(other, of);
            change.add_scaled(-1.0, &expected);
            expected.add_scaled(share, &change);
            change.scale(per_unit);
            Moving { expected, change }
        };
        let places = ColourPlaces::of(photo, model.functions());
        let [in_panel_light, in_broad_light] = BLUE_ON_GREEN;
        let by_light = |of, functions, share| {
            let per_light = (in_broad_light - in_panel_light) * share;
            crossed(of, functions, in_broad_light * share, per_light)
        };
        let of_light = ChannelPair {
            of: by_light(blue, [green, red], BROAD_LIGHT.green),
            on: by_light(green, [blue, green], BROAD_LIGHT.blue),
        };
        let less_broad = of_light.fit(&places, LIGHT_SIGMA).unwrap_or(0.0);
        let broad = (1.0 + less_broad).clamp(0.0, 1.0);
        let of_distance = ChannelPair {
            of: crossed(red, [green, red], broad * BROAD_LIGHT.green, GREEN_PER_RED),
            on: crossed(green, [red, green], broad * BROAD_LIGHT.red, -1.0),
        };
        let nearer = of_distance.fit(&places, FOCUS_SIGMA)?;
        log::debug!("focus of the colours: light {broad:.3}, distance {nearer:.3}");
        Some(ColourFocus::at(broad, nearer))
    }

    /// Lens functions of the photo, given the `measured` ones.
    pub fn functions(self, measured: &LensFunctions) -> LensFunctions {
        let [red, green, blue] = measured.taps.each_ref();
        let moved = |own: &[f32], other: &[f32], share: f32| {
            let taps = own.iter().zip(other);
            taps.map(|(own, other)| own + share * (other - own)).collect()
        };
        let taps = [
            moved(red, green, self.red),
            moved(green, red, self.green),
            moved(blue, green, self.blue),
        ];
        LensFunctions { taps, ..*measured }
    }

    /// Halos of the photo, given the `measured` ones; never extrapolated.
    pub fn halos(self, measured: &[Vec<Halo>; 3]) -> [Vec<Halo>; 3] {
        let [red, green, blue] = measured;
        let mixed = |own: &[Halo], other: &[Halo], share: f32| {
            let share = share.max(0.0);
            let scaled = |halo: &Halo, by: f32| Halo { share: by * halo.share, ..*halo };
            let mut halos: Vec<Halo> = own.iter().map(|halo| scaled(halo, 1.0 - share)).collect();
            for more in other.iter().map(|halo| scaled(halo, share)) {
                match halos.iter_mut().find(|halo| halo.radius_px == more.radius_px) {
                    Some(same) => same.share += more.share,
                    None => halos.push(more),
                }
            }
            halos
        };
        [mixed(red, green, self.red), green.clone(), mixed(blue, green, self.blue)]
    }

    /// Bounds on ‖K‖² of [`ColourFocus::functions`], from those of the `measured` ones.
    pub fn norms_squared(self, measured: &[f32; 3]) -> [f32; 3] {
        self.bounds(measured, |a, b| a.max(*b), |norm, factor| norm * factor.powi(2))
    }

    /// Bounds on the wavelet-level norms of [`ColourFocus::functions`], from the `measured` ones.
    pub fn level_norms(self, measured: &[LevelNorms; 3]) -> [LevelNorms; 3] {
        self.bounds(measured, LevelNorms::or_larger, LevelNorms::scaled)
    }

    /// Bounds the norm of an interpolated function by the larger of the two norms, since norms are
    /// convex, and that of an extrapolated function by its own norm, scaled up.
    fn bounds<T: Clone>(
        self,
        [red, green, blue]: &[T; 3],
        larger: impl Fn(&T, &T) -> T,
        scaled: impl Fn(&T, f32) -> T,
    ) -> [T; 3] {
        let moved = |own: &T, other: &T, share: f32| match share {
            0.0 => own.clone(),
            between if between > 0.0 => larger(own, other),
            beyond => scaled(own, 1.0 - beyond),
        };
        [moved(red, green, self.red), moved(green, red, self.green), moved(blue, green, self.blue)]
    }
}

#[cfg(test)]
mod tests;
