//! Imperfections of a real rig, measured from the frames.

use super::tests::{QUIET, grey, small_simulated_with, small_with};
use super::*;
use crate::frame::{Channel, Codes, Counts, Frame, Mosaic, Plane, Size, Work};
use crate::rig::pixel_format::PixelFormat;

/// small.toml without noise, and some lines changed.
pub(super) fn quiet_with(changes: &[(&str, &str)]) -> (config::RigFile, Devices, Witness) {
    small_with(&[&QUIET[..], changes].concat())
}

/// small.toml without noise, with some lines and its simulation changed.
pub(super) fn quiet_simulated_with(
    changes: &[(&str, &str)],
    change: impl FnOnce(&mut config::Simulation),
) -> (config::RigFile, Devices, Witness) {
    small_simulated_with(&[&QUIET[..], changes].concat(), change)
}

/// A line of `[sensor]` that occurs in every rig file, followed by `lines`.
fn sensor_with(lines: &str) -> String {
    format!("readout-ms = 30.0\n{lines}")
}

pub(super) fn mean_and_sigma(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

/// Coloured edges in all directions.
fn colourful(size: Size) -> Codes {
    Frame::from_fn(|c| {
        let c = c.index();
        Plane::from_fn(size, |x, y| ((x / (3 + c) + y / (5 - c)) % 2 * 150 + 50 + 20 * c) as u8)
    })
}

#[test]
fn a_mosaic_gives_each_site_its_own_colour_and_the_others_by_interpolation() {
    let (config, mut whole, _) = quiet_with(&[]);
    let codes = colourful(config.panel.size());
    let full = whole.capture(&codes).expect("no faults").counts;
    for (word, mosaic) in ["bggr", "gbrg", "grbg", "rggb"].iter().zip(Mosaic::ALL) {
        let line = sensor_with(&format!("mosaic = \"{word}\""));
        let (config, mut rig, _) = quiet_with(&[("readout-ms = 30.0", &line)]);
        assert_eq!(PixelFormat::of(&config), Some(PixelFormat::raw(mosaic, 12)));
        let seen = rig.capture(&codes).expect("no faults").counts;
        let Size { width, height } = seen.size();
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let own = mosaic.colour_at(x, y);
                let count = |c: Channel, x: usize, y: usize| u32::from(full.plane(c).at(x, y));
                assert_eq!(u32::from(seen.plane(own).at(x, y)), count(own, x, y), "{word} {x} {y}");
                if own != Channel::Green {
                    let g = |x, y| count(Channel::Green, x, y);
                    let mean = (g(x - 1, y) + g(x + 1, y) + g(x, y - 1) + g(x, y + 1) + 2) / 4;
                    assert_eq!(u32::from(seen.plane(Channel::Green).at(x, y)), mean);
                }
            }
        }
    }
}

#[test]
fn counts_behind_a_mosaic_have_the_camera_s_bits() {
    for (bits, white) in [(8, 255), (10, 1023), (12, 4095)] {
        let (config, mut rig, witness) = small_with(&[
            ("readout-ms = 30.0", &sensor_with("mosaic = \"grbg\"")),
            ("bits = 10", &format!("bits = {bits}")),
            ("black-level-counts = 64.0", "black-level-counts = 9.0"),
        ]);
        witness.change_sensor(|sensor| sensor.white_share = 3.0);
        let seen = rig.capture(&grey(&config, 255)).expect("no faults").counts;
        assert!(seen.planes().iter().all(|p| p.data().iter().all(|&v| v == white)), "{bits}");
    }
}

