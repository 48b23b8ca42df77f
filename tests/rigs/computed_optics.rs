//! Forward convolution by a lens model in place of a rig: for tests, and for the paper's comparison
//! with "accurate numerical calculation" (§4.1).

use relens::deconvolution::data_term::TRUSTED;
use relens::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use relens::deconvolution::lens_model::LensModel;
use relens::frame::{Channel, FULL_SCALE, Frame, Size, Work};
use relens::remedy::AnyFailure;

/// Forward convolution FC(L) = K·L, computed from a lens model.
pub(crate) struct ComputedOptics<'a> {
    model: &'a LensModel,
    eight_bit: bool,
    captures: usize,
}

impl<'a> ComputedOptics<'a> {
    /// Optics of `model`. With `eight_bit`, input and output are clipped to 0..255 and rounded to
    /// whole levels.
    pub(crate) fn new(model: &'a LensModel, eight_bit: bool) -> Self {
        ComputedOptics { model, eight_bit, captures: 0 }
    }

    fn level(&self, value: f32) -> f32 {
        if self.eight_bit { value.clamp(0.0, FULL_SCALE).round() } else { value }
    }
}

impl ForwardConvolution for ComputedOptics<'_> {
    fn size(&self) -> Size {
        self.model.canvas()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        self.captures += 1;
        let mut light: Frame<Work> = Frame::zeros(self.size());
        for channel in Channel::ALL {
            let on_panel = shown.plane(channel).map(|v: f32| self.level(v));
            if on_panel.data().iter().any(|&v| v != 0.0) {
                self.model.forward(channel, &on_panel, light.plane_mut(channel));
                light.plane_mut(channel).data_mut().iter_mut().for_each(|v| *v = self.level(*v));
            }
        }
        Ok(Seen { light, trusted: Frame::filled(self.size(), TRUSTED) })
    }

    fn captures(&self) -> usize {
        self.captures
    }

    fn seconds(&self) -> f64 {
        0.0
    }
}
