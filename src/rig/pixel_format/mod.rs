//! What a camera's bytes mean: the pixel formats relens takes, each turned into planes of counts.
//!
//! A count is the number the sensor's converter gave, or what is left of one that a camera has bent
//! or coded already. The planes keep the camera's pixel grid; a Bayer sensor's missing colours are
//! the mean of the nearest sites of that colour, which is linear in the light.

mod samples;
#[cfg(test)]
mod tests;
mod y_cb_cr;

use super::bayer;
use crate::config;
use crate::frame::{Counts, Mosaic, Plane, Size};
use crate::picture::{Flaw, camera_frame};
pub use samples::Samples;
pub use y_cb_cr::YCbCr;

/// A layout of pixels in memory, after V4L2's four-character codes
/// (<https://docs.kernel.org/userspace-api/media/v4l/pixfmt.html>).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFormat {
    /// One sample a pixel.
    Grey(Samples),
    /// One sample a pixel, each behind a colour filter.
    Bayer {
        /// Which colour is where.
        mosaic: Mosaic,
        /// How a sample is written.
        samples: Samples,
    },
    /// `RGB3`, three bytes a pixel: red, green, blue.
    Rgb24,
    /// `BGR3`, three bytes a pixel: blue, green, red.
    Bgr24,
    /// Brightness of every pixel and colour of every second one. The camera has bent the light
    /// already; the calibration's response curves unbend it.
    YCbCr(YCbCr),
    /// `MJPG`: every frame a JPEG. Its coding is part of what the camera does to the light, and is
    /// measured and certified with it.
    Jpeg,
}