#[test]
fn a_raw_photo_has_the_sensor_s_noise_on_its_sites_and_a_developed_one_less() {
    let (config, _, witness) =
        small_with(&[("readout-ms = 30.0", &sensor_with("mosaic = \"rggb\""))]);
    let scene: Frame<Work> = Frame::filled(config.photo.size(), 100.0);
    let raw = witness.photograph_raw(&scene, 5).expect("a mosaic");
    // The photo begins in column and row 16: the same colours as the sensor.
    assert_eq!(raw.mosaic, Mosaic::Rggb);
    let gain = witness.counts_per_level();
    // The middle of the field, where the dark corner is flat.
    let middle = |x: usize, y: usize| (98..158).contains(&x) && (66..126).contains(&y);
    for channel in Channel::ALL {
        let sites = (0..raw.sites.size().area())
            .map(|n| (n % 256, n / 256))
            .filter(|&(x, y)| middle(x, y) && raw.mosaic.colour_at(x, y) == channel);
        let levels = sites.map(|(x, y)| (f64::from(raw.sites.at(x, y)) - 64.0) / gain);
        let (mean, sigma) = mean_and_sigma(levels);
        let expected = (witness.noise_levels(100.0).powi(2) + 1.0 / 12.0 / gain / gain).sqrt();
        assert!((mean - 100.0).abs() < 0.5, "{} {mean}", channel.name());
        assert!((sigma / expected - 1.0).abs() < 0.06, "{} {sigma}", channel.name());
    }
    // Interpolating four sites halves their noise; in green, half of all sites need none.
    let (config, _, witness) = small_with(&[
        ("readout-ms = 30.0", &sensor_with("mosaic = \"rggb\"")),
        ("curve = \"srgb\"", "curve = \"linear\""),
        ("read-noise-levels = 0.2", "read-noise-levels = 5.0"),
    ]);
    let scene: Frame<Work> = Frame::filled(config.photo.size(), 100.0);
    let photo = witness.photograph(&scene, 5);
    for (channel, share) in [(Channel::Green, 0.5 + 0.5 / 4.0), (Channel::Red, 9.0 / 16.0)] {
        let plane = photo.plane(channel);
        let inside = (66..126).flat_map(|y| plane.row(y)[98..158].iter().map(|&v| f64::from(v)));
        let expected = (witness.noise_levels(100.0).powi(2) * share).sqrt();
        let (_, sigma) = mean_and_sigma(inside);
        assert!((sigma / expected - 1.0).abs() < 0.05, "{}: {sigma} {expected}", channel.name());
    }
}

#[test]
fn a_sensor_without_filters_has_no_raw_photo() {
    let (config, _, witness) = quiet_with(&[]);
    assert_eq!(PixelFormat::of(&config), None);
    assert_eq!(witness.photograph_raw(&Frame::zeros(config.photo.size()), 1), None);
}

/// Mean counts above black in the middle of the field, green.
pub(super) fn middle_of(counts: &Counts) -> f64 {
    let plane = counts.plane(Channel::Green);
    let rows = 100..124;
    let sum: f64 =
        rows.clone().flat_map(|y| plane.row(y)[130..158].iter()).map(|&v| f64::from(v)).sum();
    sum / (rows.len() * 28) as f64 - 64.0
}

#[test]
fn a_camera_s_gamma_and_knee_bend_counts_and_keep_white_in_photos() {
    let (config, mut straight, witness) = quiet_with(&[]);
    let curve = config::SensorCurve { gamma: 0.8, knee_share: 0.7, knee_slope: 0.4 };
    let (_, mut bent, bent_witness) = quiet_simulated_with(&[], |s| s.sensor.curve = curve);
    let range = 4095.0 - witness.black_level_counts();
    for code in [30, 90, 150, 200, 230, 255] {
        let light = middle_of(&straight.capture(&grey(&config, code)).expect("no faults").counts);
        let found = middle_of(&bent.capture(&grey(&config, code)).expect("no faults").counts);
        let share = (light / range).powf(0.8);
        let expected = range * (share - (share - 0.7).max(0.0) * 0.6);
        assert!((found - expected).abs() < 1.0, "{code}: {found} {expected}");
    }
    for (level, brighter) in [(255.0, 0.0), (60.0, 10.0)] {
        let scene: Frame<Work> = Frame::filled(config.photo.size(), level);
        let [plain, other] = [&witness, &bent_witness].map(|w| w.photograph(&scene, 1));
        let at = |photo: &Frame<Work, u8>| f64::from(photo.plane(Channel::Green).at(128, 96));
        let off = at(&other) - at(&plain);
        assert!(off >= brighter && (brighter > 0.0 || off < 1.0), "{level}: {off}");
    }
}

