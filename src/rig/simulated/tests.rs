//! The simulated rig as a whole: captures, their timing, and their agreement with the witness.

use std::path::Path;

use super::*;
use crate::config::{Faults, load, parse};
use crate::frame::{Channel, Codes, Counts, Frame, Plane, Size, Work};
use crate::rig::Moment;

fn opened(name: &str) -> (config::RigFile, Devices, Witness) {
    let config = load(Path::new(name)).expect("built in");
    let (rig, witness) = open(&config).expect("a good lens");
    (config, rig, witness)
}

/// small.toml with some lines changed.
pub(super) fn small_with(changes: &[(&str, &str)]) -> (config::RigFile, Devices, Witness) {
    small_simulated_with(changes, |_| {})
}

/// small.toml with some lines and its simulation changed.
pub(super) fn small_simulated_with(
    changes: &[(&str, &str)],
    change: impl FnOnce(&mut config::Simulation),
) -> (config::RigFile, Devices, Witness) {
    let mut text = include_str!("../../../rig-config/small.toml").to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "small.toml has no `{from}`");
        text = text.replacen(from, to, 1);
    }
    let mut config = parse(&text, "small.toml").expect("allowed");
    if let config::Kind::Simulated(simulation) = &mut config.kind {
        change(simulation);
    }
    let (rig, witness) = open(&config).expect("a good lens");
    (config, rig, witness)
}

pub(super) const QUIET: [(&str, &str); 4] = [
    ("full-well-electrons = 42000.0", "full-well-electrons = inf"),
    ("read-noise-levels = 0.2", "read-noise-levels = 0.0"),
    ("bits = 10", "bits = 12"),
    ("ambient-levels = [0.4, 0.5, 0.6]", "ambient-levels = [0.0, 0.0, 0.0]"),
];

fn only(stale: f64, duplicate: f64, missing: f64, mixed: f64, unplugged: f64) -> Faults {
    Faults { stale, duplicate, missing, mixed, unplugged, unplugged_ms: 2000.0 }
}

pub(super) fn grey(config: &config::RigFile, code: u8) -> Codes {
    Frame::filled(config.panel.size(), code)
}

fn mean(counts: &Counts, channel: Channel, rows: std::ops::Range<usize>) -> f64 {
    let plane = counts.plane(channel);
    let values = rows.clone().flat_map(|y| plane.row(y).iter());
    values.map(|&v| f64::from(v)).sum::<f64>() / (rows.len() * plane.width()) as f64
}

#[test]
fn a_capture_takes_as_long_as_its_parts() {
    let (config, mut rig, _) = opened("small.toml");
    let seen = rig.capture(&grey(&config, 128)).expect("no faults");
    assert_eq!(seen.counts.size(), config.camera.size());
    // First vblank at 1/60 s, 100 ms to settle, 50 ms of exposure, 30 ms to read out.
    assert!((rig.seconds() - (1.0 / 60.0 + 0.18)).abs() < 1e-9, "{}", rig.seconds());
    assert_eq!((rig.captures(), seen.at), (1, Moment(1.0 / 60.0 + 0.1)));
    let again = rig.capture(&grey(&config, 128)).expect("no faults");
    assert_eq!(again.sequence, seen.sequence + 1);
}

#[test]
fn captures_of_a_flat_panel_agree_with_the_witness() {
    let (config, mut rig, witness) = small_with(&QUIET);
    let codes = Frame::from_fn(|c| Plane::filled(config.panel.size(), [200, 120, 60][c.index()]));
    let seen = rig.capture(&codes).expect("no faults").counts;
    let (x, y) = (config.camera.width_px / 2, config.camera.height_px / 2);
    for channel in Channel::ALL {
        let row = witness.cross_channel()[channel.index()];
        let mut level = 0.0;
        for primary in Channel::ALL {
            let code = usize::from(codes.plane(primary).at(0, 0));
            level += row[primary.index()] * f64::from(witness.panel_response(primary)[code]);
        }
        let expected = witness.black_level_counts() + level * witness.counts_per_level();
        let found = f64::from(seen.plane(channel).at(x, y));
        // Half a count of rounding, and the light that glare scatters beyond the panel.
        assert!(
            (found - expected).abs() < 0.6 + 2e-3 * expected,
            "{}: {found} {expected}",
            channel.name()
        );
    }
    let corner = witness.dark_corner(Channel::Green);
    assert!(corner.at(0, 0) < 0.97 && corner.at(0, 0) > 0.5, "{}", corner.at(0, 0));
    assert!((corner.at(x, y) - 1.0).abs() < 1e-3);
}

