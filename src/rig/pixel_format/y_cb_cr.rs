//! Y′CbCr formats of webcams: BT.601 in the limited range, V4L2's default.

use crate::frame::{Counts, Size};

/// Layout of luma and chroma.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum YCbCr {
    /// 4:2:2: Y′ Cb Y′ Cr of two pixels.
    Yuyv,
    /// 4:2:2: Cb Y′ Cr Y′ of two pixels.
    Uyvy,
    /// 4:2:0: all Y′, then one pair of Cb Cr for every 2 × 2 pixels, with the same stride.
    Nv12,
}

impl YCbCr {
    /// Bytes per row and number of rows of a frame, those of chroma included.
    pub(super) fn rows(self, size: Size) -> (usize, usize) {
        let even = 2 * size.width.div_ceil(2);
        match self {
            YCbCr::Yuyv | YCbCr::Uyvy => (2 * even, size.height),
            YCbCr::Nv12 => (even, size.height + size.height.div_ceil(2)),
        }
    }

    /// Reads the counts of a frame of sufficient length.
    pub(super) fn read(self, bytes: &[u8], stride_bytes: usize, counts: &mut Counts) {
        let size = counts.size();
        for y in 0..size.height {
            let row = &bytes[y * stride_bytes..];
            let chroma = match self {
                YCbCr::Nv12 => &bytes[(size.height + y / 2) * stride_bytes..],
                _ => row,
            };
            let [red, green, blue] = counts.planes_mut().each_mut().map(|plane| plane.row_mut(y));
            for x in 0..size.width {
                let (pair, second) = (x / 2, x % 2);
                let [luma, cb, cr] = match self {
                    YCbCr::Yuyv => [4 * pair + 2 * second, 4 * pair + 1, 4 * pair + 3],
                    YCbCr::Uyvy => [4 * pair + 2 * second + 1, 4 * pair, 4 * pair + 2],
                    YCbCr::Nv12 => [x, 2 * pair, 2 * pair + 1],
                };
                [red[x], green[x], blue[x]] = rgb_of_bt601(row[luma], chroma[cb], chroma[cr]);
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
    // From the luma weights 0.299, 0.587 and 0.114: 2(1 − 0.299), 2(1 − 0.114), and green.
    let rgb = [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb];
    rgb.map(|v| (v + 0.5).clamp(0.0, 255.0) as u16)
}
