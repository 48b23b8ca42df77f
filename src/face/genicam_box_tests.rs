//! The whole box with a GenICam camera: calibrate, take a photo, restore it. Frames of a simulated
//! light path go through a camera on the loopback.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::UNIX_EPOCH;

use crate::chart::scenes::{Scene, cut};
use crate::config::{self, CameraDevice, Curve, Kind, RigFile};
use crate::daemon::{Daemon, DaemonSetting, Folders};
use crate::frame::{Channel, Codes, Counts, Frame, Mosaic, Size, Work};
use crate::picture::{Limits, Photo};
use crate::restorer::Restorer;
use crate::restorer::on_rig::{OnRig, measure};
use crate::rig::camera::genicam::tests::fake::{FakeCamera, Line};
use crate::rig::camera::genicam::{GenicamCamera, GenicamSettings};
use crate::rig::exposure::{Devices, Timing};
use crate::rig::monotonic::Monotonic;
use crate::rig::simulated::{self, Witness};
use crate::rig::{Clock, Flip, Moment, Panel, RigError, Trigger};

const SMALL: &str = include_str!("../../rig-config/small.toml");

/// Devices of `[hardware]` that replace the simulated ones. The simulation keeps its own time.
const DEVICES: &str = r#"
[hardware]
panel.connector = "HDMI-A-1"
trigger = { kind = "line", chip = "pinctrl-rp1", line = "GPIO17", active = "high" }

[hardware.camera]
kind = "genicam"
serial = "GV01"
format = "BayerRG10p"
trigger-source = "Line0"
exposure-by = "control"
"#;

/// The light path: a simulated rig, whose frames go through the fake camera.
#[derive(Clone)]
struct SimulatedLight {
    simulated: Arc<Mutex<Devices>>,
    line: Line,
    settle_s: f64,
}

impl Panel for SimulatedLight {
    fn size(&self) -> Size {
        self.simulated.lock().unwrap().panel.size()
    }
    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        let mut rig = self.simulated.lock().unwrap();
        let flip = rig.panel.show(codes)?;
        rig.clock.wait_until(Moment(flip.at.0 + self.settle_s));
        Ok(Flip { at: Monotonic.now(), ..flip })
    }
}

impl Trigger for SimulatedLight {
    fn fire(&mut self) -> Result<Moment, RigError> {
        let mut rig = self.simulated.lock().unwrap();
        let fired = rig.trigger.fire()?;
        let counts = rig.camera.frame(Moment(fired.0 + 1.0))?.counts;
        self.line.show(packed(&counts));
        let before = Monotonic.now();
        self.line.pulse();
        Ok(before)
    }
}

/// Packs the sites of a frame as 10-bit values, lowest bits first.
fn packed(counts: &Counts) -> Vec<u8> {
    let size = counts.size();
    let (mut bytes, mut held, mut bits) = (Vec::new(), 0u32, 0);
    for y in 0..size.height {
        for x in 0..size.width {
            held |= u32::from(counts.plane(Mosaic::Rggb.colour_at(x, y)).at(x, y)) << bits;
            bits += 10;
            while bits >= 8 {
                bytes.push(held as u8);
                (held, bits) = (held >> 8, bits - 8);
            }
        }
    }
    bytes
}

/// Energy of the differences between neighbours.
fn sharpness(light: &Frame<Work>) -> f64 {
    let green = light.plane(Channel::Green);
    let rows = (0..green.size().height).map(|y| green.row(y));
    rows.flat_map(|row| row.windows(2).map(|two| f64::from(two[1] - two[0]).powi(2))).sum()
}

#[test]
fn a_photo_is_taken_and_restored_through_a_camera_on_the_loopback() {
    let optical = SMALL.replacen("[sensor]", "[sensor]\nmosaic = \"rggb\"", 1);
    let optical = config::parse(&optical, "optics.toml").unwrap();
    let (tables, _) = SMALL.split_once("[simulation]").unwrap();
    let text = tables.replacen("settle-ms = 100.0", "settle-ms = 0.0", 1) + DEVICES;
    let rig = config::parse(&text, "genicam.toml").unwrap_or_else(|e| panic!("{e}"));
    let (simulated, witness) = simulated::open(&optical).unwrap();
    let fake = FakeCamera::plug(&[]);
    let light = SimulatedLight {
        simulated: Arc::new(Mutex::new(simulated)),
        line: fake.line(),
        settle_s: optical.panel.settle_ms / 1e3,
    };
    let Kind::Hardware(hardware) = &rig.kind else { panic!("it is made of parts") };
    let CameraDevice::Genicam(device) = &hardware.camera else { panic!("it is GenICam's") };
    let settings = GenicamSettings::of(&rig.camera, device).unwrap();
    let camera = GenicamCamera::open(settings).unwrap_or_else(|e| panic!("{e}"));
    let timing = Timing::of(&rig.panel, &rig.camera);
    let panel = Box::new(light.clone());
    let devices =
        Devices::new(panel, Box::new(light), Box::new(camera), Box::new(Monotonic), timing);
    // A frame has sixty packets.
    fake.lose_packets(0.001);
    box_works(&rig, devices, &witness);
}

/// Calibrates, takes a photo, and restores it from an inbox.
fn box_works(rig: &RigFile, mut devices: Devices, witness: &Witness) {
    devices.refuse_free_running().unwrap_or_else(|e| panic!("{e}"));
    let (slots, root) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    measure(rig, &mut devices, slots.path(), |_| {}, None).unwrap_or_else(|e| panic!("{e:?}"));
    let slots = slots.path().to_owned();
    let mut restorer = OnRig::new(rig, devices, slots, None, Arc::new(|| 0.0), |_| {}).unwrap();
    let sensor = rig.photo_grid().sensor;
    witness.put_before_lens(Some(&cut(&Scene::ALL[0].light(sensor), sensor)));
    let taken = restorer.take().unwrap_or_else(|e| panic!("{e}")).expect("a photo").bytes;
    witness.put_before_lens(None);
    let photo = Photo::from_bytes("x.dng", &taken, Curve::Srgb, &Limits::default()).unwrap();
    assert_eq!(photo.camera.as_ref().unwrap().setting.as_ref().unwrap().identity, rig.identity);

    let folders = Folders::open(root.path()).unwrap();
    std::fs::write(root.path().join("inbox/x.dng"), &taken).unwrap();
    let setting = DaemonSetting::new(&rig.name, rig.photo_grid(), rig.photo.curve);
    let (calendar, mut watcher) =
        (|| UNIX_EPOCH + std::time::Duration::from_secs(4_000_000_000), ());
    let mut daemon =
        Daemon::open(folders, setting, &mut restorer, &Monotonic, &calendar, &mut watcher).unwrap();
    let summary = daemon.once(&|| false).unwrap();
    assert_eq!(summary.restored.len(), 1, "{summary:?}");
    let result = root.path().join("outbox/x.tif");
    let restored = Photo::read(Path::new(&result), Curve::Srgb, &Limits::default()).unwrap();
    let gain = sharpness(&restored.light) / sharpness(&photo.light);
    assert!(gain > 1.3, "a gain of {gain:.2} in sharpness");
}
