//! Marks painted, seen through a blurring, noisy, posed camera of the test's own, and read.

use super::*;

const PANEL: Size = Size::new(480, 270);
const SENSOR: Size = Size::new(288, 224);
const PLACE: MarkPlace = MarkPlace::still(SENSOR, 2, 5, 4);

fn sensor_at([x, y]: [f64; 2]) -> [f64; 2] {
    [0.86 * x + 0.004 * y - 64.0, -0.005 * x + 0.86 * y - 2.8]
}

fn geometry() -> CoarseGeometry {
    let corners = [[20.0, 20.0], [460.0, 30.0], [240.0, 135.0], [30.0, 240.0], [450.0, 250.0]];
    CoarseGeometry::fit(&corners.map(|panel| (panel, sensor_at(panel))), 0.1).unwrap()
}

/// A frame of `codes`: the panel pixel under each sensor pixel, blurred over 11 × 11, darker to the
/// right, with noise from `seed`.
fn seen(codes: &Codes, geometry: &CoarseGeometry, seed: u32) -> Counts {
    let mut state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let shown = codes.plane(Channel::Green);
    let grey = Plane::from_fn(SENSOR, |x, y| {
        let [px, py] = geometry.panel_at([x as f64, y as f64]).map(|v| v.round() as i32);
        let (mut sum, mut taps) = (0.0, 0.0);
        for (dx, dy) in (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (dx, dy))) {
            let (x, y) = (px + dx, py + dy);
            if (0..PANEL.width as i32).contains(&x) && (0..PANEL.height as i32).contains(&y) {
                sum += f64::from(shown.at(x as usize, y as usize));
            }
            taps += 1.0;
        }
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(state >> 16) / 65536.0 * 12.0 - 6.0;
        (64.0 + 3.0 * sum / taps * (1.0 - 0.5 * x as f64 / SENSOR.width as f64) + noise) as u16
    });
    Counts::from_planes([grey.clone(), grey.clone(), grey])
}

fn learned() -> (FrameMarks, CoarseGeometry) {
    let geometry = geometry();
    let mut marks = FrameMarks::new(PLACE, &geometry, PANEL).unwrap();
    let frames: Vec<_> =
        [0x00, 0xff, 0x5a].map(|number| (number, shown(&marks, &geometry, number))).into();
    assert!(marks.learn(&frames));
    (marks, geometry)
}

fn shown(marks: &FrameMarks, geometry: &CoarseGeometry, number: u8) -> Counts {
    let mut codes = Codes::filled(PANEL, 90);
    marks.paint(&mut codes, number);
    seen(&codes, geometry, number.into())
}

/// Rows of `counts` above `row`, and rows of `other` from there on.
fn torn(counts: &Counts, other: &Counts, row: usize) -> Counts {
    Counts::from_fn(|c| {
        Plane::from_fn(SENSOR, |x, y| {
            if y < row { counts.plane(c).at(x, y) } else { other.plane(c).at(x, y) }
        })
    })
}

#[test]
fn numbers_are_read_through_blur_pose_noise_and_dark_corners() {
    let (marks, geometry) = learned();
    for number in (0..=255).step_by(17) {
        assert_eq!(marks.read(&shown(&marks, &geometry, number)), MarkReading::Number(number));
    }
}

#[test]
fn a_torn_frame_is_rejected() {
    let (marks, geometry) = learned();
    let (old, new) = (shown(&marks, &geometry, 41), shown(&marks, &geometry, 42));
    // The tear may be anywhere: above, between or in the strips.
    for row in 0..=SENSOR.height {
        let reading = marks.read(&torn(&old, &new, row));
        // The outermost measured row of each strip is one row inside it.
        let edge = PLACE.from_edge_px + 1;
        let whole = !(edge + 1..SENSOR.height - edge).contains(&row);
        assert!(whole || reading == MarkReading::Mixed, "torn at row {row}: {reading}");
    }
}

#[test]
fn a_frame_exposed_over_two_pictures_is_rejected() {
    let (marks, geometry) = learned();
    let (old, new) = (shown(&marks, &geometry, 7), shown(&marks, &geometry, 8));
    for share in [0.15, 0.3, 0.5, 0.7, 0.85] {
        let blend =
            |a: u16, b: u16| (f64::from(a) * share + f64::from(b) * (1.0 - share)).round() as u16;
        let both = Counts::from_fn(|c| {
            Plane::from_fn(SENSOR, |x, y| blend(old.plane(c).at(x, y), new.plane(c).at(x, y)))
        });
        assert_eq!(marks.read(&both), MarkReading::Mixed, "{share} of the old picture");
    }
}

#[test]
fn a_frame_without_marks_reads_as_nothing() {
    let (marks, geometry) = learned();
    assert_eq!(marks.read(&seen(&Codes::filled(PANEL, 90), &geometry, 1)), MarkReading::Nothing);
    assert_eq!(marks.read(&Counts::zeros(SENSOR)), MarkReading::Nothing);
}

#[test]
fn the_picture_does_not_disturb_the_mark() {
    let (marks, geometry) = learned();
    // Squares about as wide as the cells, up to the guard.
    let checker = Plane::from_fn(PANEL, |x, y| if (x / 14 + y / 14) % 2 == 0 { 255 } else { 0 });
    for number in [3, 64, 200] {
        let mut codes = Codes::from_planes([checker.clone(), checker.clone(), checker.clone()]);
        marks.paint(&mut codes, number);
        assert_eq!(marks.read(&seen(&codes, &geometry, 9)), MarkReading::Number(number));
    }
}

#[test]
fn the_brightness_of_a_strip_does_not_depend_on_its_number() {
    let (marks, _) = learned();
    let light = |number: u8| {
        let mut codes = Codes::zeros(PANEL);
        marks.paint(&mut codes, number);
        codes.plane(Channel::Green).data().iter().map(|&v| u32::from(v)).sum::<u32>()
    };
    let (least, most) = (0..=255).map(light).fold((u32::MAX, 0), |(a, b), v| (a.min(v), b.max(v)));
    // Cells are 12 or 13 panel pixels wide here, and half of them are light for every number.
    assert!(f64::from(most - least) < f64::from(most) / 13.0, "{least} to {most}");
}

#[test]
fn two_numbers_differ_in_at_least_two_bits() {
    for a in 0..=255u8 {
        for b in 0..a {
            let differing = bits(a).iter().zip(bits(b)).filter(|&(x, y)| *x != y).count();
            assert!(differing >= 2, "{a} and {b}");
        }
    }
}

#[test]
fn strips_that_leave_the_panel_are_refused() {
    let shifted = [[20.0, 20.0], [460.0, 30.0], [240.0, 135.0], [30.0, 240.0], [450.0, 250.0]];
    let pairs = shifted.map(|panel| (panel, [sensor_at(panel)[0], sensor_at(panel)[1] + 20.0]));
    let geometry = CoarseGeometry::fit(&pairs, 0.1).unwrap();
    assert!(FrameMarks::new(PLACE, &geometry, PANEL).is_none());
}