#[test]
fn a_blob_is_seen_at_its_mapped_place_in_every_channel() {
    let (config, _, witness) = small_with(&[
        ("glare-share = 0.03", "glare-share = 0.0"),
        ("leakage-share = 0.001", "leakage-share = 0.0"),
    ]);
    for at in [[240usize, 135], [90, 60], [370, 200]] {
        // A round, soft blob, since a single pixel's centroid depends on how footprints cut it.
        let blob = Plane::from_fn(config.panel.size(), |x, y| {
            let square = (x as f64 - at[0] as f64).powi(2) + (y as f64 - at[1] as f64).powi(2);
            (255.0 * (-square / 50.0).exp()) as u8
        });
        let codes: Codes = Frame::from_fn(|_| blob.clone());
        let light = witness.light_on_sensor(&codes);
        for channel in Channel::ALL {
            let (plane, falloff) = (&light[channel.index()], witness.dark_corner(channel));
            let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
            for (n, (&value, &share)) in plane.data().iter().zip(falloff.data()).enumerate() {
                let value = f64::from(value / share);
                sum += value;
                x += value * (n % plane.width()) as f64;
                y += value * (n / plane.width()) as f64;
            }
            let found = [x / sum, y / sum];
            let expected = witness.panel_to_sensor(channel, at.map(|v| v as f64));
            let off = (found[0] - expected[0]).hypot(found[1] - expected[1]);
            // Binning displaces the centroid of spots with edges sharper than a pixel by up to 0.02
            // px.
            assert!(off < 0.03, "{} {at:?}: {found:?} {expected:?}", channel.name());
            let back = witness.sensor_to_panel(channel, expected);
            assert!((back[0] - at[0] as f64).hypot(back[1] - at[1] as f64) < 1e-3, "{back:?}");
        }
    }
}

#[test]
fn the_whole_sensor_sees_panel() {
    for name in config::built_in_names() {
        // Rig files of real devices need the `hardware` feature.
        let Ok(config) = load(Path::new(name)) else { continue };
        let Some(simulation) = config.simulation() else { continue };
        let optics = Optics::new(simulation, config.camera.size(), config.photo_on_sensor())
            .expect("a good lens");
        let map = optics.map(&simulation.pose, config.panel.size());
        let (width, height) =
            (config.camera.width_px as f64 - 1.0, config.camera.height_px as f64 - 1.0);
        for corner in [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]] {
            let [x, y] = map.to_panel(corner);
            let (right, bottom) =
                (config.panel.width_px as f64 - 1.0, config.panel.height_px as f64 - 1.0);
            assert!(
                x >= -1e-6 && y >= -1e-6 && x <= right + 1e-6 && y <= bottom + 1e-6,
                "{name}: {x} {y}"
            );
        }
    }
}

#[test]
fn on_the_study_s_rig_a_capture_is_the_operator_plus_noise() {
    let (config, mut rig, witness) = opened("study.toml");
    let codes: Codes = Frame::from_fn(|c| {
        Plane::from_fn(config.panel.size(), |x, y| {
            (60 + (x / 9 + y / 7 + c.index()) % 2 * 120) as u8
        })
    });
    let shown: Frame<Work> = Frame::from_fn(|c| codes.plane(c).map(f32::from));
    let truth = witness.forward(&shown, Light::Panel);
    let seen = rig.capture(&codes).expect("no faults").counts;
    for channel in Channel::ALL {
        let gain = witness.counts_per_level();
        let mut off = seen.plane(channel).map(|count| f32::from(count) / gain as f32);
        off.add_scaled(-1.0, truth.plane(channel));
        // One grey level of noise and 8-bit rounding.
        let noise = (1.0 + 1.0 / (12.0 * gain * gain)).sqrt();
        assert!((off.rms() - noise).abs() < 0.02, "{}", off.rms());
        assert!(off.mean().abs() < 0.01, "{}", off.mean());
    }
    let spot = witness.function(Light::Panel, Channel::Green, [255.5, 191.5]);
    assert_eq!(spot.size(), Size::new(33, 33));
}

