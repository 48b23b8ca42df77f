//! What a JPEG states of a picture: each block's coefficients, to half a step.

use serde::{Deserialize, Serialize};

use super::Size;

/// Side of a block, samples (ITU-T T.81, A.3).
pub const BLOCK_PX: usize = 8;
/// Coefficients of a block.
pub const BLOCK_AREA: usize = BLOCK_PX * BLOCK_PX;

/// A picture as a JPEG states it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coding {
    /// Width and height of the picture, pixels.
    pub size: Size,
    /// Brightness alone, or brightness Y', blueness Cb and redness Cr (ITU-T T.871).
    pub components: Vec<CodedComponent>,
}

/// One component of a JPEG.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CodedComponent {
    /// Pixels across and down that one sample stands for, 1 or 2.
    pub pixels: (u8, u8),
    /// Columns and rows of blocks, those that fill up the last unit included.
    pub blocks: Size,
    /// The steps q of the 64 coefficients, row by row.
    pub steps: Vec<u16>,
    /// The coefficients in steps, block by block, row by row.
    #[serde(skip)]
    pub coefficients: Vec<i16>,
}

impl Coding {
    /// Blocks, as components are laid out for a picture of `size` in which one unit is
    /// `densest` blocks of the first component across and down.
    pub fn blocks(size: Size, densest: (u8, u8), pixels: (u8, u8)) -> Size {
        let of = |side: usize, densest: u8, pixels: u8| {
            let (densest, pixels) = (usize::from(densest), usize::from(pixels).max(1));
            side.div_ceil(BLOCK_PX * densest.max(1)) * (densest / pixels).max(1)
        };
        let (across, down) = (of(size.width, densest.0, pixels.0), densest.1);
        Size::new(across, of(size.height, down, pixels.1))
    }

    /// Its brightness alone.
    #[must_use]
    pub fn brightness(&self) -> Coding {
        let of = |first: &CodedComponent| {
            let blocks = Coding::blocks(self.size, (1, 1), (1, 1));
            let rows = first.coefficients.chunks(first.blocks.width * BLOCK_AREA);
            let kept = rows.take(blocks.height).flat_map(|row| &row[..blocks.width * BLOCK_AREA]);
            let coefficients = kept.copied().collect();
            CodedComponent { blocks, coefficients, ..first.clone() }
        };
        Coding { size: self.size, components: self.components.iter().take(1).map(of).collect() }
    }

    /// Pixels across and down that one sample of the coarsest component stands for.
    pub fn densest(&self) -> (u8, u8) {
        let of = |side: fn(&CodedComponent) -> u8| self.components.iter().map(side).max();
        (of(|c| c.pixels.0).unwrap_or(1), of(|c| c.pixels.1).unwrap_or(1))
    }

    /// Whether it is laid out as the readers of it take for granted: one component, or three of
    /// which the first has a sample for each pixel.
    pub fn is_whole(&self) -> bool {
        let densest = self.densest();
        let sound = |component: &CodedComponent| {
            let (across, down) = component.pixels;
            (1..=2).contains(&across)
                && (1..=2).contains(&down)
                && component.blocks == Coding::blocks(self.size, densest, component.pixels)
                && component.steps.len() == BLOCK_AREA
                && component.steps.iter().all(|&step| step > 0)
                && component.coefficients.len() == component.blocks.area() * BLOCK_AREA
        };
        let first = self.components.first().is_some_and(|first| first.pixels == (1, 1));
        let alike = || self.components[1].pixels == self.components[2].pixels;
        first
            && match self.components.len() {
                1 => true,
                3 => alike(),
                _ => false,
            }
            && self.components.iter().all(sound)
    }
}
