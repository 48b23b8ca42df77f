//! The virtual rig's USB camera, driven by the kernel's own `uvcvideo`: a webcam with a trigger in
//! the maker's extension unit, and a bulk endpoint.
//!
//! Whenever it is plugged in, it has its defaults: it exposes automatically and runs free. A frame
//! is sent after its exposure, which is as long as set but not longer than the frame interval.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::{Mutex, MutexGuard};
use std::time::Duration;

use relens::frame::Size;

use super::Outcome;
use super::usb_ip::{Plug, Request, Setup};
use super::uvc_descriptors::{
    self as descriptors, AUTO_EXPOSURE, BROKEN, BYTES_PER_PIXEL, CONTROLS, EXPOSURE, INTERVALS,
    PAYLOAD_BYTES, TRIGGER_MODE,
};

/// Requests of the video class, and two of every device.
const SET_CURRENT: u8 = 0x01;
const GET_CURRENT: u8 = 0x81;
const GET_MINIMUM: u8 = 0x82;
const GET_MAXIMUM: u8 = 0x83;
const GET_STEP: u8 = 0x84;
const GET_LENGTH: u8 = 0x85;
const GET_ABILITIES: u8 = 0x86;
const GET_DEFAULT: u8 = 0x87;
const CLEAR_FEATURE: u8 = 1;
const GET_DESCRIPTOR: u8 = 6;

/// Value of `auto_exposure` for a manual exposure; the other, 8, is automatic.
const MANUAL: i32 = 1;

/// Bits of a payload's header: the frame's parity, its last payload, the header's end.
const LAST: u8 = 2;
const END_OF_HEADER: u8 = 0x80;

/// State of the plugged camera.
struct Plugged {
    plug: Plug,
    values: [i32; CONTROLS.len()],
    /// Frame interval, in units of 100 ns.
    interval: u32,
    /// Numbers of the host's requests that wait for data.
    waiting: VecDeque<u32>,
    payloads: VecDeque<Vec<u8>>,
    parity: u8,
}

/// A USB camera, plugged or not.
pub struct UsbCamera {
    size: Size,
    plugged: Mutex<Option<Plugged>>,
}

impl UsbCamera {
    pub fn new(size: Size) -> UsbCamera {
        UsbCamera { size, plugged: Mutex::new(None) }
    }

    fn state(&self) -> MutexGuard<'_, Option<Plugged>> {
        self.plugged.lock().unwrap()
    }

    /// Plugs the camera in whenever `wish` exists and serves it until unplugged; then removes
    /// `wish`.
    pub fn run(&self, wish: &Path) -> Outcome<()> {
        loop {
            while !wish.exists() {
                std::thread::sleep(Duration::from_millis(50));
            }
            let mut requests = Plug::insert()?;
            *self.state() = Some(Plugged::new(requests.try_clone()?));
            println!("the USB camera is plugged in");
            while let Some(request) = requests.next()? {
                if let Some(plugged) = &mut *self.state() {
                    // The host may unplug between a request and its answer.
                    let _ = plugged.serve(request, self.size);
                }
            }
            *self.state() = None;
            println!("the USB camera is unplugged");
            std::fs::remove_file(wish)?;
        }
    }

    /// Exposure time at a trigger, seconds; `None` if the camera is unplugged or runs free.
    pub fn exposure_s(&self) -> Option<f64> {
        let state = self.state();
        let plugged = state.as_ref()?;
        let exposure_s = f64::from(plugged.value(EXPOSURE)) * 1e-4;
        (plugged.value(TRIGGER_MODE) == 1)
            .then(|| exposure_s.min(f64::from(plugged.interval) * 1e-7))
    }

    /// Sends a frame of red, green and blue counts to a host that waits for it.
    pub fn send(&self, frame: &[u8]) {
        let mut state = self.state();
        let Some(plugged) = &mut *state else { return };
        if plugged.waiting.is_empty() || plugged.value(TRIGGER_MODE) != 1 {
            return;
        }
        let turned: Vec<u8> =
            frame.chunks_exact(BYTES_PER_PIXEL).flat_map(|rgb| [rgb[2], rgb[1], rgb[0]]).collect();
        let parts = turned.chunks(PAYLOAD_BYTES - 2);
        let last = parts.len() - 1;
        plugged.parity ^= 1;
        for (n, part) in parts.enumerate() {
            let flags = END_OF_HEADER | plugged.parity | if n == last { LAST } else { 0 };
            plugged.payloads.push_back([&[2, flags], part].concat());
        }
        let _ = plugged.fill();
    }
}

impl Plugged {
    fn new(plug: Plug) -> Plugged {
        Plugged {
            plug,
            values: CONTROLS.each_ref().map(|control| control.default),
            interval: INTERVALS[0],
            waiting: VecDeque::new(),
            payloads: VecDeque::new(),
            parity: 0,
        }
    }

    fn value(&self, name: &str) -> i32 {
        CONTROLS.iter().zip(self.values).find(|(control, _)| control.name == name).unwrap().1
    }