#[test]
fn functions_sum_to_one_and_are_as_wide_as_the_spots() {
    let (_, _, witness) = opened("study.toml");
    // numbers.md: green RMS 1.94 px in the centre, 4.05 px in the corner, at 20 µm.
    for (at, expected) in [([255.5, 191.5], 0.03876 / 0.02), ([511.5, 383.5], 0.08496 / 0.02)] {
        let spot = witness.function(Light::Panel, Channel::Green, at);
        let (mut sum, mut x, mut y, mut square) = (0.0, 0.0, 0.0, 0.0);
        for (n, &value) in spot.data().iter().enumerate() {
            let (value, i, j) = (f64::from(value), (n % 33) as f64 - 16.0, (n / 33) as f64 - 16.0);
            sum += value;
            x += value * i;
            y += value * j;
            square += value * (i * i + j * j);
        }
        assert!((sum - 1.0).abs() < 1e-5 && x.hypot(y) < 0.02, "{sum} {x} {y}");
        // Binning to pixels adds 1/6 px² to the second moment.
        let rms = (square - 1.0 / 6.0).sqrt();
        assert!((rms / expected - 1.0).abs() < 0.03, "{at:?}: {rms} {expected}");
    }
}

#[test]
fn a_photograph_has_its_noise_its_surround_and_its_seed() {
    let (config, _, witness) = opened("study.toml");
    let scene: Frame<Work> = Frame::filled(config.photo.size(), 128.0);
    let photo = witness.photograph(&scene, 3);
    let plane = photo.plane(Channel::Green);
    let inner: Vec<f64> =
        (100..300).flat_map(|y| plane.row(y)[100..400].iter().map(|&v| f64::from(v))).collect();
    let mean = inner.iter().sum::<f64>() / inner.len() as f64;
    let sigma = (inner.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / inner.len() as f64).sqrt();
    assert!(
        (mean - 128.0).abs() < 0.03 && (sigma - (1.0f64 + 1.0 / 12.0).sqrt()).abs() < 0.02,
        "{mean} {sigma}"
    );
    // The surround is black, so a corner gets about a quarter of its light.
    assert!(plane.at(0, 0) < 80, "{}", plane.at(0, 0));
    assert_eq!(photo, witness.photograph(&scene, 3));
    assert_ne!(photo, witness.photograph(&scene, 4));

    let (config, _, witness) = opened("small.toml");
    let scene: Frame<Work> = Frame::filled(config.photo.size(), 128.0);
    let photo = witness.photograph(&scene, 3);
    // The scene continues, so only the dark corner darkens; the sRGB code of linear 128 is 188.
    assert!(
        photo.plane(Channel::Green).at(0, 0) > 175 && photo.plane(Channel::Green).at(128, 96) > 184
    );
}

#[test]
fn a_panel_not_settled_still_shows_the_last_picture() {
    let changes: Vec<_> =
        QUIET.into_iter().chain([("settle-ms = 100.0", "settle-ms = 0.0")]).collect();
    let (config, mut rig, witness) = small_with(&changes);
    let middle = config.camera.height_px / 2..config.camera.height_px / 2 + 1;
    let seen = rig.capture(&grey(&config, 255)).expect("no faults").counts;
    let early = mean(&seen, Channel::Green, middle.clone()) - witness.black_level_counts();
    let settled = rig.capture(&grey(&config, 255)).expect("no faults").counts;
    let full = mean(&settled, Channel::Green, middle) - witness.black_level_counts();
    // Two refreshes at 60 Hz pass before the change. For the last 16.7 ms of the 50 ms exposure the
    // panel approaches the picture, with a time constant of 5 ms.
    let passed_ms = 50.0 - 2000.0 / 60.0;
    let expected = (passed_ms - 5.0 * (1.0 - (-passed_ms / 5.0f64).exp())) / 50.0;
    assert!((early / full - expected).abs() < 0.005, "{} {expected}", early / full);
}

