//! Gradations: blocks of many levels shuffled over the panel, so that glare and blur add the same
//! light to every level on average, unlike with a ramp.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::frame::{Channel, Codes, Frame, Plane, Size};

/// A panel filled with square blocks of one code each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gradation {
    size: Size,
    block_px: usize,
    columns: usize,
    rows: usize,
    codes: Vec<u8>,
}

/// One block of a gradation.
#[derive(Debug, Clone, PartialEq)]
pub struct GradationBlock {
    /// Code of the block.
    pub code: u8,
    /// Centre on the panel.
    pub centre: (f64, f64),
    /// Codes of the neighbouring blocks, up to eight.
    pub around: Vec<u8>,
}

impl Gradation {
    /// Creates a gradation of blocks of `block_px` panel pixels, in which the codes of `levels` are
    /// equally frequent, in an order derived from `seed`.
    pub fn new(size: Size, block_px: usize, levels: &[u8], seed: u64) -> Gradation {
        let block_px = block_px.max(1);
        let (columns, rows) = (size.width.div_ceil(block_px), size.height.div_ceil(block_px));
        let mut codes: Vec<u8> = levels.iter().copied().cycle().take(columns * rows).collect();
        codes.resize(columns * rows, 0);
        codes.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed));
        Gradation { size, block_px, columns, rows, codes }
    }

    /// `count` evenly spaced codes (at least two) from 0 to 255.
    pub fn levels(count: usize) -> Vec<u8> {
        let last = count.max(2) - 1;
        (0..=last).map(|n| ((255 * n + last / 2) / last) as u8).collect()
    }

    /// The gradation in one channel, with 0 in the others.
    pub fn in_channel(&self, channel: Channel) -> Codes {
        Frame::from_fn(|c| if c == channel { self.plane() } else { Plane::zeros(self.size) })
    }

    /// The gradation in all three channels alike.
    pub fn grey(&self) -> Codes {
        Frame::from_fn(|_| self.plane())
    }

    fn plane(&self) -> Plane<u8> {
        Plane::from_fn(self.size, |x, y| {
            self.codes[y / self.block_px * self.columns + x / self.block_px]
        })
    }

    /// The blocks that lie wholly on the panel.
    pub fn blocks(&self) -> impl Iterator<Item = GradationBlock> + '_ {
        let centre = |n: usize| (n * self.block_px) as f64 + (self.block_px as f64 - 1.0) / 2.0;
        (0..self.rows * self.columns)
            .filter(|n| {
                (n % self.columns + 1) * self.block_px <= self.size.width
                    && (n / self.columns + 1) * self.block_px <= self.size.height
            })
            .map(move |n| GradationBlock {
                code: self.codes[n],
                centre: (centre(n % self.columns), centre(n / self.columns)),
                around: self.around(n % self.columns, n / self.columns),
            })
    }

    fn around(&self, column: usize, row: usize) -> Vec<u8> {
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        near(row, self.rows)
            .flat_map(|j| near(column, self.columns).map(move |i| (i, j)))
            .filter(|&place| place != (column, row))
            .map(|(i, j)| self.codes[j * self.columns + i])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_equally_frequent_and_shown_at_their_positions() {
        let levels = Gradation::levels(9);
        assert_eq!(levels, [0, 32, 64, 96, 128, 159, 191, 223, 255]);
        let g = Gradation::new(Size::new(100, 75), 10, &levels, 3);
        let shown = g.in_channel(Channel::Blue);
        let mut count = [0usize; 256];
        for block in g.blocks() {
            let (x, y) = (block.centre.0 as usize, block.centre.1 as usize);
            assert_eq!(shown.plane(Channel::Blue).at(x, y), block.code);
            count[usize::from(block.code)] += 1;
            assert!([3, 5, 8].contains(&block.around.len()));
        }
        assert_eq!(count.iter().sum::<usize>(), 70);
        assert_ne!(g, Gradation::new(Size::new(100, 75), 10, &levels, 4));
    }
}
