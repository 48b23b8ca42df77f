//! Fakes of drivers at the system call, which behave as the real ones do: rp1-cfe and imx296 of
//! Raspberry Pi's kernels, and uvcvideo. Nodes are files in a folder; structures are read by their
//! offsets in the kernel's headers, not by this crate's own definitions.
#![allow(unsafe_code)] // Arguments of system calls.

use std::cell::RefCell;
use std::ffi::c_void;
use std::fs::File;
use std::io;
use std::os::fd::RawFd;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use rustix::io::Errno;

use crate::config::bus_format;
use crate::rig::{Clock, monotonic::Monotonic};

/// What the drivers do, where that differs from what their interfaces promise.
#[derive(Debug, Clone)]
pub(in super::super) struct DriverRules {
    /// Whether the driver is rp1-cfe with a sensor behind it, rather than uvcvideo.
    pub(in super::super) is_graph: bool,
    /// The sensor's bus format follows its flips.
    pub(in super::super) flips_change_code: bool,
    /// The stream starts once all nodes with an enabled link stream; no error until then.
    pub(in super::super) waits_for_all_nodes: bool,
    /// The receiver compares the colour fields of its pads.
    pub(in super::super) compares_colours: bool,
    /// Number of frames, from the first, whose lower half was lost.
    pub(in super::super) torn: u32,
    /// Number of stream starts that fail, in the sensor or for lack of bandwidth.
    pub(in super::super) failing_starts: u32,
    /// Listings of the controls before the maker's control appears.
    pub(in super::super) listings_without_maker_control: u32,
    /// A control whose range the camera does not give.
    pub(in super::super) without_range: Option<&'static str>,
    /// The frame interval cannot be set while streaming.
    pub(in super::super) interval_is_busy: bool,
    /// Name of the sensor's entity.
    pub(in super::super) sensor: &'static str,
}

