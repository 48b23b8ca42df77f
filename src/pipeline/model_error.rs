//! Error of the lens model: the capture of a chart held out of its fits, minus the prediction, as a
//! share of how much the lens changes that chart.

use std::sync::OnceLock;

use crate::calibration::lens_blur::misfit;
use crate::calibration::{Calibration, Noise};
use crate::deconvolution::data_term::place_with_edges;
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, Plane, Rect, once};
use crate::patterns;

/// Error of the lens model per channel; the shares are computed when first needed.
#[derive(Debug)]
pub(super) struct ModelError {
    /// RMS of the held-out capture minus its prediction, grey levels.
    held_out: [f32; 3],
    noise: [Noise; 3],
    shares: OnceLock<[f32; 3]>,
}

impl ModelError {
    pub(super) fn of(calibration: &Calibration) -> ModelError {
        ModelError {
            held_out: calibration.operator_error,
            noise: calibration.noise,
            shares: OnceLock::new(),
        }
    }

    /// Error of `model` per channel, as a share of how much the lens changes the chart; `photo` is
    /// the photo's rectangle on the canvas.
    pub(super) fn shares(&self, model: &LensModel, photo: Rect) -> &[f32; 3] {
        once(&self.shares, || {
            let chart = place_with_edges(&patterns::chart(photo.size), model.canvas(), photo);
            let trusted = Plane::filled(chart.size(), 1);
            let seen = |c: Channel, of: &Plane| {
                let mut seen = Plane::zeros(of.size());
                model.forward(c, of, &mut seen);
                seen
            };
            Channel::ALL.map(|c| {
                let once = seen(c, &chart);
                let changed = misfit(&seen(c, &once), &once, &trusted, photo.x.min(photo.y));
                let noise = self.noise[c.index()].sigma(once.mean() as f32);
                // Most photos do not need these spectra: they have a lens of their own.
                model.release_spectra(c);
                let missed = (self.held_out[c.index()].powi(2) - noise.powi(2)).max(0.0).sqrt();
                missed / changed.max(f32::MIN_POSITIVE)
            })
        })
    }
}
