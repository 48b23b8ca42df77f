//! Focus shares estimated from photos through a known lens, and bounds on the lens's norms.

use std::sync::Arc;

use super::*;
use crate::deconvolution::example_lens::{SIZE, gaussians, lens, photo};
use crate::deconvolution::observation::Raw;
use crate::frame::{Mosaic, Rect};

/// The measured lens: red blurred most, green least.
fn measured() -> LensFunctions {
    gaussians([2.0, 1.2, 1.7])
}

/// Shares estimated from `photo` with the measured `functions`.
fn found(functions: &LensFunctions, photo: &Observation) -> Option<ColourFocus> {
    ColourFocus::of(&lens(functions), photo)
}

/// Changes of focus of the scenes in the photos.
const FOCUSES: [f32; 4] = [0.0, -0.2, 0.15, 0.4];

/// Largest difference of the shares of red.
fn off(found: ColourFocus, taken: ColourFocus) -> f32 {
    (found.red - taken.red).abs()
}

#[test]
fn the_focus_is_found_to_a_few_hundredths() {
    for taken in FOCUSES.map(|nearer| ColourFocus::at(1.0, nearer)) {
        let photo = photo(&lens(&taken.functions(&measured())), 3, Channels::Colour);
        let found = found(&measured(), &photo).unwrap();
        assert!(off(found, taken) < 0.04, "{found:?} for {taken:?}");
    }
}

#[test]
fn raw_sites_show_what_pixels_show() {
    // The sites of one colour are two pixels apart: a narrower lens would alias.
    let wide = gaussians([2.6, 1.8, 2.3]);
    for taken in FOCUSES.map(|nearer| ColourFocus::at(1.0, nearer)) {
        let mut photo = photo(&lens(&taken.functions(&wide)), 5, Channels::Colour);
        let by_pixels = found(&wide, &photo).unwrap();
        photo.sampling = Arc::new(Raw { mosaic: Mosaic::Grbg });
        let by_sites = found(&wide, &photo).unwrap();
        assert!(off(by_sites, by_pixels) < 0.05, "{by_sites:?} {by_pixels:?}");
    }
}

#[test]
fn grey_photos_and_channels_of_different_things_show_nothing() {
    let model = lens(&measured());
    let grey = photo(&model, 3, Channels::Green);
    assert_eq!(found(&measured(), &grey), None);
    let mut other = photo(&model, 3, Channels::Colour);
    for (n, plane) in other.light.planes_mut().iter_mut().enumerate() {
        let turned = Plane::from_fn(plane.size(), |x, y| {
            plane.at((x + 17 * n) % plane.width(), (y + 29 * n) % plane.height())
        });
        *plane = turned;
    }
    assert_eq!(found(&measured(), &other), None);
}

#[test]
fn a_stamp_in_a_corner_hardly_counts() {
    let taken = ColourFocus::at(1.0, 0.25);
    let mut stamped = photo(&lens(&taken.functions(&measured())), 3, Channels::Colour);
    let Rect { x: left, y: top, .. } = stamped.rect;
    for plane in stamped.light.planes_mut() {
        for (x, y) in (0..SIZE.width / 4).flat_map(|x| (0..SIZE.height / 4).map(move |y| (x, y))) {
            let ink = if (x / 2 + y / 3).is_multiple_of(2) { 250.0 } else { 5.0 };
            plane.set(left + x, top + y, ink);
        }
    }
    let found = found(&measured(), &stamped).unwrap();
    assert!(off(found, taken) < 0.06, "{found:?} for {taken:?}");
}

#[test]
fn norms_are_within_their_bounds() {
    let norms = |functions: &LensFunctions| {
        let model = lens(functions);
        Channel::ALL.map(|c| LevelNorms::measure(&model, c, 3, 16, 1))
    };
    let of_measured = norms(&measured());
    let nearer_and_farther = [
        ColourFocus { red: -0.2, green: 0.3, blue: 0.4 },
        ColourFocus { red: 0.4, green: 0.0, blue: -0.2 },
    ];
    for shares in nearer_and_farther {
        let bounds = shares.level_norms(&of_measured);
        let after = norms(&shares.functions(&measured()));
        for (bound, norm) in bounds.iter().zip(&after) {
            let within = (0..=3).all(|level| norm.at(level) <= 1.001 * bound.at(level));
            assert!(within, "{bound:?} {norm:?}");
        }
    }
    let squared = ColourFocus { red: 0.1, green: 0.0, blue: -0.1 }.norms_squared(&[0.9, 1.0, 0.8]);
    assert_eq!(squared.map(|v| (1000.0 * v).round()), [1000.0, 1000.0, 968.0]);
}

#[test]
fn broad_light_is_mixed_and_not_extrapolated() {
    let halo = |radius_px: f32, share: f32| Halo { radius_px, share };
    let measured = [vec![halo(10.0, 0.02)], vec![halo(10.0, 0.03)], vec![halo(20.0, 0.04)]];
    let near = |found: &[Halo], wanted: &[Halo]| {
        let pairs = found.iter().zip(wanted);
        found.len() == wanted.len()
            && pairs.map(|(a, b)| (a.share - b.share).abs()).all(|off| off < 1e-6)
    };
    let [red, green, blue] = ColourFocus { red: 0.5, green: 0.1, blue: 0.25 }.halos(&measured);
    assert!(near(&red, &[halo(10.0, 0.025)]), "{red:?}");
    assert_eq!(green, measured[1]);
    assert!(near(&blue, &[halo(20.0, 0.03), halo(10.0, 0.0075)]), "{blue:?}");
    let beyond_red = ColourFocus { red: -0.1, green: 0.0, blue: 0.0 };
    assert_eq!(beyond_red.halos(&measured)[0], measured[0]);
}

#[test]
fn the_panel_s_own_light_is_recognised() {
    let in_panel_light = photo(&lens(&measured()), 3, Channels::Colour);
    let ColourFocus { red, green, blue } = found(&measured(), &in_panel_light).unwrap();
    assert!(red.abs().max(green.abs()).max(blue.abs()) < 0.05, "{red} {green} {blue}");
}
