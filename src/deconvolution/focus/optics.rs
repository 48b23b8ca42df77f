//! Captures at the panel's focus, converted to a photo's focus.
//!
//! A capture is y = K_panel L, for the panel does not move. At the photo's focus the capture would
//! have been about y + (K̂_photo − K̂_panel) L by the two measured models; errors common to both
//! models cancel.

use std::sync::Arc;

use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::panel_beat::ColumnWave;
use crate::frame::{Channel, FULL_SCALE, Frame, Size, Work};
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

/// The channels of `shown` that are not black.
fn shown_channels(shown: &Frame<Work>) -> Vec<Channel> {
    let is_shown = |&c: &Channel| shown.plane(c).data().iter().any(|&v| v != 0.0);
    Channel::ALL.into_iter().filter(is_shown).collect()
}

impl OpticsAtFocus<'_> {
    /// Converts the capture `seen` of `shown` to the photo's focus, where its model predicts
    /// `at_photo`.
    fn refocus(&self, shown: &Frame<Work>, at_photo: &Frame<Work>, mut seen: Seen) -> Seen {
        let at_panel = self.panel.seen(&shown_channels(shown), shown);
        for c in Channel::ALL {
            let light = seen.light.plane_mut(c);
            light.add_scaled(1.0, at_photo.plane(c));
            light.add_scaled(-1.0, at_panel.plane(c));
        }
        seen
    }
}

impl ForwardConvolution for OpticsAtFocus<'_> {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        let clamp = |v: f32| v.clamp(0.0, FULL_SCALE);
        let shown = Frame::from_fn(|c| shown.plane(c).map(clamp));
        let at_photo = self.photo.seen(&shown_channels(&shown), &shown);
        self.forward_predicted(&shown, &at_photo)
    }

    fn forward_predicted(
        &mut self,
        shown: &Frame<Work>,
        predicted: &Frame<Work>,
    ) -> Result<Seen, AnyFailure> {
        let seen = self.inner.forward(shown)?;
        Ok(self.refocus(shown, predicted, seen))
    }

    fn column_wave(&self) -> Option<&ColumnWave> {
        self.inner.column_wave()
    }

    fn captures(&self) -> usize {
        self.inner.captures()
    }

    fn seconds(&self) -> f64 {
        self.inner.seconds()
    }
}
