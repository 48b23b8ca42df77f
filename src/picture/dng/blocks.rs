//! The strips or tiles of a raw photo's counts, of 8 to 16 bits a site.

use super::super::Flaw;
use super::super::tiff::{
    Directory, File, ROWS_PER_STRIP, STRIP_BYTE_COUNTS, STRIP_OFFSETS, TILE_BYTE_COUNTS,
    TILE_OFFSETS,
};
use crate::frame::{Rect, Size};

const TILE_WIDTH: u16 = 322;
const TILE_LENGTH: u16 = 323;

/// Bits a site may have.
pub(super) const BITS: [usize; 5] = [8, 10, 12, 14, 16];

/// Most sites by which a tile may exceed the picture. Guess: most tiles are of 256 or 512 sites.
const TILE_MORE: usize = 1024;
/// Most padding bytes of a strip or tile. Guess: up to the next multiple of 16.
const FILLED_MAX: usize = 15;

#[derive(Debug, Clone, Copy)]
struct SiteBlock {
    /// Place of its bytes in the file.
    from: usize,
    /// Column and row of its first site.
    x: usize,
    y: usize,
    /// Its columns and rows inside the picture.
    size: Size,
}

/// The counts of a raw photo, not yet read.
#[derive(Debug)]
pub(super) struct SiteBlocks {
    bits: usize,
    /// Bytes of a block's row; each row begins at a whole byte.
    row_bytes: usize,
    /// Together they hold each site once.
    blocks: Vec<SiteBlock>,
    /// Columns and rows of the whole picture.
    pub(super) size: Size,
}

impl SiteBlocks {
    /// The blocks in `directory` of a picture of `size`, with `bits` a site.
    pub(super) fn of(
        directory: &Directory<'_>,
        size: Size,
        bits: usize,
    ) -> Result<SiteBlocks, Flaw> {
        let file = directory.file;
        let of = |tag| directory.numbers(tag).map(Option::unwrap_or_default);
        let in_tiles = directory.find(TILE_OFFSETS).is_some();
        let (kind, block) = if in_tiles {
            let side = |tag| directory.number(tag).map(Option::unwrap_or_default);
            ("tiles", Size::new(side(TILE_WIDTH)?, side(TILE_LENGTH)?))
        } else {
            let rows = directory.number(ROWS_PER_STRIP)?.unwrap_or(size.height);
            ("strips", Size::new(size.width, rows.min(size.height)))
        };
        let (offsets, counts) = match in_tiles {
            true => (of(TILE_OFFSETS)?, of(TILE_BYTE_COUNTS)?),
            false => (of(STRIP_OFFSETS)?, of(STRIP_BYTE_COUNTS)?),
        };
        let misfit = || {
            let found = format!("{} {kind} of {block} for {size}", counts.len());
            file.damaged(&found, &format!("{kind} that hold each site once"))
        };
        let (most_width, most_height) = (size.width + TILE_MORE, size.height + TILE_MORE);
        let fits =
            (1..=most_width).contains(&block.width) && (1..=most_height).contains(&block.height);
        if !fits || offsets.len() != counts.len() {
            return Err(misfit());
        }
        let (across, down) = (size.width.div_ceil(block.width), size.height.div_ceil(block.height));
        if across.checked_mul(down) != Some(counts.len()) {
            return Err(misfit());
        }
        let row_bytes = (block.width * bits).div_ceil(8);
        let place = |n: usize| {
            let (x, y) = ((n % across) * block.width, (n / across) * block.height);
            let inside =
                Size::new(block.width.min(size.width - x), block.height.min(size.height - y));
            SiteBlock { from: offsets[n], x, y, size: inside }
        };
        let blocks: Vec<SiteBlock> = (0..counts.len()).map(place).collect();
        let rows = |of: &SiteBlock| if in_tiles { block.height } else { of.size.height };
        // Some programs write the byte count of a smaller depth; it is accepted, as it is not used.
        let whole = |(of, &count): (&SiteBlock, &usize)| {
            let most = |bits: usize| rows(of) * (block.width * bits).div_ceil(8) + FILLED_MAX;
            let least = |bits: usize| rows(of) * block.width * bits / 8;
            BITS.into_iter().any(|b| b <= bits && (least(b)..=most(b)).contains(&count))
        };
        if !blocks.iter().zip(&counts).all(whole) {
            return Err(misfit());
        }
        // A tile's padding rows below the picture are not needed.
        let lengths: Vec<usize> = blocks.iter().map(|of| of.size.height * row_bytes).collect();
        file.strips(&offsets, &lengths, true)?;
        Ok(SiteBlocks { bits, row_bytes, blocks, size })
    }

    /// The counts in `part` of the picture, row by row, in the `bytes` of its file.
    pub(super) fn counts(&self, bytes: &[u8], part: Rect) -> Vec<u16> {
        let big_endian = File::new(bytes).big_endian;
        let mut all = vec![0u16; self.size.area()];
        for block in &self.blocks {
            for row in 0..block.size.height {
                let from = block.from + row * self.row_bytes;
                let Some(packed) = bytes.get(from..from + self.row_bytes) else { continue };
                let to = (block.y + row) * self.size.width + block.x;
                self.unpack(packed, big_endian, &mut all[to..to + block.size.width]);
            }
        }
        let rows = (part.y..part.y + part.size.height).map(|y| y * self.size.width + part.x);
        rows.flat_map(|from| &all[from..from + part.size.width]).copied().collect()
    }

    /// Unpacks a row's counts. Those of 8 or 16 bits are in the file's byte order; others are
    /// packed bit by bit, the most significant bit first, whatever the byte order (TIFF 6.0,
    /// FillOrder 1).
    fn unpack(&self, packed: &[u8], big_endian: bool, row: &mut [u16]) {
        match self.bits {
            8 => row.iter_mut().zip(packed).for_each(|(to, &b)| *to = u16::from(b)),
            16 => row.iter_mut().zip(packed.chunks_exact(2)).for_each(|(to, b)| {
                let b = [b[0], b[1]];
                *to = if big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) };
            }),
            bits => {
                let (mut held, mut count, mut bytes) = (0u32, 0, packed.iter());
                for to in row {
                    while count < bits {
                        held = held << 8 | u32::from(bytes.next().copied().unwrap_or(0));
                        count += 8;
                    }
                    count -= bits;
                    *to = (held >> count) as u16 & (u16::MAX >> (16 - bits));
                }
            }
        }
    }
}
