//! Cycle spinning level by level: the mean of the shrunk pictures over all shifts of the finest levels.
//!
//! A transform of n levels has 4ⁿ shifts, but one level alone has four. Spinning each of the finest [`EVERYWHERE`]
//! levels over its four, and the approximations below them over one each, costs four one-level transforms of the plane
//! for every spun level: over 16 shifts for the price of seven whole ones. What is spun this way does not see where
//! the grid lies; no choice of shifts is left to do well or badly.

use super::draw;
use crate::frame::{Plane, Size};
use crate::restore::wavelet::{Coefficients, Scratch, Sym8};

/// Levels spun over all their shifts. Coarser ones turn with the step.
pub(super) const EVERYWHERE: usize = 2;

/// The four shifts of one level, in halves that two cores can take: each half is a quincunx.
const SHIFTS: [[(usize, usize); 2]; 2] = [[(0, 0), (1, 1)], [(1, 0), (0, 1)]];

/// The levels' transforms, each of one level, the plane's own first.
#[derive(Debug, Clone)]
pub(super) struct Spinning {
    levels: Vec<Sym8>,
}

/// Memory of one level and of those below it.
#[derive(Debug, Clone, Default)]
pub(super) struct SpinningScratch {
    levels: Vec<LevelScratch>,
}

#[derive(Debug, Clone)]
struct LevelScratch {
    coefficients: Coefficients,
    sum: Plane,
    one: Plane,
    transform: Scratch,
    rows: Vec<f32>,
}

/// What is done to details.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drawing<'a> {
    /// Threshold of each level, finest first; the last one holds for all coarser ones.
    pub(super) thresholds: &'a [f32],
    pub(super) clustered: bool,
    /// Which shift of the levels that are not spun everywhere.
    pub(super) turn: usize,
}

impl Spinning {
    pub(super) fn new(size: Size, levels: usize) -> Self {
        let mut of_level = size;
        let levels = (0..levels).map(|_| {
            let transform = Sym8::new(of_level, 1);
            of_level = Size::new(of_level.width.div_ceil(2), of_level.height.div_ceil(2));
            transform
        });
        Spinning { levels: levels.collect() }
    }

    /// Replaces `plane` by the mean of its shrunk versions; two halves of it run side by side.
    pub(super) fn shrink(&self, plane: &mut Plane, drawing: Drawing<'_>, scratch: &mut [SpinningScratch; 2]) {
        if self.levels.is_empty() {
            return;
        }
        let [first, second] = scratch;
        self.fit(first);
        self.fit(second);
        let of = |shifts: &[(usize, usize)], scratch: &mut SpinningScratch| {
            self.sum_shrunk(0, plane, drawing, shifts, &mut scratch.levels);
        };
        rayon::join(|| of(&SHIFTS[0], first), || of(&SHIFTS[1], second));
        let share = 1.0 / 4.0;
        let sums = first.levels[0].sum.data().iter().zip(second.levels[0].sum.data());
        plane.data_mut().iter_mut().zip(sums).for_each(|(value, (a, b))| *value = (a + b) * share);
    }

    /// `scratch[0].sum` = the sum of `plane`, of level `level`, shrunk at each of `shifts`.
    fn sum_shrunk(
        &self,
        level: usize,
        plane: &Plane,
        drawing: Drawing<'_>,
        shifts: &[(usize, usize)],
        scratch: &mut [LevelScratch],
    ) {
        let (transform, deeper_exists) = (&self.levels[level], level + 1 < self.levels.len());
        let Some((here, deeper)) = scratch.split_first_mut() else { return };
        for (k, &shift) in shifts.iter().enumerate() {
            transform.analyse_shifted(plane, shift, &mut here.coefficients, &mut here.transform);
            let threshold = drawing.thresholds[level.min(drawing.thresholds.len() - 1)].max(0.0);
            for band in here.coefficients.details[0].bands_mut() {
                draw(band, threshold, drawing.clustered, &mut here.rows);
            }
            if deeper_exists {
                let approximation = &mut here.coefficients.approximation;
                if level + 1 < EVERYWHERE {
                    self.sum_shrunk(level + 1, approximation, drawing, SHIFTS.as_flattened(), deeper);
                    let sums = deeper[0].sum.data().iter();
                    approximation.data_mut().iter_mut().zip(sums).for_each(|(a, sum)| *a = sum * 0.25);
                } else {
                    let turn = drawing.turn + k;
                    let shift = SHIFTS.as_flattened()[(turn >> (2 * (level + 1 - EVERYWHERE))) % 4];
                    self.sum_shrunk(level + 1, approximation, drawing, &[shift], deeper);
                    std::mem::swap(approximation, &mut deeper[0].sum);
                }
            }
            match k {
                0 => transform.synthesise_shifted(
                    &here.coefficients,
                    shift,
                    &mut here.sum,
                    &mut here.transform,
                ),
                _ => {
                    transform.synthesise_shifted(
                        &here.coefficients,
                        shift,
                        &mut here.one,
                        &mut here.transform,
                    );
                    here.sum.add_scaled(1.0, &here.one);
                }
            }
        }
    }

    fn fit(&self, scratch: &mut SpinningScratch) {
        let fits = scratch.levels.len() == self.levels.len()
            && self.levels.iter().zip(&scratch.levels).all(|(t, level)| t.size() == level.sum.size());
        if !fits {
            let made = self.levels.iter().map(|transform| LevelScratch {
                coefficients: transform.zeros(),
                sum: Plane::zeros(transform.size()),
                one: Plane::zeros(transform.size()),
                transform: Scratch::default(),
                rows: Vec::new(),
            });
            scratch.levels = made.collect();
        }
    }
}
