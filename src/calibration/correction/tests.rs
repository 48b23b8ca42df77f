//! `show` and `see` against the plain formulas.

use super::*;
use crate::calibration::example::calibration;

pub(super) fn layout() -> Layout {
    Layout {
        panel: Size::new(70, 60),
        subpixels: Subpixels::Whole,
        sensor: Size::new(48, 38),
        photo: Size::new(40, 30),
        photo_x_px: 4,
        photo_y_px: 4,
        margin_px: 4,
        saturated: 1023,
        mosaic: None,
    }
}

#[test]
fn codes_show_the_light_of_the_picture_at_the_mapped_positions() {
    let correction = Correction::new(&calibration(), layout()).unwrap();
    let canvas = layout().canvas();
    let light = |x: f64, y: f64| 90.0 + 2.0 * x + 1.0 * y;
    let picture = Frame::from_fn(|_| {
        Plane::from_fn(canvas, |x, y| light(x as f64 - 4.0, y as f64 - 4.0) as f32)
    });
    let codes = correction.show(&picture);
    let curve = &calibration().curves[1];
    // Error diffusion is exact only in the mean, here over 8×8 panel pixels.
    for by in [10usize, 22, 34] {
        for bx in [10usize, 25, 40] {
            let (mut shown, mut wanted) = (0.0f64, 0.0f64);
            for y in by..by + 8 {
                for x in bx..bx + 8 {
                    shown += f64::from(curve.light(codes.plane(Channel::Green).at(x, y))) / 64.0;
                    wanted += light(0.8 * x as f64 - 5.6, 0.8 * y as f64 - 5.6) / 64.0;
                }
            }
            assert!((shown - wanted).abs() < 0.25, "{bx} {by}: {shown} {wanted}");
        }
    }
    // Far outside the canvas, the light of its border is repeated.
    let corner = curve.light(codes.plane(Channel::Green).at(0, 0));
    assert!((f64::from(corner) - light(-4.0, -4.0)).abs() < 2.0, "{corner}");
}

#[test]
fn see_removes_black_mixing_and_dark_corner() {
    let calibration = calibration();
    let correction = Correction::new(&calibration, layout()).unwrap();
    let light = |c: usize, x: usize, y: usize| 20.0 + 30.0 * c as f64 + (3 * x + 2 * y) as f64;
    let counts = Counts::from_fn(|to| {
        Plane::from_fn(layout().sensor, |x, y| {
            let (wx, wy) = (x as f64 - 4.0, y as f64 - 4.0);
            let to = to.index();
            let mixed: f64 = (0..3)
                .map(|from| {
                    f64::from(
                        calibration.cross_channel.c[from][to] * calibration.counts_per_level[from],
                    ) * calibration.dark_corner[from].at(wx, wy)
                        * light(from, x, y)
                })
                .sum();
            (mixed + calibration.black[to].at(wx, wy)).round() as u16
        })
    });
    let seen = correction.see(&counts);
    for c in Channel::ALL {
        for (x, y) in [(0, 0), (20, 15), (47, 37)] {
            let found = f64::from(seen.light.plane(c).at(x, y));
            // Half a count of rounding is a sixth of a level; mixing and dark corner add to it.
            assert!(
                (found - light(c.index(), x, y)).abs() < 0.5,
                "{found} {}",
                light(c.index(), x, y)
            );
        }
    }
    assert!(seen.trusted.plane(Channel::Red).data().iter().all(|&t| t == 1));
}

#[test]
fn saturated_pixels_are_not_trusted_in_any_channel() {
    let correction = Correction::new(&calibration(), layout()).unwrap();
    let mut counts = Counts::filled(layout().sensor, 100);
    counts.plane_mut(Channel::Blue).set(10, 12, 1023);
    let seen = correction.see(&counts);
    for c in Channel::ALL {
        assert_eq!(seen.trusted.plane(c).at(10, 12), 0);
        assert_eq!(seen.trusted.plane(c).at(11, 12), 1);
    }
}

#[test]
fn a_calibration_of_another_size_is_refused() {
    let other = Layout { margin_px: 5, ..layout() };
    let refused = Correction::new(&calibration(), other).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("a margin of 4 px; the rig file has"), "{refused}");
}

/// Prints the wall time of one frame of the default rig; run with `--ignored --nocapture`.
#[test]
#[ignore = "measures time"]
fn time_of_show_and_see() {
    use crate::calibration::geometric::{Geometry, Map};
    use crate::calibration::surface::{Domain, Surface};
    let canvas = Domain { left: -32.0, top: -32.0, right: 1055.0, bottom: 799.0 };
    let map = Map {
        x: Surface::plane(canvas, 370.0, 1.16, 0.01),
        y: Surface::plane(canvas, 95.0, -0.01, 1.16),
    };
    let pairs: Vec<_> = (0..800)
        .map(|n| {
            let from = (-32.0 + 36.0 * f64::from(n % 31), -32.0 + 33.0 * f64::from(n / 31));
            crate::calibration::geometric::Pair { from, to: map.at(from.0, from.1) }
        })
        .collect();
    let geometry = Geometry::fit(canvas, &pairs).unwrap();
    let calibration =
        Calibration { photo: Size::new(1024, 768), margin_px: 32, geometry, ..calibration() };
    let layout = Layout {
        panel: Size::new(1920, 1080),
        subpixels: Subpixels::Whole,
        sensor: Size::new(1152, 896),
        photo: Size::new(1024, 768),
        photo_x_px: 64,
        photo_y_px: 64,
        margin_px: 32,
        saturated: 1023,
        mosaic: None,
    };
    let correction = Correction::new(&calibration, layout).unwrap();
    let picture = Frame::from_fn(|c| {
        Plane::from_fn(layout.canvas(), |x, y| ((x * (7 + c.index()) + y * 13) % 251) as f32)
    });
    let counts = Counts::filled(layout.sensor, 400);
    let best = |work: &dyn Fn()| {
        (0..5)
            .map(|_| {
                let start = std::time::Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e3
            })
            .fold(f64::MAX, f64::min)
    };
    let show = best(&|| drop(std::hint::black_box(correction.show(&picture))));
    let see = best(&|| drop(std::hint::black_box(correction.see(&counts))));
    println!("show {show:.1} ms, see {see:.1} ms");
}
