//! Resampling: exactness, borders, accuracy, and `warp` against `sample`.

use super::*;
use crate::frame::Size;

/// A smooth picture as a function, with waves of at least `shortest_px`.
fn smooth(shortest_px: f32, x: f32, y: f32) -> f32 {
    let wave = std::f32::consts::TAU / shortest_px;
    128.0
        + 60.0 * (wave * x * 0.8 + wave * y * 0.6).sin()
        + 40.0 * (wave * x * 0.3 - wave * y * 0.9).cos()
}

fn smooth_plane(size: Size, shortest_px: f32) -> Plane {
    Plane::from_fn(size, |x, y| smooth(shortest_px, x as f32, y as f32))
}

/// Value inside `plane` by Keys' kernel with a = −¾, as in OpenCV.
fn sample_by_opencv(plane: &Plane, x: f32, y: f32) -> f32 {
    let weight = |distance: f32| match distance.abs() {
        d @ 0.0..=1.0 => (1.25 * d - 2.25) * d * d + 1.0,
        d => ((-0.75 * d + 3.75) * d - 6.0) * d + 3.0,
    };
    let taps =
        |at: f32| (at as usize - 1..at as usize + 3).map(move |n| (n, weight(at - n as f32)));
    let row = |v: usize| taps(x).map(|(u, weight)| weight * plane.at(u, v)).sum::<f32>();
    taps(y).map(|(v, weight)| weight * row(v)).sum()
}

/// RMS error of `sampled` at many positions between pixels.
fn error_of(sampled: impl Fn(&Plane, f32, f32) -> f32, shortest_px: f32) -> f64 {
    let plane = smooth_plane(Size::new(80, 60), shortest_px);
    let errors = Plane::from_fn(Size::new(200, 150), |i, j| {
        let (x, y) = (5.0 + i as f32 * 0.34, 5.0 + j as f32 * 0.33);
        sampled(&plane, x, y) - smooth(shortest_px, x, y)
    });
    errors.rms()
}

#[test]
fn keys_parameter_is_more_accurate_on_smooth_pictures() {
    for shortest_px in [6.0, 10.0, 20.0] {
        let (ours, opencv) =
            (error_of(sample, shortest_px), error_of(sample_by_opencv, shortest_px));
        println!(
            "waves of {shortest_px} px: RMS error {ours:.3} with -0.5, {opencv:.3} with -0.75"
        );
        assert!(ours < 0.6 * opencv, "{shortest_px}: {ours} {opencv}");
    }
}

#[test]
fn a_displaced_plane_is_sampled_at_displaced_places() {
    let plane = smooth_plane(Size::new(23, 17), 6.0);
    for (x, y) in [(0.3, -0.4), (-1.75, 2.0), (0.0, 0.25), (30.0, -40.5)] {
        let found = translate(&plane, x, y);
        for v in 0..17 {
            for u in 0..23 {
                let wanted = sample(&plane, u as f32 - x, v as f32 - y);
                let off = (found.at(u, v) - wanted).abs();
                assert!(off < 1e-3, "({x}, {y}) at ({u}, {v}): {off}");
            }
        }
    }
    assert_eq!(translate(&Plane::default(), 0.5, 0.5), Plane::default());
}

#[test]
fn integer_positions_and_quadratic_planes_are_exact() {
    let plane = Plane::from_fn(Size::new(20, 15), |x, y| {
        let (x, y) = (x as f32, y as f32);
        3.0 + 2.0 * x - y + 0.3 * x * x - 0.2 * x * y + 0.1 * y * y
    });
    let (x, y) = (7.37f32, 6.81f32);
    let wanted = 3.0 + 2.0 * x - y + 0.3 * x * x - 0.2 * x * y + 0.1 * y * y;
    assert!((sample(&plane, x, y) - wanted).abs() < 1e-3);
    for (x, y) in [(0, 0), (19, 14), (7, 3), (18, 13), (17, 12)] {
        assert_eq!(sample(&plane, x as f32, y as f32), plane.at(x, y));
    }
}

#[test]
fn warp_equals_sample_at_every_position() {
    let source = Plane::from_fn(Size::new(31, 23), |x, y| ((x * 37 + y * 91) % 101) as f32);
    let size = Size::new(64, 50);
    // From far outside to far outside, with some whole positions and some that are not finite.
    let mut map_x = Plane::from_fn(size, |x, y| x as f32 * 0.75 - 8.0 + y as f32 * 0.01);
    let map_y = Plane::from_fn(size, |x, y| y as f32 * 0.5 - 1.0 + x as f32 * 0.02);
    map_x.set(5, 5, f32::NAN);
    map_x.set(6, 5, f32::INFINITY);
    map_x.set(7, 5, -1e30);
    let mut out = Plane::zeros(size);
    warp(&source, &map_x, &map_y, &mut out);
    for y in 0..size.height {
        for x in 0..size.width {
            let plain = sample(&source, map_x.at(x, y), map_y.at(x, y));
            assert!((out.at(x, y) - plain).abs() < 1e-3, "{x} {y}");
        }
    }
    assert_eq!(out.at(5, 5), 0.0);
}

#[test]
fn pixels_outside_are_the_edge() {
    let plane = Plane::filled(Size::new(9, 7), 50.0);
    for (x, y) in [(-30.0, 3.0), (4.0, 99.0), (-0.4, -0.4), (8.7, 6.2)] {
        assert!((sample(&plane, x, y) - 50.0).abs() < 1e-4);
    }
}

#[test]
fn tiny_planes_are_resampled() {
    let one = Plane::filled(Size::new(1, 1), 7.0);
    let mut out = Plane::zeros(Size::new(3, 1));
    let (map_x, map_y) = (Plane::filled(out.size(), 0.3), Plane::filled(out.size(), 0.2));
    warp(&one, &map_x, &map_y, &mut out);
    assert!(out.data().iter().all(|&v| (v - 7.0).abs() < 1e-5));
    assert!(resize(&one, Size::new(5, 4)).data().iter().all(|&v| (v - 7.0).abs() < 1e-5));
    assert_eq!(sample(&Plane::zeros(Size::new(0, 0)), 0.0, 0.0), 0.0);
}

#[test]
fn resizing_keeps_position_and_mean_without_aliasing() {
    let plane = smooth_plane(Size::new(240, 160), 40.0);
    for size in [Size::new(120, 80), Size::new(100, 70), Size::new(333, 201), Size::new(240, 160)] {
        let made = resize(&plane, size);
        let (scale_x, scale_y) = (240.0 / size.width as f32, 160.0 / size.height as f32);
        for y in 8..size.height - 8 {
            for x in 8..size.width - 8 {
                let (at_x, at_y) =
                    ((x as f32 + 0.5) * scale_x - 0.5, (y as f32 + 0.5) * scale_y - 0.5);
                assert!((made.at(x, y) - smooth(40.0, at_x, at_y)).abs() < 3.0, "{size} {x} {y}");
            }
        }
    }
    // Stripes of two pixels reduced to a quarter are grey, without moiré.
    let stripes = Plane::from_fn(Size::new(256, 64), |x, _| if x % 2 == 0 { 0.0 } else { 200.0 });
    let grey = resize(&stripes, Size::new(61, 16));
    let inner: Vec<f32> = (4..57).map(|x| grey.at(x, 8)).collect();
    assert!(inner.iter().all(|v| (v - 100.0).abs() < 3.0), "{inner:?}");
}
