//! The change of the lens that explains a capture: least squares, as detailed as held-out squares
//! of the capture allow.
//!
//! A candidate is a grid of changes, interpolated over the field as the lens's functions are. Every
//! one is fitted to one half of the squares and held against the other, both ways. A finer grid is
//! taken when its gain over the plainer one stands out of its own uncertainty, and none when no
//! gain does, or when too little is explained: a model that is nearly right is corrected well
//! enough without.

use super::banded::Banded;
use super::squares::{Square, Squares};

/// A grid of changes, evenly spread over the photo; one column after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
}

/// Grids tried, plainest first.
const GRIDS: [Grid; 3] =
    [Grid { columns: 1, rows: 1 }, Grid { columns: 4, rows: 3 }, Grid { columns: 6, rows: 4 }];
/// Size of a change that is expected, as a share of the light that a band lets through: sets the
/// ridge. Guess; 0.03 to 0.3 make no difference on study.toml.
const EXPECTED: f64 = 0.1;
/// Squares in a row that are held out together, so that a fit is asked about places some way off.
const HELD_OUT: usize = 2;
/// By how many of its standard errors a gain must stand out.
const CERTAIN: f64 = 3.0;
/// Share of the residual's power, noise and all, that a change must explain.
const EXPLAINED_MIN: f64 = 0.5;

impl Grid {
    /// The changes that hold at `place` (shares of the photo), with their weights.
    pub(super) fn at(self, place: (f64, f64)) -> [(usize, f64); 4] {
        let along = |share: f64, count: usize| {
            let place = (share * count as f64 - 0.5).clamp(0.0, count as f64 - 1.0);
            let lower = (place.floor() as usize).min(count.saturating_sub(2));
            (lower, (lower + 1).min(count - 1), place - lower as f64)
        };
        let ((left, right, u), (above, below, v)) =
            (along(place.0, self.columns), along(place.1, self.rows));
        let n = |row: usize, column: usize| column * self.rows + row;
        [
            (n(above, left), (1.0 - v) * (1.0 - u)),
            (n(below, left), v * (1.0 - u)),
            (n(above, right), (1.0 - v) * u),
            (n(below, right), v * u),
        ]
    }
}

/// A change found.
#[derive(Debug, Clone)]
pub(super) struct Change {
    pub(super) grid: Grid,
    /// Coefficients of the regressors from `first` on, one grid place after the other.
    coefficients: Vec<f64>,
    first: usize,
    count: usize,
    /// Share of the residual's power that it explains of squares that it was not fitted to.
    pub(super) explains: f64,
}

impl Change {
    /// The coefficients that hold at `place` (shares of the photo).
    pub(super) fn at(&self, place: (f64, f64)) -> Vec<f64> {
        let (mut sum, own) = (vec![0.0; self.count], self.count - self.first);
        for (n, weight) in self.grid.at(place) {
            let of = &self.coefficients[n * own..][..own];
            sum[self.first..].iter_mut().zip(of).for_each(|(s, c)| *s += weight * c);
        }
        sum
    }

    /// By how much it lessens the power of the residual in `square`.
    fn gain(&self, square: &Square) -> f64 {
        let at = self.at(square.centre);
        let mut gain = 0.0;
        for (a, &c) in at.iter().enumerate().skip(self.first) {
            gain += 2.0 * c * square.product(a, self.count) - c * c * square.product(a, a);
            let others = at.iter().enumerate().skip(a + 1);
            gain -= 2.0 * c * others.map(|(b, &other)| other * square.product(a, b)).sum::<f64>();
        }
        gain
    }
}

/// The half that a square belongs to.
fn half(square: &Square) -> usize {
    (square.place.0 / HELD_OUT + square.place.1 / HELD_OUT) % 2
}

/// Whether no change could explain enough of a residual of this mean `power`, in units of the
/// captures' noise.
pub(super) fn is_explained(power: f64) -> bool {
    (1.0 - EXPLAINED_MIN) * power <= 1.0
}

/// The change that `squares` call for, if they call for one; `noise` is the capture's, grey levels.
pub(super) fn find(squares: &Squares, noise: f64) -> Option<Change> {
    let ridge = (noise / EXPECTED).powi(2);
    let power: f64 = squares.squares.iter().map(|s| s.product(squares.count, squares.count)).sum();
    let mut best: Option<(Vec<f64>, Change)> = None;
    for grid in GRIDS {
        let (Some((gains, mut change)), Some((wide, _))) =
            (held_out(grid, squares, 0, ridge), held_out(grid, squares, squares.narrow, ridge))
        else {
            continue;
        };
        let over = |plainer: &[f64]| -> Vec<f64> {
            gains.iter().zip(plainer).map(|(gain, plainer)| gain - plainer).collect()
        };
        // What is wide alone would explain is no reason to change what is narrow.
        let beyond_wide = over(&wide);
        if stands_out(&beyond_wide)
            && stands_out(&over(best.as_ref().map_or(&wide, |(gains, _)| gains)))
        {
            let left = power - wide.iter().sum::<f64>();
            change.explains = beyond_wide.iter().sum::<f64>() / left.max(f64::MIN_POSITIVE);
            best = Some((gains, change));
        }
    }
    let (_, change) = best?;
    log::debug!(
        "{}×{} changes explain {:.2}",
        change.grid.columns,
        change.grid.rows,
        change.explains
    );
    (change.explains >= EXPLAINED_MIN).then_some(change)
}

