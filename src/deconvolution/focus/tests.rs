//! Estimates from a photo's spectra, with a synthetic lens of longitudinal chromatic aberration.

use super::*;
use crate::deconvolution::data_term::{SATURATED, TRUSTED};
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channels, Frame, Mosaic, Plane, Rect, Size, Work};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

const SIZE: Size = Size::new(192, 160);
/// Standard deviation of the noise, grey levels.
const NOISE: f32 = 0.6;

/// Gaussian functions at the focus `offset`; each channel is in focus at another offset.
fn gaussians(offset: f32) -> LensFunctions {
    let (rows, columns, support_px) = (3, 4, 15);
    let of = |channel: Channel| {
        let apart = [0.02, 0.0, -0.02][channel.index()];
        let sigma = 0.9 + 28.0 * (offset - apart).abs();
        let one: Vec<f32> = (0..225)
            .map(|n| {
                let (x, y) = ((n % 15) as f32 - 7.0, (n / 15) as f32 - 7.0);
                (-(x * x + y * y) / (2.0 * sigma * sigma)).exp()
            })
            .collect();
        let sum: f32 = one.iter().sum();
        (0..rows * columns).flat_map(|_| one.iter().map(move |v| v / sum)).collect()
    };
    LensFunctions { rows, columns, support_px, taps: Channel::ALL.map(of) }
}

fn gaussian(random: &mut Xoshiro256PlusPlus) -> f32 {
    (0..12).map(|_| random.random::<f32>()).sum::<f32>() - 6.0
}

/// Discs of flat light with a power spectrum near |f|^−3.
fn scene(seed: u64) -> Frame<Work> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut light: Frame<Work> = Frame::filled(SIZE, 110.0);
    for _ in 0..900 {
        let side = 2.0 + 40.0 * random.random::<f32>().powi(3);
        let (x, y) = (random.random::<f32>() * 192.0, random.random::<f32>() * 160.0);
        let levels = [0, 1, 2].map(|_| 20.0 + 190.0 * random.random::<f32>());
        for v in 0..SIZE.height {
            for u in 0..SIZE.width {
                if (u as f32 - x).hypot(v as f32 - y) < side / 2.0 {
                    let planes = light.planes_mut().iter_mut();
                    planes.zip(levels).for_each(|(plane, level)| plane.set(u, v, level));
                }
            }
        }
    }
    light
}

/// `scene` photographed at `offset`, with noise.
fn photo(scene: &Frame<Work>, offset: f32, seed: u64) -> Frame<Work> {
    taken(scene, &gaussians(offset), NOISE, seed)
}

/// `scene` photographed through a lens of `functions`, with noise σ of `noise` grey levels.
fn taken(scene: &Frame<Work>, functions: &LensFunctions, noise: f32, seed: u64) -> Frame<Work> {
    let model = LensModel::new(SIZE, 0, functions).unwrap();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    Frame::from_fn(|c| {
        let mut seen = Plane::zeros(SIZE);
        model.forward(c, scene.plane(c), &mut seen);
        seen.data_mut().iter_mut().for_each(|v| *v += noise * gaussian(&mut random));
        seen
    })
}

