//! Aravis's fake GigE Vision camera on the loopback, with features of real cameras, a clock of its
//! own, and frames supplied by the test.
#![allow(unsafe_code)] // Parts of the library that crate `aravis` does not wrap.

use std::ffi::c_void;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use aravis::glib::translate::ToGlibPtr;
use aravis_sys as sys;

use crate::rig::monotonic::Monotonic;

/// Lock on the port of GigE Vision, which only one camera at a time can use.
static PORT: Mutex<()> = Mutex::new(());

/// Registers of the library's fake (arvfakecamera.h).
const TRIGGER_SOFTWARE: u32 = 0x30c;
pub(crate) const PIXEL_FORMAT: u32 = 0x128;
pub(crate) const GAIN_AUTO: u32 = 0x114;
pub(crate) const EXPOSURE_US: u32 = 0x120;

/// Registers of the features added to the library's fake.
pub(crate) const EXPOSURE_AUTO: u32 = 0x3000;
pub(crate) const GAMMA_ENABLE: u32 = 0x3004;
pub(crate) const GAIN: u32 = 0x3008;
const LATCH: u32 = 0x3010;
const LATCHED: u32 = 0x3018;

/// Additional pixel formats, with their numbers (PFNC 2.4).
const FORMATS: [(&str, u32); 6] = [
    ("Mono10p", 0x010A_0046),
    ("Mono12Packed", 0x010C_0006),
    ("BayerRG10p", 0x010A_0058),
    ("BayerGR12", 0x0110_0010),
    ("BayerBG12Packed", 0x010C_002D),
    ("BayerGB16", 0x0110_0030),
];

/// The frame that the fake delivers next.
struct NextFrame {
    bytes: Mutex<Vec<u8>>,
    began_s: f64,
}

impl NextFrame {
    /// The camera's clock in nanoseconds.
    fn clock_ns(&self) -> u64 {
        ((Monotonic::seconds() - self.began_s) * 1e9) as u64
    }
}

/// The camera's registers and its input line.
#[derive(Clone)]
pub(crate) struct Line {
    camera: aravis::FakeCamera,
    next: Arc<NextFrame>,
}

impl Line {
    /// Sets the frame of the next trigger.
    pub(crate) fn show(&self, bytes: Vec<u8>) {
        *self.next.bytes.lock().expect("no panic holds it") = bytes;
    }

    /// Pulses the line.
    pub(crate) fn pulse(&self) {
        self.camera.write_register(TRIGGER_SOFTWARE, 1);
    }

    pub(crate) fn register(&self, address: u32) -> u32 {
        self.camera.read_register(address).expect("a register")
    }

    pub(crate) fn write(&self, address: u32, value: u32) {
        self.camera.write_register(address, value);
    }

    /// Writes the clock into the register of latched values.
    fn tick(&self) {
        let mut bytes = self.next.clock_ns().to_be_bytes();
        // SAFETY: eight bytes within the registers, which live as long as the camera.
        unsafe {
            let camera = self.camera.to_glib_none().0;
            sys::arv_fake_camera_write_memory(camera, LATCHED, 8, bytes.as_mut_ptr().cast());
        }
    }
}

/// The camera on the network.
struct Device(aravis::GvFakeCamera);

pub(crate) struct FakeCamera {
    gv: Device,
    line: Box<Line>,
    _description: tempfile::NamedTempFile,
    alone: MutexGuard<'static, ()>,
}

impl FakeCamera {
    /// Plugs in a camera, after replacing `from` by `to` in its description for each of `changes`.
    pub(crate) fn plug(changes: &[(&str, &str)]) -> FakeCamera {
        Self::plug_into(PORT.lock().unwrap_or_else(PoisonError::into_inner), changes)
    }

    /// Unplugs the camera. While the guard is held, no other test gets the port.
    pub(crate) fn unplug(self) -> MutexGuard<'static, ()> {
        let FakeCamera { gv, line, _description, alone } = self;
        drop((gv, line));
        alone
    }

    /// Plugs in a camera as [`FakeCamera::plug`] does, into a port that is already held.
    pub(crate) fn plug_into(
        alone: MutexGuard<'static, ()>,
        changes: &[(&str, &str)],
    ) -> FakeCamera {
        let mut description = description();
        for (from, to) in changes {
            assert!(description.contains(from), "no {from} in the description");
            description = description.replace(from, to);
        }
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        file.write_all(description.as_bytes()).expect("room for a file");
        let path = file.path().to_str().expect("a plain path");
        let gv = aravis::GvFakeCamera::new_full(None, Some("GV01"), Some(path));
        assert!(gv.is_running(), "port 3956 of the loopback is taken");
        let camera = gv.fake_camera().expect("its registers");
        camera.set_trigger_frequency(500.0);
        let next =
            Arc::new(NextFrame { bytes: Mutex::default(), began_s: Monotonic::seconds() - 3.0 });
        let line = Box::new(Line { camera: camera.clone(), next });
        let data = std::ptr::from_ref::<Line>(&line).cast_mut().cast();
        // SAFETY: `line` is boxed and outlives the camera, whose `drop` removes the callback.
        unsafe { sys::arv_fake_camera_set_fill_pattern(camera.to_glib_none().0, Some(fill), data) };
        for automatic in [EXPOSURE_AUTO, GAMMA_ENABLE] {
            camera.write_register(automatic, 1);
        }
        camera.write_register(GAIN_AUTO, 2);
        FakeCamera { gv: Device(gv), line, _description: file, alone }
    }

    pub(crate) fn lose_packets(&self, share: f64) {
        self.gv.0.set_gvsp_lost_ratio(share);
    }

    /// The camera's input line, for a trigger.
    pub(crate) fn line(&self) -> Line {
        (*self.line).clone()
    }

    /// Keeps the latched value up to date until `until` returns.
    pub(crate) fn ticking<T>(&self, until: impl FnOnce() -> T) -> T {
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let (is_done, line) = (&done, self.line());
            scope.spawn(move || {
                while !is_done.load(Ordering::Acquire) {
                    line.tick();
                    std::thread::sleep(std::time::Duration::from_micros(300));
                }
            });
            let _stops = StopsTicking(&done);
            until()
        })
    }
}

