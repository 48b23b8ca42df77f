//! What a real rig does and an ideal one does not, measured from the frames.

use super::tests::{QUIET, grey, small_with};
use super::*;
use crate::frame::{Channel, Codes, Counts, Frame, Mosaic, Plane, Size, Work};
use crate::rig::pixel_format::PixelFormat;

/// small.toml without noise, and some lines changed.
fn quiet_with(changes: &[(&str, &str)]) -> (config::Rig, Rig, Witness) {
    small_with(&[&QUIET[..], changes].concat())
}

/// A line of `[sensor]`, which every rig file has, and more lines with it.
fn sensor_with(lines: &str) -> String {
    format!("readout-ms = 30.0\n{lines}")
}

fn mean_and_sigma(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
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
        assert_eq!(PixelFormat::of(&config), Some(PixelFormat::Bayer { mosaic, bits: 12 }));
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
        witness.set_white_share(3.0);
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
    // Interpolating four sites halves their noise; half of all sites are a channel's own in green.
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
fn middle_of(counts: &Counts) -> f64 {
    let plane = counts.plane(Channel::Green);
    let rows = 100..124;
    let sum: f64 =
        rows.clone().flat_map(|y| plane.row(y)[130..158].iter()).map(|&v| f64::from(v)).sum();
    sum / (rows.len() * 28) as f64 - 64.0
}

#[test]
fn a_camera_s_gamma_and_knee_bend_counts_as_said_and_keep_white_white_in_photos() {
    let curve =
        "[sensor.curve]\ngamma = 0.8\nknee-share = 0.7\nknee-slope = 0.4\n\n[sensor.filters]";
    let (config, mut straight, witness) = quiet_with(&[]);
    let (_, mut bent, bent_witness) = quiet_with(&[("[sensor.filters]", curve)]);
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
fn the_fixed_pattern_is_as_large_as_said_and_the_same_in_photo_and_captures() {
    let lines =
        sensor_with("gain-deviation = 0.01\nhot-pixel-share = 0.001\nhot-pixel-levels = 60.0");
    let pattern = ("readout-ms = 30.0", lines.as_str());
    let linear = ("curve = \"srgb\"", "curve = \"linear\"");
    let (config, mut rig, witness) = quiet_with(&[pattern, linear]);
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
    // The photo's 8 bits add 0.29 of a level to a pattern of two levels.
    let correlation = both / (one * other).sqrt();
    assert!(correlation > 0.97, "{correlation}");
}