/// Results of `estimate` for all pixels of `photo` and for a mosaic's sites.
fn both<T>(photo: &Frame<Work>, estimate: impl Fn(&FocusData<'_>) -> T) -> [T; 2] {
    [None, Some(Mosaic::Rggb)].map(|mosaic| {
        let valid = |c, x, y| mosaic.is_none_or(|of: Mosaic| of.colour_at(x, y) == c);
        let trust =
            &Frame::from_fn(|c| Plane::from_fn(SIZE, |x, y| u8::from(valid(c, x, y)) * TRUSTED));
        let rect = Rect { x: 0, y: 0, size: SIZE };
        let [at_black, per_level] = POWERS;
        let noise = &|_, light: f32| (at_black + per_level * light).sqrt();
        let channels = Channels::Colour;
        estimate(&FocusData { photo, trust, rect, field: rect, mosaic, channels, noise })
    })
}

/// The lens measured from −0.08 to +0.08 dioptres.
fn members() -> Vec<(f32, LensFunctions)> {
    (-4i8..=4).map(|n| 0.02 * f32::from(n)).map(|offset| (offset, gaussians(offset))).collect()
}

/// The focus of a photo estimated with a series of `members`.
fn found_by(
    members: &[(f32, LensFunctions)],
    photo: &Frame<Work>,
    trust: &Frame<Work, u8>,
    mosaic: Option<Mosaic>,
) -> Option<FoundFocus> {
    let series = FocusSeries::new(members.iter().map(|(o, f)| (*o, f)).collect()).unwrap();
    let (rect, channels) = (Rect { x: 0, y: 0, size: SIZE }, Channels::Colour);
    let noise = &|_, _| NOISE;
    series.find(&FocusData { photo, trust, rect, field: rect, mosaic, channels, noise })
}

fn found(photo: &Frame<Work>) -> Option<FoundFocus> {
    found_by(&members(), photo, &Frame::filled(SIZE, TRUSTED), None)
}

#[test]
fn the_focus_and_its_sign_are_estimated() {
    let scene = scene(3);
    for offset in [-0.07, -0.04, 0.03, 0.06] {
        let photo = photo(&scene, offset, 5);
        let found = found(&photo).expect("far out of focus");
        assert!((found.offset - offset).abs() < 0.012, "{offset}: {found:?}");
        let (before, after) = found.between;
        assert!(after == before + 1 && (0.0..=1.0).contains(&found.share) && !found.at_end);
    }
    let sharp = found(&photo(&scene, 0.0, 5));
    assert!(sharp.is_none_or(|found| found.offset.abs() < 0.012), "{sharp:?}");
}

#[test]
fn the_focus_of_raw_sites_is_estimated_and_other_pixels_are_ignored() {
    let scene = scene(4);
    let mosaic = Mosaic::Grbg;
    for offset in [-0.05, 0.06] {
        let mut photo = photo(&scene, offset, 6);
        for c in Channel::ALL {
            for y in 0..SIZE.height {
                for x in (0..SIZE.width).filter(|&x| mosaic.colour_at(x, y) != c) {
                    photo.plane_mut(c).set(x, y, 1e4);
                }
            }
        }
        // The mean of a tile is taken over valid sites.
        let trust: Frame<Work, u8> =
            Frame::from_fn(|c| Plane::from_fn(SIZE, |x, y| u8::from(mosaic.colour_at(x, y) == c)));
        let found = found_by(&members(), &photo, &trust, Some(mosaic));
        let found = found.expect("far out of focus");
        assert!((found.offset - offset).abs() < 0.015, "{offset}: {found:?}");
    }
}

#[test]
fn noise_and_a_saturated_photo_have_no_focus() {
    let noise = photo(&Frame::filled(SIZE, 100.0), 0.0, 7);
    assert_eq!(found(&noise), None);
    let photo = photo(&scene(5), 0.07, 8);
    let trust: Frame<Work, u8> = Frame::filled(SIZE, SATURATED);
    assert_eq!(found_by(&members(), &photo, &trust, None), None);
}

#[test]
fn beyond_the_measured_offsets_the_focus_is_the_last_one_at_the_end() {
    let found = found(&photo(&scene(9), 0.1, 9)).expect("far out");
    assert!(found.at_end && (found.offset - 0.08).abs() < 1e-6, "{found:?}");
    assert_eq!((found.between, found.share), ((8, 8), 0.0));
}

#[test]
fn a_series_needs_the_panel_s_focus_and_one_grid() {
    let [a, b] = [gaussians(0.0), gaussians(0.04)];
    let mut other = gaussians(0.08);
    other.columns = 6;
    other.rows = 2;
    assert!(FocusSeries::new(vec![(0.04, &b), (0.0, &a)]).is_some());
    assert!(FocusSeries::new(vec![(0.0, &a)]).is_none());
    assert!(FocusSeries::new(vec![(0.02, &a), (0.04, &b)]).is_none());
    assert!(FocusSeries::new(vec![(0.0, &a), (0.0, &b)]).is_none());
    assert!(FocusSeries::new(vec![(0.0, &a), (0.08, &other)]).is_none());
    assert!(FocusSeries::new(Vec::new()).is_none());
}

#[test]
fn the_fitted_scene_is_the_true_one() {
    let tiles = Tiles::of(SIZE, &gaussians(0.0)).unwrap();
    let at = tiles.frequencies(spectra::Folding::Whole);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
    let passed = vec![0.5f32; at.ln.len()];
    let power = at.aliases.iter().map(|&n| {
        let expected = (1.0 - 2.4 * at.ln[n as usize]).exp() * 0.5 + 0.2;
        -expected * (1.0 - random.random::<f32>()).ln()
    });
    let spectrum =
        TileSpectrum { power: power.collect(), noise: 0.2, folding: spectra::Folding::Whole };
    let mut scene = PowerLaw::of(&spectrum);
    let best = likeliest(at, &spectrum, &passed, &mut scene);
    let PowerLaw { ln_power, exponent } = scene;
    // The heavy-tailed likelihood underestimates the power.
    assert!((exponent - 2.4).abs() < 0.15 && (ln_power - 1.0).abs() < 0.6, "{scene:?}");
    for (a, b) in [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.0, -0.2)] {
        let other = PowerLaw { ln_power: ln_power + a, exponent: exponent + b };
        let cost = likelihood::scored(at, &spectrum, &passed, other).cost;
        assert!(cost > best, "{a} {b}");
    }
}

