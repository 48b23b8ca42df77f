//! Coding of samples, one per pixel.

/// Coding of a sample in memory; packed ones have 10 or 12 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // Fields are described with their variants.
pub enum Samples {
    /// One byte per sample.
    Bytes,
    /// A little-endian 16-bit word of 10, 12 or 16 significant bits, above `shift` unused ones.
    Words { bits: u8, shift: u8 },
    /// Packing of MIPI CSI-2 (V4L2's `…P` formats) of four samples of 10 bits or two of 12: a byte
    /// with the upper eight bits of each, then a byte with the lower bits of all, the first
    /// sample's lowest.
    Packed { bits: u8 },
    /// Packing of USB3 Vision (`…p` in the Pixel Format Naming Convention 2.4): a stream of bits
    /// that begins with the lowest bit of the first sample.
    Stream { bits: u8 },
    /// Packing of GigE Vision (`…Packed`) of two samples in three bytes: the upper eight bits of
    /// the first, the lower bits of both (the first in the lower half), the upper eight bits of the
    /// second.
    Pair { bits: u8 },
}

impl Samples {
    /// Coding for the `ending` of a name in the Pixel Format Naming Convention, such as `12p`.
    pub(super) fn from_pfnc(ending: &str) -> Option<Samples> {
        Some(match ending {
            "8" => Samples::Bytes,
            "10" => Samples::Words { bits: 10, shift: 0 },
            "12" => Samples::Words { bits: 12, shift: 0 },
            "16" => Samples::Words { bits: 16, shift: 0 },
            "10p" => Samples::Stream { bits: 10 },
            "12p" => Samples::Stream { bits: 12 },
            "10Packed" => Samples::Pair { bits: 10 },
            "12Packed" => Samples::Pair { bits: 12 },
            _ => return None,
        })
    }

    /// Bits of a count.
    pub fn bits(self) -> u8 {
        match self {
            Samples::Bytes => 8,
            Samples::Words { bits, .. }
            | Samples::Packed { bits }
            | Samples::Stream { bits }
            | Samples::Pair { bits } => bits,
        }
    }

    pub(super) fn has_whole_rows(self, width: usize) -> bool {
        width.is_multiple_of(self.group().0)
    }

    /// Narrows 16-bit words to their upper `bits`; other codings are unchanged.
    pub(super) fn in_upper(self, bits: u8) -> Samples {
        match self {
            Samples::Words { bits: 16, .. } if (9..16).contains(&bits) => {
                Samples::Words { bits, shift: 16 - bits }
            }
            other => other,
        }
    }

    /// Widens narrowed words to all of their bits; undoes [`Samples::in_upper`].
    pub(super) fn whole(self) -> Samples {
        match self {
            Samples::Words { bits, shift } => Samples::Words { bits: bits + shift, shift: 0 },
            other => other,
        }
    }

    /// Samples and bytes per packing group.
    fn group(self) -> (usize, usize) {
        match self {
            Samples::Bytes => (1, 1),
            Samples::Words { .. } => (1, 2),
            Samples::Packed { bits: 10 } | Samples::Stream { bits: 10 } => (4, 5),
            Samples::Packed { .. } | Samples::Stream { .. } | Samples::Pair { .. } => (2, 3),
        }
    }

    /// Bytes of `width` samples, rounded up to whole groups.
    pub(super) fn row_bytes(self, width: usize) -> usize {
        let (samples, bytes) = self.group();
        width.div_ceil(samples) * bytes
    }

    /// Reads the counts of a `row`; unused upper bits are ignored.
    pub(super) fn read(self, row: &[u8], counts: &mut [u16]) {
        let (group, bytes) = self.group();
        match self {
            Samples::Bytes => {
                counts.iter_mut().zip(row).for_each(|(count, &byte)| *count = byte.into());
            }
            Samples::Words { bits, shift } => {
                let mask = ((1u32 << bits) - 1) as u16;
                for (count, word) in counts.iter_mut().zip(row.chunks_exact(bytes)) {
                    *count = (u16::from_le_bytes([word[0], word[1]]) >> shift) & mask;
                }
            }
            Samples::Stream { bits } => {
                let mask = (1u64 << bits) - 1;
                for (counts, packed) in counts.chunks_mut(group).zip(row.chunks_exact(bytes)) {
                    let all = packed.iter().rev().fold(0, |all, &byte| all << 8 | u64::from(byte));
                    for (n, count) in counts.iter_mut().enumerate() {
                        *count = (all >> (n * usize::from(bits)) & mask) as u16;
                    }
                }
            }
            Samples::Pair { bits } => {
                let (low_bits, mask) = (bits - 8, (1u16 << (bits - 8)) - 1);
                for (counts, packed) in counts.chunks_mut(group).zip(row.chunks_exact(bytes)) {
                    for (n, count) in counts.iter_mut().enumerate() {
                        let low = u16::from(packed[1]) >> (4 * n) & mask;
                        *count = u16::from(packed[2 * n]) << low_bits | low;
                    }
                }
            }
            Samples::Packed { bits } => {
                let low_bits = usize::from(bits - 8);
                let mask = (1u16 << low_bits) - 1;
                for (counts, packed) in counts.chunks_mut(group).zip(row.chunks_exact(bytes)) {
                    let low = u16::from(packed[group]);
                    for (n, (count, &high)) in counts.iter_mut().zip(packed).enumerate() {
                        *count = u16::from(high) << low_bits | (low >> (n * low_bits)) & mask;
                    }
                }
            }
        }
    }
}
