//! USB/IP: attaches a device of this program to a port of the kernel's virtual host controller
//! (`vhci-hcd`).
//!
//! The protocol is in the kernel's Documentation/usb/usbip_protocol.rst. Its numbers are
//! big-endian.

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

use super::Outcome;

/// Attribute of the controller that takes a port, a connected socket, a device number and a speed.
const ATTACH: &str = "/sys/devices/platform/vhci_hcd.0/attach";

/// High speed (`enum usb_device_speed`).
const SPEED: u32 = 3;

/// Bytes of every message before its data.
const HEADER_BYTES: usize = 48;

const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const SUBMITTED: u32 = 3;
const UNLINKED: u32 = 4;

/// Status of a transfer that the device refuses (EPIPE), and of one that the host cancelled
/// (ECONNRESET).
const STALLED: i32 = -32;
const CALLED_BACK: i32 = -104;

/// Setup packet of a control transfer.
pub struct Setup {
    /// Direction, type and recipient.
    pub kind: u8,
    pub request: u8,
    pub value: u16,
    pub index: u16,
    pub length: u16,
}

/// Request of the host; `number` identifies its answer.
pub enum Request {
    /// A control transfer, with the data of an outgoing one.
    Control { number: u32, setup: Setup, data: Vec<u8> },
    /// A buffer for data of the streaming endpoint.
    Stream { number: u32 },
    /// The host cancels the request `of`.
    Unlink { number: u32, of: u32 },
}

/// A plugged device.
pub struct Plug(UnixStream);

impl Plug {
    /// Plugs a device into port 0.
    pub fn insert() -> Outcome<Plug> {
        let (device, host) = UnixStream::pair()?;
        fs::write(ATTACH, format!("0 {} 1 {SPEED}", host.as_raw_fd()))?;
        Ok(Plug(device))
    }

    pub fn try_clone(&self) -> Outcome<Plug> {
        Ok(Plug(self.0.try_clone()?))
    }

    /// Next request; `None` once the device is unplugged.
    pub fn next(&mut self) -> Outcome<Option<Request>> {
        let mut header = [0; HEADER_BYTES];
        match self.0.read_exact(&mut header) {
            Ok(()) => {}
            Err(cause)
                if [ErrorKind::UnexpectedEof, ErrorKind::ConnectionReset]
                    .contains(&cause.kind()) =>
            {
                return Ok(None);
            }
            Err(cause) => return Err(cause.into()),
        }
        let word = |n: usize| u32::from_be_bytes([0, 1, 2, 3].map(|k| header[4 * n + k]));
        let (number, is_in, endpoint) = (word(1), word(3) == 1, word(4));
        match (word(0), endpoint) {
            (UNLINK, _) => Ok(Some(Request::Unlink { number, of: word(5) })),
            (SUBMIT, 0) => {
                let mut data = vec![0; if is_in { 0 } else { word(6) as usize }];
                self.0.read_exact(&mut data)?;
                let half = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
                let (kind, request) = (header[40], header[41]);
                let setup =
                    Setup { kind, request, value: half(42), index: half(44), length: half(46) };
                Ok(Some(Request::Control { number, setup, data }))
            }
            (SUBMIT, _) if is_in => Ok(Some(Request::Stream { number })),
            (command, endpoint) => Err(format!("command {command} at endpoint {endpoint}").into()),
        }
    }

    /// Answers a request for data.
    pub fn send(&mut self, number: u32, data: &[u8]) -> Outcome<()> {
        self.answer(SUBMITTED, number, [0, data.len() as i32], data)
    }

    /// Confirms `length` bytes of outgoing data.
    pub fn confirm(&mut self, number: u32, length: usize) -> Outcome<()> {
        self.answer(SUBMITTED, number, [0, length as i32], &[])
    }

    /// Refuses a request.
    pub fn stall(&mut self, number: u32) -> Outcome<()> {
        self.answer(SUBMITTED, number, [STALLED, 0], &[])
    }

    /// Answers a cancellation; `was_waiting` is false if the request was answered before.
    pub fn unlink(&mut self, number: u32, was_waiting: bool) -> Outcome<()> {
        self.answer(UNLINKED, number, [if was_waiting { CALLED_BACK } else { 0 }, 0], &[])
    }

    fn answer(&mut self, kind: u32, number: u32, words: [i32; 2], data: &[u8]) -> Outcome<()> {
        let mut message = vec![0; HEADER_BYTES];
        message[..4].copy_from_slice(&kind.to_be_bytes());
        message[4..8].copy_from_slice(&number.to_be_bytes());
        message[20..24].copy_from_slice(&words[0].to_be_bytes());
        message[24..28].copy_from_slice(&words[1].to_be_bytes());
        message.extend(data);
        Ok(self.0.write_all(&message)?)
    }
}
