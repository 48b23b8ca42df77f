//! Checks of a lens model: its dominant picture, and a held-out capture.

use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, Plane};

/// Largest squared singular value of the model in `channel` and its singular picture (length 1), by
/// `rounds` of the power method from grey.
pub fn dominant(model: &LensModel, channel: Channel, rounds: usize) -> (f32, Plane) {
    let mut picture = Plane::filled(model.canvas(), 1.0);
    let mut seen = Plane::zeros(model.canvas());
    let mut largest = 0.0;
    for round in 0..=rounds {
        let length = picture.dot(&picture).sqrt().max(1e-30) as f32;
        picture.data_mut().iter_mut().for_each(|v| *v /= length);
        model.forward(channel, &picture, &mut seen);
        largest = seen.dot(&seen);
        if round < rounds {
            model.adjoint(channel, &seen, &mut picture);
        }
    }
    (largest as f32, picture)
}

/// RMS of `seen` − `predicted` over the trusted pixels of the photo.
pub fn misfit(predicted: &Plane, seen: &Plane, trusted: &Plane<u8>, margin_px: usize) -> f32 {
    let (mut squared, mut count) = (0.0f64, 0usize);
    let canvas = predicted.size();
    for y in margin_px..canvas.height - margin_px {
        for x in margin_px..canvas.width - margin_px {
            if trusted.at(x, y) > 0 {
                squared += f64::from(seen.at(x, y) - predicted.at(x, y)).powi(2);
                count += 1;
            }
        }
    }
    (squared / count.max(1) as f64).sqrt() as f32
}
