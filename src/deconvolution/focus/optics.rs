//! The light of a rig whose panel stands in another focus than a photo's scene did.
//!
//! A capture y of L is K_panel L: the panel stands where it stands. What the photo's focus would
//! have made of L is y + (K̂_photo − K̂_panel) L, by the two measured models: all that they have in
//! common, what they miss of the lens and what happened to the rig since, is the light's.

use std::sync::Arc;

use rayon::prelude::*;

use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::remedy::AnyFailure;

/// `inner`, a rig whose panel is seen by `panel`, as a photo is seen by `photo`.
pub(crate) struct OpticsAtFocus<'a> {
    /// The light.
    pub(crate) inner: &'a mut dyn ForwardConvolution,
    /// The lens as measured at the panel's focus.
    pub(crate) panel: Arc<LensModel>,
    /// The same at the photo's.
    pub(crate) photo: Arc<LensModel>,
}

impl OpticsAtFocus<'_> {
    /// `seen` of `shown` brought to the photo's focus.
    fn refocused(&self, shown: &Frame<Work>, mut seen: Seen) -> Seen {
        let (photo, panel) = (&self.photo, &self.panel);
        let of = |&c: &Channel| {
            let plane = shown.plane(c);
            let mut more = Plane::zeros(plane.size());
            // A channel that is not shown has nothing to refocus.
            if plane.data().iter().any(|&v| v != 0.0) {
                let on_panel = plane.map(|v: f32| v.clamp(0.0, FULL_SCALE));
                let mut at_panel = Plane::zeros(plane.size());
                photo.forward(c, &on_panel, &mut more);
                panel.forward(c, &on_panel, &mut at_panel);
                more.add_scaled(-1.0, &at_panel);
            }
            more
        };
        let more: Vec<Plane> = Channel::ALL.par_iter().map(of).collect();
        for (light, more) in seen.light.planes_mut().iter_mut().zip(&more) {
            light.add_scaled(1.0, more);
        }
        seen
    }
}

impl ForwardConvolution for OpticsAtFocus<'_> {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        let seen = self.inner.forward(shown)?;
        Ok(self.refocused(shown, seen))
    }

    fn pedestal(&mut self, flat: &Frame<Work>) -> Result<Seen, AnyFailure> {
        let seen = self.inner.pedestal(flat)?;
        Ok(self.refocused(flat, seen))
    }

    fn panel_columns(&self) -> Option<&Frame<Work>> {
        self.inner.panel_columns()
    }

    fn captures(&self) -> usize {
        self.inner.captures()
    }

    fn seconds(&self) -> f64 {
        self.inner.seconds()
    }
}
