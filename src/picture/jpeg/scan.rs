//! Decoding of one scan's blocks into their coefficients.

use super::huffman::{Bits, HuffmanCodes};
use crate::frame::BLOCK_AREA;

/// The places of a block's coefficients, row by row, in scan order (T.81, figure A.6).
#[rustfmt::skip]
pub(super) const ZIGZAG: [u8; BLOCK_AREA] = [
     0,  1,  8, 16,  9,  2,  3, 10, 17, 24, 32, 25, 18, 11,  4,  5,
    12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13,  6,  7, 14, 21, 28,
    35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51,
    58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// A scan's header (T.81, B.2.3).
#[derive(Clone, Copy)]
pub(super) struct Scan {
    pub(super) progressive: bool,
    /// First and last coefficient.
    pub(super) band: (usize, usize),
    /// Lowest bit of the previous pass, the one above the refined bit; 0 in a first pass.
    pub(super) high: u32,
    /// The lowest bit coded.
    pub(super) low: u32,
}

/// A component of a scan, with its tables.
pub(super) struct ScanPart {
    /// Index of the component in the frame header.
    pub(super) component: usize,
    pub(super) dc: Option<HuffmanCodes>,
    pub(super) ac: Option<HuffmanCodes>,
}

/// The blocks of a scan.
pub(super) struct ScanBlocks<'a> {
    scan: Scan,
    bits: Bits<'a>,
    /// First coefficient (DC) of the last block of each component.
    dc: [i32; 4],
    /// Blocks still to come in a run without new coefficients (end-of-band run).
    blank: u32,
}

impl<'a> ScanBlocks<'a> {
    /// The blocks of `scan`, whose data begin at `at`.
    pub(super) fn new(scan: Scan, bytes: &'a [u8], at: usize) -> Self {
        ScanBlocks { scan, bits: Bits::new(bytes, at), dc: [0; 4], blank: 0 }
    }

    /// Position of the byte after the one that held the last bit.
    pub(super) fn end(&self) -> usize {
        self.bits.end()
    }

    /// Moves past the restart marker that must be next; `None` if there is none.
    pub(super) fn restart(&mut self) -> Option<()> {
        (self.dc, self.blank) = ([0; 4], 0);
        self.bits.restart()
    }

    /// Decodes the next block of the component `part`.
    pub(super) fn read(&mut self, part: &ScanPart, block: &mut [i16]) -> Option<()> {
        let Scan { progressive, band, high, low } = self.scan;
        if !progressive {
            self.dc_first(part, block)?;
            // A sequential scan's coefficients are one band without runs of blocks (T.81, F.2.2.2).
            self.ac_first((1, BLOCK_AREA - 1), part.ac.as_ref()?, block)?;
            self.blank = 0;
            return Some(());
        }
        match (band.0, high) {
            (0, 0) => self.dc_first(part, block),
            (0, _) => {
                block[0] |= (self.bits.bit()? << low) as i16;
                Some(())
            }
            (_, 0) => self.ac_first(band, part.ac.as_ref()?, block),
            _ => self.ac_refine(part.ac.as_ref()?, block),
        }
    }

    fn dc_first(&mut self, part: &ScanPart, block: &mut [i16]) -> Option<()> {
        let size = u32::from(part.dc.as_ref()?.next(&mut self.bits)?);
        if size > 15 {
            return None;
        }
        let before = &mut self.dc[part.component];
        *before += self.bits.extended(size)?;
        block[0] = shifted(*before, self.scan.low)?;
        Some(())
    }

    /// First pass over a band (T.81, G.1.2.2).
    fn ac_first(
        &mut self,
        (first, last): (usize, usize),
        codes: &HuffmanCodes,
        block: &mut [i16],
    ) -> Option<()> {
        if self.blank > 0 {
            self.blank -= 1;
            return Some(());
        }
        let mut k = first;
        while k <= last {
            let (zeros, size) = halves(codes.next(&mut self.bits)?);
            if size > 0 {
                k += zeros;
                let value = shifted(self.bits.extended(size)?, self.scan.low)?;
                *block.get_mut(place(k, last)?)? = value;
            } else if zeros < 15 {
                self.blank = (1 << zeros) - 1 + self.bits.bits(zeros as u32)? as u32;
                break;
            } else {
                k += 15;
            }
            k += 1;
        }
        Some(())
    }

    /// A pass that refines a band by one bit (T.81, G.1.2.3).
    fn ac_refine(&mut self, codes: &HuffmanCodes, block: &mut [i16]) -> Option<()> {
        let Scan { band: (mut k, last), low, .. } = self.scan;
        let one = 1i16.checked_shl(low).filter(|one| *one > 0)?;
        while self.blank == 0 && k <= last {
            let (mut zeros, size) = halves(codes.next(&mut self.bits)?);
            let mut fresh = 0;
            match (size, zeros) {
                (0, 15) => {}
                (0, _) => {
                    self.blank = (1 << zeros) + self.bits.bits(zeros as u32)? as u32;
                    break;
                }
                (1, _) => fresh = if self.bits.bit()? == 1 { one } else { -one },
                _ => return None,
            }
            while k <= last {
                let value = block.get_mut(place(k, last)?)?;
                k += 1;
                if *value != 0 {
                    refine(value, one, &mut self.bits)?;
                } else if zeros == 0 {
                    *value = fresh;
                    break;
                } else {
                    zeros -= 1;
                }
            }
        }
        if self.blank > 0 {
            for k in k..=last {
                let value = block.get_mut(place(k, last)?)?;
                if *value != 0 {
                    refine(value, one, &mut self.bits)?;
                }
            }
            self.blank -= 1;
        }
        Some(())
    }
}

/// Length of a run of zeros, and size in bits of the number after it.
fn halves(value: u8) -> (usize, u32) {
    (usize::from(value >> 4), u32::from(value & 15))
}

fn place(k: usize, last: usize) -> Option<usize> {
    if k <= last { ZIGZAG.get(k).map(|&place| usize::from(place)) } else { None }
}

fn shifted(value: i32, low: u32) -> Option<i16> {
    i16::try_from(value.checked_shl(low)?).ok()
}

/// Adds the next bit, worth `one`, to a nonzero coefficient.
fn refine(value: &mut i16, one: i16, bits: &mut Bits<'_>) -> Option<()> {
    if bits.bit()? == 1 && *value & one == 0 {
        *value = value.checked_add(if *value > 0 { one } else { -one })?;
    }
    Some(())
}
