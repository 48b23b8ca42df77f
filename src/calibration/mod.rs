//! What a rig's captures say about it, fitted and kept: everything between a Work picture and its
//! photograph.
//!
//! | paper §3 | here |
//! |---|---|
//! | geometric calibration, per channel | [`checkerboard`], [`geometric`], on [`surface`] |
//! | dark corner | [`dark_corner`]; the lens's alone: [`LensFlat`] |
//! | cross-channel response, Eq. 13 | [`cross_channel`], [`curve`] |
//! | (noise, lens functions: not in the paper) | [`noise`], [`lens_blur`] |
//! | (the lens out of focus: not in the paper) | [`OtherFocus`] |
//! | (how the sensor's sites differ: not in the paper) | [`response_pattern`], [`site_gains`] |
//!
//! The fits are pure: numbers in, numbers out. [`correction`] applies them, [`store`] keeps them on
//! flash, and the procedure on a rig is [`crate::measurement`] (layer 5).

pub mod camera_curve;
pub mod checkerboard;
pub mod correction;
pub mod cross_channel;
pub mod curve;
pub mod dark_corner;
pub mod dither;
pub mod geometric;
pub mod lens_blur;
mod lens_flat;
pub mod noise;
mod norms;
mod other_focus;
pub mod photo_side;
pub mod response;
pub mod response_pattern;
pub mod site_gains;
mod site_norms;
pub mod store;
pub mod surface;

use serde::{Deserialize, Serialize};

use crate::deconvolution::lens_model::broad::check_halos;
use crate::deconvolution::lens_model::{Beyond, Halo, LensFunctions, LensModel, LensModelError};
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::Size;
pub use camera_curve::CameraCurve;
pub use correction::{Corrected, Correction, CorrectionError, Layout};
pub use cross_channel::CrossChannel;
pub use curve::ResponseCurve;
pub use geometric::Geometry;
pub use lens_flat::{LensFlat, LensFlatError};
pub use noise::Noise;
pub use other_focus::{FocusError, OtherFocus, focus_offset};
pub use response_pattern::ResponsePattern;
pub use site_gains::SiteGains;
pub use site_norms::SiteNorms;
use surface::Surface;

/// Everything measured on one rig, at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Identity of the rig it was measured on: hash of the geometry-relevant parts of its rig file.
    pub rig: u64,
    /// Counts up by one with each calibration kept.
    pub generation: u32,
    /// The photo's grid.
    pub photo: Size,
    /// Canvas around the photo, on every side.
    pub margin_px: usize,
    /// Work ↔ panel, per channel.
    pub geometry: [Geometry; 3],
    /// Share of the light that arrives, over Work coordinates, per channel; mean 1 over the photo.
    pub dark_corner: [Surface; 3],
    /// The mixing of the channels, Eq. 13.
    pub cross_channel: CrossChannel,
    /// How the camera's counts bend; all else here is of straight counts.
    pub camera_curve: CameraCurve,
    /// Light 0..255 of each panel code, per channel, black subtracted.
    pub curves: [ResponseCurve; 3],
    /// Sensor counts with a black panel, over Work coordinates, per channel: pedestal, ambient
    /// light and leakage.
    pub black: [Surface; 3],
    /// Sensor counts per unit of light (0..255) where the dark corner is 1, per channel.
    pub counts_per_level: [f32; 3],
    /// How the sensor's sites differ, on the canvas.
    pub pattern: ResponsePattern,
    /// Noise of one capture in units of light, per channel, mixing undone.
    pub noise: [Noise; 3],
    /// The lens functions, each about sum 1: light to light, dark corner taken out.
    pub functions: LensFunctions,
    /// What the lens scatters wider than that, per channel; nothing where nothing was found, or not
    /// looked for.
    pub broad: [Vec<Halo>; 3],
    /// Largest squared singular value of the lens model, per channel.
    pub norm_squared: [f32; 3],
    /// How much of each wavelet level the lens model lets through, per channel; for the rig file's
    /// levels.
    pub level_norms: [LevelNorms; 3],
    /// The same norms at the sites of the camera's colour filters, if it has them.
    pub at_sites: Option<SiteNorms>,
    /// The lens at other focus offsets, rising.
    pub focuses: Vec<OtherFocus>,
    /// ‖K‖², asked of the light: what the rig makes of the model's dominant picture; green.
    pub norm_squared_seen: f32,
    /// RMS of (held-out capture of a chart − the model's prediction), grey levels, per channel;
    /// the capture registered, its beat taken out, its noise included.
    pub operator_error: [f32; 3],
    /// Captures the calibration took.
    pub captures: u32,
}