#[test]
fn the_fixed_pattern_is_the_same_in_photo_and_captures() {
    let linear = ("curve = \"srgb\"", "curve = \"linear\"");
    let (config, mut rig, witness) = quiet_simulated_with(&[linear], |simulation| {
        let sensor = &mut simulation.sensor;
        (sensor.gain_deviation, sensor.hot_pixel_share) = (0.01, 0.001);
        sensor.hot_pixel_levels = 60.0;
    });
    let (_, mut even, even_witness) = quiet_with(&[linear]);
    let codes = grey(&config, 200);
    let [seen, plain] = [&mut rig, &mut even].map(|r| r.capture(&codes).expect("no faults").counts);
    let (seen, plain) = (seen.plane(Channel::Green), plain.plane(Channel::Green));
    let gain_of =
        |n: usize| (f64::from(seen.data()[n]) - 64.0) / (f64::from(plain.data()[n]) - 64.0);
    let gains: Vec<f64> = (0..seen.size().area()).map(gain_of).collect();
    let ordinary = gains.iter().copied().filter(|g| (g - 1.0).abs() < 0.05);
    let (mean, sigma) = mean_and_sigma(ordinary);
    assert!((mean - 1.0).abs() < 2e-4 && (sigma / 0.01 - 1.0).abs() < 0.03, "{mean} {sigma}");
    let hot = gains.iter().filter(|&&g| g > 1.05).count() as f64 / gains.len() as f64;
    assert!((0.0005..0.0015).contains(&hot), "{hot}");

    let scene: Frame<Work> = Frame::filled(config.photo.size(), 200.0);
    let [photo, plain] = [&witness, &even_witness].map(|w| w.photograph(&scene, 1));
    let (mut both, mut one, mut other) = (0.0, 0.0, 0.0);
    for y in 0..192 {
        for x in 0..256 {
            let in_photo = f64::from(photo.plane(Channel::Green).at(x, y))
                - f64::from(plain.plane(Channel::Green).at(x, y));
            let in_capture = gains[(y + 16) * seen.width() + x + 16] - 1.0;
            if in_capture.abs() < 0.05 {
                both += in_photo * in_capture;
                one += in_photo * in_photo;
                other += in_capture * in_capture;
            }
        }
    }
    // Rounding the photo to 8 bits adds noise of 0.29 levels to a pattern of two levels.
    let correlation = both / (one * other).sqrt();
    assert!(correlation > 0.97, "{correlation}");
}

/// Means of 8×8 pixels above black, around sensor place (x, y), of the three channels.
fn around(counts: &Counts, [x, y]: [usize; 2]) -> [f64; 3] {
    counts.planes().each_ref().map(|plane| {
        let rows = (y - 4..y + 4).flat_map(|row| &plane.row(row)[x - 4..x + 4]);
        rows.map(|&v| f64::from(v)).sum::<f64>() / 64.0 - 64.0
    })
}

const PURE: (&str, &str) = (
    "cross-channel = [[1.0, 0.08, 0.01], [0.06, 1.0, 0.09], [0.01, 0.12, 1.0]]",
    "cross-channel = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
);
pub(super) const NO_GLARE: (&str, &str) = ("glare-share = 0.03", "glare-share = 0.0");

#[test]
fn an_uneven_panel_loses_light_and_blue_towards_its_corners() {
    let uneven =
        config::Uneven { corner_loss: 0.15, corner_tint: 0.02, ..config::Uneven::default() };
    let (config, mut even, witness) = quiet_with(&[PURE, NO_GLARE]);
    let (_, mut rig, _) = quiet_simulated_with(&[PURE, NO_GLARE], |s| s.display.uneven = uneven);
    // A flat field, and a picture that differs in one pixel and so takes the general path.
    let mut pictures = [grey(&config, 255), grey(&config, 255)];
    pictures[1].planes_mut().iter_mut().for_each(|plane| plane.set(0, 0, 254));
    for codes in &pictures {
        let [seen, plain] =
            [&mut rig, &mut even].map(|r| r.capture(codes).expect("no faults").counts);
        for at in [[144, 112], [20, 20], [268, 204], [20, 204], [268, 112]] {
            let [found, whole] = [around(&seen, at), around(&plain, at)];
            let [x, y] = witness.sensor_to_panel(Channel::Green, at.map(|v| v as f64 - 0.5));
            let out = ((x / 239.5 - 1.0).powi(2) + (y / 134.5 - 1.0).powi(2)) / 2.0;
            for (n, loss) in [0.14, 0.15, 0.16].into_iter().enumerate() {
                let share = found[n] / whole[n];
                assert!((share - (1.0 - loss * out)).abs() < 0.002, "{at:?} {n}: {share} {out}");
            }
        }
    }
}

