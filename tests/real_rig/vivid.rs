//! A camera with faults on request: the kernel's vivid.

use std::collections::BTreeMap;

use relens::config::{ExposureBy, Stamps, V4l2Device};
use relens::frame::Size;
use relens::rig::camera::v4l2::{CameraSettings, Exposure, GainControl, V4l2Camera};
use relens::rig::monotonic::Monotonic;
use relens::rig::pixel_format::{PixelFormat, Samples};
use relens::rig::{Camera, Clock, Moment, RigError};

use super::counted;

fn vivid() -> CameraSettings {
    let card = std::env::var("RELENS_VIVID").expect("RELENS_VIVID names the card");
    let device = V4l2Device {
        device: None,
        card: Some(card),
        media: None,
        format: "GREY".to_owned(),
        stamps: Stamps::Driver,
        buffers: 4,
        exposure_by: ExposureBy::Elsewhere,
        gain_step_db: None,
        controls: BTreeMap::new(),
    };
    CameraSettings {
        device,
        size: Size::new(640, 480),
        format: PixelFormat::Grey(Samples::Bytes),
        exposure: Exposure { by: ExposureBy::Elsewhere, exposure_ms: 0.0 },
        gain: None,
        free_running: true,
    }
}

fn in_seconds(seconds: f64) -> Moment {
    Moment(Monotonic.now().0 + seconds)
}

/// A second handle of vivid's node.
fn second_handle() -> v4l::Device {
    let card = std::env::var("RELENS_VIVID").expect("RELENS_VIVID names the card");
    let node = (0..64).find_map(|n| {
        let device = v4l::Device::with_path(format!("/dev/video{n}")).ok()?;
        (device.query_caps().ok()?.card == card).then_some(device)
    });
    node.expect("vivid is there")
}

/// Sets one of vivid's controls through a second handle, which is returned.
fn set_control(title: &str, value: i64) -> v4l::Device {
    let device = second_handle();
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

/// Value of one of vivid's controls.
fn control_value(title: &str) -> i64 {
    let device = second_handle();
    let controls = device.query_controls().expect("it has controls");
    let control = controls.iter().find(|control| control.name == title).expect("it has this one");
    match device.control(control.id).expect("it can be read").value {
        v4l::control::Value::Integer(value) => value,
        other => panic!("{title} is {other:?}"),
    }
}

#[test]
#[ignore = "needs vivid"]
fn vivid_s_gain_is_set_for_a_photo_and_reset_on_opening() {
    let (name, value) = ("gain".to_owned(), 20);
    let mut amplified = vivid();
    amplified.device.controls = BTreeMap::from([(name.clone(), value)]);
    // vivid's control goes to 255.
    amplified.gain = Some(GainControl { name, value, step_db: 0.1 });
    let mut camera = V4l2Camera::open(amplified.clone()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(control_value("Gain"), 20);
    let times = camera.amplify_times(4.0).expect("it is set").expect("the settings say how");
    assert!((times / 4.0 - 1.0).abs() < 0.006, "{times}");
    assert_eq!(control_value("Gain"), 140);
    camera.frame(in_seconds(5.0)).expect("frames go on");
    match camera.amplify_times(100.0) {
        Err(RigError::Refused { allowed, .. }) => assert_eq!(allowed, "0 to 255"),
        other => panic!("{other:?}"),
    }
    drop(camera);
    drop(V4l2Camera::open(amplified).unwrap_or_else(|error| panic!("{error}")));
    assert_eq!(control_value("Gain"), 20);
    let mut plain = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    assert!(plain.amplify_times(4.0).expect("nothing is asked of it").is_none());
}

#[test]
#[ignore = "needs vivid"]
fn vivid_frames_are_in_sequence_and_deadlines_hold() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    let first = camera.frame(in_seconds(5.0)).expect("a frame");
    let second = camera.frame(in_seconds(5.0)).expect("a frame");
    assert!(second.sequence > first.sequence && second.counts.size() == Size::new(640, 480));
    // A past deadline returns at once and costs no buffer.
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
fn vivid_dropped_and_damaged_frames_are_never_delivered() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    let mut last = camera.frame(in_seconds(5.0)).expect("a frame").sequence;
    // Number of frames missing until `frames` have arrived.
    let mut missing = |frames: usize| {
        let before = last;
        for _ in 0..frames {
            last = camera.frame(in_seconds(5.0)).expect("a frame").sequence;
        }
        last - before - frames as u32
    };
    set_control("Percentage of Dropped Buffers", 50);
    let dropped = missing(20);
    assert!(dropped > 3, "{dropped} of about 20");
    set_control("Percentage of Dropped Buffers", 0);
    // Skips frames already in the ring of buffers.
    missing(5);
    set_control("Inject V4L2_BUF_FLAG_ERROR", 1);
    assert!(missing(5) > 0, "the damaged one is missing");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_a_broken_stream_is_an_error_and_reopens() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame");
    set_control("Inject Fatal Streaming Error", 1);
    let error = (0..10).find_map(|_| camera.frame(in_seconds(2.0)).err());
    assert!(matches!(error, Some(RigError::Gone { .. } | RigError::NoFrame { .. })), "{error:?}");
    camera.reopen().unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame after the stream was opened again");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_a_second_reader_is_refused() {
    let _camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    let second = V4l2Camera::open(vivid()).err();
    assert!(matches!(second, Some(RigError::Held { .. })), "{second:?}");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_unplugged_and_back() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame");
    // vivid returns when its last reader closes it.
    let away = set_control("Disconnect", 1);
    let error = (0..10).find_map(|_| camera.frame(in_seconds(2.0)).err());
    assert!(matches!(error, Some(RigError::Gone { .. })), "{error:?}");
    for _ in 0..3 {
        let still = camera.reopen();
        assert!(matches!(still, Err(RigError::Gone { .. })), "{still:?}");
        assert!(matches!(camera.frame(in_seconds(0.1)), Err(RigError::Gone { .. })));
    }
    drop(away);
    camera.reopen().unwrap_or_else(|error| panic!("{error}"));
    camera.frame(in_seconds(5.0)).expect("a frame after it came back");
}

#[test]
#[ignore = "needs vivid"]
fn vivid_frames_allocate_nothing() {
    let mut camera = V4l2Camera::open(vivid()).unwrap_or_else(|error| panic!("{error}"));
    for n in 0..20 {
        let (frame, allocations) = counted::allocations(|| camera.frame(in_seconds(5.0)));
        camera.give_back(frame.expect("a frame").counts);
        // The first frame allocates memory, which is then reused.
        assert!(n == 0 || allocations == 0, "frame {n}: {allocations} allocations");
    }
}
