//! A rig of real devices, whichever `RELENS_RIG` names; ignored where there is none.
//!
//!     RELENS_RIG=/etc/relens/rig.toml cargo test --release --features hardware --test real_rig -- --ignored
//!
//! The virtual rig of `tests/vm` runs the same bodies, and those for a camera that misbehaves on request
//! (the kernel's vivid, `RELENS_VIVID` its card name).
#![cfg(feature = "hardware")]

use std::path::Path;

use relens::config;
use relens::frame::{Channel, Codes, Size};
use relens::rig::exposure::Rig;
use relens::rig::monotonic::Monotonic;
use relens::rig::pixel_format::PixelFormat;
use relens::rig::v4l2_camera::{CameraName, CameraSettings, V4l2Camera};
use relens::rig::v4l2_controls::Exposure;
use relens::rig::{self, Camera, Clock, Moment, RigError};

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

fn vivid() -> CameraSettings {
    let card = std::env::var("RELENS_VIVID").expect("RELENS_VIVID names the card");
    CameraSettings {
        name: CameraName::Card(card),
        size: Size::new(640, 480),
        format: PixelFormat::Grey,
        buffers: 4,
        exposure: Exposure::Elsewhere { exposure_ms: 0.0 },
        controls: Vec::new(),
    }
}

fn in_seconds(seconds: f64) -> Moment {
    Moment(Monotonic.now().0 + seconds)
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

/// vivid's node, opened beside the camera.
fn beside() -> v4l::Device {
    let card = std::env::var("RELENS_VIVID").expect("RELENS_VIVID names the card");
    let node = (0..64).find_map(|n| {
        let device = v4l::Device::with_path(format!("/dev/video{n}")).ok()?;
        (device.query_caps().ok()?.card == card).then_some(device)
    });
    node.expect("vivid is there")
}

/// Sets one of vivid's controls from outside, as a gremlin would; the node it did it through.
fn gremlin(title: &str, value: i64) -> v4l::Device {
    let device = beside();
    let controls = device.query_controls().expect("it has controls");
    let control = controls.iter().find(|control| control.name == title);
    let control = control.unwrap_or_else(|| panic!("no control {title}"));
    let value = match control.typ {
        v4l::control::Type::Button => v4l::control::Value::None,
        _ => v4l::control::Value::Integer(value),
    };
    let _ = device.set_control(v4l::Control { id: control.id, value });
    device
}

#[test]
#[ignore = "needs vivid"]
fn vivid_frames_come_in_sequence_and_a_deadline_is_one() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    let first = camera.frame(in_seconds(5.0)).expect("a frame");
    let second = camera.frame(in_seconds(5.0)).expect("a frame");
    assert!(second.sequence > first.sequence && second.counts.size() == Size::new(640, 480));
    // A deadline that has passed is not waited for, and costs no buffer: frames go on coming.
    for _ in 0..20 {
        match camera.frame(in_seconds(0.0)) {
            Ok(_) | Err(RigError::NoFrame { .. }) => {}
            Err(error) => panic!("{error}"),
        }
    }
    camera.frame(in_seconds(5.0)).expect("frames go on after time-outs");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_dropped_and_damaged_frames_are_counted_and_never_delivered() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame");
    let before = camera.lost();
    gremlin("Percentage of Dropped Buffers", 50);
    for _ in 0..20 {
        camera.frame(in_seconds(5.0)).expect("a frame");
    }
    gremlin("Percentage of Dropped Buffers", 0);
    let dropped = camera.lost() - before;
    assert!(dropped > 3, "{dropped} of about 20");
    gremlin("Inject V4L2_BUF_FLAG_ERROR", 1);
    for _ in 0..5 {
        camera.frame(in_seconds(5.0)).expect("a frame");
    }
    assert!(camera.lost() > before + dropped, "the damaged one was counted");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_a_stream_that_breaks_is_told_and_reopens() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame");
    gremlin("Inject Fatal Streaming Error", 1);
    let told = (0..10).find_map(|_| camera.frame(in_seconds(2.0)).err());
    assert!(matches!(told, Some(RigError::Gone { .. } | RigError::NoFrame { .. })), "{told:?}");
    camera.reopen().unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame after the stream was opened again");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_two_readers_are_one_too_many() {
    let _camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    let second = V4l2Camera::open(vivid()).err();
    assert!(matches!(second, Some(RigError::Held { .. })), "{second:?}");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_unplugged_and_back() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame");
    // vivid comes back when its last reader has closed it: as long as this one is held, it is away.
    let away = gremlin("Disconnect", 1);
    let told = (0..10).find_map(|_| camera.frame(in_seconds(2.0)).err());
    assert!(matches!(told, Some(RigError::Gone { .. })), "{told:?}");
    for _ in 0..3 {
        let still = camera.reopen();
        assert!(matches!(still, Err(RigError::Gone { .. })), "{still:?}");
        assert!(matches!(camera.frame(in_seconds(0.1)), Err(RigError::Gone { .. })));
    }
    drop(away);
    camera.reopen().unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame after it came back");
}
