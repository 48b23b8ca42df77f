//! Dot test of the adjoint by captures: whether ⟨K x, y⟩ = ⟨x, Kᵀ y⟩ for forward convolution and
//! flip–FC–flip on the rig.
//!
//! Flip–FC–flip is Kᵀ only while a patch and its margin hold the blur, the blur does not vary
//! within them (paper Eq. 10), and light is linear. The test fails for patches too small (light is
//! lost) or too large (the wrong blur is flipped), for drift of the panel, a wrong response and
//! saturation. The measured lens serves only to choose a y correlated with K x. A constant shift
//! passes: it is a blur like any other.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::backward_convolution::{Sign, backward_convolution};
use super::forward_convolution::ForwardConvolution;
use super::lens_model::LensModel;
use super::patches::{PatchGrid, PatchShape};
use crate::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};
use crate::remedy::AnyFailure;

/// Number of random pictures; their spread gives the uncertainty.
const PROBES: u64 = 3;
/// Captures of grey averaged, for their mean is subtracted from all others.
const GREYS: usize = 4;
/// Mean level of the pictures shown.
const GREY: f32 = 127.5;
/// Amplitude of a probe about grey.
const AMPLITUDE: f32 = 80.0;
/// Squares of a probe per width of the lens functions: coarse enough for the tails of the blur.
const SQUARES_A_FUNCTION: usize = 4;

/// Result of the dot test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DotTest {
    /// Red, green and blue.
    pub channels: [Mismatch; 3],
}

/// Mismatch of one channel's adjoint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mismatch {
    /// The channel.
    pub channel: Channel,
    /// (⟨x, Kᵀ y⟩ − ⟨K x, y⟩) / ⟨K x, y⟩; negative where flip–FC–flip loses light.
    pub difference: f64,
    /// Its standard error.
    pub uncertainty: f64,
}

impl DotTest {
    /// Tests `optics` with patches of `shape` over `photo`, a rectangle of the canvas of `model`.
    ///
    /// # Errors
    /// The failure of the capture that failed.
    pub fn measure(
        optics: &mut dyn ForwardConvolution,
        model: &LensModel,
        photo: Rect,
        shape: PatchShape,
    ) -> Result<DotTest, AnyFailure> {
        let grid = PatchGrid::new(optics.size(), photo, shape);
        let grey = grey(optics)?;
        let mut found = [[0.0; PROBES as usize]; 3];
        for probe in 0..PROBES {
            let x = self::probe(optics.size(), photo, model.functions().support_px, probe);
            let mut y: Frame<Work> = Frame::zeros(optics.size());
            for c in Channel::ALL {
                model.forward(c, x.plane(c), y.plane_mut(c));
                clear_outside(y.plane_mut(c), photo);
            }
            let mut forward =
                optics.forward(&Frame::from_fn(|c| x.plane(c).map(|v: f32| GREY + v)))?.light;
            Channel::ALL.iter().for_each(|&c| forward.plane_mut(c).add_scaled(-1.0, grey.plane(c)));
            let sign = Sign::Pedestal { level: GREY, gain: 1.0 };
            let back =
                backward_convolution(optics, &y, &grid, Channels::Colour, sign, Some(&grey))?;
            for c in Channel::ALL {
                let by_forward = forward.plane(c).dot(y.plane(c));
                let by_backward = back.plane(c).dot(x.plane(c));
                found[c.index()][probe as usize] = by_backward / by_forward - 1.0;
            }
        }
        let probes = PROBES as f64;
        let channels = Channel::ALL.map(|channel| {
            let found = &found[channel.index()];
            let difference = found.iter().sum::<f64>() / probes;
            let spread: f64 = found.iter().map(|d| (d - difference).powi(2)).sum();
            let uncertainty = (spread / (probes - 1.0) / probes).sqrt();
            Mismatch { channel, difference, uncertainty }
        });
        Ok(DotTest { channels })
    }

