//! A board's camera behind a media graph, with the kernel's vimc: set-up, streaming, set-up after
//! another program, and errors.

use std::collections::BTreeMap;
use std::process::Command;

use relens::config::{ExposureBy, MediaGraph, MediaLink, PadFormat, Stamps, V4l2Device};
use relens::frame::{Counts, Size};
use relens::rig::camera::v4l2::{CameraSettings, Exposure, V4l2Camera};
use relens::rig::monotonic::Monotonic;
use relens::rig::pixel_format::PixelFormat;
use relens::rig::{Camera, Clock, Moment, RigError};

/// The kernel's colour bars, from left to right, as red, green and blue.
const BARS: [[bool; 3]; 8] = [
    [true, true, true],
    [true, true, false],
    [false, true, true],
    [false, true, false],
    [true, false, true],
    [true, false, false],
    [false, false, true],
    [false, false, false],
];

fn pad_format((pad, code): (&str, &str)) -> PadFormat {
    PadFormat { pad: pad.to_owned(), code: code.to_owned() }
}

fn link(from: &str, to: &str, on: bool) -> MediaLink {
    MediaLink { from: from.to_owned(), to: to.to_owned(), on }
}

/// Media graph for the raw sites of sensor `which`. The converter also connected to it needs the
/// same format; its output is disabled.
fn raw_graph(which: &str, bus_code: &str) -> MediaGraph {
    let (sensor, converter) = (format!("Sensor {which}"), format!("Debayer {which}"));
    MediaGraph {
        driver: "vimc".to_owned(),
        capture: format!("Raw Capture {}", if which == "A" { 0 } else { 1 }),
        link: vec![link(&format!("{converter}:1"), "Scaler:0", false)],
        format: vec![
            pad_format((&format!("{sensor}:0"), bus_code)),
            pad_format((&format!("{converter}:0"), bus_code)),
        ],
        sensor: Some(sensor),
    }
}

/// Media graph for the colours of sensor `which` through its converter and the scaler, with the
/// other converter's link disabled.
fn scaled_graph(which: &str, other: &str) -> MediaGraph {
    let [sensor, debayer, away] =
        [format!("Sensor {which}"), format!("Debayer {which}:"), format!("Debayer {other}:1")];
    let (before, after) = (format!("{debayer}0"), format!("{debayer}1"));
    MediaGraph {
        driver: "vimc".to_owned(),
        capture: "RGB/YUV Capture".to_owned(),
        link: vec![link(&away, "Scaler:0", false), link(&after, "Scaler:0", true)],
        format: vec![
            pad_format((&format!("{sensor}:0"), "SRGGB8_1X8")),
            pad_format((&before, "SRGGB8_1X8")),
            pad_format((&after, "RGB888_1X24")),
            pad_format(("Scaler:0", "RGB888_1X24")),
            pad_format(("Scaler:1", "RGB888_1X24")),
        ],
        sensor: Some(sensor),
    }
}

fn settings(graph: MediaGraph, code: &str, size: Size) -> CameraSettings {
    let device = V4l2Device {
        device: None,
        card: None,
        media: Some(graph),
        format: code.to_owned(),
        stamps: Stamps::Driver,
        buffers: 4,
        exposure_by: ExposureBy::Elsewhere,
        gain_step_db: None,
        controls: BTreeMap::from([("test_pattern".to_owned(), 0)]),
    };
    CameraSettings {
        device,
        size,
        format: PixelFormat::from_code(code).expect("relens takes it"),
        exposure: Exposure { by: ExposureBy::Elsewhere, exposure_ms: 0.0 },
        gain: None,
        free_running: true,
    }
}

fn raw() -> CameraSettings {
    settings(raw_graph("A", "SRGGB8_1X8"), "RGGB", Size::new(640, 480))
}

fn opened(settings: CameraSettings) -> V4l2Camera {
    V4l2Camera::open(settings).unwrap_or_else(|error| panic!("{error}"))
}

fn said(settings: CameraSettings) -> String {
    V4l2Camera::open(settings).err().expect("it is refused").to_string()
}

fn frame(camera: &mut V4l2Camera) -> Counts {
    let deadline = Moment(Monotonic.now().0 + 20.0);
    camera.frame(deadline).unwrap_or_else(|error| panic!("{error}")).counts
}

/// Mean counts of red, green and blue around column `x`, below the driver's text overlay.
fn colours_at(counts: &Counts, x: usize) -> [f64; 3] {
    counts.planes().each_ref().map(|plane| {
        let rows = plane.height() * 7 / 8 - 8..plane.height() * 7 / 8 + 8;
        let sites = rows.flat_map(|y| &plane.row(y)[x - 8..x + 8]);
        sites.map(|&count| f64::from(count)).sum::<f64>() / 256.0
    })
}

fn shows_the_bars(counts: &Counts) {
    let width = counts.size().width / 8;
    for (n, bar) in BARS.iter().enumerate() {
        let found = colours_at(counts, n * width + width / 2);
        for (level, lit) in found.iter().zip(bar) {
            assert!((*level > 100.0) == *lit, "bar {n}: {found:.0?} for {bar:?}");
        }
    }
}

#[test]
#[ignore = "needs vimc"]
fn vimc_raw_sites_have_their_colours_for_every_pattern() {
    for (bus_code, code) in [("SRGGB8_1X8", "RGGB"), ("SBGGR8_1X8", "BA81"), ("SGRBG8_1X8", "GRBG")]
    {
        for size in [Size::new(640, 480), Size::new(320, 240)] {
            let mut camera = opened(settings(raw_graph("A", bus_code), code, size));
            let counts = frame(&mut camera);
            assert_eq!(counts.size(), size);
            shows_the_bars(&counts);
        }
    }
}

