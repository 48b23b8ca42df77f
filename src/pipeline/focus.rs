//! The focus of a photo, and the lens model there.

use std::sync::{Arc, OnceLock};

use super::stages::{PhotoFocus, Prepared};
use super::{Pipeline, norm_bound};
use crate::calibration::{Calibration, OtherFocus, SiteNorms};
use crate::deconvolution::focus::{FocusData, FocusSeries, FoundFocus};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::Channel;

/// The lens as measured at several focus offsets, the panel's included; empty where it was measured
/// at the panel's alone.
pub(super) struct Focuses(Vec<OtherFocus>);

impl Focuses {
    pub(super) fn of(calibration: &Calibration) -> Focuses {
        if calibration.focuses.is_empty() {
            return Focuses(Vec::new());
        }
        let panel = OtherFocus {
            offset: 0.0,
            functions: calibration.functions.clone(),
            norm_squared: calibration.norm_squared,
            level_norms: calibration.level_norms.clone(),
            at_sites: calibration.at_sites.clone(),
        };
        let mut all = calibration.focuses.clone();
        all.push(panel);
        all.sort_by(|a, b| a.offset.total_cmp(&b.offset));
        // The measured excess of ‖K‖² over the model's holds at any focus.
        let measured = calibration.norm_squared;
        let bound = norm_bound(calibration);
        for focus in &mut all {
            for c in Channel::ALL.map(Channel::index) {
                focus.norm_squared[c] *= bound[c] / measured[c].max(f32::MIN_POSITIVE);
            }
        }
        Focuses(all)
    }

    /// Whether the lens was measured at the panel's focus only.
    pub(super) fn is_panel_alone(&self) -> bool {
        self.0.is_empty()
    }

    fn series(&self) -> Option<FocusSeries<'_>> {
        FocusSeries::new(self.0.iter().map(|focus| (focus.offset, &focus.functions)).collect())
    }
}

impl Pipeline {
    /// The measured lens at the focus of `photo`.
    pub(super) fn lens_of<'a>(&'a self, photo: &'a Prepared<'_>) -> &'a Arc<LensModel> {
        photo.focus.as_ref().map_or(&self.model, |focus| &focus.model)
    }

    /// The focus of `photo`, with `noise` σ at a light; `None` unless its spectra show another than
    /// the panel's.
    pub(super) fn focus_of(
        &self,
        photo: &Prepared<'_>,
        noise: &(dyn Fn(Channel, f32) -> f32 + Sync),
    ) -> Option<PhotoFocus> {
        let series = self.focuses.series()?;
        let FoundFocus { offset, between: (before, after), share, at_end } =
            series.find(&photo.focus_data(noise))?;
        let [before, after] = [before, after].map(|n| &self.focuses.0[n]);
        let rect = photo.observation.rect;
        let functions = before.functions.between(&after.functions, share);
        let model = self.model.with_functions(rect.size, rect.x, &functions).ok()?;
        let [before, after] = [before, after].map(|focus| FocusNorms {
            norm_squared: focus.norm_squared,
            level_norms: focus.level_norms.clone(),
            at_sites: focus.at_sites.clone(),
        });
        let FocusNorms { norm_squared, level_norms, at_sites } = before.or_larger(after);
        Some(PhotoFocus {
            offset,
            at_end,
            model: Arc::new(model),
            norm_squared,
            level_norms,
            at_sites: at_sites.map_or_else(OnceLock::new, OnceLock::from),
        })
    }
}

impl Prepared<'_> {
    /// The data for its spectra, with `noise` σ at a light.
    pub(super) fn focus_data<'a>(
        &'a self,
        noise: &'a (dyn Fn(Channel, f32) -> f32 + Sync),
    ) -> FocusData<'a> {
        FocusData {
            photo: &self.observation.light,
            trust: &self.observation.trust,
            rect: self.observation.rect,
            mosaic: self.observation.sampling.mosaic(),
            channels: self.observation.channels,
            noise,
        }
    }
}

/// Bounds on what a lens passes.
struct FocusNorms {
    norm_squared: [f32; 3],
    level_norms: [LevelNorms; 3],
    at_sites: Option<SiteNorms>,
}

impl FocusNorms {
    /// The larger of both, a bound for every lens interpolated between the two: norms are convex.
    fn or_larger(self, other: FocusNorms) -> FocusNorms {
        let larger = |a: &[f32; 3], b: &[f32; 3]| [0, 1, 2].map(|c| a[c].max(b[c]));
        let levels = |a: &[LevelNorms; 3], b: &[LevelNorms; 3]| {
            Channel::ALL.map(|c| a[c.index()].or_larger(&b[c.index()]))
        };
        FocusNorms {
            norm_squared: larger(&self.norm_squared, &other.norm_squared),
            level_norms: levels(&self.level_norms, &other.level_norms),
            at_sites: self.at_sites.zip(other.at_sites).map(|(a, b)| SiteNorms {
                norm_squared: larger(&a.norm_squared, &b.norm_squared),
                level_norms: levels(&a.level_norms, &b.level_norms),
            }),
        }
    }
}