impl Default for DriverRules {
    fn default() -> Self {
        DriverRules {
            is_graph: true,
            flips_change_code: true,
            waits_for_all_nodes: true,
            compares_colours: true,
            torn: 0,
            failing_starts: 0,
            listings_without_maker_control: 0,
            without_range: None,
            interval_is_busy: true,
            sensor: "imx296 10-001a",
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(in super::super) struct FakeLink {
    pub(in super::super) from: (u32, u32),
    pub(in super::super) to: (u32, u32),
    pub(in super::super) flags: u32,
}

/// A driver with its nodes, and the record of the requests to it.
pub(in super::super) struct FakeKernel {
    folder: tempfile::TempDir,
    node: File,
    pub(in super::super) rules: DriverRules,
    pub(in super::super) asked: Vec<String>,
    pub(in super::super) links: Vec<FakeLink>,
    /// Values by name, numbered from [`FIRST_CONTROL`] on.
    pub(in super::super) controls: Vec<(&'static str, i32)>,
    /// Formats of pads and of the node: width, height, code, colours.
    formats: Vec<((u32, u32), [u32; 4])>,
    buffer_bytes: u32,
    queued: Vec<u32>,
    streams: bool,
    sequence: u32,
    /// Frame interval in units of 0.1 ms.
    pub(in super::super) interval: u32,
}

const CSI2: u32 = 1;
const SENSOR: u32 = 3;
const CAPTURE: u32 = 4;
/// Entities of the downstream driver by number, from 1 on (raspberrypi/libcamera, issue 194).
const ENTITIES: [&str; 9] = [
    "csi2",
    "pisp-fe",
    "",
    "rp1-cfe-csi2_ch0",
    "rp1-cfe-embedded",
    "rp1-cfe-fe_image0",
    "rp1-cfe-fe_image1",
    "rp1-cfe-fe_stats",
    "rp1-cfe-fe_config",
];
/// Device nodes: entity, minor number, name.
const NODES: [(u32, u32, &str); 4] = [
    (CSI2, 1, "v4l-subdev0"),
    (2, 2, "v4l-subdev1"),
    (SENSOR, 3, "v4l-subdev2"),
    (CAPTURE, 10, "video0"),
];
/// The sensor's formats by `vertical_flip` and `horizontal_flip` (raspberrypi/linux, pull request
/// 5384).
const CODES: [[&str; 2]; 2] = [["SRGGB10_1X10", "SGRBG10_1X10"], ["SGBRG10_1X10", "SBGGR10_1X10"]];
/// Number of the first control (V4L2_CID_BASE).
const FIRST_CONTROL: u32 = 0x0098_0900;
/// Maker's control, which may come late.
pub(in super::super) const MAKER_CONTROL: &str = "trigger_mode";
const RAW: u32 = 11;

thread_local! {
    static KERNEL: RefCell<Option<FakeKernel>> = const { RefCell::new(None) };
}

/// Folder that contains `dev` and `sys`.
pub(in super::super) fn root() -> PathBuf {
    KERNEL.with_borrow(|kernel| {
        kernel.as_ref().map_or_else(|| "/".into(), |kernel| kernel.folder.path().to_owned())
    })
}

/// Runs `with` on this thread's kernel.
pub(in super::super) fn kernel<T>(with: impl FnOnce(&mut FakeKernel) -> T) -> T {
    KERNEL.with_borrow_mut(|kernel| with(kernel.as_mut().expect("a kernel was set up")))
}

/// Replaces the system call on nodes of this thread's kernel.
///
/// # Safety
/// The caller must meet the requirements of the system call.
pub(in super::super) unsafe fn ioctl(
    fd: RawFd,
    number: v4l::v4l2::vidioc::_IOC_TYPE,
    argument: *mut c_void,
) -> io::Result<()> {
    let path = std::fs::read_link(format!("/proc/self/fd/{fd}")).unwrap_or_default();
    let is_fake =
        KERNEL.with_borrow(|k| k.as_ref().is_some_and(|k| path.starts_with(k.folder.path())));
    if !is_fake {
        // SAFETY: the caller guarantees what the system call requires.
        return unsafe { v4l::v4l2::ioctl(fd, number, argument) };
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let bytes = number as usize >> 16 & 0x3fff;
    // SAFETY: a request's number has the size of its argument.
    let argument = unsafe { std::slice::from_raw_parts_mut(argument.cast::<u8>(), bytes) };
    kernel(|kernel| kernel.answer(&name, number as u32 & 0xffff, &mut Argument(argument)))
        .map_err(io::Error::from)
}

/// A structure of a system call.
struct Argument<'a>(&'a mut [u8]);

impl Argument<'_> {
    fn get(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.0[at..at + 4].try_into().expect("four bytes"))
    }

    fn set(&mut self, at: usize, values: &[u32]) {
        for (n, value) in values.iter().enumerate() {
            self.0[at + 4 * n..at + 4 * n + 4].copy_from_slice(&value.to_le_bytes());
        }
    }

    fn name(&mut self, at: usize, text: &str) {
        self.0[at..at + text.len()].copy_from_slice(text.as_bytes());
    }

    /// Writes a list of `media_v2_topology` at `at` if it has an address.
    fn list(&mut self, at: usize, objects: &[Vec<u8>]) {
        self.set(at, &[objects.len() as u32]);
        let place = u64::from_le_bytes(self.0[at + 8..at + 16].try_into().expect("eight bytes"));
        let whole: Vec<u8> = objects.concat();
        if place != 0 {
            // SAFETY: the caller has made room for as many objects as were counted.
            unsafe { std::ptr::copy_nonoverlapping(whole.as_ptr(), place as *mut u8, whole.len()) };
        }
    }
}

/// A graph object of `bytes` bytes that begins with `words`; `name` follows the first of them.
fn object(bytes: usize, words: &[u32], name: &str) -> Vec<u8> {
    let mut whole = vec![0; bytes];
    Argument(&mut whole).set(0, words);
    Argument(&mut whole).name(4, name);
    whole
}

fn pad_id((entity, pad): (u32, u32)) -> u32 {
    1000 + entity * 16 + pad
}

impl FakeKernel {
    /// Sets up this thread's kernel as `rpicam-hello` leaves it, for frames of `bytes`.
    pub(in super::super) fn install(rules: DriverRules, bytes: u32) {
        let folder = tempfile::tempdir().expect("a folder");
        let (dev, char) = (folder.path().join("dev"), folder.path().join("sys/dev/char"));
        std::fs::create_dir(&dev).expect("a folder");
        std::fs::create_dir_all(&char).expect("a folder");
        let names = NODES.iter().map(|(.., name)| *name).chain(["media0"]);
        names.for_each(|name| drop(File::create(dev.join(name)).expect("a node")));
        for (_, minor, name) in NODES {
            let place = format!("../../devices/platform/{name}");
            std::os::unix::fs::symlink(place, char.join(format!("81:{minor}"))).expect("a link");
        }
        let buffer_bytes = bytes.next_multiple_of(4096);
        let node = File::options().write(true).open(dev.join("video0")).expect("a node");
        node.set_len(u64::from(buffer_bytes) * 4).expect("memory");
        let link = |from, to, flags| FakeLink { from, to, flags };
        let links = vec![
            link((SENSOR, 0), (CSI2, 0), 3),
            link((CSI2, 4), (CAPTURE, 0), 0),
            link((CSI2, 4), (2, 0), 1),
            link((CSI2, 5), (5, 0), 0),
            link((9, 0), (2, 1), 1),
            link((2, 2), (6, 0), 1),
            link((2, 3), (7, 0), 0),
            link((2, 4), (8, 0), 1),
        ];
        let sensor_controls = [("analogue_gain", 0), ("horizontal_flip", 1), ("vertical_flip", 1)];
        let camera_controls = [("auto_exposure", 3), ("exposure_time_absolute", 10), ("gain", 0)];
        let mut controls =
            if rules.is_graph { sensor_controls.to_vec() } else { camera_controls.to_vec() };
        controls.extend([("test_pattern", 1), (MAKER_CONTROL, 0)]);
        let kernel = FakeKernel {
            folder,
            node,
            rules,
            asked: Vec::new(),
            links,
            controls,
            formats: Vec::new(),
            buffer_bytes,
            queued: Vec::new(),
            streams: false,
            sequence: 0,
            interval: 333,
        };
        KERNEL.set(Some(kernel));
    }

    /// Value of a control.
    pub(in super::super) fn value(&self, name: &str) -> i32 {
        self.controls.iter().find(|(one, _)| *one == name).expect("it has the control").1
    }

    /// Index in the record of the first request that begins with `words`.
    pub(in super::super) fn first(&self, words: &str) -> Option<usize> {
        self.asked.iter().position(|one| one.starts_with(words))
    }

    fn format(&self, place: (u32, u32)) -> [u32; 4] {
        self.formats.iter().rev().find(|(one, _)| *one == place).map_or([0; 4], |(_, f)| *f)
    }

    fn sensor_code(&self) -> u32 {
        let flips = ["vertical_flip", "horizontal_flip"].map(|name| self.value(name) as usize);
        let flips = if self.rules.flips_change_code { flips } else { [0, 0] };
        bus_format(CODES[flips[0]][flips[1]]).expect("a known code")
    }

    fn answer(
        &mut self,
        node: &str,
        number: u32,
        argument: &mut Argument<'_>,
    ) -> Result<(), Errno> {
        let subdevice = NODES.iter().find(|(.., name)| *name == node && name.starts_with("v4l"));
        match (number, subdevice) {
            (0x7c00, _) => argument.name(0, "rp1-cfe"),
            (0x7c04, _) => self.graph(argument),
            (0x7c03, _) => return self.set_link(argument),
            (0x5604 | 0x5605, Some(&(entity, ..))) => self.pad(number == 0x5605, entity, argument),
            (0x5624, _) => return self.query_control(argument),
            (0x561b, _) => {
                let index = (argument.get(0) - FIRST_CONTROL) as usize;
                let value = self.controls.get(index).ok_or(Errno::INVAL)?;
                argument.set(4, &[value.1 as u32]);
            }
            (0x561c, _) => {
                let index = (argument.get(0) - FIRST_CONTROL) as usize;
                let value = argument.get(4) as i32;
                let control = self.controls.get_mut(index).ok_or(Errno::INVAL)?;
                self.asked.push(format!("control {} = {value}", control.0));
                if self.streams && control.0.ends_with("_flip") {
                    return Err(Errno::BUSY);
                }
                control.1 = value;
            }
            _ => return self.stream(number, argument),
        }
        Ok(())
    }

    fn graph(&self, argument: &mut Argument<'_>) {
        let name = |n: u32| match n {
            SENSOR => self.rules.sensor,
            n => ENTITIES[n as usize - 1],
        };
        let entities = (1..=9).map(|n| object(96, &[n], name(n)));
        argument.list(8, &entities.collect::<Vec<_>>());
        let interface = |&(entity, minor, _): &(u32, u32, &str)| {
            let mut whole = object(112, &[500 + entity], "");
            Argument(&mut whole).set(48, &[81, minor]);
            whole
        };
        argument.list(24, &NODES.iter().map(interface).collect::<Vec<_>>());
        let mut pads: Vec<(u32, u32)> = self.links.iter().flat_map(|l| [l.from, l.to]).collect();
        pads.sort_unstable();
        pads.dedup();
        let pad = |&place: &(u32, u32)| object(32, &[pad_id(place), place.0, 0, place.1], "");
        argument.list(40, &pads.iter().map(pad).collect::<Vec<_>>());
        let between = self.links.iter().map(|l| (pad_id(l.from), pad_id(l.to), l.flags));
        let interfaces = NODES.iter().map(|&(entity, ..)| (500 + entity, entity, 1 << 28));
        let links =
            between.chain(interfaces).map(|(a, b, flags)| object(40, &[1, a, b, flags], ""));
        argument.list(56, &links.collect::<Vec<_>>());
    }

    fn set_link(&mut self, argument: &Argument<'_>) -> Result<(), Errno> {
        let end = |at: usize| (argument.get(at), argument.get(at + 4) & 0xffff);
        let (from, to, flags) = (end(0), end(20), argument.get(40));
        self.asked.push(format!("link {from:?} {to:?} {}", flags & 1));
        let mut links = self.links.iter_mut();
        let link = links.find(|link| (link.from, link.to) == (from, to)).ok_or(Errno::INVAL)?;
        if link.flags & 2 != 0 {
            return Err(Errno::INVAL);
        }
        link.flags = flags;
        Ok(())
    }

    /// Reads or sets the format of a pad; a sensor gives its own, csi2 stores any.
    fn pad(&mut self, sets: bool, entity: u32, argument: &mut Argument<'_>) {
        let place = (entity, argument.get(4));
        if sets {
            self.asked.push(format!("format {place:?}"));
            let [width, height, code, colours] = [8, 12, 16, 24].map(|at| argument.get(at));
            let given = match entity {
                SENSOR => [1456, 1088, self.sensor_code(), RAW],
                _ => [width, height, code, colours],
            };
            self.formats.push((place, given));
        }
        let [width, height, code, colours] = self.format(place);
        argument.set(8, &[width, height, code, 1, colours]);
    }

    fn query_control(&mut self, argument: &mut Argument<'_>) -> Result<(), Errno> {
        let (flag, id) = (argument.get(0) >> 31, argument.get(0) & 0x7fff_ffff);
        let index = (id + flag).saturating_sub(FIRST_CONTROL) as usize;
        let late = self.rules.listings_without_maker_control > 0;
        let (name, value) = *self.controls.get(index).ok_or(Errno::INVAL)?;
        if late && name == MAKER_CONTROL {
            self.rules.listings_without_maker_control -= 1;
            return Err(Errno::INVAL);
        }
        if Some(name) == self.rules.without_range {
            return Err(Errno::PIPE);
        }
        argument.set(0, &[FIRST_CONTROL + index as u32, 1]);
        argument.name(8, name);
        argument.set(40, &[0, 1_048_575, 1, value as u32, 0]);
        Ok(())
    }

    /// Answers a request to the capture node.
    fn stream(&mut self, number: u32, argument: &mut Argument<'_>) -> Result<(), Errno> {
        match number {
            0x5600 => {
                argument.name(0, if self.rules.is_graph { "rp1-cfe" } else { "uvcvideo" });
                argument.set(84, &[0x8400_0001, 0x0400_0001]);
            }
            0x5605 => {
                let stride = argument.get(8) * if self.rules.is_graph { 2 } else { 1 };
                argument.set(24, &[stride, stride * argument.get(12)]);
            }
            0x5608 => argument.set(0, &[argument.get(0).min(4)]),
            0x5609 => {
                argument.set(64, &[argument.get(0) * self.buffer_bytes, 0, self.buffer_bytes]);
            }
            0x560f => self.queued.push(argument.get(0)),
            0x5611 => return self.deliver(argument),
            0x5612 => return self.start(),
            0x5613 => {
                self.streams = false;
                self.queued.clear();
            }
            0x5615 if !self.rules.is_graph => argument.set(4, &[0x1000, 0, self.interval, 10_000]),
            0x5616 if !self.rules.is_graph && self.streams && self.rules.interval_is_busy => {
                return Err(Errno::BUSY);
            }
            0x5616 if !self.rules.is_graph => {
                self.interval = argument.get(12) * 10_000 / argument.get(16);
                argument.set(4, &[0x1000]);
            }
            _ => return Err(Errno::NOTTY),
        }
        Ok(())
    }

    fn start(&mut self) -> Result<(), Errno> {
        self.asked.push("start".to_owned());
        if self.rules.is_graph {
            let enabled = |link: &&FakeLink| link.to == (CAPTURE, 0) && link.flags & 1 != 0;
            if !self.links.iter().any(|link| enabled(&link)) {
                return Err(Errno::INVAL);
            }
            let [sensor, sink] = [self.format((SENSOR, 0)), self.format((CSI2, 0))];
            let compared = if self.rules.compares_colours { 4 } else { 3 };
            if sensor[..compared] != sink[..compared] || sensor[2] != self.sensor_code() {
                return Err(Errno::PIPE);
            }
        }
        if self.rules.failing_starts > 0 {
            self.rules.failing_starts -= 1;
            return Err(if self.rules.is_graph { Errno::REMOTEIO } else { Errno::NOSPC });
        }
        (self.streams, self.sequence) = (true, 0);
        Ok(())
    }

    /// A filled buffer; its lower half keeps its old bytes in a torn frame.
    fn deliver(&mut self, argument: &mut Argument<'_>) -> Result<(), Errno> {
        // Nodes of entities beyond the capture node stream only if another program starts them.
        let waits = |link: &FakeLink| link.to.0.max(link.from.0) > CAPTURE && link.flags & 1 != 0;
        let is_held = self.rules.waits_for_all_nodes && self.links.iter().any(waits);
        if !self.streams || self.queued.is_empty() || (self.rules.is_graph && is_held) {
            return Err(Errno::AGAIN);
        }
        let index = self.queued.remove(0);
        let torn = self.rules.torn > 0;
        self.rules.torn = self.rules.torn.saturating_sub(1);
        let bytes = self.buffer_bytes as usize / if torn { 2 } else { 1 };
        let place = u64::from(index) * u64::from(self.buffer_bytes);
        self.node.write_all_at(&vec![0x40; bytes], place).expect("it is written");
        let now_s = Monotonic.now().0;
        argument.set(0, &[index, 1, self.buffer_bytes, 0x2000]);
        argument.set(24, &[now_s as u32, 0, (now_s.fract() * 1e6) as u32, 0]);
        argument.set(56, &[self.sequence]);
        self.sequence += 1;
        Ok(())
    }
}