#[test]
#[ignore = "needs vimc"]
fn vimc_links_that_are_not_listed_are_disabled() {
    let state = || {
        let mut text = String::new();
        relens::rig::camera::v4l2::describe(&mut text).expect("a string takes it");
        let link = text.lines().find(|line| line.contains("Debayer A:1 to Scaler:0"));
        link.unwrap_or_else(|| panic!("no such link in {text}")).to_owned()
    };
    drop(opened(settings(scaled_graph("A", "B"), "RGB3", Size::new(640, 480))));
    assert!(state().ends_with(": on"), "{}", state());
    let mut graph = raw_graph("A", "SRGGB8_1X8");
    graph.link.clear();
    shows_the_bars(&frame(&mut opened(settings(graph, "RGGB", Size::new(640, 480)))));
    assert!(state().ends_with(": off"), "{}", state());
}

#[test]
#[ignore = "needs vimc"]
fn vimc_links_are_enabled_and_disabled() {
    // The kernel's patterns 5 and 6 are black and white.
    for (which, other, pattern) in [("B", "A", 6), ("A", "B", 5), ("B", "A", 6)] {
        // The raw node also needs the sensor's format.
        drop(opened(settings(raw_graph(which, "SRGGB8_1X8"), "RGGB", Size::new(640, 480))));
        let graph = scaled_graph(which, other);
        let mut wanted = settings(graph, "RGB3", Size::new(640, 480));
        wanted.device.controls = BTreeMap::from([("test_pattern".to_owned(), pattern)]);
        let found = colours_at(&frame(&mut opened(wanted)), 320);
        let white = pattern == 6;
        assert!(found.iter().all(|level| (*level > 128.0) == white), "{which}: {found:?}");
    }
}

/// Streams as the other program of the next test, which starts it.
#[test]
#[ignore = "needs vimc"]
fn vimc_another_program() {
    let mut camera = opened(settings(raw_graph("A", "SGBRG8_1X8"), "GBRG", Size::new(320, 240)));
    frame(&mut camera);
}

#[test]
#[ignore = "needs vimc"]
fn vimc_changes_of_another_program_are_undone() {
    let other = || {
        let itself = std::env::current_exe().expect("this program has a path");
        let words = ["--ignored", "--exact", "vimc::vimc_another_program"];
        Command::new(itself).args(words).output().expect("it starts")
    };
    let mut camera = opened(raw());
    shows_the_bars(&frame(&mut camera));
    let outcome = other();
    let words = String::from_utf8_lossy(&outcome.stdout).into_owned();
    assert!(!outcome.status.success() && words.contains("another program streams"), "{words}");
    drop(camera);
    let outcome = other();
    assert!(outcome.status.success(), "{}", String::from_utf8_lossy(&outcome.stdout));
    let mut camera = opened(raw());
    shows_the_bars(&frame(&mut camera));
    camera.reopen().unwrap_or_else(|error| panic!("{error}"));
    shows_the_bars(&frame(&mut camera));
}

#[test]
#[ignore = "needs vimc"]
fn vimc_errors_name_their_cause() {
    let size = Size::new(640, 480);
    let with = |change: &dyn Fn(&mut MediaGraph)| {
        let mut graph = raw_graph("A", "SRGGB8_1X8");
        change(&mut graph);
        said(settings(graph, "RGGB", size))
    };
    let holds = |said: String, words: &[&str]| {
        println!("{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said} lacks one of {words:?}");
    };
    let driver = with(&|graph| graph.driver = "rp1-cfe".to_owned());
    holds(driver, &["no media device of driver \"rp1-cfe\"", "\"vimc\""]);
    let sensor = with(&|graph| graph.sensor = Some("Sensor C".to_owned()));
    holds(sensor, &["no entity \"Sensor C\"", "\"Sensor A\""]);
    let capture = with(&|graph| graph.capture = "Debayer A".to_owned());
    holds(capture, &["\"Debayer A\" takes no pictures"]);
    let missing = with(&|graph| graph.link.push(link("Sensor A:0", "Raw Capture 1:0", true)));
    holds(missing, &["no link from Sensor A:0 to Raw Capture 1:0", "Raw Capture 0:0"]);
    let fixed = with(&|graph| graph.link.push(link("Sensor A:0", "Raw Capture 0:0", false)));
    holds(fixed, &["disabled", "immutable"]);
    let pad = with(&|graph| graph.format.push(pad_format(("Sensor A:7", "SRGGB8_1X8"))));
    holds(pad, &["Sensor A:7"]);
    // The sensor has no such format; the error names those that it has.
    let format = with(&|graph| graph.format = vec![pad_format(("Sensor A:0", "Y12_1X12"))]);
    holds(format, &["Y12_1X12 of 640×480 at Sensor A:0", "RGB888_1X24"]);
    // The node's format differs from the sensor's.
    let differs = said(settings(raw_graph("A", "SRGGB8_1X8"), "BA81", size));
    holds(differs, &["no path from the sensor to \"Raw Capture 0\"", "BA81"]);
    let mut control = raw();
    control.device.controls = BTreeMap::from([("analogue_gain".to_owned(), 1)]);
    holds(said(control), &["control analogue_gain", "test_pattern"]);
    let held = opened(raw());
    let second = V4l2Camera::open(raw()).err();
    assert!(matches!(second, Some(RigError::Held { .. })), "{second:?}");
    drop(held);
}
