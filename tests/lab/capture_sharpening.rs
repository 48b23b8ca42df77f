//! Sharpening as raw developers do it, after RawTherapee's capture sharpening: Richardson–Lucy
//! steps on luminance with a Gaussian, applied where there is contrast.

use rayon::prelude::*;
use relens::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// Number of Richardson–Lucy steps, RawTherapee's default.
const STEPS: u32 = 20;
/// Weights of red, green and blue in luminance (Rec. 709).
const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// Side of a tile, pixels; the flattest tile sets the contrast threshold. Guess.
const TILE_PX: usize = 32;
/// Contrast from which sharpening is full, over that of the flattest tile. Guess.
const CONTRAST: f32 = 3.0;

/// Sharpens linear `light` with a Gaussian of standard deviation `sigma_px`.
pub(crate) fn sharpen(light: &Frame<Work>, sigma_px: f32) -> Frame<Work> {
    let mut luminance = Plane::zeros(light.size());
    for (c, weight) in Channel::ALL.into_iter().zip(WEIGHTS) {
        luminance.add_scaled(weight, light.plane(c));
    }
    let luminance = luminance.map(|v: f32| v.max(0.1));
    let taps = gaussian(sigma_px);
    let mut sharp = luminance.clone();
    for _ in 0..STEPS {
        let predicted = blurred(&sharp, &taps);
        let ratio = zipped(&luminance, &predicted, |data, predicted| data / predicted.max(0.1));
        let factor = blurred(&ratio, &taps);
        sharp = zipped(&sharp, &factor, |value, factor| value * factor);
    }
    let mask = contrast_mask(&luminance);
    let mixed = zipped(&sharp, &mask, |sharp, mask| sharp * mask);
    let kept = zipped(&luminance, &mask, |plain, mask| plain * (1.0 - mask));
    let wanted = zipped(&mixed, &kept, |a, b| a + b);
    let factor = zipped(&wanted, &luminance, |wanted, plain| wanted / plain);
    Frame::from_fn(|c| {
        zipped(light.plane(c), &factor, |value, factor| (value * factor).clamp(0.0, FULL_SCALE))
    })
}

/// Weights 0..1 of sharpening: contrast over that of the flattest tile, smoothed.
fn contrast_mask(luminance: &Plane) -> Plane {
    let size = luminance.size();
    let contrast: Plane = Plane::from_fn(size, |x, y| {
        let (right, below) = ((x + 1).min(size.width - 1), (y + 1).min(size.height - 1));
        let across = luminance.at(right, y) - luminance.at(x.saturating_sub(1), y);
        let down = luminance.at(x, below) - luminance.at(x, y.saturating_sub(1));
        // Noise grows with the root of light.
        across.hypot(down) / luminance.at(x, y).max(1.0).sqrt()
    });
    let mut flattest = f32::INFINITY;
    for top in (0..size.height).step_by(TILE_PX) {
        for left in (0..size.width).step_by(TILE_PX) {
            let (right, bottom) =
                ((left + TILE_PX).min(size.width), (top + TILE_PX).min(size.height));
            let sum: f32 =
                (top..bottom).map(|y| (left..right).map(|x| contrast.at(x, y)).sum::<f32>()).sum();
            flattest = flattest.min(sum / ((right - left) * (bottom - top)) as f32);
        }
    }
    let full = CONTRAST * flattest.max(1e-3);
    blurred(&contrast.map(|v: f32| (v / full).clamp(0.0, 1.0)), &gaussian(2.0))
}

fn zipped(a: &Plane, b: &Plane, of: impl Fn(f32, f32) -> f32) -> Plane {
    let mut made = a.clone();
    made.data_mut().iter_mut().zip(b.data()).for_each(|(a, &b)| *a = of(*a, b));
    made
}

fn gaussian(sigma_px: f32) -> Vec<f32> {
    let reach = (3.0 * sigma_px).ceil() as i32;
    let taps: Vec<f32> =
        (-reach..=reach).map(|n| (-0.5 * (n as f32 / sigma_px).powi(2)).exp()).collect();
    let sum: f32 = taps.iter().sum();
    taps.into_iter().map(|tap| tap / sum).collect()
}

/// `plane` blurred by `taps` along rows and columns, edges repeated.
fn blurred(plane: &Plane, taps: &[f32]) -> Plane {
    let (size, reach) = (plane.size(), taps.len() / 2);
    let mut rows = plane.clone();
    rows.data_mut().par_chunks_mut(size.width).enumerate().for_each(|(y, row)| {
        let source = &plane.data()[y * size.width..][..size.width];
        for (x, value) in row.iter_mut().enumerate() {
            let at = |n: usize| source[(x + n).saturating_sub(reach).min(size.width - 1)];
            *value = taps.iter().enumerate().map(|(n, tap)| tap * at(n)).sum();
        }
    });
    let mut both = Plane::zeros(size);
    both.data_mut().par_chunks_mut(size.width).enumerate().for_each(|(y, row)| {
        for (n, tap) in taps.iter().enumerate() {
            let from = (y + n).saturating_sub(reach).min(size.height - 1);
            let source = &rows.data()[from * size.width..][..size.width];
            row.iter_mut().zip(source).for_each(|(value, from)| *value += tap * from);
        }
    });
    both
}

#[cfg(test)]
mod tests {
    use super::*;
    use relens::frame::Size;

    #[test]
    fn an_edge_blurred_by_the_gaussian_becomes_steeper_and_flats_stay() {
        let size = Size::new(96, 64);
        let edge: Plane = Plane::from_fn(size, |x, _| if x < 48 { 40.0 } else { 160.0 });
        let soft = blurred(&edge, &gaussian(1.5));
        let found = sharpen(&Frame::from_fn(|_| soft.clone()), 1.5);
        let found = found.plane(Channel::Green);
        let step = |plane: &Plane| plane.at(48, 32) - plane.at(47, 32);
        assert!(step(found) > 1.4 * step(&soft), "{} {}", step(found), step(&soft));
        assert!((found.at(4, 32) - 40.0).abs() < 0.1);
    }
}
