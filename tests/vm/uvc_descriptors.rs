//! Description of the virtual rig's USB camera (USB Device Class Definition for Video Devices 1.1):
//! descriptors and controls.

use relens::frame::Size;

/// Units of the camera, in the order in which a picture passes them.
pub const CAMERA: u8 = 1;
pub const PROCESSING: u8 = 2;
pub const EXTENSION: u8 = 3;
const OUTPUT: u8 = 4;

/// Guid of The Imaging Source's extension unit, in the order of the bytes on the cable (tiscamera,
/// data/uvc-extensions/usb33.json).
const EXTENSION_GUID: [u8; 16] = [
    0xde, 0x49, 0xba, 0x0a, 0x0b, 0x5c, 0xd5, 0x49, 0x8f, 0x71, 0x0b, 0xe4, 0x0f, 0x94, 0xa6, 0x7a,
];

/// Guid of the format that the kernel calls BGR3 (include/media/v4l2-uvc.h).
const BGR3: [u8; 16] = [
    0x7d, 0xeb, 0x36, 0xe4, 0x4f, 0x52, 0xce, 0x11, 0x9f, 0x53, 0x00, 0x20, 0xaf, 0x0b, 0xa7, 0x70,
];
pub const BYTES_PER_PIXEL: usize = 3;

/// Bytes of a payload with its header: one transfer of the kernel's, 32 packets.
pub const PAYLOAD_BYTES: usize = 32 * PACKET_BYTES as usize;
const PACKET_BYTES: u16 = 512;

/// Shortest and longest frame interval, in units of 100 ns: 60 frames a second and one frame in two
/// seconds.
pub const INTERVALS: [u32; 2] = [166_667, 20_000_000];

/// A control of a unit.
pub struct Control {
    pub unit: u8,
    pub selector: u8,
    /// Bit of the unit's `bmControls`.
    bit: u8,
    pub name: &'static str,
    pub bytes: usize,
    pub minimum: i32,
    pub maximum: i32,
    pub default: i32,
}

const fn control(
    [unit, selector, bit, bytes]: [u8; 4],
    name: &'static str,
    [minimum, maximum, default]: [i32; 3],
) -> Control {
    Control { unit, selector, bit, name, bytes: bytes as usize, minimum, maximum, default }
}

/// Controls with the defaults of a webcam, which a rig must change: automatic exposure and white
/// balance, some gain and gamma. The maker's extension has a trigger, which is off. The range of
/// [`BROKEN`] cannot be read, as happens with webcams.
pub const CONTROLS: [Control; 14] = [
    control([CAMERA, 0x02, 1, 1], AUTO_EXPOSURE, [1, 8, 8]),
    control([CAMERA, 0x04, 3, 4], EXPOSURE, [1, 20_000, 100]),
    control([PROCESSING, 0x01, 8, 2], BROKEN, [0, 1, 0]),
    control([PROCESSING, 0x03, 1, 2], "contrast", [0, 100, 50]),
    control([PROCESSING, 0x04, 9, 2], "gain", [0, 480, 96]),
    control([PROCESSING, 0x05, 10, 1], "power_line_frequency", [0, 2, 1]),
    control([PROCESSING, 0x06, 2, 2], "hue", [-40, 40, 0]),
    control([PROCESSING, 0x07, 3, 2], "saturation", [0, 128, 64]),
    control([PROCESSING, 0x08, 4, 2], "sharpness", [0, 7, 3]),
    control([PROCESSING, 0x09, 5, 2], "gamma", [72, 500, 220]),
    control([PROCESSING, 0x0a, 6, 2], "white_balance_temperature", [2800, 6500, 4600]),
    control([PROCESSING, 0x0b, 12, 1], "white_balance_automatic", [0, 1, 1]),
    control([EXTENSION, 0x05, 4, 1], TRIGGER_MODE, [0, 1, 0]),
    control([EXTENSION, 0x41, 64, 1], "trigger_polarity", [0, 1, 0]),
];
pub const BROKEN: &str = "backlight_compensation";
pub const AUTO_EXPOSURE: &str = "auto_exposure";
pub const EXPOSURE: &str = "exposure_time_absolute";
pub const TRIGGER_MODE: &str = "trigger_mode";

