//! The camera against drivers as they behave, each rule broken in turn.

pub(super) mod kernel;

use super::*;
use kernel::{DriverRules, FakeKernel, MAKER_CONTROL, kernel, root};

use crate::config;

const CHEAP: &str = include_str!("../../../../../rig-config/raspberry-pi-5-gs.toml");

/// Settings of the cheap rig's file.
fn cheap() -> CameraSettings {
    let rig = config::parse(CHEAP, "gs.toml").unwrap_or_else(|e| panic!("{e}"));
    let config::Kind::Hardware(hardware) = &rig.kind else { panic!("it is made of parts") };
    let config::CameraDevice::V4l2(device) = &hardware.camera else { panic!("it is V4L2's") };
    CameraSettings::of(&rig.camera, device, &hardware.trigger).unwrap_or_else(|e| panic!("{e}"))
}

/// A USB camera of 32 × 8 pixels on this thread's kernel.
fn usb(controls: &[(&str, i32)]) -> CameraSettings {
    let by = config::ExposureBy::Control;
    let device = V4l2Device {
        device: Some(root().join("dev/video0")),
        card: None,
        media: None,
        format: "GREY".to_owned(),
        stamps: config::Stamps::Driver,
        buffers: 4,
        exposure_by: by,
        gain_step_db: None,
        controls: controls.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
    };
    CameraSettings {
        device,
        size: Size::new(32, 8),
        format: PixelFormat::from_code("GREY").expect("a format"),
        exposure: Exposure { by, exposure_ms: 20.0 },
        gain: None,
        free_running: true,
    }
}

/// Opens the cheap rig's camera on a kernel of `rules`, and waits for a frame.
fn first_frame(
    rules: DriverRules,
    change: impl FnOnce(&mut FakeKernel),
) -> Result<Exposed, RigError> {
    FakeKernel::install(rules, 1456 * 1088 * 2);
    kernel(change);
    let mut camera = V4l2Camera::open(cheap())?;
    camera.frame(soon())
}

fn soon() -> Moment {
    Moment(Monotonic.now().0 + 0.05)
}

#[test]
fn the_cheap_rig_has_its_colours_whatever_flips_another_program_left() {
    for flips in 0..4 {
        let frame = first_frame(DriverRules::default(), |kernel| {
            (kernel.controls[1].1, kernel.controls[2].1) = (flips & 1, flips >> 1);
        });
        let counts = frame.unwrap_or_else(|e| panic!("flips {flips}: {e}")).counts;
        assert_eq!(counts.size(), Size::new(1456, 1088));
        kernel(|kernel| {
            let held = ["horizontal_flip", "vertical_flip", "test_pattern"];
            assert!(held.iter().all(|name| kernel.value(name) == 0), "{:?}", kernel.controls);
            let last = held.iter().filter_map(|n| kernel.first(&format!("control {n}"))).max();
            assert!(last.is_some() && last < kernel.first("format"), "{:?}", kernel.asked);
        });
    }
}

#[test]
fn links_that_another_program_left_are_disabled_before_those_of_the_rig_file_are_enabled() {
    first_frame(DriverRules::default(), |_| ()).unwrap_or_else(|e| panic!("{e}"));
    kernel(|kernel| {
        let on = kernel.links.iter().filter(|link| link.flags & 1 != 0);
        let on: Vec<_> = on.map(|link| (link.from, link.to)).collect();
        assert_eq!(on, [((3, 0), (1, 0)), ((1, 4), (4, 0))]);
        let (first_on, last_off) = (kernel.first("link (1, 4) (4, 0) 1"), kernel.first("control"));
        let offs = kernel.asked.iter().filter(|one| one.ends_with(" 0") && one.starts_with("link"));
        assert_eq!(offs.count(), 4, "{:?}", kernel.asked);
        assert!(first_on == Some(4) && first_on < last_off, "{:?}", kernel.asked);
    });
}

/// A rule, a change that breaks it, and words of the error if no frame may arrive then.
type BrokenRule = (&'static str, fn(&mut DriverRules), Option<&'static str>);

const BROKEN: [BrokenRule; 4] = [
    ("flips leave the code", |rules| rules.flips_change_code = false, None),
    ("a node streams by itself", |rules| rules.waits_for_all_nodes = false, None),
    ("colours are not compared", |rules| rules.compares_colours = false, None),
    ("a frame is whole", |rules| rules.torn = u32::MAX, Some("no frame from the camera")),
];