#[test]
fn light_and_black_of_a_panel_depend_on_the_angle_of_view() {
    let uneven = config::Uneven {
        loss_at_10_deg: 0.2,
        leakage_at_10_deg: 0.02,
        ..config::Uneven::default()
    };
    let (config, mut even, _) = quiet_with(&[PURE, NO_GLARE]);
    let (_, mut rig, _) = quiet_simulated_with(&[PURE, NO_GLARE], |s| s.display.uneven = uneven);
    let mut shot = |code| {
        [&mut rig, &mut even].map(|r| r.capture(&grey(&config, code)).expect("no faults").counts)
    };
    let ([dark, dark_even], [bright, bright_even]) = (shot(0), shot(255));
    // Half the field of 288 pixels of 40 µm at 76.1 mm is 4.3°; the panel is turned by 0.9° and
    // 0.6° besides.
    let aslant = |at: [usize; 2]| {
        let [across, down] = [at[0] as f64 - 144.0, at[1] as f64 - 112.0]
            .map(|px| (px * 0.04 / 76.1).atan().to_degrees());
        [across, down]
    };
    for at in [[8, 112], [280, 112], [144, 8], [144, 216]] {
        let white = around(&bright_even, at)[1];
        let leaked = (around(&dark, at)[1] - around(&dark_even, at)[1]) / white;
        let lost = 1.0 - (around(&bright, at)[1] - leaked * white) / white;
        let [across, down] = aslant(at);
        // The frames show which way it is turned: one side is seen less aslant than the other.
        let angle = |leaked: f64| (leaked / 0.02).sqrt() * 10.0;
        let straight = across.hypot(down);
        assert!((angle(leaked) - straight).abs() < 1.15, "{at:?}: {} {straight}", angle(leaked));
        assert!((lost / 0.2 - leaked / 0.02).abs() < 0.02, "{at:?}: {lost} {leaked}");
    }
    let side = |x| around(&dark, [x, 112])[1] - around(&dark_even, [x, 112])[1];
    let ratio = (side(280) / side(8)).sqrt();
    let turned = (4.1f64 + 0.9) / (4.1 - 0.9);
    assert!((ratio - turned).abs() < 0.25 || (1.0 / ratio - turned).abs() < 0.25, "{ratio}");
}

/// Centroids, and second moments about them, of the three channels' light without dark corners.
pub(super) fn moments(light: &[Plane; 3], witness: &Witness) -> [([f64; 2], f64); 3] {
    Channel::ALL.map(|channel| {
        let (plane, falloff) = (&light[channel.index()], witness.dark_corner(channel));
        let values = plane.data().iter().zip(falloff.data()).map(|(&v, &f)| f64::from(v / f));
        moments_of(values, plane.width())
    })
}

pub(super) fn moments_of(
    values: impl Iterator<Item = f64> + Clone,
    width: usize,
) -> ([f64; 2], f64) {
    let total: f64 = values.clone().sum();
    let place = |n: usize| [(n % width) as f64, (n / width) as f64];
    let mean = |of: &dyn Fn([f64; 2]) -> f64| {
        values.clone().enumerate().map(|(n, v)| v * of(place(n))).sum::<f64>() / total
    };
    let [x, y] = [mean(&|at| at[0]), mean(&|at| at[1])];
    ([x, y], mean(&|at| (at[0] - x).powi(2) + (at[1] - y).powi(2)))
}

