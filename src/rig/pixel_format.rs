//! What a camera's bytes mean: the pixel formats relens takes, each turned into planes of counts.
//!
//! Nothing is scaled here: a count is the number the sensor's converter gave. The planes keep the
//! camera's pixel grid; a Bayer sensor's missing colours are the mean of the nearest sites of that
//! colour, which is linear in the light and therefore part of the lens as the calibration sees it.

use super::bayer;
use crate::config;
use crate::frame::{Counts, Mosaic, Plane, Size};

/// A layout of pixels in memory, after V4L2's four-character codes
/// (<https://docs.kernel.org/userspace-api/media/v4l/pixfmt.html>).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFormat {
    /// `GREY`, 8 bits a pixel.
    Grey,
    /// `Y10 `, `Y12 `, `Y16 `: one little-endian 16-bit word a pixel, the low `bits` of it used.
    GreyWide {
        /// 10, 12 or 16.
        bits: u8,
    },
    /// Raw Bayer: a byte a pixel with 8 bits, else a little-endian 16-bit word with the low `bits`
    /// used.
    Bayer {
        /// Which colour is where.
        mosaic: Mosaic,
        /// 8, 10, 12 or 16.
        bits: u8,
    },
    /// `RGB3`, three bytes a pixel: red, green, blue.
    Rgb24,
    /// `YUYV`, 4:2:2, BT.601 in the limited range, which is V4L2's default for Y′CbCr.
    /// The camera has bent the light already; the calibration's response curves unbend it.
    Yuyv,
}

/// Bytes that are not the frame they are said to be.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "a {format} frame of {size} with {stride_bytes} bytes a row has {found} bytes; {wanted} are \
     needed"
)]
pub struct ShortFrame {
    /// Four-character code.
    pub format: &'static str,
    /// Pixels.
    pub size: Size,
    /// Bytes from row to row.
    pub stride_bytes: usize,
    /// Bytes there are.
    pub found: usize,
    /// Bytes there must be at least.
    pub wanted: usize,
}

impl PixelFormat {
    /// Every format relens takes, with its four-character code without trailing blanks.
    pub const ALL: [(&'static str, PixelFormat); 22] = {
        use Mosaic::{Bggr, Gbrg, Grbg, Rggb};
        use PixelFormat::{Bayer, Grey, GreyWide, Rgb24, Yuyv};
        [
            ("GREY", Grey),
            ("Y10", GreyWide { bits: 10 }),
            ("Y12", GreyWide { bits: 12 }),
            ("Y16", GreyWide { bits: 16 }),
            ("BA81", Bayer { mosaic: Bggr, bits: 8 }),
            ("GBRG", Bayer { mosaic: Gbrg, bits: 8 }),
            ("GRBG", Bayer { mosaic: Grbg, bits: 8 }),
            ("RGGB", Bayer { mosaic: Rggb, bits: 8 }),
            ("BG10", Bayer { mosaic: Bggr, bits: 10 }),
            ("GB10", Bayer { mosaic: Gbrg, bits: 10 }),
            ("BA10", Bayer { mosaic: Grbg, bits: 10 }),
            ("RG10", Bayer { mosaic: Rggb, bits: 10 }),
            ("BG12", Bayer { mosaic: Bggr, bits: 12 }),
            ("GB12", Bayer { mosaic: Gbrg, bits: 12 }),
            ("BA12", Bayer { mosaic: Grbg, bits: 12 }),
            ("RG12", Bayer { mosaic: Rggb, bits: 12 }),
            ("BYR2", Bayer { mosaic: Bggr, bits: 16 }),
            ("GB16", Bayer { mosaic: Gbrg, bits: 16 }),
            ("GR16", Bayer { mosaic: Grbg, bits: 16 }),
            ("RG16", Bayer { mosaic: Rggb, bits: 16 }),
            ("RGB3", Rgb24),
            ("YUYV", Yuyv),
        ]
    };

    /// The format of a four-character code (`"GREY"`, `"RG10"`, …); `None` when relens does not
    /// take it.
    pub fn from_code(code: &str) -> Option<Self> {
        Self::ALL.iter().find(|(name, _)| *name == code.trim_end()).map(|&(_, format)| format)
    }

    /// The format that the camera of `rig` sends; `None` when it is one relens does not take, or a
    /// simulated one without colour filters, which sends counts of three colours.
    pub fn of(rig: &config::RigFile) -> Option<Self> {
        match &rig.kind {
            config::Kind::Simulated(simulation) => {
                let mosaic = simulation.sensor.mosaic?;
                Some(PixelFormat::Bayer { mosaic, bits: rig.camera.bits })
            }
            config::Kind::Hardware(hardware) => match &hardware.camera {
                config::CameraDevice::V4l2(device) => Self::from_code(&device.format),
            },
        }
    }

    /// The colour of each site, if a site has one: the count at column x, row y of an unpacked
    /// frame is the sensor's own in the plane of `colour_at(x, y)` and interpolated in the others.
    pub fn mosaic(self) -> Option<Mosaic> {
        match self {
            PixelFormat::Bayer { mosaic, .. } => Some(mosaic),
            _ => None,
        }
    }

    /// The four-character code without trailing blanks.
    pub fn code(self) -> &'static str {
        Self::ALL.iter().find(|&&(_, format)| format == self).map_or("?", |&(name, _)| name)
    }

