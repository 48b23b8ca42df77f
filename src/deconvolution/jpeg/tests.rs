//! Tests of the term against its plain form, of its descent, and of the detection of JPEGs made
//! from JPEGs.

mod plain;

use super::luma::draw_band;
use super::*;
use crate::frame::BLOCK_PX;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// sRGB's light of each code (IEC 61966-2-1, equations 5 and 6).
fn lights() -> Vec<f32> {
    let light = |code: f64| match code {
        code if code <= 0.040_45 => code / 12.92,
        code => ((code + 0.055) / 1.055).powf(2.4),
    };
    (0..256).map(|code| (255.0 * light(f64::from(code) / 255.0)) as f32).collect()
}

/// A scene of colours that change, with noise of one grey level.
fn scene(size: Size) -> Frame<Work> {
    let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(4);
    Frame::from_fn(|c: Channel| {
        let k = 3.0 + c.index() as f32;
        Plane::from_fn(size, |x, y| {
            let noise: f32 = StandardNormal.sample(&mut random);
            let light = 90.0 + 60.0 * (x as f32 / k).sin() + 20.0 * (y as f32 / (7.0 - k)).cos();
            (light + noise).clamp(0.0, 255.0)
        })
    })
}

/// Codes `photo` as a JPEG whose steps grow from `first` by `more` per frequency.
fn stated_by(photo: &Frame<Work>, pixels: (u8, u8), (first, more): (u16, u16)) -> Coding {
    let (size, light) = (photo.size(), lights());
    let curve = CodeCurve::new(&light, &|_| 0.0).unwrap();
    let steps: Vec<u16> = (0..64).map(|k| first + more * (k % 8 + k / 8)).collect();
    let components = (0..3).map(|n| {
        let own = if n == 0 { (1, 1) } else { pixels };
        let blocks = Coding::blocks(size, pixels, own);
        let (across, down) = (usize::from(own.0), usize::from(own.1));
        let mut coefficients = Vec::new();
        for block in 0..blocks.area() {
            let (x0, y0) = (block % blocks.width * BLOCK_PX, block / blocks.width * BLOCK_PX);
            let mut samples: [f32; BLOCK_AREA] = std::array::from_fn(|k| {
                let pixel = |p: usize| {
                    let x = ((x0 + k % 8) * across + p % across).min(size.width - 1);
                    let y = ((y0 + k / 8) * down + p / across).min(size.height - 1);
                    let code = |c: usize| curve.encode(photo.planes()[c].at(x, y)).round();
                    (0..3).map(|c| TO_YCC[n][c] * code(c)).sum::<f32>()
                };
                let mean = (0..across * down).map(pixel).sum::<f32>() / (across * down) as f32;
                mean - if n == 0 { MIDDLE } else { 0.0 }
            });
            transform(&mut samples, &cosines());
            let numbers =
                samples.iter().zip(&steps).map(|(m, &q)| (m / f32::from(q)).round() as i16);
            coefficients.extend(numbers);
        }
        CodedComponent {
            pixels: own,
            blocks,
            steps: steps.clone(),
            coefficients: coefficients.into(),
        }
    });
    Coding { size, components: components.collect() }
}

/// A photo within a canvas of 5 pixels more on each side.
fn placed(photo: &Frame<Work>) -> (Frame<Work>, Rect) {
    use crate::deconvolution::data_term::{canvas_of, place_with_edges};
    let (canvas, rect) = canvas_of(photo.size(), 5);
    (Frame::from_fn(|c| place_with_edges(photo.plane(c), canvas, rect)), rect)
}

fn stated<'a>(
    coding: &'a Coding,
    light: &'a [f32],
    (photo, rect): (&'a Frame<Work>, Rect),
) -> Stated<'a> {
    let (lights, noise) = ([light; 3], [1.0; 3]);
    let noise_at = &|_: Channel, light: f32| (0.5 + 0.005 * light).sqrt();
    Stated { coding, lights, channels: Channels::Colour, photo, rect, noise, noise_at, once: true }
}

/// `planes` changed by a pattern that is unrelated to blocks.
fn moved(planes: &Frame<Work>) -> Frame<Work> {
    Frame::from_fn(|c: Channel| {
        let plane = planes.plane(c);
        let shift = |x: usize, y: usize| (x * 7 + y * 5 + c.index() * 11) % 23;
        Plane::from_fn(plane.size(), |x, y| plane.at(x, y) + shift(x, y) as f32 - 11.0)
    })
}

