//! The camera against Aravis's own fakes.

pub(crate) mod fake;
mod finding_tests;

use std::collections::BTreeMap;

use fake::{
    EXPOSURE_AUTO, EXPOSURE_US, FakeCamera, GAIN_AUTO, GAMMA_ENABLE, PIXEL_FORMAT, enable_interface,
};

use super::*;
use crate::config::Stamps;
use crate::frame::{Codes, Plane};
use crate::rig::exposure::{Devices, Timing};
use crate::rig::{Flip, Panel, Trigger};

/// Settings of the fake camera.
fn settings(format: &str, bits: u8) -> GenicamSettings {
    let word = |word: &str| Some(word.to_owned());
    let device = GenicamDevice {
        vendor: word("Aravis"),
        model: word("Fake"),
        serial: word("GV01"),
        format: format.to_owned(),
        trigger_source: word("Line0"),
        stamps: Stamps::Driver,
        buffers: 4,
        exposure_by: ExposureBy::Control,
        gain_step_db: Some(1.0),
        features: BTreeMap::from([("Gain".to_owned(), 3.0.into())]),
    };
    let format = PixelFormat::from_code_and_bits(format, bits).expect("a format");
    GenicamSettings { device, size: Size::new(32, 8), format, exposure_ms: 20.0 }
}

fn open(settings: &GenicamSettings) -> GenicamCamera {
    GenicamCamera::open(settings.clone()).unwrap_or_else(|e| panic!("{e}"))
}

fn refusal(settings: &GenicamSettings) -> String {
    match GenicamCamera::open(settings.clone()) {
        Err(refused @ RigError::Refused { .. }) => refused.to_string(),
        other => panic!("it is {:?}", other.map(|_| ()).map_err(|e| e.to_string())),
    }
}

fn soon() -> Moment {
    Moment(Monotonic.now().0 + 0.5)
}

/// Bytes of a frame, each different from its neighbours.
fn bytes(settings: &GenicamSettings) -> Vec<u8> {
    let count = settings.format.row_bytes(settings.size.width) * settings.size.height;
    (0..count).map(|n| (n * 37 + n / 32) as u8).collect()
}

/// Pulses `fake` and waits for the frame.
fn shoot(camera: &mut GenicamCamera, fake: &FakeCamera) -> Result<Exposed, RigError> {
    fake.pulse();
    camera.frame(soon())
}

#[test]
fn frames_of_every_kind_of_format_arrive_as_they_were_sent() {
    for (format, bits) in [
        ("Mono8", 8),
        ("BayerRG8", 8),
        ("Mono10p", 10),
        ("Mono12Packed", 12),
        ("BayerRG10p", 10),
        ("BayerGR12", 12),
        ("BayerBG12Packed", 12),
        ("BayerGB16", 12),
        ("RGB8", 8),
    ] {
        let fake = FakeCamera::plug(&[]);
        let settings = settings(format, bits);
        let mut camera = open(&settings);
        fake.show(bytes(&settings));
        let frame = shoot(&mut camera, &fake).unwrap_or_else(|e| panic!("{format}: {e}"));
        let mut wanted = Counts::zeros(settings.size);
        let stride = settings.format.row_bytes(settings.size.width);
        let mut scratch = Plane::zeros(settings.size);
        settings.format.unpack(&bytes(&settings), stride, &mut wanted, &mut scratch).expect(format);
        assert_eq!(frame.counts, wanted, "{format}");
    }
}

#[test]
fn automatics_are_off_and_the_exposure_and_the_gain_are_set() {
    let fake = FakeCamera::plug(&[]);
    let mut camera = open(&settings("Mono8", 8));
    let off = [EXPOSURE_AUTO, GAMMA_ENABLE, GAIN_AUTO].map(|register| fake.register(register));
    assert_eq!(off, [0, 0, 1], "`GainAuto` is off at 1");
    assert_eq!((fake.register(EXPOSURE_US), fake.register(fake::GAIN)), (20_000, 30));
    assert!(camera.expose_times(2.0).unwrap_or_else(|e| panic!("{e}")));
    assert_eq!(fake.register(EXPOSURE_US), 40_000);
    let reached = camera.amplify_times(2.0).unwrap_or_else(|e| panic!("{e}")).expect("a gain");
    assert!((reached - 2.0).abs() < 0.01, "9 dB instead of 9.02: {reached}");
    assert_eq!(fake.register(fake::GAIN), 90);
}

