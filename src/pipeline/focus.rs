//! The focus of a photo, and the lens model there.

use std::sync::{Arc, OnceLock};

use super::stages::{BoundedLens, PhotoFocus, Prepared};
use super::{Pipeline, norm_excess};
use crate::calibration::{Calibration, OperatorNorms, OtherFocus};
use crate::deconvolution::colour_focus::ColourFocus;
use crate::deconvolution::focus::{FocusData, FocusSeries, FoundFocus};
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::{Channel, Rect};

/// The lens as measured at several focus offsets, including the panel's; empty if it was measured
/// at the panel's only.
pub(super) struct Focuses(pub(super) Vec<OtherFocus>);

impl Focuses {
    pub(super) fn of(calibration: &Calibration) -> Focuses {
        if calibration.focuses.is_empty() {
            return Focuses(Vec::new());
        }
        let panel = OtherFocus {
            offset: 0.0,
            functions: calibration.functions.clone(),
            norms: calibration.norms.clone(),
            at_sites: calibration.at_sites.clone(),
        };
        let mut all = calibration.focuses.clone();
        all.push(panel);
        all.sort_by(|a, b| a.offset.total_cmp(&b.offset));
        // The measured excess of ‖K‖² over the model's holds at any focus.
        let excess = norm_excess(calibration);
        for focus in &mut all {
            focus.norms.squared = focus.norms.squared.map(|norm| norm * excess);
        }
        Focuses(all)
    }

    fn series(&self) -> Option<FocusSeries<'_>> {
        FocusSeries::new(self.0.iter().map(|focus| (focus.offset, &focus.functions)).collect())
    }
}

impl Pipeline {
    /// The lens of `photo`: as measured, or at the photo's own focus and light.
    pub(super) fn lens_of<'a>(&'a self, photo: &'a Prepared<'_>) -> &'a BoundedLens {
        photo.lens.as_ref().unwrap_or(&self.lens)
    }

    /// Sets the focus and lens of `photo` if its spectra show another focus than the panel's;
    /// `noise` is the σ of a channel at a light, grey levels.
    pub(super) fn find_focus(
        &self,
        photo: &mut Prepared<'_>,
        noise: &(dyn Fn(Channel, f32) -> f32 + Sync),
    ) {
        let Some(series) = self.focuses.series() else { return };
        let Some(found) = series.find(&photo.focus_data(self.lens.model.field(), noise)) else {
            return;
        };
        let FoundFocus { offset, between: (before, after), share, at_end } = found;
        let [before, after] = [before, after].map(|n| &self.focuses.0[n]);
        let functions = before.functions.between(&after.functions, share);
        let norms = before.norms.or_larger(&after.norms);
        let at_sites = before.at_sites.as_ref().zip(after.at_sites.as_ref());
        let at_sites = at_sites.map(|(before, after)| before.or_larger(after));
        photo.lens = self.lens_with(&functions, norms, at_sites);
        photo.focus = photo.lens.is_some().then_some(PhotoFocus { offset, at_end });
    }

    /// Fits the lens of `photo` to the [focus of its colours](ColourFocus).
    pub(super) fn fit_colours(&self, photo: &mut Prepared<'_>) {
        let (observation, lens) = (&photo.observation, self.lens_of(photo));
        let Some(colours) = ColourFocus::of(&lens.model, observation) else { return };
        let bounds = |measured: &OperatorNorms| OperatorNorms {
            squared: colours.norms_squared(&measured.squared),
            levels: colours.level_norms(&measured.levels),
        };
        let norms = bounds(&lens.norms);
        let at_sites = observation.sampling.mosaic().map(|_| bounds(lens.norms_at_sites()));
        let functions = colours.functions(lens.model.functions());
        let Some(mut lens) = self.lens_with(&functions, norms, at_sites) else { return };
        let halos = colours.halos(&self.halos);
        if let Ok(model) = Arc::unwrap_or_clone(lens.model).with_broad_light(&halos, self.beyond) {
            lens.model = Arc::new(model);
            photo.lens = Some(lens);
        }
    }

    /// The lens with `functions` and the bounds `norms`, or `at_sites` for data at raw sites.
    fn lens_with(
        &self,
        functions: &LensFunctions,
        norms: OperatorNorms,
        at_sites: Option<OperatorNorms>,
    ) -> Option<BoundedLens> {
        let model = self.lens.model.with_functions(functions).ok()?;
        Some(BoundedLens {
            model: Arc::new(model),
            norms,
            at_sites: at_sites.map_or_else(OnceLock::new, OnceLock::from),
        })
    }
}

impl Prepared<'_> {
    /// Data for the photo's spectra, with the lens's `field` and a channel's `noise` σ at a light.
    pub(super) fn focus_data<'a>(
        &'a self,
        field: Rect,
        noise: &'a (dyn Fn(Channel, f32) -> f32 + Sync),
    ) -> FocusData<'a> {
        FocusData {
            photo: &self.observation.light,
            trust: &self.observation.trust,
            rect: self.observation.rect,
            field,
            mosaic: self.observation.sampling.mosaic(),
            channels: self.observation.channels,
            noise,
        }
    }
}