#[test]
fn the_term_by_units_is_that_of_the_plain_form() {
    let light = lights();
    for (size, pixels) in
        [(Size::new(21, 19), (1, 1)), (Size::new(24, 9), (2, 1)), (Size::new(35, 18), (2, 2))]
    {
        let photo = scene(size);
        let coding = stated_by(&photo, pixels, (4, 3));
        assert!(coding.is_whole());
        let (canvas, rect) = placed(&photo);
        let of = stated(&coding, &light, (&canvas, rect));
        let about: Vec<Plane> = canvas.planes().iter().map(|p| blur(p, ABOUT_PX)).collect();
        let seen = moved(&canvas);
        let found = JpegTerm::of(&of).unwrap().redecoded(&seen);
        let want = plain::redecoded(&of, &about, &seen);
        for c in Channel::ALL {
            let pairs = found.plane(c).data().iter().zip(want.plane(c).data());
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 0.3, "{pixels:?} {c:?}: {worst} grey levels");
            assert_eq!(found.plane(c).row(0), seen.plane(c).row(0), "outside the photo");
        }
    }
}

/// Sum of the squared distances of the coefficients of `light` from the intervals of `coding`.
fn outside(coding: &Coding, (light, rect): (&Frame<Work>, Rect)) -> f64 {
    let photo = Frame::from_fn(|c| light.plane(c).crop(rect));
    // Steps of 1 hardly quantise.
    let pixels = coding.densest();
    let fine = stated_by(&photo, pixels, (1, 0));
    let components = coding.components.iter().zip(&fine.components);
    let of = |(stated, fine): (&CodedComponent, &CodedComponent)| -> f64 {
        let numbers = stated.coefficients.iter().zip(&*fine.coefficients).enumerate();
        let apart = numbers.map(|(k, (&c, &m))| {
            let q = f64::from(stated.steps[k % BLOCK_AREA]);
            ((f64::from(c) * q - f64::from(m)).abs() - 0.5 * q).max(0.0).powi(2)
        });
        apart.sum()
    };
    components.map(of).sum()
}

#[test]
fn each_step_along_the_gradient_comes_nearer_to_what_the_file_states() {
    let light = lights();
    for pixels in [(1, 1), (2, 2)] {
        let photo = scene(Size::new(48, 32));
        let coding = stated_by(&photo, pixels, (10, 6));
        let (canvas, rect) = placed(&photo);
        let term = JpegTerm::of(&stated(&coding, &light, (&canvas, rect))).unwrap();
        // With K = 1, a step gives L − (L − B̃), the picture decoded again.
        let mut picture = moved(&canvas);
        let mut before = outside(&coding, (&picture, rect));
        let begun = before;
        for step in 0..4 {
            picture = term.redecoded(&picture);
            let now = outside(&coding, (&picture, rect));
            assert!(now < before || now < 0.01 * begun, "{pixels:?} {step}: {before} to {now}");
            before = now;
        }
        assert!(before < 0.05 * begun, "{pixels:?}: {begun} to {before}");
    }
}

#[test]
fn a_picture_that_the_file_may_stand_for_hardly_moves_and_grey_is_decoded_alone() {
    let (light, photo) = (lights(), scene(Size::new(40, 24)));
    let (canvas, rect) = placed(&photo);
    let coding = stated_by(&photo, (2, 2), (1, 0));
    let of = stated(&coding, &light, (&canvas, rect));
    let again = JpegTerm::of(&of).unwrap().redecoded(&canvas);
    // The file determines brightness to within a code, but not chroma between its samples.
    let apart = Channel::ALL.map(|c| {
        let mut apart = again.plane(c).clone();
        apart.add_scaled(-1.0, canvas.plane(c));
        apart.rms()
    });
    assert!(apart.iter().all(|&apart| apart < 0.5), "{apart:?}");
    let grey = Frame::from_fn(|_| canvas.plane(Channel::Green).clone());
    let coding =
        stated_by(&Frame::from_fn(|_| photo.plane(Channel::Green).clone()), (2, 2), (9, 4));
    let of = Stated { channels: Channels::Green, ..stated(&coding, &light, (&grey, rect)) };
    let term = JpegTerm::of(&of).unwrap();
    let seen = moved(&grey);
    let found = term.redecoded(&seen);
    assert_eq!(found.plane(Channel::Red), seen.plane(Channel::Red));
    assert_ne!(found.plane(Channel::Green), seen.plane(Channel::Green));
    let other = Stated { rect: Rect { size: Size::new(32, 24), ..rect }, ..of };
    assert!(JpegTerm::of(&other).is_none(), "a file of another size");
}

