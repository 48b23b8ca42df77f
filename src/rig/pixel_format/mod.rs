//! Pixel formats of cameras, unpacked into planes of counts.
//!
//! A count is a value of the sensor's converter, raw or processed by the camera. The planes keep
//! the camera's pixel grid. Colours that a Bayer sensor lacks at a pixel are means of the nearest
//! sites, which keeps them linear in the light.

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

/// Layout of pixels in memory, after V4L2's four-character codes
/// (<https://docs.kernel.org/userspace-api/media/v4l/pixfmt.html>).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // The fields' types describe them.
pub enum PixelFormat {
    /// One sample per pixel.
    Grey(Samples),
    /// One sample per pixel, behind colour filters.
    Bayer { mosaic: Mosaic, samples: Samples },
    /// `RGB3`, three bytes per pixel: red, green, blue.
    Rgb24,
    /// `BGR3`, three bytes per pixel: blue, green, red.
    Bgr24,
    /// Luma of every pixel and chroma of every second one, with the camera's tone curve, which the
    /// calibration's response curves invert.
    YCbCr(YCbCr),
    /// `MJPG`: each frame a JPEG. The calibration measures its coding as part of the camera.
    Jpeg,
}

/// Error in the bytes of a frame.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The messages describe the variants.
pub enum BadFrame {
    #[error(
        "a {format} frame of {size} with {stride_bytes} bytes a row has {found} bytes; {wanted} \
         are needed"
    )]
    Short { format: &'static str, size: Size, stride_bytes: usize, found: usize, wanted: usize },
    #[error(transparent)]
    Coded(#[from] Flaw),
}

impl PixelFormat {
    /// Supported formats with their four-character codes, without trailing blanks.
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

    /// Format with this four-character code (`"GREY"`, `"RG10"`, …) or this name in the Pixel
    /// Format Naming Convention (`"Mono8"`, `"BayerRG12p"`, …); `None` if it is not supported.
    pub fn from_code(code: &str) -> Option<Self> {
        let known = Self::ALL.iter().find(|(name, _)| *name == code.trim_end());
        known.map(|&(_, format)| format).or_else(|| Self::from_pfnc(code))
    }

    /// Format with this name in the Pixel Format Naming Convention.
    fn from_pfnc(name: &str) -> Option<Self> {
        if let Some(samples) = name.strip_prefix("Mono") {
            return Samples::from_pfnc(samples).map(PixelFormat::Grey);
        }
        match name {
            "RGB8" | "RGB8Packed" => Some(PixelFormat::Rgb24),
            "BGR8" | "BGR8Packed" => Some(PixelFormat::Bgr24),
            _ => Some(PixelFormat::Bayer {
                samples: Samples::from_pfnc(name.strip_prefix("Bayer")?.get(2..)?)?,
                mosaic: Mosaic::of_format(name)?,
            }),
        }
    }

    /// Format with this code and counts of `bits`. Fewer than 16 bits in a format of 16 are the
    /// upper ones (rp1-cfe and other CSI-2 receivers). `None` if the format has another depth.
    pub fn from_code_and_bits(code: &str, bits: u8) -> Option<Self> {
        let narrowed = Self::from_code(code)?.with_samples(|samples| samples.in_upper(bits));
        (narrowed.bits() == bits).then_some(narrowed)
    }

    /// Coding of the samples; `None` unless the format has one per pixel.
    fn samples(self) -> Option<Samples> {
        match self {
            PixelFormat::Grey(samples) | PixelFormat::Bayer { samples, .. } => Some(samples),
            _ => None,
        }
    }

    /// Applies `change` to the coding of the samples.
    fn with_samples(self, change: impl Fn(Samples) -> Samples) -> Self {
        match self {
            PixelFormat::Grey(samples) => PixelFormat::Grey(change(samples)),
            PixelFormat::Bayer { mosaic, samples } => {
                PixelFormat::Bayer { mosaic, samples: change(samples) }
            }
            other => other,
        }
    }

    /// Format of the rig's camera; `None` if it is not supported, or for a simulated camera without
    /// colour filters, which delivers three colours.
    pub fn of(rig: &config::RigFile) -> Option<Self> {
        match &rig.kind {
            config::Kind::Simulated(simulation) => {
                Some(PixelFormat::raw(simulation.sensor.mosaic?, rig.camera.bits))
            }
            config::Kind::Hardware(hardware) => {
                Self::from_code_and_bits(hardware.camera.format(), rig.camera.bits)
            }
        }
    }

    /// Format of unpacked samples of `bits` bits behind colour filters.
    pub fn raw(mosaic: Mosaic, bits: u8) -> Self {
        let samples = match bits {
            8 => Samples::Bytes,
            bits => Samples::Words { bits, shift: 0 },
        };
        PixelFormat::Bayer { mosaic, samples }
    }

    /// Colour filters of the sites, if any: in an unpacked frame, the count at (x, y) is measured
    /// in the plane of `colour_at(x, y)` and interpolated in the others.
    pub fn mosaic(self) -> Option<Mosaic> {
        match self {
            PixelFormat::Bayer { mosaic, .. } => Some(mosaic),
            _ => None,
        }
    }

    /// Four-character code without trailing blanks.
    pub fn code(self) -> &'static str {
        let whole = self.with_samples(Samples::whole);
        Self::ALL.iter().find(|&&(_, format)| format == whole).map_or("?", |&(name, _)| name)
    }

    /// Four-character code padded with blanks, for V4L2.
    pub fn fourcc(self) -> [u8; 4] {
        let mut code = self.code().bytes();
        [0; 4].map(|_| code.next().unwrap_or(b' '))
    }

    /// Bits of one count.
    pub fn bits(self) -> u8 {
        self.samples().map_or(8, Samples::bits)
    }

    /// Whether `width` pixels fill whole packing groups, so that a row ends with a whole byte.
    pub fn has_whole_rows(self, width: usize) -> bool {
        self.samples().is_none_or(|samples| samples.has_whole_rows(width))
    }

    /// Bytes of a row of `width` pixels, without padding.
    pub fn row_bytes(self, width: usize) -> usize {
        self.layout(Size::new(width, 1)).0
    }

    /// Whether the meaning of the values depends on the quantisation range that the driver states.
    pub fn has_range(self) -> bool {
        matches!(self, PixelFormat::YCbCr(_))
    }

    /// Bytes per row and number of rows of a frame of `size`; zeros for JPEGs.
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

    /// Bytes of a frame of `size` with rows `stride_bytes` apart; 0 for formats of varying length.
    pub fn frame_bytes(self, size: Size, stride_bytes: usize) -> usize {
        let (row_bytes, height) = self.layout(size);
        height.saturating_sub(1) * stride_bytes + row_bytes
    }

    /// Unpacks a frame of `bytes`, with rows `stride_bytes` apart, into `counts` of the frame's
    /// size. A grey camera fills all three planes. `scratch` is reused memory.
    ///
    /// # Errors
    /// [`BadFrame::Short`] for too few bytes, [`BadFrame::Coded`] for an incomplete JPEG.
    pub fn unpack(
        self,
        bytes: &[u8],
        stride_bytes: usize,
        counts: &mut Counts,
        scratch: &mut Plane<u16>,
    ) -> Result<(), BadFrame> {
        let size = counts.size();
        let (row_bytes, height) = self.layout(size);
        let wanted = self.frame_bytes(size, stride_bytes);
        if bytes.len() < wanted || stride_bytes < row_bytes {
            let (format, found) = (self.code(), bytes.len());
            return Err(BadFrame::Short { format, size, stride_bytes, found, wanted });
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

/// Unpacks rows of three bytes per pixel; `order` has the offsets of red, green and blue.
fn three_bytes<'a>(rows: impl Iterator<Item = &'a [u8]>, counts: &mut Counts, order: [usize; 3]) {
    for (y, row) in rows.enumerate() {
        let [red, green, blue] = counts.planes_mut().each_mut().map(|plane| plane.row_mut(y));
        let pixels = red.iter_mut().zip(green).zip(blue).zip(row.chunks_exact(3));
        for (((r, g), b), pixel) in pixels {
            (*r, *g, *b) = (pixel[order[0]].into(), pixel[order[1]].into(), pixel[order[2]].into());
        }
    }
}