/// `bmControls` of `unit`, preceded by their length.
fn available(unit: u8, bytes: u8) -> Vec<u8> {
    let mut bits = vec![0; usize::from(bytes)];
    for control in CONTROLS.iter().filter(|control| control.unit == unit) {
        bits[usize::from(control.bit / 8)] |= 1 << (control.bit % 8);
    }
    [vec![bytes], bits].concat()
}

/// A descriptor with its length and kind.
fn part(kind: u8, body: &[&[u8]]) -> Vec<u8> {
    let body = body.concat();
    [vec![body.len() as u8 + 2, kind], body].concat()
}

const INTERFACE: u8 = 4;
const CLASS_SPECIFIC: u8 = 0x24;

pub fn device() -> Vec<u8> {
    // USB 2.0, class by interface associations, pid.codes' number for tests, two strings.
    part(1, &[&[0, 2, 0xef, 2, 1, 64, 0x09, 0x12, 1, 0, 0, 1, 1, 2, 0, 1]])
}

/// String `index`; the second is the camera's name.
pub fn string(index: u8) -> Vec<u8> {
    let text = match index {
        0 => return part(3, &[&[0x09, 0x04]]),
        1 => "relens",
        _ => "relens USB camera",
    };
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    part(3, &[&units])
}

/// The configuration for frames of `size`.
pub fn configuration(size: Size) -> Vec<u8> {
    let interfaces = [
        part(0x0b, &[&[0, 2, 0x0e, 3, 0, 0]]),
        part(INTERFACE, &[&[0, 0, 0, 0x0e, 1, 0, 0]]),
        units(),
        part(INTERFACE, &[&[1, 0, 1, 0x0e, 2, 0, 0]]),
        formats(size),
        // A bulk endpoint with the first input number.
        part(5, &[&[0x81, 2], &PACKET_BYTES.to_le_bytes(), &[0]]),
    ]
    .concat();
    let total = (interfaces.len() as u16 + 9).to_le_bytes();
    [part(2, &[&total, &[2, 1, 0, 0x80, 250]]), interfaces].concat()
}

fn units() -> Vec<u8> {
    let units = [
        part(
            CLASS_SPECIFIC,
            &[&[2, CAMERA, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0], &available(CAMERA, 3)],
        ),
        part(CLASS_SPECIFIC, &[&[5, PROCESSING, CAMERA, 0, 0], &available(PROCESSING, 2), &[0, 0]]),
        part(
            CLASS_SPECIFIC,
            &[
                &[6, EXTENSION],
                &EXTENSION_GUID,
                &[2, 1, PROCESSING],
                &available(EXTENSION, 9),
                &[0],
            ],
        ),
        part(CLASS_SPECIFIC, &[&[3, OUTPUT, 0x01, 0x01, 0, EXTENSION, 0]]),
    ]
    .concat();
    let total = (units.len() as u16 + 13).to_le_bytes();
    let header = part(CLASS_SPECIFIC, &[&[1, 0x10, 0x01], &total, &[0, 0, 0, 0, 1, 1]]);
    [header, units].concat()
}

fn formats(size: Size) -> Vec<u8> {
    let frame_bytes = (size.area() * BYTES_PER_PIXEL) as u32;
    let [shortest, longest] = INTERVALS.map(u32::to_le_bytes);
    let formats = [
        part(CLASS_SPECIFIC, &[&[4, 1, 1], &BGR3, &[8 * BYTES_PER_PIXEL as u8, 1, 0, 0, 0, 0]]),
        part(
            CLASS_SPECIFIC,
            &[
                &[5, 1, 0],
                &(size.width as u16).to_le_bytes(),
                &(size.height as u16).to_le_bytes(),
                &[0; 8],
                &frame_bytes.to_le_bytes(),
                &shortest,
                // All intervals between the shortest and the longest.
                &[0],
                &shortest,
                &longest,
                &1_u32.to_le_bytes(),
            ],
        ),
    ]
    .concat();
    let total = (formats.len() as u16 + 14).to_le_bytes();
    let header = part(CLASS_SPECIFIC, &[&[1, 1], &total, &[0x81, 0, OUTPUT, 0, 0, 0, 1, 0]]);
    [header, formats].concat()
}