    /// Fills waiting buffers with payloads.
    fn fill(&mut self) -> Outcome<()> {
        while !self.waiting.is_empty() && !self.payloads.is_empty() {
            let (number, payload) =
                (self.waiting.pop_front().unwrap(), self.payloads.pop_front().unwrap());
            self.plug.send(number, &payload)?;
        }
        Ok(())
    }

    fn serve(&mut self, request: Request, size: Size) -> Outcome<()> {
        match request {
            Request::Stream { number } => {
                self.waiting.push_back(number);
                self.fill()
            }
            Request::Unlink { number, of } => {
                let found = self.waiting.iter().position(|&waiting| waiting == of);
                found.map(|at| self.waiting.remove(at));
                self.plug.unlink(number, found.is_some())
            }
            Request::Control { number, setup, data } if setup.kind & 0x80 == 0 => {
                match self.set(&setup, &data) {
                    Some(()) => self.plug.confirm(number, data.len()),
                    None => self.plug.stall(number),
                }
            }
            Request::Control { number, setup, .. } => match self.get(&setup, size) {
                Some(mut data) => {
                    data.truncate(setup.length.into());
                    self.plug.send(number, &data)
                }
                None => self.plug.stall(number),
            },
        }
    }

    /// Outgoing control transfer; `None` if it is refused.
    fn set(&mut self, setup: &Setup, data: &[u8]) -> Option<()> {
        match (setup.kind, setup.request, setup.index) {
            (0x21, SET_CURRENT, 1) => {
                let interval = u32::from_le_bytes(data.get(4..8)?.try_into().ok()?);
                self.interval = interval.clamp(INTERVALS[0], INTERVALS[1]);
                println!("frame interval {:.1} ms", f64::from(self.interval) * 1e-4);
            }
            (0x21, SET_CURRENT, _) => {
                let n = position(setup)?;
                let control = &CONTROLS[n];
                let mut bytes = [0; 4];
                bytes[..control.bytes].copy_from_slice(data.get(..control.bytes)?);
                let spare = 32 - 8 * control.bytes as u32;
                let value = i32::from_le_bytes(bytes) << spare >> spare;
                let is_automatic = control.name == EXPOSURE && self.value(AUTO_EXPOSURE) != MANUAL;
                println!("control {} = {value}", control.name);
                if is_automatic || !(control.minimum..=control.maximum).contains(&value) {
                    return None;
                }
                self.values[n] = value;
            }
            // The end of a stream.
            (0x02, CLEAR_FEATURE, _) => self.payloads.clear(),
            // Choices of a configuration or interface have no effect: there is one of each.
            _ => {}
        }
        Some(())
    }

    /// Data of an incoming control transfer; `None` if it is refused.
    fn get(&self, setup: &Setup, size: Size) -> Option<Vec<u8>> {
        let [low, high] = setup.value.to_le_bytes();
        match (setup.kind, setup.request) {
            (0x80, GET_DESCRIPTOR) => match high {
                1 => Some(descriptors::device()),
                2 => Some(descriptors::configuration(size)),
                3 => Some(descriptors::string(low)),
                _ => None,
            },
            // A device's or endpoint's state.
            (0x80..=0x82, 0) => Some(vec![0, 0]),
            (0xa1, GET_LENGTH | GET_ABILITIES) if setup.index == 1 => None,
            (0xa1, request) if setup.index == 1 => Some(self.negotiated(request, size)),
            (0xa1, request) => {
                let n = position(setup)?;
                let control = &CONTROLS[n];
                let value = match request {
                    GET_CURRENT => self.values[n],
                    GET_MINIMUM if control.name == BROKEN => return None,
                    GET_MINIMUM => control.minimum,
                    GET_MAXIMUM => control.maximum,
                    GET_DEFAULT => control.default,
                    // Bits of the available modes.
                    GET_STEP if control.name == AUTO_EXPOSURE => MANUAL | 8,
                    GET_STEP => 1,
                    GET_LENGTH => return Some((control.bytes as u16).to_le_bytes().into()),
                    // The control can be read and written.
                    GET_ABILITIES => return Some(vec![3]),
                    _ => return None,
                };
                Some(value.to_le_bytes()[..control.bytes].into())
            }
            _ => None,
        }
    }

    /// Parameters of the stream (UVC 1.1, §4.3.1.1).
    fn negotiated(&self, request: u8, size: Size) -> Vec<u8> {
        let interval = match request {
            GET_CURRENT => self.interval,
            GET_MAXIMUM => INTERVALS[1],
            _ => INTERVALS[0],
        };
        let mut all = vec![0; 34];
        all[2..4].copy_from_slice(&[1, 1]);
        all[4..8].copy_from_slice(&interval.to_le_bytes());
        let frame_bytes = (size.area() * BYTES_PER_PIXEL) as u32;
        all[18..22].copy_from_slice(&frame_bytes.to_le_bytes());
        all[22..26].copy_from_slice(&(PAYLOAD_BYTES as u32).to_le_bytes());
        all
    }
}

/// Position of a request's control.
fn position(setup: &Setup) -> Option<usize> {
    let [_, selector] = setup.value.to_le_bytes();
    let [_, unit] = setup.index.to_le_bytes();
    CONTROLS.iter().position(|control| (control.unit, control.selector) == (unit, selector))
}