#[test]
fn a_jpeg_of_a_jpeg_is_recognised_by_its_gaps() {
    // Soft enough that the scene itself makes no value of a coefficient more common than smaller
    // ones.
    let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(8);
    let size = Size::new(256, 192);
    let rough = Plane::from_fn(size, |_, _| {
        let noise: f32 = StandardNormal.sample(&mut random);
        noise
    });
    let soft = blur(&rough, 1.5).map(|v: f32| (90.0 + 200.0 * v).clamp(0.0, 255.0));
    let photo = Frame::from_fn(|_| soft.clone());
    for once in [(1, 0), (3, 1), (8, 2), (16, 4)] {
        assert!(!coded_twice(&stated_by(&photo, (1, 1), once)), "{once:?}");
    }
    for (first, then) in [((16, 4), (2, 1)), ((10, 3), (3, 1))] {
        let decoded = decoded(&stated_by(&photo, (1, 1), first));
        let again = stated_by(&Frame::from_fn(|_| decoded.clone()), (1, 1), then);
        assert!(coded_twice(&again), "{first:?}, {then:?}");
    }
}

/// Light to which the luma of `coding` is decoded: the middle of each coefficient's interval.
fn decoded(coding: &Coding) -> Plane {
    let curve = CodeCurve::new(&lights(), &|_| 0.0).unwrap();
    let component = &coding.components[0];
    let mut decoded = Plane::zeros(coding.size);
    for (n, numbers) in component.coefficients.chunks_exact(BLOCK_AREA).enumerate() {
        let stated = |k: usize| f32::from(numbers[k]) * f32::from(component.steps[k]);
        let mut block = std::array::from_fn(stated);
        transform(&mut block, &transposed(&cosines()));
        let (x0, y0) = (n % component.blocks.width * 8, n / component.blocks.width * 8);
        for (k, v) in block.iter().enumerate() {
            let code = (v + MIDDLE).round().clamp(0.0, 255.0);
            decoded.set(x0 + k % 8, y0 + k / 8, curve.decode(code));
        }
    }
    decoded
}

#[test]
fn the_prior_keeps_grey_details_and_shrinks_colours_more() {
    let size = Size::new(16, 12);
    let detail = Plane::from_fn(size, |x, y| ((x * 5 + y * 3) % 7) as f32 - 3.0);
    let u = (1.0f32 / 3.0).sqrt();
    // n·u = 1.
    let n = [0.3, 0.6, 0.1].map(|w| Plane::filled(size, w / u));
    let kept = |signs: [f32; 3]| {
        let mut bands = signs.map(|sign| detail.map(|v: f32| sign * v));
        let before: f64 = bands.iter().map(|band| band.dot(band)).sum();
        draw_band(bands.each_mut(), &n, 0.5, None);
        (bands.iter().map(|band| band.dot(band)).sum::<f64>() / before, bands)
    };
    let (grey, bands) = kept([1.0, 1.0, 1.0]);
    let apart = bands[0].data().iter().zip(bands[2].data()).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f32::max) < 1e-4, "grey stays grey");
    // Without luma: −0.2·0.3 + 0.0·0.6 + 0.6·0.1 = 0.
    let (colour, _) = kept([-0.2, 0.0, 0.6]);
    assert!(grey > 0.6 && colour < 0.5 * grey, "{grey} {colour}");
    let mut bands = [(); 3].map(|()| detail.clone());
    draw_band(bands.each_mut(), &n, 0.0, None);
    assert_eq!(bands[1], detail);
}

#[test]
fn colours_are_the_mean_of_both_and_luma_stays() {
    let scene = scene(Size::new(32, 16));
    let coding = stated_by(&scene, (2, 2), (8, 4));
    let (photo, rect) = placed(&scene);
    let light = lights();
    let term = JpegTerm::of(&stated(&coding, &light, (&photo, rect))).unwrap();
    let bright = Frame::from_fn(|c| photo.plane(c).map(|v: f32| (0.8 * v + 20.0).min(255.0)));
    let mut mixed = bright.clone();
    term.mix_colours(&mut mixed, &photo);
    let codes = |of: &Frame<Work>, n: usize| {
        let code = |c: Channel| term.curves[c.index()].encode(of.plane(c).at(20, 9));
        Channel::ALL.map(|c| TO_YCC[n][c.index()] * code(c)).iter().sum::<f32>()
    };
    assert!((codes(&mixed, 0) - codes(&bright, 0)).abs() < 0.3);
    for n in [1, 2] {
        let mean = 0.5 * (codes(&bright, n) + codes(&photo, n));
        assert!((codes(&mixed, n) - mean).abs() < 0.3, "chroma {n}");
        assert!((codes(&photo, n) - codes(&bright, n)).abs() > 1.0, "there is nothing to mix");
    }
}
