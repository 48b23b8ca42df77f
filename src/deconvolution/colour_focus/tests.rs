//! Shares found in photos through a known lens, and bounds on its norms.

use std::sync::Arc;

use super::*;
use crate::deconvolution::example_lens::{SIZE, gaussians, lens, photo};
use crate::deconvolution::observation::Raw;
use crate::frame::Mosaic;

/// The measured lens: red blurred most, green least.
fn measured() -> LensFunctions {
    gaussians([2.0, 1.2, 1.7])
}

/// The shares found in a photo through the measured lens moved by `shares`, of raw sites behind
/// `mosaic`, if any.
fn found(shares: ColourFocus, mosaic: Option<Mosaic>) -> ColourFocus {
    // Finer dots than what the sites of one colour resolve would alias.
    let dot_px = if mosaic.is_some() { 6 } else { 3 };
    let mut photo = photo(&lens(&shares.functions(&measured())), dot_px, Channels::Colour);
    let mut light = photo.light.clone();
    if let Some(mosaic) = mosaic {
        photo.sampling = Arc::new(Raw { mosaic });
        light = Frame::from_fn(|c| mosaic.interpolated_finely(c, photo.light.plane(c)));
    }
    ColourFocus::of(&lens(&measured()), &photo, &light).unwrap()
}

#[test]
fn shares_are_found_in_pixels_and_in_sites() {
    for (red_green, blue) in [(0.0, 0.0), (0.2, 0.1), (-0.15, 0.2), (0.1, -0.1)] {
        for (mosaic, precision) in [(None, 0.04), (Some(Mosaic::Grbg), 0.08)] {
            let ColourFocus { red_green: s, blue: t } =
                found(ColourFocus { red_green, blue }, mosaic);
            assert!((s - red_green).abs() < precision, "{mosaic:?}: {s} for {red_green}");
            assert!((t - blue).abs() < precision, "{mosaic:?}: {t} for {blue}");
        }
    }
}

#[test]
fn grey_photos_and_channels_of_different_things_show_nothing() {
    let model = lens(&measured());
    let grey = photo(&model, 3, Channels::Green);
    assert_eq!(ColourFocus::of(&model, &grey, &grey.light), None);
    let mut other = photo(&model, 3, Channels::Colour);
    for (n, plane) in other.light.planes_mut().iter_mut().enumerate() {
        let turned = Plane::from_fn(plane.size(), |x, y| {
            plane.at((x + 17 * n) % plane.width(), (y + 29 * n) % plane.height())
        });
        *plane = turned;
    }
    assert_eq!(ColourFocus::of(&model, &other, &other.light), None);
}

#[test]
fn a_stamp_in_a_corner_hardly_counts() {
    let shares = ColourFocus { red_green: -0.15, blue: 0.2 };
    let mut stamped = photo(&lens(&shares.functions(&measured())), 3, Channels::Colour);
    let Rect { x: left, y: top, .. } = stamped.rect;
    for plane in stamped.light.planes_mut() {
        for (x, y) in (0..SIZE.width / 4).flat_map(|x| (0..SIZE.height / 4).map(move |y| (x, y))) {
            let ink = if (x / 2 + y / 3).is_multiple_of(2) { 250.0 } else { 5.0 };
            plane.set(left + x, top + y, ink);
        }
    }
    let ColourFocus { red_green, blue } =
        ColourFocus::of(&lens(&measured()), &stamped, &stamped.light).unwrap();
    assert!((red_green - shares.red_green).abs() < 0.06, "{red_green}");
    assert!((blue - shares.blue).abs() < 0.06, "{blue}");
}

#[test]
fn norms_are_within_their_bounds() {
    let norms = |functions: &LensFunctions| {
        let model = lens(functions);
        Channel::ALL.map(|c| LevelNorms::measure(&model, c, 3, 16, 1))
    };
    let of_measured = norms(&measured());
    for (red_green, blue) in [(0.2, 0.4), (-0.2, -0.2)] {
        let shares = ColourFocus { red_green, blue };
        let bounds = shares.level_norms(&of_measured);
        let after = norms(&shares.functions(&measured()));
        for (bound, norm) in bounds.iter().zip(&after) {
            let within = (0..=3).all(|level| norm.at(level) <= 1.001 * bound.at(level));
            assert!(within, "{bound:?} {norm:?}");
        }
    }
    let squared = ColourFocus { red_green: 0.1, blue: -0.1 }.norms_squared(&[0.9, 1.0, 0.8]);
    assert_eq!(squared.map(|v| (1000.0 * v).round()), [1000.0, 1000.0, 968.0]);
}
