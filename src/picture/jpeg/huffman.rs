//! The bits of a JPEG's entropy-coded data, and its Huffman codes.

/// The bits of a scan, without stuffed zeros.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    held: u32,
    count: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Bits { bytes, at, held: 0, count: 0 }
    }

    /// Position of the byte after the one that held the last bit.
    pub(super) fn end(&self) -> usize {
        self.at
    }

    /// The next bit; `None` at a marker or the end.
    pub(super) fn bit(&mut self) -> Option<u32> {
        if self.count == 0 {
            let byte = *self.bytes.get(self.at)?;
            self.at += 1;
            if byte == 0xff {
                if self.bytes.get(self.at) != Some(&0) {
                    self.at -= 1;
                    return None;
                }
                self.at += 1;
            }
            (self.held, self.count) = (u32::from(byte), 8);
        }
        self.count -= 1;
        Some(self.held >> self.count & 1)
    }

    /// The next `count` bits, at most 16, as a number.
    pub(super) fn bits(&mut self, count: u32) -> Option<i32> {
        (0..count).try_fold(0, |value, _| Some(value << 1 | self.bit()? as i32))
    }

    /// The next `size` bits as a number, extended to its sign (T.81, F.2.2.1).
    pub(super) fn extended(&mut self, size: u32) -> Option<i32> {
        let value = self.bits(size)?;
        let negative = size > 0 && value < 1 << (size - 1);
        Some(if negative { value - (1 << size) + 1 } else { value })
    }

    /// Moves past the restart marker that must be next; `None` if there is none.
    pub(super) fn restart(&mut self) -> Option<()> {
        self.count = 0;
        let marker = self.bytes.get(self.at..self.at + 2)?;
        if marker[0] != 0xff || !(0xd0..=0xd7).contains(&marker[1]) {
            return None;
        }
        self.at += 2;
        Some(())
    }
}

/// One table of codes (T.81, annex C).
#[derive(Clone)]
pub(super) struct HuffmanCodes {
    values: Vec<u8>,
    /// For each length, 1 to 16: the first code past those of this length, and the offset from a
    /// code to the place of its value.
    ends: [(i32, i32); 16],
}

impl HuffmanCodes {
    /// The table of a DHT segment, in which the `counts` of codes by length precede their `values`.
    pub(super) fn new(counts: &[u8; 16], values: &[u8]) -> HuffmanCodes {
        let (mut code, mut before) = (0, 0);
        let ends = counts.map(|count| {
            let place = before - code;
            before += i32::from(count);
            let end = code + i32::from(count);
            code = end << 1;
            (end, place)
        });
        HuffmanCodes { values: values.to_vec(), ends }
    }

    /// The value of the next code (T.81, F.2.2.3).
    pub(super) fn next(&self, bits: &mut Bits<'_>) -> Option<u8> {
        let mut code = 0;
        for (end, place) in self.ends {
            code = code << 1 | bits.bit()? as i32;
            if code < end {
                return self.values.get(usize::try_from(code + place).ok()?).copied();
            }
        }
        None
    }
}
