//! Symmetric equations in which only near neighbours meet: places of a grid that do not touch share
//! nothing.

/// The lower triangle of a symmetric matrix, of each row the `width` numbers up to the diagonal.
#[derive(Debug, Clone)]
pub(super) struct Banded {
    size: usize,
    width: usize,
    rows: Vec<f64>,
}

impl Banded {
    /// Zeros.
    pub(super) fn zeros(size: usize, width: usize) -> Banded {
        Banded { size, width, rows: vec![0.0; size * width] }
    }

    /// Numbers `from..to` of row `row`, up to the diagonal and none before the band.
    pub(super) fn row_mut(&mut self, row: usize, from: usize, to: usize) -> &mut [f64] {
        // Where the number on the diagonal is.
        let last = (row + 1) * self.width - 1;
        &mut self.rows[last + from - row..last + to - row]
    }

    /// Adds `value` to the diagonal.
    pub(super) fn raise(&mut self, value: f64) {
        let width = self.width;
        self.rows.chunks_exact_mut(width.max(1)).for_each(|row| row[width - 1] += value);
    }

    /// Adds `other`, of the same shape.
    pub(super) fn add(&mut self, other: &Banded) {
        self.rows.iter_mut().zip(&other.rows).for_each(|(a, b)| *a += b);
    }

    /// The solution for `side` by Cholesky's factors; `None` when the matrix is not positive
    /// definite.
    pub(super) fn solve(mut self, side: &[f64]) -> Option<Vec<f64>> {
        let (size, width) = (self.size, self.width);
        for i in 0..size {
            let first = (i + 1).saturating_sub(width);
            for j in first..=i {
                // Both rows hold columns from..j one after the other.
                let from = first.max((j + 1).saturating_sub(width));
                let at = |row: usize, column: usize| row * width + width - 1 + column - row;
                let (a, b) = (&self.rows[at(i, from)..at(i, j)], &self.rows[at(j, from)..at(j, j)]);
                let sum = self.rows[at(i, j)] - dot(a, b);
                self.rows[at(i, j)] = if i == j {
                    if sum.is_nan() || sum <= 0.0 {
                        return None;
                    }
                    sum.sqrt()
                } else {
                    sum / self.rows[at(j, j)]
                };
            }
        }
        let at = |row: usize, column: usize| row * width + width - 1 + column - row;
        let mut found = side.to_vec();
        for i in 0..size {
            let first = (i + 1).saturating_sub(width);
            let sum = found[i] - dot(&self.rows[at(i, first)..at(i, i)], &found[first..i]);
            found[i] = sum / self.rows[at(i, i)];
        }
        for i in (0..size).rev() {
            found[i] /= self.rows[at(i, i)];
            let (value, first) = (found[i], (i + 1).saturating_sub(width));
            let row = &self.rows[at(i, first)..at(i, i)];
            found[first..i].iter_mut().zip(row).for_each(|(f, l)| *f -= value * l);
        }
        found.iter().all(|v| v.is_finite()).then_some(found)
    }
}

/// Σ aᵢ bᵢ, four sums at a time.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a_fours, b_fours) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a_fours.remainder().iter().zip(b_fours.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_fours.zip(b_fours) {
        for n in 0..4 {
            sums[n] += a[n] * b[n];
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_solves() {
        let (size, width) = (12, 4);
        let mut matrix = Banded::zeros(size, width);
        let entry = |i: usize, j: usize| {
            if i == j { 5.0 + i as f64 } else { 0.3 * (i + 2 * j) as f64 / 10.0 }
        };
        for i in 0..size {
            let first = (i + 1).saturating_sub(width);
            let row = matrix.row_mut(i, first, i + 1);
            row.iter_mut().enumerate().for_each(|(n, v)| *v = entry(i, first + n));
        }
        let side: Vec<f64> = (0..size).map(|n| 1.0 + n as f64).collect();
        let found = matrix.solve(&side).unwrap();
        for (i, wanted) in side.iter().enumerate() {
            let near = |j: &usize| i.abs_diff(*j) < width;
            let sum: f64 =
                (0..size).filter(near).map(|j| entry(i.max(j), i.min(j)) * found[j]).sum();
            assert!((sum - wanted).abs() < 1e-9, "{i}: {sum}");
        }
    }

    #[test]
    fn what_is_not_positive_has_no_solution() {
        let mut matrix = Banded::zeros(2, 2);
        matrix.raise(1.0);
        matrix.row_mut(1, 0, 1)[0] = 2.0;
        assert!(matrix.solve(&[1.0, 1.0]).is_none());
    }
}
