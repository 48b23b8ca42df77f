//! Reference implementation of the lens model, as sums over pixels and taps, for tests.

use super::super::LensFunctions;
use super::super::interpolation::Interpolation;
use crate::frame::{Channel, Plane, Size};

/// A grid of functions with its interpolation over the canvas.
pub(super) struct Plain<'a> {
    pub(super) functions: &'a LensFunctions,
    pub(super) along_x: &'a Interpolation,
    pub(super) along_y: &'a Interpolation,
}

impl Plain<'_> {
    /// The four functions interpolated at (x, y), with their weights.
    fn at(&self, x: usize, y: usize) -> [(usize, f32); 4] {
        let (u, v) = (self.along_x.weight[x], self.along_y.weight[y]);
        let [left, right] = self.along_x.functions[x];
        let [above, below] = self.along_y.functions[y].map(|row| row * self.functions.columns);
        [
            (above + left, (1.0 - v) * (1.0 - u)),
            (above + right, (1.0 - v) * u),
            (below + left, v * (1.0 - u)),
            (below + right, v * u),
        ]
    }

    /// Calls `visit((object x, y), (image x, y), tap index, weight)` for every ray.
    fn for_each_ray(
        &self,
        size: Size,
        mut visit: impl FnMut((usize, usize), (usize, usize), usize, f32),
    ) {
        let k = self.functions.support_px;
        let r = k / 2;
        for y in 0..size.height {
            for x in 0..size.width {
                for (function, weight) in self.at(x, y) {
                    if weight == 0.0 {
                        continue;
                    }
                    for v in r.saturating_sub(y)..k.min(size.height + r - y) {
                        for u in r.saturating_sub(x)..k.min(size.width + r - x) {
                            visit(
                                (x, y),
                                (x + u - r, y + v - r),
                                function * k * k + v * k + u,
                                weight,
                            );
                        }
                    }
                }
            }
        }
    }

    /// K x.
    pub(super) fn forward(&self, channel: Channel, x: &Plane) -> Plane {
        let taps = &self.functions.taps[channel.index()];
        let mut out = Plane::<f64>::zeros(x.size());
        self.for_each_ray(x.size(), |(ox, oy), (ix, iy), tap, weight| {
            let light = f64::from(x.at(ox, oy)) * f64::from(weight) * f64::from(taps[tap]);
            out.set(ix, iy, out.at(ix, iy) + light);
        });
        out.map(|v| v as f32)
    }

    /// Kᵀ y.
    pub(super) fn adjoint(&self, channel: Channel, y: &Plane) -> Plane {
        let taps = &self.functions.taps[channel.index()];
        let mut out = Plane::<f64>::zeros(y.size());
        self.for_each_ray(y.size(), |(ox, oy), (ix, iy), tap, weight| {
            let light = f64::from(y.at(ix, iy)) * f64::from(weight) * f64::from(taps[tap]);
            out.set(ox, oy, out.at(ox, oy) + light);
        });
        out.map(|v| v as f32)
    }

    /// The adjoint of taps ↦ K(taps) x, applied to `residual`.
    pub(super) fn correlate(&self, x: &Plane, residual: &Plane) -> Vec<f32> {
        let k = self.functions.support_px;
        let mut out = vec![0.0f64; self.functions.rows * self.functions.columns * k * k];
        self.for_each_ray(x.size(), |(ox, oy), (ix, iy), tap, weight| {
            out[tap] +=
                f64::from(x.at(ox, oy)) * f64::from(weight) * f64::from(residual.at(ix, iy));
        });
        out.into_iter().map(|v| v as f32).collect()
    }
}
