//! A scene of two depths: which part of a photo is for which of two focuses.

use super::{STEPS, TILES_MIN, TileCosts, standard_errors};

/// Each part is for its own focus, against the other part's, by so many standard errors of the mean
/// of its tiles. Parts are chosen by what their tiles say, so scenes of one depth have some, too:
/// 24 on small.toml 0.4 to 2.9, but two far out of focus 3.3 and 3.5, to which it does little.
const STANDARD_ERRORS: f64 = 3.0;

/// Two focuses, as numbers of what was tried, and which of them each place of a grid is for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TwoDepths {
    pub(super) focuses: [usize; 2],
    pub(super) of_place: Vec<usize>,
}

/// The two focuses for which tiles on a grid of `columns` are likeliest; `None` where one will do.
/// A place that has no say goes by its neighbours'.
pub(super) fn two_depths(costs: &[Option<TileCosts>], columns: usize) -> Option<TwoDepths> {
    let tried = costs.iter().flatten().next()?.0.len();
    // Two that are nearer to each other than two measured ones are blurred nearly alike.
    let pairs = (0..tried).flat_map(|a| (a + STEPS..tried).map(move |b| [a, b]));
    let part = |focuses: [usize; 2]| {
        let of_place = parts(costs, columns, focuses);
        let all = costs.iter().zip(&of_place);
        let cost: f64 = all.flat_map(|(tile, &n)| Some(tile.as_ref()?.0[focuses[n]])).sum();
        (cost, TwoDepths { focuses, of_place })
    };
    let best = pairs.map(part).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    let [first, second] = [0, 1].map(|n| {
        let own = costs.iter().zip(&best.of_place).filter(|of| *of.1 == n);
        let [own_focus, other] = [best.focuses[n], best.focuses[1 - n]];
        own.flat_map(|(tile, _)| Some(tile.as_ref()?.0[other] - tile.as_ref()?.0[own_focus]))
            .collect::<Vec<f64>>()
    });
    let enough = first.len().min(second.len()) >= TILES_MIN;
    let errors = standard_errors(&first).min(standard_errors(&second));
    log::debug!(
        "two depths: {} and {} tiles, by {errors:.1} standard errors",
        first.len(),
        second.len()
    );
    (enough && errors > STANDARD_ERRORS).then_some(best)
}

/// Which of two focuses each place is for: what it and the places around it say together, since
/// things are larger than tiles.
fn parts(costs: &[Option<TileCosts>], columns: usize, [a, b]: [usize; 2]) -> Vec<usize> {
    let rows = costs.len() / columns;
    let around = |n: usize, of: usize| n.saturating_sub(1)..=(n + 1).min(of - 1);
    let one = |n: usize| {
        let (row, column) = (n / columns, n % columns);
        let near = around(row, rows)
            .flat_map(|r| around(column, columns).map(move |c| r * columns + c))
            .filter_map(|n| costs[n].as_ref());
        usize::from(near.map(|tile| tile.0[a] - tile.0[b]).sum::<f64>() > 0.0)
    };
    (0..costs.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: usize = 8;
    const TRIED: usize = 13;

    /// Costs of 6 rows of tiles: parabolas around the focus of each column, and some unrest.
    fn costs(focus_of: impl Fn(usize) -> usize, worth: f64) -> Vec<Option<TileCosts>> {
        let one = |n: usize| {
            let unrest = ((n * 7919) % 101) as f64 / 101.0 - 0.5;
            let off = |tried: usize| tried as f64 - focus_of(n % COLUMNS) as f64 - 3.0 * unrest;
            TileCosts((0..TRIED).map(|tried| worth * off(tried).powi(2)).collect())
        };
        (0..48).map(|n| (n != 20).then(|| one(n))).collect()
    }

    #[test]
    fn two_depths_are_found_each_at_its_places_and_a_tile_without_a_say_goes_by_its_neighbours() {
        let two = two_depths(&costs(|column| if column < 3 { 2 } else { 9 }, 1.0), COLUMNS)
            .expect("three columns of eight are elsewhere");
        assert_eq!(two.focuses, [2, 9]);
        let expected: Vec<usize> = (0..48).map(|n| usize::from(n % COLUMNS >= 3)).collect();
        assert_eq!(two.of_place, expected);
    }

    #[test]
    fn one_depth_is_no_two_and_neither_is_a_single_column() {
        assert_eq!(two_depths(&costs(|_| 5, 1.0), COLUMNS), None);
        assert_eq!(two_depths(&costs(|column| if column < 1 { 2 } else { 9 }, 1.0), COLUMNS), None);
        assert_eq!(two_depths(&[None, None], 2), None);
    }
}