/// An operator error above which results are doubted, grey levels. Guess: the simulated rigs of
/// the laboratory have 1 to 5.6, a lens that blurs by less than a pixel 8.8.
const OPERATOR_ERROR_MOST: f32 = 7.0;

impl Calibration {
    /// What lies beyond the canvas: without margin everything outside the photo is dark; with one,
    /// light goes on.
    pub fn beyond(&self) -> Beyond {
        if self.margin_px == 0 { Beyond::Dark } else { Beyond::LikeTheBorder }
    }

    /// K as measured, broad light included.
    ///
    /// # Errors
    /// When the functions or the broad light are none.
    pub fn lens_model(&self) -> Result<LensModel, LensModelError> {
        LensModel::new(self.photo, self.margin_px, &self.functions)?
            .with_broad_light(&self.broad, self.beyond())
    }

    /// Share of the light that the lens scatters wider than its functions reach, per channel.
    pub fn scattered(&self) -> [f32; 3] {
        let side = self.functions.support_px;
        // Not by `sum`, which makes −0.0 of nothing.
        self.broad.each_ref().map(|halos| halos.iter().fold(0.0, |sum, h| sum + h.beyond(side)))
    }

    /// What its own captures say against it, in a sentence with what to do.
    pub fn doubt(&self) -> Option<String> {
        let largest = self.operator_error.into_iter().fold(0.0, f32::max);
        (largest > OPERATOR_ERROR_MOST).then(|| {
            format!(
                "the lens model misses a chart by {largest:.1} grey levels, allowed \
                 {OPERATOR_ERROR_MOST:.0}: results will be poor. Either the rig is out of focus, \
                 which `relens align` tells; or the lens blurs by less than a pixel, and the \
                 camera sees the panel's: a panel with finer pixels, or farther away, has two of \
                 them to a pixel of the sensor"
            )
        })
    }

    /// Whether all parts are whole and fit together, in words when not.
    fn check(&self) -> Result<(), String> {
        let surfaces =
            self.dark_corner.iter().chain(&self.black).chain(self.geometry.iter().flat_map(|g| {
                [&g.work_to_panel.x, &g.work_to_panel.y, &g.panel_to_work.x, &g.panel_to_work.y]
            }));
        if surfaces.into_iter().any(|s| !s.is_whole()) {
            return Err(
                "a surface has the wrong number of coefficients, or one that is not finite"
                    .to_owned(),
            );
        }
        if self.counts_per_level.iter().any(|c| !c.is_finite() || *c <= 0.0) {
            return Err(format!(
                "counts per level of {:?}; positive numbers are allowed",
                self.counts_per_level
            ));
        }
        if self.level_norms.iter().any(|norms| !norms.is_whole()) {
            return Err(format!(
                "level norms of {:?}; positive numbers are allowed",
                self.level_norms
            ));
        }
        let twice = self.margin_px.saturating_mul(2);
        let side = |photo: usize| photo.saturating_add(twice);
        if let Some(norms) = self.at_sites.as_ref().filter(|norms| !norms.is_whole()) {
            return Err(format!("norms at sites of {norms:?}; positive numbers are allowed"));
        }
        self.camera_curve.check()?;
        self.pattern.check(Size::new(side(self.photo.width), side(self.photo.height)))?;
        self.broad.iter().try_for_each(|halos| check_halos(halos))?;
        self.functions.check().map_err(|e| e.to_string())?;
        self.check_focuses()
    }
}

#[cfg(test)]
pub(crate) mod example;

#[cfg(test)]
mod tests {
    use super::Calibration;
    use super::example::calibration;

    #[test]
    fn a_lens_model_that_misses_much_is_doubted_and_told_what_to_do() {
        assert_eq!(calibration().doubt(), None);
        let poor = Calibration { operator_error: [3.0, 16.4, 4.5], ..calibration() };
        let doubt = poor.doubt().unwrap();
        assert!(doubt.contains("16.4") && doubt.contains("relens align"), "{doubt}");
    }

    #[test]
    fn a_lens_that_scatters_nothing_scatters_no_less_than_nothing() {
        let clear = Calibration { broad: Default::default(), ..calibration() };
        assert!(clear.scattered().iter().all(|share| share.to_bits() == 0));
    }
}
