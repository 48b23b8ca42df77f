//! Sharpness of a fine pattern at nine places, and the search for the best focus.

use super::FocusTurn;
use super::sites::{GreenSites, PLACES, place_of};
use crate::frame::{Channel, Codes, Counts, Frame, Plane, Size};
use crate::patterns;

/// Side of the focus pattern's squares, panel pixels: finer ones drown in noise, coarser ones stay
/// sharp out of focus.
const SQUARE_PX: usize = 2;
const PATTERN_SEED: u64 = 29;
/// Share of the best figure above which a figure counts as the best, given noise.
const BEST_SHARE: f64 = 0.985;
/// Relative change from the last extreme that counts as a reversal: more than noise.
const REVERSED_SHARE: f64 = 0.0075;
/// The best counts as found once figures on both sides were below this share of it.
const PASSED_SHARE: f64 = 0.95;

/// Contrast of a fine pattern at nine places, row by row from the upper left: RMS difference of
/// neighbouring sites of one colour over their mean. The product of two exposures removes the noise
/// on average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sharpness(pub [f64; PLACES]);

impl Sharpness {
    /// Mean over the places.
    pub fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / PLACES as f64
    }

    /// Computes the sharpness from two exposures of one pattern, and the mean counts of the second
    /// over `black`.
    pub fn of(first: &Counts, second: &Counts, sites: GreenSites, black: f64) -> (Sharpness, f64) {
        let (first, second) = (first.plane(Channel::Green), second.plane(Channel::Green));
        let size = first.size();
        // The next green site is to the right, or diagonal behind filters.
        let down = usize::from(sites.are_filtered());
        let mut sums = [PairSums::default(); PLACES];
        for y in sites.rows(size).filter(|y| y + down < size.height) {
            let here = (first.row(y), second.row(y));
            let next = (first.row(y + down), second.row(y + down));
            for part in 0..3 {
                let sums = &mut sums[place_of(part * size.width / 3 + 1, y, size)];
                for x in sites.part_of_row(y, part, size).filter(|x| x + 1 < size.width) {
                    sums.add((here.0[x], next.0[x + 1]), (here.1[x], next.1[x + 1]));
                }
            }
        }
        let total = |of: fn(&PairSums) -> i64| sums.iter().map(of).sum::<i64>() as f64;
        let mean = total(|sums| sums.second) / total(|sums| sums.count).max(1.0);
        (Sharpness(sums.map(|sums| sums.contrast(black))), mean - black)
    }
}

/// Sums over pairs of neighbouring sites, in integers: exact, and fast on a small board.
#[derive(Clone, Copy, Default)]
struct PairSums {
    count: i64,
    first: i64,
    second: i64,
    product: i64,
    differences: i64,
}

impl PairSums {
    fn add(&mut self, (a, a_next): (u16, u16), (b, b_next): (u16, u16)) {
        let [a, a_next, b, b_next] = [a, a_next, b, b_next].map(i64::from);
        self.count += 1;
        self.first += a;
        self.second += b;
        self.product += a * b;
        self.differences += (a - a_next) * (b - b_next);
    }

    fn contrast(&self, black: f64) -> f64 {
        let [count, first, second] = [self.count, self.first, self.second].map(|n| n as f64);
        let light = self.product as f64 - black * (first + second) + black * black * count;
        ((self.differences as f64).max(0.0) / light.max(f64::MIN_POSITIVE)).sqrt()
    }
}

/// The focus pattern for a panel of `size`: random black and white squares.
pub(super) fn pattern(size: Size) -> Codes {
    let squares = Size::new(size.width.div_ceil(SQUARE_PX), size.height.div_ceil(SQUARE_PX));
    let random = patterns::pseudo_random(squares, PATTERN_SEED);
    let is_white = |x, y| random.at(x / SQUARE_PX, y / SQUARE_PX) > 0.0;
    let plane = Plane::from_fn(size, |x, y| if is_white(x, y) { 255 } else { 0 });
    Frame::from_fn(|_| plane.clone())
}

/// Summary of the focus figures so far, as needed to find the best focus.
#[derive(Debug, Clone, Default)]
pub struct FocusHistory {
    best: f64,
    least: f64,
    rises: bool,
    /// The largest figure while rising, the least while falling.
    extreme: f64,
    /// The best figure when it last rose by more than noise.
    risen: f64,
    /// Whether clearly worse figures came before and after `risen`.
    worse: [bool; 2],
}

impl FocusHistory {
    /// Adds a figure and returns what to do with the focus ring.
    pub fn add(&mut self, figure: f64) -> FocusTurn {
        if self.best == 0.0 {
            *self = FocusHistory { best: figure, least: figure, rises: true, ..Self::default() };
            (self.risen, self.extreme) = (figure, figure);
        }
        self.best = self.best.max(figure);
        if figure > self.risen / BEST_SHARE {
            self.risen = figure;
            self.worse = [self.least < PASSED_SHARE * figure, false];
        }
        self.least = self.least.min(figure);
        self.worse[1] |= figure < PASSED_SHARE * self.best;
        let turns = match self.rises {
            true => figure < self.extreme * (1.0 - REVERSED_SHARE),
            false => figure > self.extreme * (1.0 + REVERSED_SHARE),
        };
        self.rises ^= turns;
        let farther = if self.rises { figure > self.extreme } else { figure < self.extreme };
        if turns || farther {
            self.extreme = figure;
        }
        let both = self.worse == [true, true];
        match figure >= BEST_SHARE * self.best {
            true if both => FocusTurn::Stay,
            true => FocusTurn::PassBest,
            false if self.rises => FocusTurn::Continue,
            false if self.worse[1] => FocusTurn::Reverse,
            false => FocusTurn::PassBest,
        }
    }
}
