//! Overlaps of the weights of neighbouring lens functions: the expected normal matrix for white
//! patterns.

use nalgebra::DMatrix;

use super::FunctionGrid;
use crate::frame::Plane;

/// Σ over trusted pixels of the products of the functions' weights.
pub(super) fn overlaps(grid: &FunctionGrid, trusted: &Plane<u8>) -> DMatrix<f64> {
    let across = grid.hats(grid.photo.width, grid.columns);
    let down = grid.hats(grid.photo.height, grid.rows);
    let functions = grid.rows * grid.columns;
    let mut normal = DMatrix::zeros(functions, functions);
    for (y, down) in down.iter().enumerate() {
        // Σ over x of the products of two horizontal weights, per row.
        let mut sums = DMatrix::<f64>::zeros(grid.columns, grid.columns);
        for (across, _) in across.iter().zip(trusted.row(y)).filter(|(_, t)| **t > 0) {
            for i in 0..grid.columns {
                for j in i.saturating_sub(1)..grid.columns.min(i + 2) {
                    sums[(i, j)] += across[i] * across[j];
                }
            }
        }
        for p in 0..grid.rows {
            for q in p.saturating_sub(1)..grid.rows.min(p + 2) {
                let weight = down[p] * down[q];
                if weight == 0.0 {
                    continue;
                }
                for i in 0..grid.columns {
                    for j in i.saturating_sub(1)..grid.columns.min(i + 2) {
                        normal[(p * grid.columns + i, q * grid.columns + j)] +=
                            weight * sums[(i, j)];
                    }
                }
            }
        }
    }
    normal
}
