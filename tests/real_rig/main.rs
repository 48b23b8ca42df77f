//! Tests on the real rig named by `RELENS_RIG`; ignored by default.
//!
//!     RELENS_RIG=/etc/relens/rig.toml cargo test --release --features hardware \
//!         --test real_rig -- --ignored rig_
//!
//! The virtual rig of `tests/vm` runs the same tests, and those for a camera with faults on request
//! (the kernel's vivid; `RELENS_VIVID` is its card name), for a media graph (the kernel's vimc),
//! and for a free-running camera (`RELENS_FREE_RIG` is its rig file).
#![cfg(feature = "hardware")]
// Measured values are printed; `--nocapture` shows them.
#![allow(clippy::print_stdout)]

#[path = "../counted/mod.rs"]
mod counted;
mod free;
mod page;
mod vimc;
mod vivid;

use std::collections::HashSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use relens::config::{self, Kind};
use relens::frame::{Channel, Codes};
use relens::rig::exposure::Devices;
use relens::rig::kms_panel::KmsPanel;
use relens::rig::monotonic::Monotonic;
use relens::rig::{self, Clock, Flip, Panel, RigError};

fn file() -> config::RigFile {
    let file = std::env::var("RELENS_RIG").expect("RELENS_RIG names the rig file");
    config::load(Path::new(&file)).unwrap_or_else(|error| panic!("{error}"))
}

fn opened() -> (Devices, config::RigFile) {
    opened_as(file())
}

fn opened_as(config: config::RigFile) -> (Devices, config::RigFile) {
    let rig = rig::open(&config).unwrap_or_else(|error| panic!("{error}"));
    (rig, config)
}

/// Opens the panel alone.
fn panel_of(config: &config::RigFile) -> KmsPanel {
    let Kind::Hardware(hardware) = &config.kind else { panic!("a rig of devices") };
    KmsPanel::open(&config.panel, &hardware.panel).unwrap_or_else(|error| panic!("{error}"))
}

fn grey(config: &config::RigFile, code: u8) -> Codes {
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
    println!("{}", every_capture_is_of_its_own_picture(opened()));
}

/// Checks that captures of four greys show their own picture; returns a summary.
fn every_capture_is_of_its_own_picture((mut rig, config): (Devices, config::RigFile)) -> String {
    let codes = [30, 90, 150, 210];
    let levels = codes.map(|code| middle(&rig.capture(&grey(&config, code)).expect("a frame")));
    assert!(
        levels.windows(2).all(|pair| pair[1] > pair[0]),
        "brighter codes are brighter: {levels:?}"
    );
    let step = levels.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    for n in 0..12 {
        let which = (n * 7) % 4;
        let level = middle(&rig.capture(&grey(&config, codes[which])).expect("a frame"));
        assert!(
            (level - levels[which]).abs() < step / 3.0,
            "capture {n}: {level}, not {}",
            levels[which]
        );
    }
    format!("levels {levels:.1?}, rejected {:?}", rig.rejected())
}

#[test]
#[ignore = "needs a rig"]
fn rig_opens_again_and_again() {
    // Every opening searches for the marks, before frames can be identified by them.
    let openings = std::env::var("RELENS_OPENINGS").ok().and_then(|n| n.parse().ok()).unwrap_or(2);
    for n in 0..openings {
        let (mut rig, config) = opened();
        let (dark, light) = (grey(&config, 60), grey(&config, 180));
        let levels = [&dark, &light].map(|codes| middle(&rig.capture(codes).expect("a frame")));
        assert!(levels[1] > levels[0], "{levels:?}");
        println!("opening {n}: {} exposures, rejected {:?}", rig.captures(), rig.rejected());
    }
}

#[test]
#[ignore = "needs a rig"]
fn rig_timing_can_be_measured() {
    let (mut rig, _) = opened_as(relens::diagnosis::patient(&file()));
    let timing =
        relens::diagnosis::measure(&mut rig, &file()).unwrap_or_else(|error| panic!("{error}"));
    println!("{timing}");
    assert!(timing.settle_ms.is_finite(), "{timing}");
}

#[test]
#[ignore = "needs a rig"]
fn rig_devices_are_released_and_can_be_opened_again() {
    let (rig, config) = opened();
    let second = rig::open(&config).err().map(|error| error.to_string());
    assert!(
        second.as_ref().is_some_and(|said| said.contains("in use")),
        "a second opening fails: {second:?}"
    );
    drop(rig);
    rig::open(&config).unwrap_or_else(|error| panic!("after the first was dropped: {error}"));
}

