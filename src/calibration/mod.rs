//! Calibration of a rig: fits to its captures, their storage and their application. It covers
//! everything between a Work picture and its capture.
//!
//! | paper §3 | here |
//! |---|---|
//! | geometric calibration, in green alone | [`checkerboard`], [`geometric`], on [`surface`] |
//! | dark corner | [`dark_corner`] |
//! | cross-channel response, Eq. 13 | [`cross_channel`], [`curve`] |
//! | (noise, lens functions: not in the paper) | [`noise`], [`lens_blur`] |
//! | (the lens out of focus: not in the paper) | [`OtherFocus`] |
//! | (how the sensor's sites differ: not in the paper) | [`response_pattern`], [`site_gains`] |
//!
//! The fits are pure functions. [`correction`] applies them, [`store`] stores them, and
//! [`crate::measurement`] is the procedure on a rig.

pub mod camera_curve;
pub mod checkerboard;
pub mod correction;
pub mod cross_channel;
pub mod curve;
pub mod dark_corner;
pub mod dither;
pub mod geometric;
pub mod lens_blur;
pub mod noise;
mod operator_norms;
mod other_focus;
pub mod photo_side;
mod pitch;
pub mod response;
pub mod response_pattern;
pub mod site_gains;
pub mod store;
pub mod surface;

use serde::{Deserialize, Serialize};

use crate::deconvolution::lens_model::broad::check_halos;
use crate::deconvolution::lens_model::{Beyond, Halo, LensFunctions, LensModel, LensModelError};
use crate::frame::{Channel, Plane, Size};
pub use camera_curve::CameraCurve;
pub use correction::{Correction, CorrectionError, Layout};
pub use cross_channel::CrossChannel;
pub use curve::ResponseCurve;
pub use geometric::Geometry;
pub use noise::Noise;
pub use operator_norms::OperatorNorms;
pub use other_focus::{FocusError, OtherFocus, focus_offset};
pub use response_pattern::ResponsePattern;
pub use site_gains::SiteGains;
use surface::Surface;

/// All results of one calibration of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Identity of the rig: hash of the geometry-relevant parts of its rig file.
    pub rig: u64,
    /// Number of the stored calibration, increasing by one.
    pub generation: u32,
    /// The photo's grid.
    pub photo: Size,
    /// Width of the canvas's margin around the photo, on every side.
    pub margin_px: usize,
    /// Work ↔ panel for green. Red's and blue's displacements are part of their functions.
    pub geometry: Geometry,
    /// Relative illumination over Work coordinates, per channel; mean 1 over the photo.
    pub dark_corner: [Surface; 3],
    /// Mixing of the channels, Eq. 13.
    pub cross_channel: CrossChannel,
    /// Linearisation of the camera's counts; all other fields refer to linear counts.
    pub camera_curve: CameraCurve,
    /// Light 0..255 of each panel code, per channel, black subtracted.
    pub curves: [ResponseCurve; 3],
    /// Sensor counts with a black panel, over Work coordinates, per channel: pedestal, ambient
    /// light and leakage.
    pub black: [Surface; 3],
    /// Sensor counts per unit of light (0..255) where the dark corner is 1, per channel.
    pub counts_per_level: [f32; 3],
    /// Response of the sensor's sites, on the canvas.
    pub pattern: ResponsePattern,
    /// Noise of one capture with its channels unmixed, in units of light, per channel.
    pub noise: [Noise; 3],
    /// Lens functions, each of sum about 1, without the dark corner.
    pub functions: LensFunctions,
    /// Light scattered beyond the functions' support, per channel; empty if none was found or
    /// measured.
    pub broad: [Vec<Halo>; 3],
    /// Norms of the lens model at all pixels.
    pub norms: OperatorNorms,
    /// The same norms at the sites of the camera's colour filters, if any.
    pub at_sites: Option<OperatorNorms>,
    /// The lens at other focus offsets, in increasing order.
    pub focuses: Vec<OtherFocus>,
    /// ‖K‖² of green, measured on the rig by capturing the model's dominant picture.
    pub norm_squared_seen: f32,
    /// RMS of (held-out capture of a chart − prediction), grey levels, per channel. The capture is
    /// registered and its beat removed; its noise is included.
    pub operator_error: [f32; 3],
    /// Number of captures.
    pub captures: u32,
}

/// Largest operator error without a warning, grey levels. Guess: the simulated rigs have 1 to 5.6,
/// a lens that blurs by less than a pixel 8.8.
const OPERATOR_ERROR_MOST: f32 = 7.0;