#[test]
fn an_automatic_that_stays_on_is_refused() {
    let fake = FakeCamera::plug(&[(
        "Name=\"Off\" NameSpace=\"Standard\">\n\t\t\t<Value>0</Value></EnumEntry>",
        "Name=\"Once\" NameSpace=\"Standard\">\n\t\t\t<Value>0</Value></EnumEntry>",
    )]);
    let said = refusal(&settings("Mono8", 8));
    assert!(said.contains("ExposureAuto = Off") && said.contains("Continuous"), "{said}");
    drop(fake);
}

#[test]
fn what_the_camera_does_not_have_is_named_with_what_it_has() {
    let _fake = FakeCamera::plug(&[]);
    let said = refusal(&settings("BayerBG8", 8).with(|device| device.format = "BayerXX".into()));
    assert!(said.contains("PixelFormat = BayerXX") && said.contains("BayerGB8"), "{said}");
    let line = |device: &mut GenicamDevice| device.trigger_source = Some("Line7".into());
    let said = refusal(&settings("Mono8", 8).with(line));
    assert!(said.contains("TriggerSource = Line7") && said.contains("Line0"), "{said}");
    let feature = |device: &mut GenicamDevice| {
        device.features.insert("Iris".to_owned(), 1.0.into());
    };
    assert!(refusal(&settings("Mono8", 8).with(feature)).contains("feature Iris"));
    let gain = |device: &mut GenicamDevice| {
        device.features.insert("Gain".to_owned(), 3.04.into());
    };
    let said = refusal(&settings("Mono8", 8).with(gain));
    assert!(
        said.contains("Gain = 3.04, which reads back as 3") && said.contains("0 to 24"),
        "{said}"
    );
    let other = settings("Mono8", 8).with(|device| device.serial = Some("GV02".into()));
    match GenicamCamera::open(other) {
        Err(RigError::Gone { what, .. }) => assert!(what.contains("\"Fake\""), "{what}"),
        _ => panic!("there is no such camera"),
    }
}

impl GenicamSettings {
    fn with(mut self, change: impl FnOnce(&mut GenicamDevice)) -> Self {
        change(&mut self.device);
        self
    }
}

#[test]
fn a_trigger_that_never_comes_ends_at_the_deadline() {
    let _fake = FakeCamera::plug(&[]);
    let mut camera = open(&settings("Mono8", 8));
    let began = Monotonic.now().0;
    assert!(matches!(camera.frame(Moment(began + 0.3)), Err(RigError::NoFrame { .. })));
    let waited_s = Monotonic.now().0 - began;
    assert!((0.3..2.0).contains(&waited_s), "{waited_s}");
}

#[test]
fn frames_of_another_format_or_with_lost_packets_are_skipped() {
    let fake = FakeCamera::plug(&[]);
    let settings = settings("BayerRG8", 8);
    let mut camera = open(&settings);
    fake.show(bytes(&settings));
    shoot(&mut camera, &fake).unwrap_or_else(|e| panic!("{e}"));
    // BayerGB8, as after the picture was flipped.
    let pattern = fake.register(PIXEL_FORMAT);
    fake.write(PIXEL_FORMAT, pattern + 1);
    assert!(matches!(shoot(&mut camera, &fake), Err(RigError::NoFrame { .. })));
    fake.write(PIXEL_FORMAT, pattern);
    let whole = shoot(&mut camera, &fake).unwrap_or_else(|e| panic!("{e}"));
    // All packets are lost, then half of them, then none.
    fake.lose_packets(1.0);
    assert!(matches!(shoot(&mut camera, &fake), Err(RigError::NoFrame { .. })));
    fake.lose_packets(0.5);
    let mut good = Vec::new();
    for _ in 0..6 {
        match shoot(&mut camera, &fake) {
            Ok(frame) => good.push(frame),
            Err(RigError::NoFrame { .. }) => {}
            Err(error) => panic!("{error}"),
        }
    }
    assert!(good.iter().all(|frame| frame.counts == whole.counts), "a torn frame was accepted");
    fake.lose_packets(0.0);
    let later = shoot(&mut camera, &fake).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(later.counts, whole.counts);
}

