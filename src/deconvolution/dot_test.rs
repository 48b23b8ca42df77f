//! Is the light's backward convolution the adjoint of its forward one? ⟨K x, y⟩ = ⟨x, Kᵀ y⟩ with
//! both sides by light.
//!
//! Flip–FC–flip gives Kᵀ only while a patch and its margin hold the blur and the blur does not vary
//! within them (paper Eq. 10), and while light adds up: a patch too small loses light, one too
//! large turns the wrong blur around, and a panel that warms up, a response that is off or light
//! that saturates breaks the sum. All of that shows here, and nothing of the measured lens is asked
//! for but a picture y that x can be seen in, so that both sides are large. A picture that is seen
//! shifted does not show: a shift is a blur like any other, and its flip undoes it.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::backward_convolution::{Sign, backward_convolution};
use super::forward_convolution::ForwardConvolution;
use super::lens_model::LensModel;
use super::patches::{PatchGrid, PatchShape};
use crate::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};
use crate::remedy::AnyFailure;

/// Pictures tried; their spread is the uncertainty.
const PROBES: u64 = 3;
/// Captures of grey that are averaged, for it is subtracted from all others.
const GREYS: usize = 4;
/// Grey around which pictures go up and down, and how far.
const GREY: f32 = 127.5;
const AMPLITUDE: f32 = 80.0;
/// Squares of a probe for each width of the lens's functions: coarse enough that the far light of a
/// blur counts.
const SQUARES_A_FUNCTION: usize = 4;

/// What the dot test found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DotTest {
    /// (⟨x, Kᵀ y⟩ − ⟨K x, y⟩) / ⟨K x, y⟩ in red, green and blue; negative where flip–FC–flip loses
    /// light.
    pub difference: [f64; 3],
    /// Standard error of each.
    pub uncertainty: [f64; 3],
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
                only_inside(y.plane_mut(c), photo);
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
        let difference = found.map(|found| found.iter().sum::<f64>() / probes);
        let uncertainty = Channel::ALL.map(|c| {
            let spread =
                found[c.index()].iter().map(|d| (d - difference[c.index()]).powi(2)).sum::<f64>();
            (spread / (probes - 1.0) / probes).sqrt()
        });
        Ok(DotTest { difference, uncertainty })
    }

    /// The channel with the largest difference beyond twice its uncertainty, with both.
    pub fn worst(&self) -> (Channel, f64, f64) {
        let all =
            Channel::ALL.map(|c| (c, self.difference[c.index()], self.uncertainty[c.index()]));
        let sure = |(_, difference, uncertainty): &(Channel, f64, f64)| {
            difference.abs() - 2.0 * uncertainty
        };
        all.into_iter().fold(all[0], |a, b| if sure(&b) > sure(&a) { b } else { a })
    }
}

/// What is seen of grey, averaged.
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

/// Random squares, each channel with its own, nought where the blur reaches over the photo's
/// border: what happens there is the canvas's matter and no question of patches.
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

/// `plane` with nought outside `photo`, where there are no patches.
fn only_inside(plane: &mut Plane, photo: Rect) {
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

    /// What the test finds of a lens that blurs as wide as `deviation_px`, with patches of so many
    /// pixels.
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
        found.worst().1
    }

    #[test]
    fn patches_that_hold_the_blur_pass_and_smaller_ones_lose_light() {
        assert!(worst(2.0, 24).abs() < 0.005, "{}", worst(2.0, 24));
        assert!(worst(3.0, 4) < -0.1, "{}", worst(3.0, 4));
    }
}
