//! To what steps a lossy WebP rounds the coefficients of a photo: its file states them (RFC 9649;
//! RFC 6386, 9 and 19.2).
//!
//! From the pixels nothing of it can be told: the blocks' borders were smoothed.

/// The step of a coefficient, by the number that the file states (RFC 6386, 14.1, `ac_qlookup`).
#[rustfmt::skip]
const STEPS: [u16; 128] = [
    4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19,
    20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35,
    36, 37, 38, 39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51,
    52, 53, 54, 55, 56, 57, 58, 60, 62, 64, 66, 68, 70, 72, 74, 76,
    78, 80, 82, 84, 86, 88, 90, 92, 94, 96, 98, 100, 102, 104, 106, 108,
    110, 112, 114, 116, 119, 122, 125, 128, 131, 134, 137, 140, 143, 146, 149, 152,
    155, 158, 161, 164, 167, 170, 173, 177, 181, 185, 189, 193, 197, 201, 205, 209,
    213, 217, 221, 225, 229, 234, 239, 245, 249, 254, 259, 264, 269, 274, 279, 284,
];

/// Of a chunk, its name and length; of the picture's, its tag, start code and size.
const CHUNK_HEAD: usize = 8;
const PICTURE_HEAD: usize = 10;

/// A coefficient of theirs is twice an orthonormal transform's (RFC 6386, 14.3: the first of an
/// even block is eight times its samples, of which there are sixteen).
const OF_ORTHONORMAL: f32 = 2.0;

/// The step to which a lossy WebP in `bytes` rounds the coefficients of an orthonormal cosine
/// transform of its brightness, codes of 8 bits; `None` of any other.
pub(super) fn step(bytes: &[u8]) -> Option<f32> {
    let mut chunks = bytes.get(12..)?;
    let picture = loop {
        let (head, rest) = chunks.split_at_checked(CHUNK_HEAD)?;
        if head.starts_with(b"VP8 ") {
            break rest;
        }
        let length = u32::from_le_bytes(head[4..].try_into().ok()?) as usize;
        chunks = rest.get(length.checked_next_multiple_of(2)?..)?;
    };
    let step = STEPS[number_of_step(&mut EvenBits::new(picture.get(PICTURE_HEAD..)?))? as usize];
    Some(f32::from(step) / OF_ORTHONORMAL)
}

/// The number of the step, which the picture's header holds after what it says of colours, parts of
/// the picture and filters.
fn number_of_step(bits: &mut EvenBits<'_>) -> Option<u32> {
    bits.number(2)?;
    if bits.bit()? {
        let (of_blocks, of_parts) = (bits.bit()?, bits.bit()?);
        if of_parts {
            bits.bit()?;
            [7, 7, 7, 7, 6, 6, 6, 6].into_iter().try_for_each(|width| bits.pass(width + 1))?;
        }
        if of_blocks {
            [8; 3].into_iter().try_for_each(|width| bits.pass(width))?;
        }
    }
    bits.number(10)?;
    if bits.bit()? && bits.bit()? {
        [7; 8].into_iter().try_for_each(|width| bits.pass(width))?;
    }
    bits.number(2)?;
    bits.number(7)
}

/// Bits of even chance in the arithmetic code of RFC 6386, 7.
struct EvenBits<'a> {
    bytes: std::slice::Iter<'a, u8>,
    value: u32,
    range: u32,
    /// Bits of `value` that were shifted out since the last byte came in.
    shifted: u32,
}

impl EvenBits<'_> {
    fn new(bytes: &[u8]) -> EvenBits<'_> {
        let mut bytes = bytes.iter();
        let mut next = || bytes.next().map_or(0, |&byte| u32::from(byte));
        let value = (next() << 8) | next();
        EvenBits { bytes, value, range: 255, shifted: 0 }
    }

    fn bit(&mut self) -> Option<bool> {
        let split = 1 + ((self.range - 1) >> 1);
        let is_set = self.value >= split << 8;
        if is_set {
            self.range -= split;
            self.value -= split << 8;
        } else {
            self.range = split;
        }
        while self.range < 128 {
            self.value <<= 1;
            self.range <<= 1;
            self.shifted += 1;
            if self.shifted == 8 {
                self.shifted = 0;
                self.value |= u32::from(*self.bytes.next()?);
            }
        }
        Some(is_set)
    }

    fn number(&mut self, width: u32) -> Option<u32> {
        (0..width).try_fold(0, |number, _| Some(2 * number + u32::from(self.bit()?)))
    }

    /// Passes over a number of `width` bits that a bit says is there.
    fn pass(&mut self, width: u32) -> Option<()> {
        if self.bit()? { self.number(width).map(|_| ()) } else { Some(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[rustfmt::skip]
    const ONE_STEP: [u8; 60] = [
        82, 73, 70, 70, 52, 0, 0, 0, 87, 69, 66, 80, 86, 80, 56, 32, 40, 0, 0, 0, 176, 1, 0,
        157, 1, 42, 16, 0, 16, 0, 0, 128, 8, 37, 148, 2, 116, 186, 0, 6, 61, 128, 0, 254,
        241, 149, 143, 226, 218, 71, 66, 167, 87, 90, 22, 131, 224, 0, 0, 0,
    ];
    #[rustfmt::skip]
    const SEVERAL_STEPS: [u8; 72] = [
        82, 73, 70, 70, 64, 0, 0, 0, 87, 69, 66, 80, 86, 80, 56, 32, 52, 0, 0, 0, 16, 3, 0,
        157, 1, 42, 32, 0, 32, 0, 63, 29, 116, 175, 83, 173, 39, 36, 34, 183, 232, 1, 160,
        35, 137, 103, 0, 190, 72, 65, 36, 150, 0, 0, 254, 193, 16, 125, 254, 38, 84, 165,
        124, 250, 157, 29, 48, 244, 144, 214, 128, 0,
    ];

    #[test]
    fn the_step_a_lossy_webp_states_is_read_and_anything_else_has_none() {
        // Written by libwebp, of quality 95 and 20; the second has several, its largest first.
        let by_step = |number: usize| Some(f32::from(STEPS[number]) / 2.0);
        assert_eq!(step(&ONE_STEP), by_step(4));
        assert_eq!(step(&SEVERAL_STEPS), by_step(71));
        let mut lossless = Vec::new();
        let encoder = image::codecs::webp::WebPEncoder::new_lossless(&mut lossless);
        encoder.encode(&[9; 48], 4, 4, image::ColorType::Rgb8.into()).unwrap();
        assert_eq!(step(&lossless), None);
        for cut in 0..SEVERAL_STEPS.len() {
            let _ = step(&SEVERAL_STEPS[..cut]);
        }
        assert_eq!(step(&[]), None);
    }
}