#[test]
fn faults_show_what_they_are_called() {
    let (config, mut rig, witness) = small_with(&QUIET);
    let (height, all) = (config.camera.height_px, 0..config.camera.height_px);
    rig.capture(&grey(&config, 0)).expect("no faults");

    witness.set_faults(only(1.0, 0.0, 0.0, 0.0, 0.0));
    let stale =
        rig.capture(&grey(&config, 255)).expect("a stale frame looks like any other").counts;
    assert!(mean(&stale, Channel::Green, all) < 300.0);

    witness.set_faults(only(0.0, 0.0, 0.0, 1.0, 0.0));
    rig.capture(&grey(&config, 0)).expect("mixed");
    let mixed =
        rig.capture(&grey(&config, 255)).expect("a mixed frame looks like any other").counts;
    assert!(
        mean(&mixed, Channel::Green, 0..1) < 300.0
            && mean(&mixed, Channel::Green, height - 1..height) > 2000.0
    );

    witness.set_faults(only(0.0, 0.0, 1.0, 0.0, 0.0));
    let before = rig.captures();
    assert!(matches!(rig.capture(&grey(&config, 9)), Err(RigError::NoFrame { .. })));
    assert_eq!(rig.captures() - before, 3);

    witness.set_faults(only(0.0, 1.0, 0.0, 0.0, 0.0));
    let said = rig.capture(&grey(&config, 9)).expect_err("only repeated frames").to_string();
    assert!(said.contains("a second time"), "{said}");

    witness.set_faults(only(0.0, 0.0, 0.0, 0.0, 0.0));
    witness.unplug();
    assert!(matches!(rig.capture(&grey(&config, 9)), Err(RigError::Gone { .. })));
    assert!(matches!(rig.reopen(), Err(RigError::Gone { .. })));
    rig.clock.wait_until(Moment(rig.clock.now().0 + 2.0));
    assert!(
        matches!(rig.capture(&grey(&config, 9)), Err(RigError::Gone { .. })),
        "not opened again yet"
    );
    rig.reopen().expect("it is back");
    rig.capture(&grey(&config, 9)).expect("no faults");
}

#[test]
fn a_missing_frame_is_shot_again() {
    let (config, mut rig, witness) = opened("small.toml");
    witness.set_faults(only(0.0, 0.0, 0.3, 0.0, 0.0));
    let got = (0..20).filter(|_| rig.capture(&grey(&config, 9)).is_ok()).count();
    // Three tries at 0.3: one in 37 pictures fails.
    assert!(got >= 18 && rig.captures() > 20, "{got} {}", rig.captures());
}

#[test]
fn a_knock_moves_everything_seen() {
    let (_, _, mut witness) = opened("small.toml");
    let before = witness.panel_to_sensor(Channel::Green, [240.0, 135.0]);
    witness.knock_panel(2.0, -1.0);
    let after = witness.panel_to_sensor(Channel::Green, [240.0, 135.0]);
    assert!((after[0] - before[0] - 2.0).abs() < 0.01 && (after[1] - before[1] + 1.0).abs() < 0.01);
}

#[test]
fn the_same_seed_gives_the_same_captures() {
    let (config, mut one, _) = opened("small.toml");
    let (_, mut other, _) = opened("small.toml");
    let pictures = [grey(&config, 40), grey(&config, 200)];
    for codes in &pictures {
        assert_eq!(
            one.capture(codes).expect("no faults"),
            other.capture(codes).expect("no faults")
        );
    }
}

#[test]
fn a_picture_of_another_size_is_refused() {
    let (_, mut rig, _) = opened("small.toml");
    let said = rig.capture(&Frame::zeros(Size::new(7, 5))).expect_err("too small").to_string();
    assert!(said.contains("7×5") && said.contains("480×270"), "{said}");
}
