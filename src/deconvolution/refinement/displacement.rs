//! How far captures as a whole lie aside of where the lens was measured.
//!
//! A panel or a camera that was knocked moves every capture by the same way in all colours. To a
//! lens model that is fitted to a capture this is a change like any other, but nothing that a photo
//! would show: it was taken without the panel. So what a refined lens says of a *photo*, it says
//! moved back.

use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::resample::{Outside, sample};
use crate::frame::{Channel, Plane, Size};

/// How far the functions `after` throw light further than those `before`, (x, y) pixels, mean over
/// field and `channels`.
pub fn moved(before: &LensFunctions, after: &LensFunctions, channels: &[Channel]) -> (f64, f64) {
    let mean = |functions: &LensFunctions| {
        let k = functions.support_px;
        let middle = (k / 2) as f64;
        let (mut sum, mut sx, mut sy) = (0.0f64, 0.0, 0.0);
        for &c in channels {
            for (n, &tap) in functions.taps[c.index()].iter().enumerate() {
                let (x, y) = ((n % k) as f64 - middle, (n / k % k) as f64 - middle);
                let tap = f64::from(tap);
                (sum, sx, sy) = (sum + tap, sx + tap * x, sy + tap * y);
            }
        }
        (sx / sum, sy / sum)
    };
    let (before, after) = (mean(before), mean(after));
    let finite = |v: f64| if v.is_finite() { v } else { 0.0 };
    (finite(after.0 - before.0), finite(after.1 - before.1))
}

/// `functions` that throw light further by (x, y) pixels; what would fall beyond the support is
/// lost.
pub fn shifted(functions: &LensFunctions, (x, y): (f64, f64)) -> LensFunctions {
    let k = functions.support_px;
    let one = |taps: &[f32]| {
        let plane = Plane::from_fn(Size::new(k, k), |u, v| taps[v * k + u]);
        (0..k * k).map(move |n| {
            let (u, v) = ((n % k) as f64 - x, (n / k) as f64 - y);
            sample(&plane, u as f32, v as f32, Outside::Zero)
        })
    };
    let taps = functions
        .taps
        .each_ref()
        .map(|taps| taps.chunks_exact((k * k).max(1)).flat_map(one).collect());
    LensFunctions { taps, ..functions.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bell(aside: f32) -> LensFunctions {
        let light = |n: i32| {
            let (x, y) = ((n % 21 - 10) as f32 - aside, (n / 21 - 10) as f32);
            (-(x * x + y * y) / 8.0).exp() / 25.13
        };
        let taps: Vec<f32> = (0..21 * 21).map(light).collect();
        LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 21,
            taps: [taps.clone(), taps.clone(), taps],
        }
    }

    #[test]
    fn a_shift_is_found_and_taken_back() {
        let (before, after) = (bell(0.0), bell(0.7));
        let (x, y) = moved(&before, &after, &Channel::ALL);
        assert!((x - 0.7).abs() < 1e-3 && y.abs() < 1e-3, "{x} {y}");
        let back = shifted(&after, (-x, -y));
        let apart = back.taps[0]
            .iter()
            .zip(&before.taps[0])
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(apart < 2e-4, "{apart}");
    }
}