#[test]
#[ignore = "needs a rig"]
fn rig_panel_away_and_back() {
    // The virtual rig's cable is a file; a real one has to be pulled by hand.
    let Ok(cable) = std::env::var("RELENS_PANEL_STATUS") else { return };
    let (mut rig, config) = opened();
    let picture = grey(&config, 128);
    let before = middle(&rig.capture(&picture).expect("a frame"));
    std::fs::write(&cable, "off").expect("the cable can be pulled");
    for _ in 0..3 {
        let error = rig.capture(&picture).err();
        assert!(matches!(error, Some(RigError::Gone { device: "panel", .. })), "{error:?}");
    }
    std::fs::write(&cable, "detect").expect("the cable can be plugged in");
    let after = middle(&rig.capture(&picture).unwrap_or_else(|error| panic!("{error}")));
    assert!((after - before).abs() < 0.05 * before + 2.0, "{before} before, {after} after");
}

#[test]
#[ignore = "needs a rig"]
fn rig_display_taken_by_another_program_and_given_back() {
    // On a real rig a desktop has to be started and ended by hand.
    let Ok(taker) = std::env::var("RELENS_DISPLAY_TAKER") else { return };
    let (mut rig, config) = opened();
    let picture = grey(&config, 128);
    let before = middle(&rig.capture(&picture).expect("a frame"));
    let words = [&std::process::id().to_string(), "/dev/dri/card0", "3"];
    let mut other =
        Command::new(&taker).args(words).stdout(Stdio::piped()).spawn().expect("it starts");
    let mut said = String::new();
    BufReader::new(other.stdout.take().expect("piped")).read_line(&mut said).expect("it speaks");
    assert_eq!(said, "the display is taken\n");
    let errors: Vec<_> = (0..4).map(|_| rig.capture(&picture).err()).collect();
    assert!(
        other.try_wait().expect("it runs").is_none(),
        "the display was given back too early to tell"
    );
    let held = |error: &RigError| matches!(error, RigError::Held { device: "panel", .. });
    assert!(errors.iter().all(|error| error.as_ref().is_some_and(held)), "{errors:?}");
    let words: HashSet<_> = errors.iter().flatten().map(ToString::to_string).collect();
    assert!(
        words.len() == 1 && words.iter().all(|w| w.contains("another program drives")),
        "{words:?}"
    );
    assert!(other.wait().expect("it ends").success());
    // The kernel blanked the display when the other program ended, so the mode is set again.
    let after = middle(&rig.capture(&picture).unwrap_or_else(|error| panic!("{error}")));
    assert!((after - before).abs() < 0.05 * before + 2.0, "{before} before, {after} after");
    println!("{before:.1} before, {after:.1} after; in between: {words:?}");
}

#[test]
#[ignore = "needs a rig"]
fn rig_flips_are_stamped_at_whole_refreshes() {
    let config = file();
    let mut panel = panel_of(&config);
    let pictures = [grey(&config, 50), grey(&config, 150)];
    let interval_s = panel.interval_s();
    let mut last: Option<Flip> = None;
    for n in 0..20 {
        let asked = Monotonic.now().0;
        let flip = panel.show(&pictures[n % 2]).unwrap_or_else(|error| panic!("{error}"));
        // The stamp is that of a refresh during the wait, to within half a refresh for drivers that
        // round.
        let seen = Monotonic.now().0;
        assert!(
            flip.at.0 > asked - interval_s / 2.0 && flip.at.0 <= seen + interval_s / 2.0,
            "flip {n}"
        );
        if let Some(last) = last {
            let refreshes = f64::from(flip.vblank.wrapping_sub(last.vblank) as u32);
            let error_s = flip.at.0 - last.at.0 - refreshes * interval_s;
            assert!(refreshes >= 1.0 && error_s.abs() < interval_s / 4.0, "flip {n}: {error_s} s");
        }
        last = Some(flip);
    }
    println!("20 flips, {:.3} ms a refresh", interval_s * 1e3);
}

#[test]
#[ignore = "needs a rig"]
fn rig_flip_events_allocate_nothing() {
    let config = file();
    let mut panel = panel_of(&config);
    let pictures = [grey(&config, 50), grey(&config, 150)];
    for n in 0..20 {
        panel.put(&pictures[n % 2]).expect("it is there");
        let (flip, allocations) = counted::allocations(|| panel.flipped());
        flip.expect("it refreshes");
        assert_eq!(allocations, 0, "flip {n}");
    }
}