/// A bright spot of Gaussian shape around panel place `at`.
pub(super) fn spot(size: Size, at: [f64; 2]) -> Codes {
    Frame::from_fn(|_| {
        Plane::from_fn(size, |x, y| {
            let square = (x as f64 - at[0]).powi(2) + (y as f64 - at[1]).powi(2);
            (255.0 * (-square / 50.0).exp()) as u8
        })
    })
}

/// Replaces whole pixels by the stripes of an LCD.
const STRIPES: (&str, &str) = ("subpixels = \"whole\"", "subpixels = \"rgb\"");

pub(super) const NO_LEAKAGE: (&str, &str) = ("leakage-share = 0.001", "leakage-share = 0.0");

#[test]
fn striped_subpixels_move_red_and_blue_by_a_third_of_a_panel_pixel() {
    let (config, _, whole) = quiet_with(&[NO_LEAKAGE, NO_GLARE]);
    let (_, _, striped) = quiet_with(&[NO_LEAKAGE, NO_GLARE, STRIPES]);
    let codes = spot(config.panel.size(), [200.0, 120.0]);
    let [plain, moved] =
        [&whole, &striped].map(|w| moments(&w.light_on_sensor(&codes), w).map(|(place, _)| place));
    for (n, thirds) in [-1.0, 0.0, 1.0].into_iter().enumerate() {
        let off = [0, 1].map(|axis| moved[n][axis] - plain[n][axis]);
        assert!((off[0] - thirds / 3.0 * 0.86).abs() < 0.01 && off[1].abs() < 0.01, "{n}: {off:?}");
    }
}

#[test]
fn stripes_beat_with_the_sensor_s_pixels_as_far_as_the_lens_passes_them() {
    // At f/4 the lens passes a twentieth of such a grating, at f/16 most of it.
    for (stop, least, most) in [("18.75", 0.004, 0.03), ("4.7", 0.1, 0.3)] {
        let stop = format!("stop-diameter-mm = {stop}");
        let lens = [NO_GLARE, ("stop-diameter-mm = 18.75", &stop)];
        let (config, _, plain) = quiet_with(&lens);
        let (_, _, striped) = quiet_with(&[lens[0], lens[1], STRIPES]);
        let white = grey(&config, 255);
        let [plain, striped] = [&plain, &striped].map(|w| w.light_on_sensor(&white));
        // A sensor pixel covers 1/0.86 panel pixels, so a beat is 6.14 sensor pixels long.
        let (mut cosine, mut sine, mut count) = (0.0, 0.0, 0.0);
        let mut sum = 0.0;
        for y in 100..124 {
            for x in 113..175 {
                let share = f64::from(striped[1].at(x, y) / plain[1].at(x, y)) - 1.0;
                let phase = std::f64::consts::TAU * x as f64 * (1.0 / 0.86 - 1.0);
                (cosine, sine) = (cosine + share * phase.cos(), sine + share * phase.sin());
                (sum, count) = (sum + share, count + 1.0);
            }
        }
        let beat = 2.0 * f64::hypot(cosine, sine) / count;
        let mean = sum / count;
        println!("{stop}: a beat of {beat:.4} of the light about {mean:.5}");
        // The field holds ten beats and a fraction, whose mean is a few hundredths of their height.
        assert!((least..most).contains(&beat) && mean.abs() < 0.05 * beat, "{stop}: {beat} {mean}");
    }
}

#[test]
fn at_a_real_sensor_s_pitch_the_lens_passes_nothing_of_the_stripes() {
    for (name, most) in [("ideal.toml", 0.02), ("small.toml", 0.2)] {
        let config = config::load(std::path::Path::new(name)).expect("built in");
        let simulation = config.simulation().expect("simulated");
        let optics = Optics::new(simulation, config.camera.size(), config.photo_on_sensor())
            .expect("a good lens");
        let Size { width, height } = config.camera.size();
        let [right, bottom] = [width, height].map(|side| side as f64 - 1.0);
        for at in [[right / 2.0, bottom / 2.0], [right * 0.75, bottom * 0.75], [right, bottom]] {
            let passed = optics.transfer(Channel::Green, at, [1.0 / 0.86, 0.0]).norm();
            println!("{name} {at:?}: {passed:.4} passed");
            assert!(passed < most, "{name} {at:?}: {passed}");
        }
    }
}