#[test]
fn a_camera_that_was_unplugged_is_gone_and_returns() {
    let fake = FakeCamera::plug(&[]);
    let settings = settings("Mono8", 8);
    let mut camera = open(&settings);
    let port = fake.unplug();
    assert!(matches!(camera.frame(soon()), Err(RigError::Gone { .. })));
    assert!(matches!(camera.reopen(), Err(RigError::Gone { .. })));
    assert!(matches!(camera.frame(soon()), Err(RigError::Gone { .. })));
    let fake = FakeCamera::plug_into(port, &[]);
    fake.show(bytes(&settings));
    camera.reopen().unwrap_or_else(|e| panic!("{e}"));
    shoot(&mut camera, &fake).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_frame_has_the_time_of_its_exposure_by_the_camera_s_clock() {
    let fake = FakeCamera::plug(&[]);
    let settings = settings("Mono8", 8);
    let mut camera = open(&settings);
    fake.show(bytes(&settings));
    for _ in 0..3 {
        let fired_s = Monotonic.now().0;
        fake.pulse();
        // The frame waits in its buffer, so that the moment of its arrival is no help.
        std::thread::sleep(std::time::Duration::from_millis(150));
        let frame = fake.ticking(|| {
            std::thread::sleep(std::time::Duration::from_millis(5));
            camera.frame(soon())
        });
        let late_s = frame.unwrap_or_else(|e| panic!("{e}")).at.0 - fired_s;
        assert!((0.0..0.12).contains(&late_s), "{late_s}");
    }
}

#[test]
fn without_a_latch_a_frame_has_the_time_of_its_arrival_less_the_exposure() {
    let fake = FakeCamera::plug(&[("\"TimestampLatch\"", "\"NoLatch\"")]);
    let settings = settings("Mono8", 8);
    let mut camera = open(&settings);
    fake.show(bytes(&settings));
    let fired_s = Monotonic.now().0;
    let frame = shoot(&mut camera, &fake).unwrap_or_else(|e| panic!("{e}"));
    let late_s = frame.at.0 + 0.02 - fired_s;
    assert!((0.0..0.12).contains(&late_s), "{late_s}");
}

#[test]
fn a_camera_of_the_library_s_own_process_delivers_its_ramp_and_runs_free() {
    enable_interface();
    let in_process = |device: &mut GenicamDevice| {
        (device.serial, device.features) = (Some("1".to_owned()), BTreeMap::new());
    };
    let mut camera = open(&settings("Mono8", 8).with(in_process));
    let frame = camera.frame(soon()).unwrap_or_else(|e| panic!("{e}"));
    // The pattern of arvfakecamera.c at twice its default exposure.
    let scale = 1.0 + 2f64.log10();
    let wanted = Plane::from_fn(Size::new(32, 8), |x, y| {
        (((x + frame.sequence as usize + y) % 255) as f64 * scale).min(255.0) as u16
    });
    assert_eq!(*frame.counts.plane(crate::frame::Channel::Green), wanted);
    let (panel, trigger) = (Box::new(Nothing), Box::new(Nothing));
    let timing = Timing { settle_ms: 0.0, exposure_ms: 20.0, deadline_ms: 200.0, exposures_max: 3 };
    let mut devices = Devices::new(panel, trigger, Box::new(camera), Box::new(Monotonic), timing);
    match devices.refuse_free_running() {
        Err(RigError::Refused { found, .. }) => assert!(found.contains("runs free"), "{found}"),
        other => panic!("it does run free: {:?}", other.map_err(|e| e.to_string())),
    }
}

/// Neither panel nor trigger.
struct Nothing;

impl Panel for Nothing {
    fn size(&self) -> Size {
        Size::new(1, 1)
    }
    fn show(&mut self, _: &Codes) -> Result<Flip, RigError> {
        panic!("nothing is shown")
    }
}

impl Trigger for Nothing {
    fn fire(&mut self) -> Result<Moment, RigError> {
        panic!("nothing is fired")
    }
}
