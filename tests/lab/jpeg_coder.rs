//! A JPEG encoder: sequential, chroma at full or half size, Huffman codes of equal length (allowed
//! by ITU-T T.81), so that files are long and the code is simple.

use relens::frame::block_transform::{cosines, transform};
use relens::frame::{BLOCK_AREA, Frame, Size, usual_step};

/// Coding of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quality {
    /// libjpeg's quality, 1 to 100.
    pub(crate) quality: u32,
    /// Pixels across and down for each sample of chroma.
    pub(crate) pixels: (usize, usize),
}

impl Quality {
    /// Name in tables.
    pub(crate) fn name(self) -> String {
        let chroma = match self.pixels {
            (1, 1) => "4:4:4",
            (2, 1) => "4:2:2",
            _ => "4:2:0",
        };
        format!("{}, {chroma}", self.quality)
    }
}

/// Row-major indices of a block's coefficients in the order of a scan (T.81, figure A.6).
fn zigzag() -> Vec<usize> {
    let mut places: Vec<usize> = (0..64).collect();
    let key = |&place: &usize| {
        let (x, y) = (place % 8, place / 8);
        (x + y, if (x + y) % 2 == 0 { x } else { y })
    };
    places.sort_by_key(key);
    places
}

/// Number of codes for the sizes of DC differences; [`DC_LENGTH`] is their length in bits.
const DC_CODES: u32 = 16;
const DC_LENGTH: u32 = 5;
/// Number of codes for runs and sizes of AC coefficients; [`AC_LENGTH`] is their length in bits.
const AC_CODES: u32 = 255;
const AC_LENGTH: u32 = 9;

/// Bits collected into bytes.
#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
    held: u32,
    count: u32,
}

impl Writer {
    fn put(&mut self, value: u32, count: u32) {
        for bit in (0..count).rev() {
            self.held = self.held << 1 | value >> bit & 1;
            self.count += 1;
            if self.count == 8 {
                self.bytes.push(self.held as u8);
                if self.held as u8 == 0xff {
                    self.bytes.push(0);
                }
                (self.held, self.count) = (0, 0);
            }
        }
    }

    /// Writes the code of `value` among codes of `length` bits. The commonest value, 0, has the
    /// last code, because readers take a run of zero bytes for a hole.
    fn code(&mut self, value: u32, length: u32) {
        let last = if length == DC_LENGTH { DC_CODES - 1 } else { AC_CODES - 1 };
        self.put(last - value, length);
    }

    /// Writes the code of `zeros` and the size of `value`, then the bits of `value`.
    fn number(&mut self, zeros: u32, value: i32, length: u32) {
        let size = 32 - value.unsigned_abs().leading_zeros();
        self.code(zeros << 4 | size, length);
        let bits = if value < 0 { value - 1 } else { value };
        self.put(bits as u32 & ((1 << size) - 1), size);
    }
}

/// Encodes `codes` into a file.
pub(crate) fn coded<S>(codes: &Frame<S, u8>, quality: Quality) -> Vec<u8> {
    let (size, (across, down)) = (codes.size(), quality.pixels);
    let step = |n: usize, k| usual_step(n, k, quality.quality as u16);
    let steps = [0, 1].map(|n| std::array::from_fn::<u16, BLOCK_AREA, _>(|k| step(n, k)));
    let zigzag = zigzag();
    let mut file = vec![0xff, 0xd8];
    let mut segment = |marker: u8, body: &[u8]| {
        file.extend([0xff, marker]);
        file.extend((body.len() as u16 + 2).to_be_bytes());
        file.extend(body);
    };
    for (n, table) in steps.iter().enumerate() {
        let body: Vec<u8> =
            std::iter::once(n as u8).chain(zigzag.iter().map(|&k| table[k] as u8)).collect();
        segment(0xdb, &body);
    }
    let [h, w] = [size.height, size.width].map(|side| (side as u16).to_be_bytes());
    let first = (across << 4 | down) as u8;
    segment(0xc0, &[8, h[0], h[1], w[0], w[1], 3, 1, first, 0, 2, 0x11, 1, 3, 0x11, 1]);
    for (class, length, count) in [(0x00, DC_LENGTH, DC_CODES), (0x10, AC_LENGTH, AC_CODES)] {
        let mut body = vec![class];
        body.extend((1..=16).map(|bits| if bits == length { count as u8 } else { 0 }));
        body.extend((0..count as u8).rev());
        segment(0xc4, &body);
    }
    segment(0xda, &[3, 1, 0, 2, 0, 3, 0, 0, 63, 0]);
    let mut bits = Writer::default();
    let mut before = [0i32; 3];
    let basis = cosines();
    let units = (size.width.div_ceil(8 * across), size.height.div_ceil(8 * down));
    for unit in 0..units.0 * units.1 {
        let (column, row) = (unit % units.0, unit / units.0);
        for n in 0..3 {
            let (own, parts) = match n {
                0 => ((1, 1), (across, down)),
                _ => ((across, down), (1, 1)),
            };
            for part in 0..parts.0 * parts.1 {
                let x0 = (column * parts.0 + part % parts.0) * 8;
                let y0 = (row * parts.1 + part / parts.0) * 8;
                let mut block: [f32; 64] =
                    std::array::from_fn(|k| sample(codes, n, (x0 + k % 8, y0 + k / 8), own, size));
                transform(&mut block, &basis);
                let levels: Vec<i32> = zigzag
                    .iter()
                    .map(|&k| (block[k] / steps[n.min(1)][k] as f32).round() as i32)
                    .collect();
                bits.number(0, levels[0] - before[n], DC_LENGTH);
                before[n] = levels[0];
                let mut zeros = 0;
                for &value in &levels[1..] {
                    if value == 0 {
                        zeros += 1;
                        continue;
                    }
                    while zeros > 15 {
                        bits.code(0xf0, AC_LENGTH);
                        zeros -= 16;
                    }
                    bits.number(zeros, value, AC_LENGTH);
                    zeros = 0;
                }
                if zeros > 0 {
                    bits.code(0, AC_LENGTH);
                }
            }
        }
    }
    bits.put(0x7f, 7);
    file.extend(bits.bytes);
    file.extend([0xff, 0xd9]);
    file
}

/// Sample of component `n` at (x, y): the mean of its pixels, edge pixels repeated.
fn sample<S>(
    codes: &Frame<S, u8>,
    n: usize,
    (x, y): (usize, usize),
    (across, down): (usize, usize),
    size: Size,
) -> f32 {
    // ITU-T T.871, clause 7, less the level shift of T.81, A.3.1.
    let weights =
        [[0.299, 0.587, 0.114], [-0.168_736, -0.331_264, 0.5], [0.5, -0.418_688, -0.081_312]][n];
    let mut sum = if n == 0 { -128.0 } else { 0.0 };
    for pixel in 0..across * down {
        let x = (x * across + pixel % across).min(size.width - 1);
        let y = (y * down + pixel / across).min(size.height - 1);
        for (plane, weight) in codes.planes().iter().zip(weights) {
            sum += weight * f32::from(plane.at(x, y)) / (across * down) as f32;
        }
    }
    sum
}