    /// The channel with the largest [significant](Mismatch::significant) mismatch.
    pub fn worst(&self) -> Mismatch {
        let worse =
            |a: Mismatch, b: Mismatch| if b.significant() > a.significant() { b } else { a };
        self.channels.into_iter().fold(self.channels[0], worse)
    }
}

impl Mismatch {
    /// Size of the difference beyond two standard errors.
    pub fn significant(&self) -> f64 {
        self.difference.abs() - 2.0 * self.uncertainty
    }
}

/// The mean of [`GREYS`] captures of grey.
fn grey(optics: &mut dyn ForwardConvolution) -> Result<Frame<Work>, AnyFailure> {
    let shown = Frame::filled(optics.size(), GREY);
    let mut mean: Frame<Work> = Frame::zeros(optics.size());
    for _ in 0..GREYS {
        let seen = optics.forward(&shown)?.light;
        Channel::ALL
            .iter()
            .for_each(|&c| mean.plane_mut(c).add_scaled(1.0 / GREYS as f32, seen.plane(c)));
    }
    Ok(mean)
}

/// Random squares, independent in each channel, 0 where the blur crosses the photo's border, which
/// patches do not cover.
fn probe(canvas: Size, photo: Rect, support_px: usize, seed: u64) -> Frame<Work> {
    let (side, rim) = ((support_px / SQUARES_A_FUNCTION).max(1), support_px / 2);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    Frame::from_fn(|_| {
        let coarse = Size::new(canvas.width.div_ceil(side), canvas.height.div_ceil(side));
        let signs =
            Plane::from_fn(
                coarse,
                |_, _| if random.random::<bool>() { AMPLITUDE } else { -AMPLITUDE },
            );
        Plane::from_fn(canvas, |x, y| {
            let inside = |at: usize, from: usize, length: usize| {
                (from + rim..(from + length).saturating_sub(rim)).contains(&at)
            };
            let lit = inside(x, photo.x, photo.size.width) && inside(y, photo.y, photo.size.height);
            if lit { signs.at(x / side, y / side) } else { 0.0 }
        })
    })
}

/// Zeroes `plane` outside `photo`, where there are no patches.
fn clear_outside(plane: &mut Plane, photo: Rect) {
    let inner = plane.crop(photo);
    plane.data_mut().fill(0.0);
    for y in 0..photo.size.height {
        plane.row_mut(photo.y + y)[photo.x..][..photo.size.width].copy_from_slice(inner.row(y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::computed_optics::ComputedOptics;
    use crate::deconvolution::lens_model::LensFunctions;
    use crate::deconvolution::patches::PARITY_CLASSES;

    /// Mismatch of a Gaussian lens of `deviation_px` with patches of `patch_px`.
    fn worst(deviation_px: f32, patch_px: usize) -> f64 {
        let bell = |t: i32| {
            let (x, y) = (t % 17 - 8, t / 17 - 8);
            (-((x * x + y * y) as f32) / (2.0 * deviation_px * deviation_px)).exp()
        };
        let taps: Vec<f32> = (0..17 * 17).map(bell).collect();
        let taps: Vec<f32> = taps.iter().map(|t| t / taps.iter().sum::<f32>()).collect();
        let functions = LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 17,
            taps: [taps.clone(), taps.clone(), taps],
        };
        let photo = Size::new(128, 96);
        let model = LensModel::new(photo, 8, &functions).unwrap();
        let shape = PatchShape { patch_px, margin_px: 8 };
        let mut optics = ComputedOptics::new(&model, true);
        let found =
            DotTest::measure(&mut optics, &model, Rect { x: 8, y: 8, size: photo }, shape).unwrap();
        assert_eq!(optics.captures(), GREYS + PROBES as usize * (1 + PARITY_CLASSES));
        found.worst().difference
    }

    #[test]
    fn patches_larger_than_the_blur_pass_and_smaller_ones_lose_light() {
        assert!(worst(2.0, 24).abs() < 0.005, "{}", worst(2.0, 24));
        assert!(worst(3.0, 4) < -0.1, "{}", worst(3.0, 4));
    }
}
