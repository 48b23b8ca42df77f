//! Captures at the panel's focus, converted to a photo's focus.
//!
//! A capture is y = K_panel L, for the panel does not move. At the photo's focus the capture would
//! have been about y + (K̂_photo − K̂_panel) L by the two measured models; errors common to both
//! models cancel.

use std::sync::Arc;

use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::remedy::AnyFailure;

/// Forward convolution at a photo's focus through a rig at the panel's.
pub(crate) struct OpticsAtFocus<'a> {
    /// The rig.
    pub(crate) inner: &'a mut dyn ForwardConvolution,
    /// The lens model at the panel's focus.
    pub(crate) panel: Arc<LensModel>,
    /// The lens model at the photo's focus.
    pub(crate) photo: Arc<LensModel>,
}

impl OpticsAtFocus<'_> {
    /// Converts the capture `seen` of `shown` to the photo's focus.
    fn refocus(&self, shown: &Frame<Work>, mut seen: Seen) -> Seen {
        let (photo, panel) = (&self.photo, &self.panel);
        let difference = |c: Channel| {
            let plane = shown.plane(c);
            let mut more = Plane::zeros(plane.size());
            // Channels that are not shown are zero.
            if plane.data().iter().any(|&v| v != 0.0) {
                let on_panel = plane.map(|v: f32| v.clamp(0.0, FULL_SCALE));
                let mut at_panel = Plane::zeros(plane.size());
                photo.forward(c, &on_panel, &mut more);
                panel.forward(c, &on_panel, &mut at_panel);
                more.add_scaled(-1.0, &at_panel);
            }
            more
        };
        for (light, more) in seen.light.planes_mut().iter_mut().zip(Channel::each(difference)) {
            light.add_scaled(1.0, &more);
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
        Ok(self.refocus(shown, seen))
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