/// The change on `grid` by the regressors from `first` on, and its gain in each square when that
/// was held out.
fn held_out(grid: Grid, squares: &Squares, first: usize, ridge: f64) -> Option<(Vec<f64>, Change)> {
    let mut halves = [0, 1].map(|h| Normal::of(grid, squares, first, |square| half(square) == h));
    let [one, other] = [halves[0].solve(ridge)?, halves[1].solve(ridge)?];
    let gain =
        |square: &Square| if half(square) == 0 { other.gain(square) } else { one.gain(square) };
    let gains = squares.squares.iter().map(gain).collect();
    let [all, rest] = &mut halves;
    all.matrix.add(&rest.matrix);
    all.side.iter_mut().zip(&rest.side).for_each(|(a, b)| *a += b);
    Some((gains, all.solve(ridge)?))
}

/// Whether the sum of `gains` is larger than chance makes it.
fn stands_out(gains: &[f64]) -> bool {
    let count = gains.len().max(1) as f64;
    let sum: f64 = gains.iter().sum();
    let spread: f64 = gains.iter().map(|gain| (gain - sum / count).powi(2)).sum();
    sum > CERTAIN * spread.sqrt()
}

/// The normal equations of a grid.
struct Normal {
    grid: Grid,
    first: usize,
    count: usize,
    matrix: Banded,
    side: Vec<f64>,
}

impl Normal {
    /// Of those squares that are `wanted`, by the regressors from `first` on.
    fn of(grid: Grid, squares: &Squares, first: usize, wanted: impl Fn(&Square) -> bool) -> Normal {
        let (count, own) = (squares.count, squares.count - first);
        let unknown = grid.columns * grid.rows * own;
        // A place meets those beside it, in its column and the next.
        let width = ((grid.rows + 2) * own).min(unknown);
        let (mut matrix, mut side) = (Banded::zeros(unknown, width), vec![0.0; unknown]);
        let mut products = vec![0.0; own * own];
        for square in squares.squares.iter().filter(|square| square.pixels > 0 && wanted(square)) {
            for a in 0..own {
                for b in a..own {
                    let product = square.product(first + a, first + b);
                    (products[a * own + b], products[b * own + a]) = (product, product);
                }
            }
            let weights = grid.at(square.centre);
            let weights = weights.iter().filter(|(_, weight)| *weight > 0.0);
            for &(n, weight) in weights.clone() {
                for a in 0..own {
                    side[n * own + a] += weight * square.product(first + a, count);
                    for &(m, other) in weights.clone().filter(|(m, _)| *m <= n) {
                        // Up to the diagonal.
                        let length = if m == n { a + 1 } else { own };
                        let row = matrix.row_mut(n * own + a, m * own, m * own + length);
                        let products = &products[a * own..][..length];
                        row.iter_mut().zip(products).for_each(|(v, p)| *v += weight * other * p);
                    }
                }
            }
        }
        Normal { grid, first, count, matrix, side }
    }

    /// The change with so much on the diagonal.
    fn solve(&self, ridge: f64) -> Option<Change> {
        let mut matrix = self.matrix.clone();
        matrix.raise(ridge);
        let coefficients = matrix.solve(&self.side)?;
        let (grid, first, count) = (self.grid, self.first, self.count);
        Some(Change { grid, coefficients, first, count, explains: 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_between_centres_are_shared() {
        let grid = Grid { columns: 2, rows: 1 };
        let weight = |place, n| -> f64 {
            grid.at(place).iter().filter(|(of, _)| *of == n).map(|(_, weight)| weight).sum()
        };
        assert_eq!((weight((0.1, 0.5), 0), weight((0.9, 0.5), 1)), (1.0, 1.0));
        assert!(
            (weight((0.5, 0.5), 0) - 0.5).abs() < 1e-12
                && (weight((0.5, 0.5), 1) - 0.5).abs() < 1e-12
        );
    }

    #[test]
    fn a_gain_of_chance_does_not_stand_out() {
        let chance: Vec<f64> = (0..100).map(|n| if n % 2 == 0 { 1.0 } else { -0.9 }).collect();
        assert!(!stands_out(&chance));
        let real: Vec<f64> = chance.iter().map(|gain| gain + 0.5).collect();
        assert!(stands_out(&real));
    }
}