impl Calibration {
    /// Light beyond the canvas: none without a margin, else the border's light continues.
    pub fn beyond(&self) -> Beyond {
        if self.margin_px == 0 { Beyond::Dark } else { Beyond::LikeTheBorder }
    }

    /// Counts of a black panel in the middle of the canvas.
    pub fn black_level(&self, channel: Channel) -> f64 {
        let middle = |side: usize| (side + 2 * self.margin_px) as f64 / 2.0;
        self.black[channel.index()].at(middle(self.photo.width), middle(self.photo.height))
    }

    /// The lens model K, broad light included.
    ///
    /// # Errors
    /// When the functions or the broad light are invalid.
    pub fn lens_model(&self) -> Result<LensModel, LensModelError> {
        LensModel::new(self.photo, self.margin_px, &self.functions)?
            .with_broad_light(&self.broad, self.beyond())
    }

    /// Share of the light scattered beyond the functions' support, per channel.
    pub fn scattered(&self) -> [f32; 3] {
        let side = self.functions.support_px;
        // Not by `sum`, which is −0.0 for an empty iterator.
        self.broad.each_ref().map(|halos| halos.iter().fold(0.0, |sum, h| sum + h.beyond(side)))
    }

    /// Computes the norms of this calibration's `model` for `levels` wavelet levels, and at sites
    /// if `at_sites`; returns green's dominant picture.
    pub fn measure_norms(&mut self, model: &LensModel, levels: usize, at_sites: bool) -> Plane {
        self.at_sites = at_sites.then(|| OperatorNorms::at_sites(model, levels));
        let (norms, green) = OperatorNorms::at_pixels(model, levels);
        self.norms = norms;
        green
    }

    /// A warning if the lens model is inaccurate, with advice.
    pub fn warning(&self) -> Option<String> {
        let largest = self.operator_error.into_iter().fold(0.0, f32::max);
        (largest > OPERATOR_ERROR_MOST).then(|| {
            format!(
                "the lens model deviates from a chart by {largest:.1} grey levels, allowed \
                 {OPERATOR_ERROR_MOST:.0}: results will be poor. Either the rig is out of focus: \
                 run `relens align`. Or the lens blurs by less than a pixel, and the camera \
                 resolves the panel's pixels: use a panel with finer pixels, or move it \
                 away, until two of them fall on a sensor pixel"
            )
        })
    }

    /// Checks that all parts are valid and consistent; the error describes the fault.
    fn check(&self) -> Result<(), String> {
        let Geometry { work_to_panel: there, panel_to_work: back } = &self.geometry;
        let maps = [&there.x, &there.y, &back.x, &back.y];
        let mut surfaces = self.dark_corner.iter().chain(&self.black).chain(maps);
        if surfaces.any(|s| !s.is_whole()) {
            return Err("a surface has a wrong number of coefficients, or one that is not finite"
                .to_owned());
        }
        if self.counts_per_level.iter().any(|c| !c.is_finite() || *c <= 0.0) {
            return Err(format!(
                "counts per level of {:?}; positive numbers are allowed",
                self.counts_per_level
            ));
        }
        let twice = self.margin_px.saturating_mul(2);
        let side = |photo: usize| photo.saturating_add(twice);
        let mut norms = self.at_sites.iter().chain([&self.norms]);
        if let Some(norms) = norms.find(|norms| !norms.is_whole()) {
            return Err(format!("norms of {norms:?}; positive numbers are allowed"));
        }
        self.camera_curve.check()?;
        self.pattern.check(Size::new(side(self.photo.width), side(self.photo.height)))?;
        self.broad.iter().try_for_each(|halos| check_halos(halos))?;
        self.functions.check().map_err(|e| e.to_string())?;
        self.check_focuses()
    }
}

#[cfg(test)]
#[path = "tests/example.rs"]
pub(crate) mod example;

#[cfg(test)]
mod tests {
    use super::Calibration;
    use super::example::calibration;

    #[test]
    fn an_inaccurate_lens_model_gives_a_warning_with_advice() {
        assert_eq!(calibration().warning(), None);
        let poor = Calibration { operator_error: [3.0, 16.4, 4.5], ..calibration() };
        let warning = poor.warning().unwrap();
        assert!(warning.contains("16.4") && warning.contains("relens align"), "{warning}");
    }

    #[test]
    fn a_lens_without_scatter_has_positive_zero_scatter() {
        let clear = Calibration { broad: Default::default(), ..calibration() };
        assert!(clear.scattered().iter().all(|share| share.to_bits() == 0));
    }
}
