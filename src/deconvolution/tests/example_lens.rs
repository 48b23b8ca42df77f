//! A lens of Gaussian point spread functions, and photos through it, for tests.

use std::sync::Arc;

use super::data_term::{MISSING, NOISE_MIN, TRUSTED, place, place_with_edges};
use super::lens_model::{LensFunctions, LensModel};
use super::observation::{Developed, Observation};
use crate::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};

/// Size of photos.
pub(super) const SIZE: Size = Size { width: 90, height: 70 };
/// Margin of the photos' canvas.
const MARGIN_PX: usize = 8;

/// One Gaussian function per channel for the whole field; `sigmas` are in pixels.
pub(super) fn gaussians(sigmas: [f32; 3]) -> LensFunctions {
    let taps = sigmas.map(|sigma| {
        let bell = (0..225).map(|t| {
            let (x, y) = ((t % 15) as f32 - 7.0, (t / 15) as f32 - 7.0);
            (-(x * x + y * y) / (2.0 * sigma * sigma)).exp()
        });
        let bell: Vec<f32> = bell.collect();
        let total: f32 = bell.iter().sum();
        bell.iter().map(|t| t / total).collect()
    });
    LensFunctions { rows: 1, columns: 1, support_px: 15, taps }
}

/// The model of `functions` on the canvas of photos.
pub(super) fn lens(functions: &LensFunctions) -> LensModel {
    LensModel::new(SIZE, MARGIN_PX, functions).unwrap()
}

/// Tinted dots, `dot_px` wide, on the canvas of `lens`.
pub(super) fn scene(lens: &LensModel, dot_px: usize) -> Frame<Work> {
    let dots: Plane = Plane::from_fn(lens.canvas(), |x, y| {
        let (x, y) = (x / dot_px, y / dot_px);
        30.0 + 150.0 * f32::from(u8::from((7 * x + 5 * y + x * y) % 4 == 0))
    });
    Frame::from_fn(|c| {
        let tint = 1.0 - 0.2 * c.index() as f32;
        dots.map(|v: f32| tint * v)
    })
}

/// A photo of the [`scene`] through `lens`, as codes of eight bits.
pub(super) fn photo(lens: &LensModel, dot_px: usize, channels: Channels) -> Observation {
    let scene = scene(lens, dot_px);
    let rect = Rect { x: MARGIN_PX, y: MARGIN_PX, size: SIZE };
    let light = lens.seen(&Channel::ALL, &scene).crop(rect);
    let canvas = lens.canvas();
    Observation {
        light: Frame::from_fn(|c| {
            place_with_edges(&light.plane(c).map(|v: f32| v.round()), canvas, rect)
        }),
        trust: Frame::from_fn(|_| {
            place(&Plane::from_fn(SIZE, |_, _| TRUSTED), canvas, rect, MISSING)
        }),
        rect,
        channels,
        noise: [NOISE_MIN; 3],
        dark_light: [f32::INFINITY; 3],
        sampling: Arc::new(Developed { interpolated: None, has_blocks: false }),
    }
}
