//! A JPEG's data: the quantised coefficients of each block.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Size;

/// Side of a block, samples (ITU-T T.81, A.3).
pub const BLOCK_PX: usize = 8;
/// Coefficients of a block.
pub const BLOCK_AREA: usize = BLOCK_PX * BLOCK_PX;

/// R, G, B to Y', Cb, Cr (ITU-T T.871, clause 7).
pub const TO_YCC: [[f32; 3]; 3] =
    [[0.299, 0.587, 0.114], [-0.168_736, -0.331_264, 0.5], [0.5, -0.418_688, -0.081_312]];

/// T.81's tables K.1 and K.2, row by row: steps at libjpeg's quality 50.
#[rustfmt::skip]
const USUAL_STEPS: [[u16; BLOCK_AREA]; 2] = [
    [
        16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55,
        14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51, 87, 80, 62,
        18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92,
        49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99,
    ],
    [
        17, 18, 24, 47, 99, 99, 99, 99, 18, 21, 26, 66, 99, 99, 99, 99,
        24, 26, 56, 99, 99, 99, 99, 99, 47, 66, 99, 99, 99, 99, 99, 99,
        99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99,
        99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99,
    ],
];

/// Step `k`, row by row, of the usual table of luma (`component` 0) or chroma (1, 2) at libjpeg's
/// `quality` of 1 to 100.
pub fn usual_step(component: usize, k: usize, quality: u16) -> u16 {
    let percent = if quality < 50 { 5000 / quality.max(1) } else { 200 - 2 * quality.min(100) };
    let step = u32::from(USUAL_STEPS[component.min(1)][k]);
    ((step * u32::from(percent) + 50) / 100).clamp(1, 255) as u16
}

/// A picture as quantised JPEG coefficients.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coding {
    /// Width and height of the picture, pixels.
    pub size: Size,
    /// Luma Y' alone, or Y', Cb and Cr (ITU-T T.871).
    pub components: Vec<CodedComponent>,
}

/// One component of a JPEG.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CodedComponent {
    /// Pixels per sample across and down, 1 or 2.
    pub pixels: (u8, u8),
    /// Columns and rows of blocks, including padding to whole units.
    pub blocks: Size,
    /// Quantisation steps q of the 64 coefficients, row by row.
    pub steps: Vec<u16>,
    /// Coefficients in units of their steps, block by block, row by row; shared by copies.
    #[serde(skip)]
    pub coefficients: Arc<Vec<i16>>,
}

impl Coding {
    /// Numbers of block columns and rows of a component with `pixels` per sample, in a picture of
    /// `size` whose units hold `densest` blocks of the first component.
    pub fn blocks(size: Size, densest: (u8, u8), pixels: (u8, u8)) -> Size {
        let count = |side: usize, densest: u8, pixels: u8| {
            let (densest, pixels) = (usize::from(densest), usize::from(pixels).max(1));
            side.div_ceil(BLOCK_PX * densest.max(1)) * (densest / pixels).max(1)
        };
        let across = count(size.width, densest.0, pixels.0);
        Size::new(across, count(size.height, densest.1, pixels.1))
    }

    /// The luma component alone.
    #[must_use]
    pub fn brightness(&self) -> Coding {
        let luma = |first: &CodedComponent| {
            let blocks = Coding::blocks(self.size, (1, 1), (1, 1));
            let rows = first.coefficients.chunks(first.blocks.width * BLOCK_AREA);
            let kept = rows.take(blocks.height).flat_map(|row| &row[..blocks.width * BLOCK_AREA]);
            let coefficients = Arc::new(kept.copied().collect());
            CodedComponent { blocks, coefficients, ..first.clone() }
        };
        Coding { size: self.size, components: self.components.iter().take(1).map(luma).collect() }
    }

    /// Pixels per sample of the coarsest component across and down.
    pub fn densest(&self) -> (u8, u8) {
        let most = |side: fn(&CodedComponent) -> u8| self.components.iter().map(side).max();
        (most(|c| c.pixels.0).unwrap_or(1), most(|c| c.pixels.1).unwrap_or(1))
    }

    /// Whether the layout is supported: one component, or three with the first at full resolution.
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
        let is_layout = match &self.components[..] {
            [luma] => luma.pixels == (1, 1),
            [luma, blue, red] => luma.pixels == (1, 1) && blue.pixels == red.pixels,
            _ => false,
        };
        is_layout && self.components.iter().all(sound)
    }
}