    /// The code as V4L2 wants it: four bytes, padded with blanks.
    pub fn fourcc(self) -> [u8; 4] {
        let mut code = [b' '; 4];
        for (to, from) in code.iter_mut().zip(self.code().bytes()) {
            *to = from;
        }
        code
    }

    /// Bits of one count.
    pub fn bits(self) -> u8 {
        match self {
            PixelFormat::Grey | PixelFormat::Rgb24 | PixelFormat::Yuyv => 8,
            PixelFormat::GreyWide { bits } | PixelFormat::Bayer { bits, .. } => bits,
        }
    }

    /// Bytes of one pixel.
    pub fn pixel_bytes(self) -> usize {
        match self {
            PixelFormat::Grey | PixelFormat::Bayer { bits: 8, .. } => 1,
            PixelFormat::GreyWide { .. } | PixelFormat::Bayer { .. } | PixelFormat::Yuyv => 2,
            PixelFormat::Rgb24 => 3,
        }
    }

    /// Unpacks a frame of `bytes`, rows `stride_bytes` apart, into `counts` (whose size says the
    /// frame's). A grey camera fills all three planes alike. `scratch` is room of the caller's, so
    /// that no frame allocates.
    ///
    /// # Errors
    /// [`ShortFrame`] when there are fewer bytes than pixels.
    pub fn unpack(
        self,
        bytes: &[u8],
        stride_bytes: usize,
        counts: &mut Counts,
        scratch: &mut Plane<u16>,
    ) -> Result<(), ShortFrame> {
        let size = counts.size();
        let row_bytes = size.width * self.pixel_bytes();
        let wanted = (size.height.saturating_sub(1)) * stride_bytes + row_bytes;
        if bytes.len() < wanted || stride_bytes < row_bytes {
            return Err(ShortFrame {
                format: self.code(),
                size,
                stride_bytes,
                found: bytes.len(),
                wanted,
            });
        }
        let rows = || bytes.chunks(stride_bytes).take(size.height).map(|row| &row[..row_bytes]);
        match self {
            PixelFormat::Grey | PixelFormat::GreyWide { .. } => {
                let [red, green, blue] = counts.planes_mut();
                samples(rows(), self, green);
                red.data_mut().copy_from_slice(green.data());
                blue.data_mut().copy_from_slice(green.data());
            }
            PixelFormat::Bayer { mosaic, .. } => {
                if scratch.size() != size {
                    *scratch = Plane::zeros(size);
                }
                samples(rows(), self, scratch);
                bayer::interpolate(scratch, mosaic, counts);
            }
            PixelFormat::Rgb24 => {
                for (y, row) in rows().enumerate() {
                    let [red, green, blue] = counts.planes_mut().each_mut().map(|p| p.row_mut(y));
                    for (((r, g), b), pixel) in
                        red.iter_mut().zip(green).zip(blue).zip(row.chunks_exact(3))
                    {
                        (*r, *g, *b) = (pixel[0].into(), pixel[1].into(), pixel[2].into());
                    }
                }
            }
            PixelFormat::Yuyv => {
                for (y, row) in rows().enumerate() {
                    let [red, green, blue] = counts.planes_mut().each_mut().map(|p| p.row_mut(y));
                    for (pair, four) in row.chunks_exact(4).enumerate() {
                        for (x, luma) in [(2 * pair, four[0]), (2 * pair + 1, four[2])] {
                            [red[x], green[x], blue[x]] = rgb_of_bt601(luma, four[1], four[3]);
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// Grey samples of one or two bytes a pixel, the bits above the format's own cut off.
fn samples<'a>(rows: impl Iterator<Item = &'a [u8]>, format: PixelFormat, plane: &mut Plane<u16>) {
    let mask = ((1u32 << format.bits()) - 1) as u16;
    for (y, row) in rows.enumerate() {
        let to = plane.row_mut(y);
        if format.pixel_bytes() == 1 {
            for (count, &byte) in to.iter_mut().zip(row) {
                *count = byte.into();
            }
        } else {
            for (count, word) in to.iter_mut().zip(row.chunks_exact(2)) {
                *count = u16::from_le_bytes([word[0], word[1]]) & mask;
            }
        }
    }
}

/// R′G′B′ of a BT.601 limited-range pixel (ITU-R BT.601-7 §2.5.3: luma 16..235, chroma 16..240
/// about 128).
fn rgb_of_bt601(luma: u8, cb: u8, cr: u8) -> [u16; 3] {
    let y = (f32::from(luma) - 16.0) * (255.0 / 219.0);
    let (cb, cr) =
        ((f32::from(cb) - 128.0) * (255.0 / 224.0), (f32::from(cr) - 128.0) * (255.0 / 224.0));
    // 2(1 − 0.299), 2(1 − 0.114) and their shares in green, from the luma weights 0.299, 0.587,
    // 0.114.
    let rgb = [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb];
    rgb.map(|v| (v + 0.5).clamp(0.0, 255.0) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Channel;

    fn unpacked(code: &str, bytes: &[u8], size: Size, stride_bytes: usize) -> Counts {
        let mut counts = Counts::zeros(size);
        let format = PixelFormat::from_code(code).unwrap();
        format
            .unpack(bytes, stride_bytes, &mut counts, &mut Plane::zeros(Size::new(0, 0)))
            .unwrap();
        counts
    }

    #[test]
    fn every_code_comes_back_from_its_format() {
        for (code, format) in PixelFormat::ALL {
            assert_eq!(format.code(), code);
            assert_eq!(format.mosaic(), Mosaic::of_format(code));
            assert_eq!(
                PixelFormat::from_code(std::str::from_utf8(&format.fourcc()).unwrap()),
                Some(format)
            );
        }
        assert_eq!(PixelFormat::from_code("MJPG"), None);
    }

    #[test]
    fn grey_rows_skip_the_padding_at_their_end() {
        let counts = unpacked("GREY", &[1, 2, 99, 3, 4], Size::new(2, 2), 3);
        for channel in Channel::ALL {
            assert_eq!(counts.plane(channel).data(), &[1, 2, 3, 4]);
        }
    }

    #[test]
    fn wide_grey_is_little_endian_and_cut_to_its_bits() {
        let bytes = [0x34, 0x12, 0xff, 0xff];
        for (code, want) in
            [("Y10", [0x234, 0x3ff]), ("Y12", [0x234, 0xfff]), ("Y16", [0x1234, 0xffff])]
        {
            assert_eq!(
                unpacked(code, &bytes, Size::new(2, 1), 4).plane(Channel::Green).data(),
                &want,
                "{code}"
            );
        }
    }

    #[test]
    fn rgb_keeps_its_order() {
        let counts = unpacked("RGB3", &[1, 2, 3, 4, 5, 6], Size::new(2, 1), 6);
        assert_eq!(
            counts.planes().each_ref().map(|p| p.data().to_vec()),
            [vec![1, 4], vec![2, 5], vec![3, 6]]
        );
    }

    #[test]
    fn yuyv_gives_the_colour_bars_of_bt601() {
        // 100 % bars, limited range: white, red and blue (BT.601-7 table values, rounded).
        let bars = [
            (235, 128, 128, [255, 255, 255]),
            (81, 90, 240, [255, 0, 0]),
            (41, 240, 110, [0, 0, 255]),
            (16, 128, 128, [0; 3]),
        ];
        for (y, cb, cr, want) in bars {
            let counts = unpacked("YUYV", &[y, cb, y, cr], Size::new(2, 1), 4);
            for x in 0..2 {
                let got = counts.planes().each_ref().map(|p| i32::from(p.at(x, 0)));
                assert!(
                    got.iter().zip(want).all(|(a, b): (&i32, i32)| (a - b).abs() <= 1),
                    "{got:?} for {want:?}"
                );
            }
        }
    }

    #[test]
    fn every_mosaic_and_depth_puts_its_sites_into_their_channel() {
        let size = Size::new(6, 4);
        for (code, format) in PixelFormat::ALL {
            let PixelFormat::Bayer { mosaic, bits } = format else { continue };
            let value = |x: usize, y: usize| (((y * 6 + x) * 7) as u16 + 1) << (bits - 8);
            let mut bytes = Vec::new();
            for y in 0..4 {
                for x in 0..6 {
                    bytes.extend_from_slice(&value(x, y).to_le_bytes()[..format.pixel_bytes()]);
                }
            }
            let counts = unpacked(code, &bytes, size, 6 * format.pixel_bytes());
            for y in 0..4 {
                for x in 0..6 {
                    assert_eq!(
                        counts.plane(mosaic.colour_at(x, y)).at(x, y),
                        value(x, y),
                        "{code} at {x},{y}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_short_frame_is_refused_with_the_bytes_it_lacks() {
        let mut counts = Counts::zeros(Size::new(4, 2));
        let error = PixelFormat::Grey
            .unpack(&[0; 7], 4, &mut counts, &mut Plane::zeros(Size::new(0, 0)))
            .unwrap_err();
        assert_eq!((error.found, error.wanted), (7, 8));
    }
}