impl std::ops::Deref for FakeCamera {
    type Target = Line;

    fn deref(&self) -> &Line {
        &self.line
    }
}

/// Enables the library's fake camera in this process.
pub(crate) fn enable_interface() {
    // SAFETY: the text ends with a zero byte.
    unsafe { sys::arv_enable_interface(c"Fake".as_ptr()) };
}

/// Ends the ticking thread when dropped, also after a panic.
struct StopsTicking<'a>(&'a AtomicBool);

impl Drop for StopsTicking<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let Some(camera) = self.0.fake_camera() else { return };
        // SAFETY: without a callback, the library fills in its own pattern.
        unsafe {
            let camera = camera.to_glib_none().0;
            sys::arv_fake_camera_set_fill_pattern(camera, None, std::ptr::null_mut());
        }
    }
}

/// Fills a buffer with the next frame, and stamps it with the camera's clock, which is then
/// latched: the value that the board reads afterwards is later than the stamp.
///
/// # Safety
/// `buffer` must be one of the library's, with room for a frame of its size and `format`; `line`
/// must point to a [`Line`].
unsafe extern "C" fn fill(
    buffer: *mut sys::ArvBuffer,
    line: *mut c_void,
    _exposure_us: u32,
    _gain: u32,
    format: sys::ArvPixelFormat,
) {
    // SAFETY: the caller upholds the contract above.
    unsafe {
        let line = &*line.cast::<Line>();
        let (width, height) =
            (sys::arv_buffer_get_image_width(buffer), sys::arv_buffer_get_image_height(buffer));
        let bits = (format >> 16 & 0xff) as usize;
        let room = width as usize * height as usize * bits / 8;
        let Ok(bytes) = line.next.bytes.lock() else { return };
        let data = sys::arv_buffer_get_data(buffer, std::ptr::null_mut());
        std::ptr::copy_nonoverlapping(bytes.as_ptr(), data, bytes.len().min(room));
        sys::arv_buffer_set_timestamp(buffer, line.next.clock_ns());
        line.tick();
    }
}

/// The description of the library's fake, with a line that the test can pulse and features of real
/// cameras.
fn description() -> String {
    let (plain, _) = aravis::FakeCamera::new("1").genicam_xml();
    let entry = |name: &str, value: u32| {
        format!("<EnumEntry Name=\"{name}\" NameSpace=\"Standard\">\n\t\t\t<Value>{value}</Value>")
    };
    let mut text = plain.to_string();
    // The fake answers only software triggers, so its line becomes one.
    for (name, was, now) in [("Line0", 0, 1), ("Software", 1, 0)] {
        let from = entry(name, was);
        assert!(text.contains(&from), "no {from}");
        text = text.replacen(&from, &entry(name, now), 1);
    }
    let mono = entry("Mono8", 0x0108_0001);
    let formats = FORMATS.map(|(name, value)| format!("{}\n\t\t</EnumEntry>", entry(name, value)));
    assert!(text.contains(&mono), "no {mono}");
    text = text.replacen(&mono, &format!("{}{mono}", formats.concat()), 1);
    let register = |name: &str, address: u32, bytes: u32, mode: &str| {
        format!(
            "<IntReg Name=\"{name}\"><Address>{address}</Address><Length>{bytes}</Length>\
             <AccessMode>{mode}</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign>\
             <Endianess>BigEndian</Endianess></IntReg>"
        )
    };
    let added = [
        format!(
            "<Enumeration Name=\"ExposureAuto\">{}</EnumEntry>{}</EnumEntry>\
             <pValue>ExposureAutoRegister</pValue></Enumeration>",
            entry("Off", 0),
            entry("Continuous", 1)
        ),
        register("ExposureAutoRegister", EXPOSURE_AUTO, 4, "RW"),
        "<Boolean Name=\"GammaEnable\"><pValue>GammaEnableRegister</pValue><OnValue>1</OnValue>\
         <OffValue>0</OffValue></Boolean>"
            .to_owned(),
        register("GammaEnableRegister", GAMMA_ENABLE, 4, "RW"),
        // A gain in steps of a tenth of a decibel.
        "<Float Name=\"Gain\"><pValue>GainConverter</pValue><Min>0.0</Min><Max>24.0</Max></Float>\
         <Converter Name=\"GainConverter\"><FormulaTo>FROM * 10</FormulaTo>\
         <FormulaFrom>TO / 10.0</FormulaFrom><pValue>GainRegister</pValue></Converter>"
            .to_owned(),
        register("GainRegister", GAIN, 4, "RW"),
        "<Command Name=\"TimestampLatch\"><pValue>LatchRegister</pValue>\
         <CommandValue>1</CommandValue></Command>"
            .to_owned(),
        register("LatchRegister", LATCH, 4, "RW"),
        register("TimestampLatchValue", LATCHED, 8, "RO"),
    ];
    let end = "</RegisterDescription>";
    assert!(text.contains(end), "no {end}");
    text.replace(end, &format!("{}{end}", added.concat()))
}