/// Noise power in the dark and per grey level, about [`NOISE`]² at mid grey.
const POWERS: [f32; 2] = [0.16, 0.002];

#[test]
fn noise_above_the_sensor_s_is_estimated() {
    // With strong blur and with weak blur.
    for offset in [0.03, 0.0] {
        let lens = gaussians(offset);
        // Factors on the power in the dark and per level: none, small, gain, both, read noise.
        for (seed, [black, light]) in [
            (21, [1.0, 1.0]),
            (22, [2.0, 2.0]),
            (23, [64.0, 8.0]),
            (24, [9.0, 9.0]),
            (25, [99.0, 1.0]),
        ] {
            let clean = taken(&scene(seed), &lens, 0.0, seed);
            let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
            let [at_black, per_level] = POWERS;
            let noise = |level: f32| (black * at_black + light * per_level * level).sqrt();
            let photo = Frame::from_fn(|c| {
                clean.plane(c).map(|v: f32| v + noise(v.max(0.0)) * gaussian(&mut random))
            });
            for found in both(&photo, |data| check_spectrum(&lens, data, true)) {
                let Some(SpectralFinding::Noisier([found_black, found_light])) = found else {
                    assert!(black < 3.0, "{black}, {light} through {offset}");
                    continue;
                };
                assert!(black > 3.0, "{black}, {light} through {offset}");
                for level in clean.planes().each_ref().map(|plane| plane.mean() as f32) {
                    let power = found_black * at_black + found_light * per_level * level;
                    let times = power.sqrt() / noise(level);
                    assert!((times - 1.0).abs() < 0.1, "{black}, {light} at {level}: {times}");
                }
            }
        }
    }
}

#[test]
fn a_photo_through_a_stopped_down_lens_is_sharper_and_a_defocused_or_noisy_one_is_not() {
    let (measured, narrow) = (gaussians(0.03), gaussians(0.0));
    let (narrower, wider) = (gaussians(0.015), gaussians(0.06));
    for seed in 31..35 {
        let is = |lens: &LensFunctions, noise: f32| {
            let photo = taken(&scene(seed), lens, noise, seed);
            both(&photo, |data| {
                check_spectrum(&measured, data, true) == Some(SpectralFinding::SharperLens)
            })
        };
        assert_eq!(is(&measured, NOISE), [false; 2], "{seed}");
        assert_eq!(is(&wider, NOISE), [false; 2], "{seed}");
        assert!(!is(&narrower, NOISE)[0], "{seed}: a little");
        assert_eq!(is(&narrow, NOISE), [true; 2], "{seed}");
    }
}