/// Why bytes are no frame.
#[derive(Debug, thiserror::Error)]
pub enum BadFrame {
    /// They are too few.
    #[error(transparent)]
    Short(#[from] ShortFrame),
    /// They are no whole JPEG of the camera's size.
    #[error(transparent)]
    Coded(#[from] Flaw),
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
    pub const ALL: [(&'static str, PixelFormat); 36] = {
        use Mosaic::{Bggr, Gbrg, Grbg, Rggb};
        use PixelFormat::{Bgr24, Grey, Jpeg, Rgb24, YCbCr};
        const fn wide(bits: u8) -> Samples {
            Samples::Words { bits, shift: 0 }
        }
        const fn packed(bits: u8) -> Samples {
            Samples::Packed { bits }
        }
        const fn raw(mosaic: Mosaic, samples: Samples) -> PixelFormat {
            PixelFormat::Bayer { mosaic, samples }
        }
        [
            ("GREY", Grey(Samples::Bytes)),
            ("Y10", Grey(wide(10))),
            ("Y12", Grey(wide(12))),
            ("Y16", Grey(wide(16))),
            ("Y10P", Grey(packed(10))),
            ("Y12P", Grey(packed(12))),
            ("BA81", raw(Bggr, Samples::Bytes)),
            ("GBRG", raw(Gbrg, Samples::Bytes)),
            ("GRBG", raw(Grbg, Samples::Bytes)),
            ("RGGB", raw(Rggb, Samples::Bytes)),
            ("BG10", raw(Bggr, wide(10))),
            ("GB10", raw(Gbrg, wide(10))),
            ("BA10", raw(Grbg, wide(10))),
            ("RG10", raw(Rggb, wide(10))),
            ("pBAA", raw(Bggr, packed(10))),
            ("pGAA", raw(Gbrg, packed(10))),
            ("pgAA", raw(Grbg, packed(10))),
            ("pRAA", raw(Rggb, packed(10))),
            ("BG12", raw(Bggr, wide(12))),
            ("GB12", raw(Gbrg, wide(12))),
            ("BA12", raw(Grbg, wide(12))),
            ("RG12", raw(Rggb, wide(12))),
            ("pBCC", raw(Bggr, packed(12))),
            ("pGCC", raw(Gbrg, packed(12))),
            ("pgCC", raw(Grbg, packed(12))),
            ("pRCC", raw(Rggb, packed(12))),
            ("BYR2", raw(Bggr, wide(16))),
            ("GB16", raw(Gbrg, wide(16))),
            ("GR16", raw(Grbg, wide(16))),
            ("RG16", raw(Rggb, wide(16))),
            ("RGB3", Rgb24),
            ("BGR3", Bgr24),
            ("YUYV", YCbCr(y_cb_cr::YCbCr::Yuyv)),
            ("UYVY", YCbCr(y_cb_cr::YCbCr::Uyvy)),
            ("NV12", YCbCr(y_cb_cr::YCbCr::Nv12)),
            ("MJPG", Jpeg),
        ]
    };

    /// The format of a four-character code (`"GREY"`, `"RG10"`, …); `None` when relens does not
    /// take it.
    pub fn from_code(code: &str) -> Option<Self> {
        Self::ALL.iter().find(|(name, _)| *name == code.trim_end()).map(|&(_, format)| format)
    }

    /// The same for counts of `bits`: those of fewer than 16 bits in a format of 16 are its upper
    /// ones (rp1-cfe's, MIPI CSI-2 receivers'). `None` when the format has not as many bits.
    pub fn from_code_and_bits(code: &str, bits: u8) -> Option<Self> {
        let format = Self::from_code(code)?;
        let narrowed = match format {
            PixelFormat::Grey(samples) => PixelFormat::Grey(samples.in_upper(bits)),
            PixelFormat::Bayer { mosaic, samples } => {
                PixelFormat::Bayer { mosaic, samples: samples.in_upper(bits) }
            }
            other => other,
        };
        (narrowed.bits() == bits).then_some(narrowed)
    }

    /// The format that the camera of `rig` sends; `None` when it is one relens does not take, or a
    /// simulated one without colour filters, which sends counts of three colours.
    pub fn of(rig: &config::RigFile) -> Option<Self> {
        match &rig.kind {
            config::Kind::Simulated(simulation) => {
                Some(PixelFormat::raw(simulation.sensor.mosaic?, rig.camera.bits))
            }
            config::Kind::Hardware(hardware) => match &hardware.camera {
                config::CameraDevice::V4l2(device) => {
                    Self::from_code_and_bits(&device.format, rig.camera.bits)
                }
            },
        }
    }

    /// Unpacked samples of `bits` behind filters.
    pub fn raw(mosaic: Mosaic, bits: u8) -> Self {
        let samples = match bits {
            8 => Samples::Bytes,
            bits => Samples::Words { bits, shift: 0 },
        };
        PixelFormat::Bayer { mosaic, samples }
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
        let whole = match self {
            PixelFormat::Grey(samples) => PixelFormat::Grey(samples.whole()),
            PixelFormat::Bayer { mosaic, samples } => {
                PixelFormat::Bayer { mosaic, samples: samples.whole() }
            }
            other => other,
        };
        Self::ALL.iter().find(|&&(_, format)| format == whole).map_or("?", |&(name, _)| name)
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
            PixelFormat::Grey(samples) | PixelFormat::Bayer { samples, .. } => samples.bits(),
            PixelFormat::Rgb24 | PixelFormat::Bgr24 => 8,
            PixelFormat::YCbCr(_) | PixelFormat::Jpeg => 8,
        }
    }

    /// Whether it is one whose numbers depend on the range that the driver says they have.
    pub fn has_range(self) -> bool {
        matches!(self, PixelFormat::YCbCr(_))
    }

    /// Bytes of a row of so many pixels, and rows of a frame of so many.
    fn layout(self, size: Size) -> (usize, usize) {
        match self {
            PixelFormat::Grey(samples) | PixelFormat::Bayer { samples, .. } => {
                (samples.row_bytes(size.width), size.height)
            }
            PixelFormat::Rgb24 | PixelFormat::Bgr24 => (3 * size.width, size.height),
            PixelFormat::YCbCr(layout) => layout.rows(size),
            PixelFormat::Jpeg => (0, 0),
        }
    }

    /// Unpacks a frame of `bytes`, rows `stride_bytes` apart, into `counts` (whose size says the
    /// frame's). A grey camera fills all three planes alike. `scratch` is room of the caller's, so
    /// that no frame allocates.
    ///
    /// # Errors
    /// [`BadFrame::Short`] when there are fewer bytes than pixels, [`BadFrame::Coded`] for what is
    /// no whole JPEG.
    pub fn unpack(
        self,
        bytes: &[u8],
        stride_bytes: usize,
        counts: &mut Counts,
        scratch: &mut Plane<u16>,
    ) -> Result<(), BadFrame> {
        let size = counts.size();
        let (row_bytes, height) = self.layout(size);
        let wanted = (height.saturating_sub(1)) * stride_bytes + row_bytes;
        if bytes.len() < wanted || stride_bytes < row_bytes {
            return Err(BadFrame::Short(ShortFrame {
                format: self.code(),
                size,
                stride_bytes,
                found: bytes.len(),
                wanted,
            }));
        }
        let rows = || bytes.chunks(stride_bytes.max(1)).take(height).map(|row| &row[..row_bytes]);
        match self {
            PixelFormat::Grey(samples) => {
                let [red, green, blue] = counts.planes_mut();
                rows().enumerate().for_each(|(y, row)| samples.read(row, green.row_mut(y)));
                red.data_mut().copy_from_slice(green.data());
                blue.data_mut().copy_from_slice(green.data());
            }
            PixelFormat::Bayer { mosaic, samples } => {
                if scratch.size() != size {
                    *scratch = Plane::zeros(size);
                }
                rows().enumerate().for_each(|(y, row)| samples.read(row, scratch.row_mut(y)));
                bayer::interpolate(scratch, mosaic, counts);
            }
            PixelFormat::Rgb24 => three_bytes(rows(), counts, [0, 1, 2]),
            PixelFormat::Bgr24 => three_bytes(rows(), counts, [2, 1, 0]),
            PixelFormat::YCbCr(layout) => layout.read(bytes, stride_bytes, counts),
            PixelFormat::Jpeg => *counts = camera_frame(bytes, size)?,
        }
        Ok(())
    }
}

/// Rows of three bytes a pixel, red, green and blue at `order` of them.
fn three_bytes<'a>(rows: impl Iterator<Item = &'a [u8]>, counts: &mut Counts, order: [usize; 3]) {
    for (y, row) in rows.enumerate() {
        let [red, green, blue] = counts.planes_mut().each_mut().map(|plane| plane.row_mut(y));
        let pixels = red.iter_mut().zip(green).zip(blue).zip(row.chunks_exact(3));
        for (((r, g), b), pixel) in pixels {
            (*r, *g, *b) = (pixel[order[0]].into(), pixel[order[1]].into(), pixel[order[2]].into());
        }
    }
}
