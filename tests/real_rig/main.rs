//! A rig of real devices, whichever `RELENS_RIG` names; ignored where there is none.
//!
//!     RELENS_RIG=/etc/relens/rig.toml cargo test --release --features hardware --test real_rig -- --ignored rig_
//!
//! The virtual rig of `tests/vm` runs the same bodies, and those for a camera that misbehaves on request
//! (the kernel's vivid, `RELENS_VIVID` its card name).
#![cfg(feature = "hardware")]

#[path = "../counted/mod.rs"]
mod counted;
mod vivid;

use std::path::Path;

use relens::config;
use relens::config::Kind;
use relens::frame::{Channel, Codes};
use relens::rig::exposure::Rig;
use relens::rig::kms_panel::{KmsPanel, KmsSettings};
use relens::rig::{self, RigError};

fn opened() -> (Rig, config::Rig) {
    let file = std::env::var("RELENS_RIG").expect("RELENS_RIG names the rig file");
    let config = config::load(Path::new(&file)).unwrap_or_else(|error| panic!("{error}"));
    let rig = rig::open(&config).unwrap_or_else(|error| panic!("{error}"));
    (rig, config)
}

fn grey(config: &config::Rig, code: u8) -> Codes {
    Codes::filled(config.panel.size(), code)
}

/// Mean count in the middle of the green plane.
fn middle(exposed: &rig::Exposed) -> f64 {
    let plane = exposed.counts.plane(Channel::Green);
    let (width, height) = (plane.width(), plane.height());
    let rows = (height / 3..height * 2 / 3).flat_map(|y| &plane.row(y)[width / 3..width * 2 / 3]);
    let (sum, count) = rows.fold((0.0, 0.0), |(sum, count), &v| (sum + f64::from(v), count + 1.0));
    sum / count
}

#[test]
#[ignore = "needs a rig"]
fn rig_every_capture_is_of_its_own_picture() {
    let (mut rig, config) = opened();
    let codes = [30, 90, 150, 210];
    let levels = codes.map(|code| middle(&rig.capture(&grey(&config, code)).expect("a frame")));
    assert!(levels.windows(2).all(|pair| pair[1] > pair[0]), "brighter codes are brighter: {levels:?}");
    let step = levels.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    for n in 0..12 {
        let which = (n * 7) % 4;
        let level = middle(&rig.capture(&grey(&config, codes[which])).expect("a frame"));
        assert!((level - levels[which]).abs() < step / 3.0, "capture {n}: {level}, not {}", levels[which]);
    }
    println!("levels {levels:.1?}, rejected {:?}", rig.rejected());
}

#[test]
#[ignore = "needs a rig"]
fn rig_opens_again_and_again() {
    // Every opening looks for the marks before any frame can be proven.
    let openings = std::env::var("RELENS_OPENINGS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    for n in 0..openings {
        let (mut rig, config) = opened();
        let (dark, light) = (grey(&config, 60), grey(&config, 180));
        let levels = [&dark, &light].map(|codes| middle(&rig.capture(codes).expect("a frame")));
        assert!(levels[1] > levels[0], "{levels:?}");
        // The next opening finds a camera that was left with overlapped frames.
        let mut seen = [0.0; 4];
        rig.capture_all(&[&light, &dark, &light, &dark], &mut |n, exposed| seen[n] = middle(&exposed))
            .unwrap_or_else(|error| panic!("{error}"));
        assert!(seen[0] > seen[1] && seen[2] > seen[3], "{seen:?}");
        println!("opening {n}: {} exposures, rejected {:?}", rig.captures(), rig.rejected());
    }
}

#[test]
#[ignore = "needs a rig"]
fn rig_known_pictures_come_each_once() {
    let (mut rig, config) = opened();
    let greys = [40, 120, 200].map(|code| grey(&config, code));
    let pictures: Vec<&Codes> = (0..9).map(|n| &greys[n % 3]).collect();
    let mut levels = vec![None; pictures.len()];
    let begin = rig.seconds();
    rig.capture_all(&pictures, &mut |n, exposed| {
        assert!(levels[n].replace(middle(&exposed)).is_none(), "picture {n} came twice");
    })
    .unwrap_or_else(|error| panic!("{error}"));
    println!("{:.0} ms a picture, rejected {:?}", (rig.seconds() - begin) / 9.0 * 1e3, rig.rejected());
    for n in 0..9 {
        let (this, first) = (levels[n].expect("it came"), levels[n % 3].expect("it came"));
        assert!((this - first).abs() < 0.05 * first + 2.0, "picture {n}: {levels:?}");
    }
}

#[test]
#[ignore = "needs a rig"]
fn rig_timing_can_be_measured() {
    let (mut rig, config) = opened();
    let timing =
        relens::check::measure(&mut rig, config.panel.refresh_hz).unwrap_or_else(|error| panic!("{error}"));
    println!("{timing}");
    assert!(timing.settle_ms.is_finite(), "{timing}");
}

#[test]
#[ignore = "needs a rig"]
fn rig_devices_are_given_back_and_can_be_had_again() {
    let (rig, config) = opened();
    let second = rig::open(&config).err().map(|error| error.to_string());
    assert!(second.as_ref().is_some_and(|said| said.contains("held")), "a second one is told: {second:?}");
    drop(rig);
    rig::open(&config).unwrap_or_else(|error| panic!("after the first was dropped: {error}"));
}

#[test]
#[ignore = "needs a rig"]
fn rig_panel_away_and_back() {
    // The virtual rig's cable is a file; on a real one somebody has to pull it.
    let Ok(cable) = std::env::var("RELENS_PANEL_STATUS") else { return };
    let (mut rig, config) = opened();
    let picture = grey(&config, 128);
    let before = middle(&rig.capture(&picture).expect("a frame"));
    std::fs::write(&cable, "off").expect("the cable can be pulled");
    for _ in 0..3 {
        let told = rig.capture(&picture).err();
        assert!(matches!(told, Some(RigError::Gone { device: "panel", .. })), "{told:?}");
    }
    std::fs::write(&cable, "detect").expect("the cable can be plugged in");
    let after = middle(&rig.capture(&picture).unwrap_or_else(|error| panic!("{error}")));
    assert!((after - before).abs() < 0.05 * before + 2.0, "{before} before, {after} after");
}

#[test]
#[ignore = "needs a rig"]
fn rig_flip_events_allocate_nothing() {
    let file = std::env::var("RELENS_RIG").expect("RELENS_RIG names the rig file");
    let config = config::load(Path::new(&file)).unwrap_or_else(|error| panic!("{error}"));
    let Kind::Hardware(hardware) = &config.kind else { panic!("a rig of devices") };
    let mut panel = KmsPanel::open(KmsSettings {
        node: hardware.panel.node.clone(),
        connector: hardware.panel.connector.clone(),
        size: config.panel.size(),
        refresh_hz: config.panel.refresh_hz,
    })
    .unwrap_or_else(|error| panic!("{error}"));
    let pictures = [grey(&config, 50), grey(&config, 150)];
    for n in 0..20 {
        panel.put(&pictures[n % 2]).expect("it is there");
        let (flip, allocations) = counted::allocations(|| panel.flipped());
        flip.expect("it refreshes");
        assert_eq!(allocations, 0, "flip {n}");
    }
}
