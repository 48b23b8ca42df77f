//! A photo's focus found, of a made-up lens whose colours focus apart.

use super::*;
use crate::deconvolution::computed_optics::ComputedOptics;
use crate::deconvolution::data_term::{SATURATED, TRUSTED};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channels, Frame, Mosaic, Plane, Rect, Size, Work};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Arc;

const SIZE: Size = Size::new(192, 160);
/// Standard deviation of the noise, grey levels.
const NOISE: f32 = 0.6;

/// A lens whose focus lies apart for its colours: Gaussian bells, by offset and channel.
fn bells(offset: f32) -> LensFunctions {
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

/// Patches of flat light, as large as things are: a spectrum near |f|^−3.
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

/// `scene` seen at `offset`, with noise.
fn photo(scene: &Frame<Work>, offset: f32, seed: u64) -> Frame<Work> {
    taken(scene, &bells(offset), NOISE, seed)
}

/// `scene` seen through a lens of `functions`, with `noise`, grey levels.
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

/// What is `said` of `photo`, all of it and as a sensor's sites know it.
fn both<T>(photo: &Frame<Work>, said: impl Fn(&FocusData<'_>) -> T) -> [T; 2] {
    [None, Some(Mosaic::Rggb)].map(|mosaic| {
        let known = |c, x, y| mosaic.is_none_or(|of: Mosaic| of.colour_at(x, y) == c);
        let trust =
            &Frame::from_fn(|c| Plane::from_fn(SIZE, |x, y| u8::from(known(c, x, y)) * TRUSTED));
        let rect = Rect { x: 0, y: 0, size: SIZE };
        let [at_black, per_level] = POWERS;
        let noise = &|_, light: f32| (at_black + per_level * light).sqrt();
        let channels = Channels::Colour;
        said(&FocusData { photo, trust, rect, mosaic, channels, noise })
    })
}

/// The lens as measured from 0.08 dioptres behind the panel to as much before it.
fn members() -> Vec<(f32, LensFunctions)> {
    (-4i8..=4).map(|n| 0.02 * f32::from(n)).map(|offset| (offset, bells(offset))).collect()
}

/// The focus of a photo by a series of `members`.
fn found_by(
    members: &[(f32, LensFunctions)],
    photo: &Frame<Work>,
    trust: &Frame<Work, u8>,
    mosaic: Option<Mosaic>,
) -> Option<FoundFocus> {
    let series = FocusSeries::new(members.iter().map(|(o, f)| (*o, f)).collect()).unwrap();
    let (rect, channels) = (Rect { x: 0, y: 0, size: SIZE }, Channels::Colour);
    let noise = &|_, _| NOISE;
    series.find(&FocusData { photo, trust, rect, mosaic, channels, noise })
}

fn found(photo: &Frame<Work>) -> Option<FoundFocus> {
    found_by(&members(), photo, &Frame::filled(SIZE, TRUSTED), None)
}

#[test]
fn a_photo_tells_its_focus_and_the_side_by_its_colours() {
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
fn raw_sites_tell_it_too_and_between_them_nothing_is_looked_at() {
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
        // Only the mean of a tile may know of them, and it is taken of known sites.
        let trust: Frame<Work, u8> =
            Frame::from_fn(|c| Plane::from_fn(SIZE, |x, y| u8::from(mosaic.colour_at(x, y) == c)));
        let found = found_by(&members(), &photo, &trust, Some(mosaic));
        let found = found.expect("far out of focus");
        assert!((found.offset - offset).abs() < 0.015, "{offset}: {found:?}");
    }
}

#[test]
fn noise_and_a_photo_that_is_full_say_nothing() {
    let noise = photo(&Frame::filled(SIZE, 100.0), 0.0, 7);
    assert_eq!(found(&noise), None);
    let photo = photo(&scene(5), 0.07, 8);
    let trust: Frame<Work, u8> = Frame::filled(SIZE, SATURATED);
    assert_eq!(found_by(&members(), &photo, &trust, None), None);
}

#[test]
fn beyond_the_last_focus_it_is_the_last_and_says_so() {
    let found = found(&photo(&scene(9), 0.1, 9)).expect("far out");
    assert!(found.at_end && (found.offset - 0.08).abs() < 1e-6, "{found:?}");
    assert_eq!((found.between, found.share), ((8, 8), 0.0));
}

#[test]
fn a_series_has_the_panel_s_focus_and_one_grid() {
    let [a, b] = [bells(0.0), bells(0.04)];
    let mut other = bells(0.08);
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
fn light_at_the_panel_s_focus_is_brought_to_the_photo_s() {
    let scene = scene(10);
    let [panel, photo] =
        [0.0, 0.05].map(|offset| Arc::new(LensModel::new(SIZE, 0, &bells(offset)).unwrap()));
    let mut light = ComputedOptics::new(&panel, false);
    let mut there = ComputedOptics::new(&photo, false);
    let ought = there.forward(&scene).unwrap().light;
    let (panel, photo) = (Arc::clone(&panel), Arc::clone(&photo));
    let mut optics = OpticsAtFocus { inner: &mut light, panel, photo };
    let is = optics.forward(&scene).unwrap().light;
    for (is, ought) in is.planes().iter().zip(ought.planes()) {
        let mut off = is.clone();
        off.add_scaled(-1.0, ought);
        assert!(off.rms() < 1e-3, "{}", off.rms());
    }
    assert_eq!(optics.captures(), 1);
}

#[test]
fn the_likeliest_scene_is_the_one_that_made_the_spectrum() {
    let tiles = Tiles::of(SIZE, &bells(0.0)).unwrap();
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
    let (ln_power, exponent) = scene.numbers();
    // Tails heavier than the spectrum's take some power off.
    assert!((exponent - 2.4).abs() < 0.15 && (ln_power - 1.0).abs() < 0.6, "{scene:?}");
    for (a, b) in [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.0, -0.2)] {
        let other = PowerLaw::at(ln_power + a, exponent + b);
        let cost = likelihood::cost(at, &spectrum, &passed, other);
        assert!(cost > best, "{a} {b}");
    }
}

/// Power of noise without light, and what a grey level adds: so that it is [`NOISE`] in the middle.
const POWERS: [f32; 2] = [0.16, 0.002];

#[test]
fn a_photo_tells_how_much_more_noise_than_its_sensor_s_it_has() {
    // As wide as the panel's focus makes it, and much narrower.
    for offset in [0.03, 0.0] {
        let lens = bells(offset);
        // Without light and by light: the sensor's, a little more, a gain, read out more noisily.
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
            for found in both(&photo, |data| doubted(&lens, data, true)) {
                let Some(SpectralDoubt::Noisier([found_black, found_light])) = found else {
                    assert!(black < 3.0, "{black}, {light} through {offset}");
                    continue;
                };
                assert!(black > 3.0, "{black}, {light} through {offset}");
                for level in clean.planes().each_ref().map(|plane| plane.mean() as f32) {
                    let told = found_black * at_black + found_light * per_level * level;
                    let times = told.sqrt() / noise(level);
                    assert!((times - 1.0).abs() < 0.1, "{black}, {light} at {level}: {times}");
                }
            }
        }
    }
}

#[test]
fn a_photo_of_a_lens_stopped_down_is_sharper_and_one_out_of_focus_or_noisy_is_not() {
    let (measured, narrow) = (bells(0.03), bells(0.0));
    let (narrower, wider) = (bells(0.015), bells(0.06));
    for seed in 31..35 {
        let is = |lens: &LensFunctions, noise: f32| {
            let photo = taken(&scene(seed), lens, noise, seed);
            both(&photo, |data| doubted(&measured, data, true) == Some(SpectralDoubt::Sharper))
        };
        assert_eq!(is(&measured, NOISE), [false; 2], "{seed}");
        assert_eq!(is(&wider, NOISE), [false; 2], "{seed}");
        assert!(!is(&narrower, NOISE)[0], "{seed}: a little");
        assert_eq!(is(&narrow, NOISE), [true; 2], "{seed}");
    }
}
