//! Focus of a photo's colour channels relative to each other.
//!
//! The lens is measured in the panel's narrow light, at the panel's distance. Through a lens with
//! longitudinal chromatic aberration, a scene somewhat nearer or farther, or lit by a broader
//! spectrum, is blurred in each channel by a function between those measured for neighbouring
//! channels, or just beyond them:
//!
//! ```text
//! H′_R = H_R + s (H_G − H_R)    H′_G = H_G + min(s, 0) (H_G − H_R)    H′_B = H_B + t (H_G − H_B)
//! ```
//!
//! A change of focus moves red and green by the same dioptres, hence one s for both. Green, the
//! sharpest, is not extrapolated to a sharper one, which would amplify noise.
//!
//! The channels y_R = H_R x and y_G = H_G x of one scene x agree once each is blurred by the
//! other's function. Where a scene's red is locally a linear function of its green,
//! H_G y_R = a H_R y_G + b with local a and b; s minimises the residual of this regression, and t
//! that of blue on green.

use super::colour_lines::{ChannelPair, ColourPlaces};
use super::lens_model::{Halo, LensFunctions, LensModel};
use super::level_norms::LevelNorms;
use super::observation::{DataKind, Observation};
use super::smoothing::halve;
use crate::frame::{Channel, Channels, Frame, Plane};

/// Interpolation shares between the lens functions of neighbouring channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourFocus {
    /// s: share from red's function towards green's; if negative, green moves towards red by −s.
    pub red_green: f32,
    /// t: share from blue's function towards green's.
    pub blue: f32,
}

impl ColourFocus {
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
        let through = |lens: Channel, of: Channel| {
            let mut seen = Plane::zeros(light.size());
            model.forward(lens, light.plane(of), &mut seen);
            // After two blurs nothing finer than the coarser pixels remains.
            halve(&seen)
        };
        let places = ColourPlaces::of(photo, model.functions());
        let green_by_green = through(green, green);
        let share = |of: Plane, on: Plane| {
            let change = difference(&green_by_green, &on);
            ChannelPair { of: &of, on: &on, change: &change }.share(&places)
        };
        let red_green = share(through(green, red), through(red, green));
        let beyond = red_green.unwrap_or(0.0).min(0.0);
        let mut blue_by_green = through(green, blue);
        if beyond < 0.0 {
            let change = difference(&blue_by_green, &through(red, blue));
            blue_by_green.add_scaled(beyond, &change);
        }
        let toward_green = share(blue_by_green, through(blue, green));
        log::debug!(
            "focus of the colours: share of red and green {red_green:.3?}, of blue \
             {toward_green:.3?}"
        );
        (red_green.is_some() || toward_green.is_some()).then(|| ColourFocus {
            red_green: red_green.unwrap_or(0.0),
            blue: toward_green.unwrap_or(0.0),
        })
    }

    /// Lens functions of the photo, given the `measured` ones.
    pub fn functions(self, measured: &LensFunctions) -> LensFunctions {
        let [red, green, blue] = measured.taps.each_ref();
        let moved = |own: &[f32], other: &[f32], share: f32| {
            let taps = own.iter().zip(other);
            taps.map(|(own, other)| own + share * (other - own)).collect()
        };
        let taps = [
            moved(red, green, self.red_green),
            moved(green, red, self.green_toward_red()),
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
        [mixed(red, green, self.red_green), green.clone(), mixed(blue, green, self.blue)]
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
        [
            moved(red, green, self.red_green),
            moved(green, red, self.green_toward_red()),
            moved(blue, green, self.blue),
        ]
    }

    fn green_toward_red(self) -> f32 {
        (-self.red_green).max(0.0)
    }
}

fn difference(a: &Plane, b: &Plane) -> Plane {
    let mut difference = a.clone();
    difference.add_scaled(-1.0, b);
    difference
}

#[cfg(test)]
mod tests;
