//! A candidate picture with its capture, and the step towards the next candidate.

use super::Problem;
use crate::deconvolution::data_term::MISSING;
use crate::deconvolution::forward_convolution::Seen;
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, FULL_SCALE, Frame, Mosaic, Plane, Work};

/// A picture with its prediction and its capture.
pub(super) struct Candidate {
    pub(super) picture: Frame<Work>,
    pub(super) prediction: Frame<Work>,
    pub(super) seen: Seen,
    /// The defect it was solved with; `None` before the first correction.
    pub(super) defect: Option<Frame<Work>>,
}

impl Candidate {
    /// Moves towards `corrected`, channel by channel, by the share α, at most `longest`, that
    /// brings the photograph nearest to the photo.
    pub(super) fn step_towards(
        &mut self,
        corrected: &Candidate,
        problem: &Problem<'_>,
        longest: f64,
    ) {
        for &c in problem.observation.channels.list() {
            let alpha = best_step(problem, c, &self.seen.light, &corrected.seen.light);
            self.move_channel(c, corrected, alpha.min(longest) as f32, problem.model);
        }
    }

    /// Moves `alpha` of the way to `corrected` in one channel.
    fn move_channel(&mut self, c: Channel, corrected: &Candidate, alpha: f32, model: &LensModel) {
        let towards =
            |plane: &mut Plane, target: &Plane| plane.update(target, |v, t| *v += alpha * (t - *v));
        let picture = self.picture.plane_mut(c);
        towards(picture, corrected.picture.plane(c));
        picture.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
        // Between two pictures the clamp changes nothing.
        match alpha <= 1.0 {
            true => towards(self.prediction.plane_mut(c), corrected.prediction.plane(c)),
            false => model.forward(c, picture, self.prediction.plane_mut(c)),
        }
        towards(self.seen.light.plane_mut(c), corrected.seen.light.plane(c));
        if let Some(defect) = &corrected.defect {
            let none = || Frame::zeros(defect.size());
            towards(self.defect.get_or_insert_with(none).plane_mut(c), defect.plane(c));
        }
        let trusted = corrected.seen.trusted.plane(c);
        self.seen.trusted.plane_mut(c).update(trusted, |own, other| *own = other.min(*own));
    }
}

/// The α ≥ 0 that minimises ‖y + α(y′ − y) − B‖, with the captures' noise subtracted from both
/// sums; 1 where the captures differ by no more than noise.
fn best_step(
    problem: &Problem<'_>,
    channel: Channel,
    seen: &Frame<Work>,
    corrected: &Frame<Work>,
) -> f64 {
    let observation = problem.observation;
    let (mut along, mut square, mut count) = (0.0f64, 0.0f64, 0u32);
    let pairs = seen.plane(channel).data().iter().zip(corrected.plane(channel).data());
    let photo = observation.light.plane(channel).data().iter();
    let photo = photo.zip(observation.trust.plane(channel).data());
    let width = problem.size().width;
    let is_site = |n: usize| {
        let own = |mosaic: Mosaic| mosaic.colour_at(n % width, n / width) == channel;
        problem.capture_mosaic.is_none_or(own)
    };
    for (n, ((&y, &y_corrected), (&b, &trust))) in pairs.zip(photo).enumerate() {
        if trust != MISSING && is_site(n) {
            let step = f64::from(y_corrected - y);
            along += f64::from(b - y) * step;
            square += step * step;
            count += 1;
        }
    }
    let noise = f64::from(problem.capture_noise[channel.index()]).powi(2) * f64::from(count);
    let (along, square) = (along - noise, square - 2.0 * noise);
    // A difference of captures below a tenth of their noise power determines no step.
    if square < 0.1 * noise { 1.0 } else { (along / square).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::data_term::TRUSTED;
    use crate::deconvolution::lens_model::LensFunctions;
    use crate::frame::Size;

    #[test]
    fn the_prediction_of_an_interpolated_picture_is_its_forward_convolution() {
        let size = Size::new(24, 18);
        let tap = vec![0.0, 0.1, 0.0, 0.1, 0.5, 0.2, 0.0, 0.1, 0.0];
        let taps = [tap.clone(), tap.clone(), tap];
        let functions = LensFunctions { rows: 1, columns: 1, support_px: 3, taps };
        let model = LensModel::new(size, 0, &functions).unwrap();
        let green = [Channel::Green];
        let candidate = |of: fn(usize, usize) -> f32, defect: Option<f32>| {
            let picture: Frame<Work> = Frame::from_fn(|_| Plane::from_fn(size, of));
            let prediction = model.seen(&green, &picture);
            let trusted = Frame::filled(size, TRUSTED);
            let seen = Seen { light: prediction.clone(), trusted };
            let defect = defect.map(|level| Frame::filled(size, level));
            Candidate { picture, prediction, seen, defect }
        };
        let corrected =
            candidate(|x, y| if (x / 3 + y / 2) % 2 == 0 { 250.0 } else { 5.0 }, Some(4.0));
        for alpha in [0.25, 1.0, 1.5] {
            let mut now = candidate(|x, y| (7 * x + 3 * y) as f32, None);
            now.move_channel(Channel::Green, &corrected, alpha, &model);
            let picture = now.picture.plane(Channel::Green).data();
            assert!(picture.iter().all(|v| (0.0..=FULL_SCALE).contains(v)), "{alpha}");
            let expected = model.seen(&green, &now.picture);
            let pairs = expected.plane(Channel::Green).data().iter();
            let off = pairs.zip(now.prediction.plane(Channel::Green).data());
            let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-3, "{alpha}: {off}");
            let defect = now.defect.unwrap();
            assert_eq!(defect.plane(Channel::Green).at(3, 3), 4.0 * alpha);
        }
    }
}