#[test]
fn each_driver_that_breaks_a_rule_gives_frames_or_names_its_fault() {
    for (rule, broken, words) in BROKEN {
        let mut rules = DriverRules::default();
        broken(&mut rules);
        match (first_frame(rules, |_| ()), words) {
            (Ok(_), None) => {}
            (Err(error), Some(words)) => assert!(error.to_string().contains(words), "{error}"),
            (outcome, _) => panic!("{rule}: {:?}", outcome.map(|frame| frame.sequence)),
        }
    }
}

#[test]
fn a_frame_whose_lower_rows_were_lost_is_no_frame() {
    let frame = first_frame(DriverRules { torn: 2, ..DriverRules::default() }, |_| ());
    assert_eq!(frame.map(|frame| frame.sequence).ok(), Some(2));
}

#[test]
fn a_sensor_that_fails_to_start_twice_is_not_started_again() {
    // Uses another name, since failures are remembered for as long as the program runs.
    let rules =
        DriverRules { failing_starts: 9, sensor: "imx477 10-001a", ..DriverRules::default() };
    FakeKernel::install(rules, 1456 * 1088 * 2);
    let mut settings = cheap();
    let graph = settings.device.media.as_mut().expect("it has a graph");
    graph.sensor = Some("imx477".to_owned());
    graph.format[0].pad = "imx477:0".to_owned();
    let open = || V4l2Camera::open(settings.clone()).err().expect("it does not start");
    assert!(matches!(open(), RigError::Failed { .. }));
    for _ in 0..3 {
        let error = open();
        assert!(error.to_string().contains("\"imx477\", which failed to start 2 times"), "{error}");
        assert!(error.to_string().contains("ribbon"), "{error}");
    }
    let starts = kernel(|k| k.asked.iter().filter(|one| *one == "start").count());
    assert_eq!(starts, 2, "the kernel may crash at another");
}

#[test]
fn a_maker_s_controls_may_come_after_the_node() {
    let rules = DriverRules {
        is_graph: false,
        listings_without_maker_control: 9,
        ..DriverRules::default()
    };
    FakeKernel::install(rules, 256);
    let mut camera = V4l2Camera::open(usb(&[(MAKER_CONTROL, 1)])).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(kernel(|kernel| kernel.value(MAKER_CONTROL)), 1);
    camera.frame(soon()).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_bus_without_room_is_no_full_disk() {
    let rules = DriverRules { is_graph: false, failing_starts: 1, ..DriverRules::default() };
    FakeKernel::install(rules, 256);
    let error = V4l2Camera::open(usb(&[])).err().expect("it does not start").to_string();
    assert!(error.contains("GREY of 32×8, for which the USB bus has no room"), "{error}");
    assert!(!error.contains("space"), "{error}");
}

#[test]
fn a_control_without_a_range_hides_no_other() {
    for broken in ["auto_exposure", "gain", "test_pattern"] {
        let rules =
            DriverRules { is_graph: false, without_range: Some(broken), ..DriverRules::default() };
        FakeKernel::install(rules, 256);
        V4l2Camera::open(usb(&[(MAKER_CONTROL, 1)])).unwrap_or_else(|e| panic!("{broken}: {e}"));
        let set = kernel(|k| (k.value(MAKER_CONTROL), k.value("exposure_time_absolute")));
        assert_eq!(set, (1, 200), "{broken}");
    }
    let last = DriverRules {
        is_graph: false,
        without_range: Some(MAKER_CONTROL),
        ..DriverRules::default()
    };
    FakeKernel::install(last, 256);
    V4l2Camera::open(usb(&[])).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_longer_exposure_gets_its_interval_by_a_new_start() {
    FakeKernel::install(DriverRules { is_graph: false, ..DriverRules::default() }, 256);
    let mut camera = V4l2Camera::open(usb(&[])).unwrap_or_else(|e| panic!("{e}"));
    camera.frame(soon()).unwrap_or_else(|e| panic!("{e}"));
    // An interval of 33.3 ms: 20 fit, 60 do not.
    for (times, interval, starts) in [(1.5, 333, 1), (3.0, 600, 2), (2.0, 600, 2)] {
        assert!(camera.expose_times(times).unwrap_or_else(|e| panic!("{e}")));
        camera.frame(soon()).unwrap_or_else(|e| panic!("{times}: {e}"));
        kernel(|kernel| {
            assert_eq!(kernel.value("exposure_time_absolute"), (times * 200.0) as i32);
            let started = kernel.asked.iter().filter(|one| *one == "start").count();
            assert_eq!((kernel.interval, started), (interval, starts), "{times}");
        });
    }
}
