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
pub(super) struct Scan {
    pub(super) progressive: bool,
    /// First and last coefficient.
    pub(super) band: (usize, usize),
    /// The bit above the refined one; 0 in a first pass.
    pub(super) high: u32,
    /// The lowest bit coded.
    pub(super) low: u32,
}

/// The tables of one component of a scan.
pub(super) struct Tables<'a> {
    pub(super) dc: Option<&'a HuffmanCodes>,
    pub(super) ac: Option<&'a HuffmanCodes>,
}

/// State from block to block, reset by a restart.
#[derive(Default)]
pub(super) struct Running {
    /// The last block's first coefficient, for each component.
    pub(super) dc: [i32; 4],
    /// Empty blocks to come.
    pub(super) blank: u32,
}

impl Scan {
    /// Decodes the next block, of component `n` of the scan.
    pub(super) fn block(
        &self,
        bits: &mut Bits<'_>,
        tables: &Tables<'_>,
        (running, n): (&mut Running, usize),
        block: &mut [i16],
    ) -> Option<()> {
        if !self.progressive {
            self.dc_first(bits, tables, &mut running.dc[n], block)?;
            // A sequential scan's coefficients are one band without runs of blocks (T.81, F.2.2.2).
            let all = Scan { band: (1, BLOCK_AREA - 1), ..*self };
            return all.ac_first(bits, tables.ac?, &mut 0, block);
        }
        match (self.band.0, self.high) {
            (0, 0) => self.dc_first(bits, tables, &mut running.dc[n], block),
            (0, _) => {
                block[0] |= (bits.bit()? << self.low) as i16;
                Some(())
            }
            (_, 0) => self.ac_first(bits, tables.ac?, &mut running.blank, block),
            _ => self.ac_refine(bits, tables.ac?, &mut running.blank, block),
        }
    }

    fn dc_first(
        &self,
        bits: &mut Bits<'_>,
        tables: &Tables<'_>,
        before: &mut i32,
        block: &mut [i16],
    ) -> Option<()> {
        let size = u32::from(tables.dc?.next(bits)?);
        if size > 15 {
            return None;
        }
        *before += bits.extended(size)?;
        block[0] = shifted(*before, self.low)?;
        Some(())
    }

    /// First pass over a band (T.81, G.1.2.2).
    fn ac_first(
        &self,
        bits: &mut Bits<'_>,
        codes: &HuffmanCodes,
        blank: &mut u32,
        block: &mut [i16],
    ) -> Option<()> {
        if *blank > 0 {
            *blank -= 1;
            return Some(());
        }
        let mut k = self.band.0;
        while k <= self.band.1 {
            let (zeros, size) = halves(codes.next(bits)?);
            if size > 0 {
                k += zeros;
                let value = shifted(bits.extended(size)?, self.low)?;
                *block.get_mut(place(k, self.band.1)?)? = value;
            } else if zeros < 15 {
                *blank = (1 << zeros) - 1 + bits.bits(zeros as u32)? as u32;
                break;
            } else {
                k += 15;
            }
            k += 1;
        }
        Some(())
    }

    /// A pass that refines a band by one bit (T.81, G.1.2.3).
    fn ac_refine(
        &self,
        bits: &mut Bits<'_>,
        codes: &HuffmanCodes,
        blank: &mut u32,
        block: &mut [i16],
    ) -> Option<()> {
        let one = 1i16.checked_shl(self.low).filter(|one| *one > 0)?;
        let mut k = self.band.0;
        while *blank == 0 && k <= self.band.1 {
            let (mut zeros, size) = halves(codes.next(bits)?);
            let mut fresh = 0;
            match (size, zeros) {
                (0, 15) => {}
                (0, _) => {
                    *blank = (1 << zeros) + bits.bits(zeros as u32)? as u32;
                    break;
                }
                (1, _) => fresh = if bits.bit()? == 1 { one } else { -one },
                _ => return None,
            }
            while k <= self.band.1 {
                let value = block.get_mut(place(k, self.band.1)?)?;
                k += 1;
                if *value != 0 {
                    refine(value, one, bits)?;
                } else if zeros == 0 {
                    *value = fresh;
                    break;
                } else {
                    zeros -= 1;
                }
            }
        }
        if *blank > 0 {
            for k in k..=self.band.1 {
                let value = block.get_mut(place(k, self.band.1)?)?;
                if *value != 0 {
                    refine(value, one, bits)?;
                }
            }
            *blank -= 1;
        }
        Some(())
    }
}

/// A run of zeros and the size of the number after it.
fn halves(value: u8) -> (usize, u32) {
    (usize::from(value >> 4), u32::from(value & 15))
}

fn place(k: usize, last: usize) -> Option<usize> {
    if k <= last { ZIGZAG.get(k).map(|&place| usize::from(place)) } else { None }
}

fn shifted(value: i32, low: u32) -> Option<i16> {
    i16::try_from(value.checked_shl(low)?).ok()
}

/// Adds a bit to a nonzero coefficient.
fn refine(value: &mut i16, one: i16, bits: &mut Bits<'_>) -> Option<()> {
    if bits.bit()? == 1 && *value & one == 0 {
        *value = value.checked_add(if *value > 0 { one } else { -one })?;
    }
    Some(())
}
