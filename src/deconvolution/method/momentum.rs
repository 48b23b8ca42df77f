//! Nesterov's momentum as in FISTA (Beck & Teboulle 2009), restarted when it points uphill
//! (O'Donoghue & Candès 2015). The test is an inner product of pictures in memory and costs no
//! capture.

use rayon::prelude::*;

use crate::frame::{Plane, STRETCH};

/// The momentum of one channel's iteration.
#[derive(Debug, Clone)]
pub struct Momentum {
    /// `stepped` of the previous step; empty before the first.
    previous: Plane,
    t: f64,
}

impl Default for Momentum {
    /// No momentum.
    fn default() -> Self {
        Momentum { previous: Plane::default(), t: 1.0 }
    }
}

impl Momentum {
    /// Moves `point`, from which the gradient step led to `stepped`, to the next point.
    pub fn next(&mut self, point: &mut Plane, stepped: Plane) {
        if self.previous.size() != stepped.size() {
            // The first step has no momentum.
            (*point, self.previous) = (stepped.clone(), stepped);
            self.t = next_t(1.0);
            return;
        }
        let stretches = (point.data().par_chunks(STRETCH))
            .zip(stepped.data().par_chunks(STRETCH))
            .zip(self.previous.data().par_chunks(STRETCH));
        let parts: Vec<f64> = stretches.map(|((y, x), x_old)| along(y, x, x_old)).collect();
        // Summed in order, so that the sum is the same on any number of threads.
        let uphill: f64 = parts.iter().sum();
        let restart = uphill > 0.0;
        let t = if restart { 1.0 } else { self.t };
        let t_next = next_t(t);
        let weight = if restart { 0.0 } else { ((t - 1.0) / t_next) as f32 };
        let pixels = (point.data_mut(), self.previous.data(), stepped.data()).into_par_iter();
        let pixels = pixels.with_min_len(STRETCH);
        pixels.for_each(|(y, x_old, &x)| *y = x + weight * (x - x_old));
        (self.previous, self.t) = (stepped, t_next);
    }
}

fn next_t(t: f64) -> f64 {
    (1.0 + (1.0 + 4.0 * t * t).sqrt()) / 2.0
}

/// (y − x)·(x − x_old) over a stretch.
fn along(y: &[f32], x: &[f32], x_old: &[f32]) -> f64 {
    let mut sum = 0.0;
    for ((y, x), x_old) in y.chunks(4096).zip(x.chunks(4096)).zip(x_old.chunks(4096)) {
        // Sixteen sums side by side hide the latency of an addition.
        let mut parts = [0.0f32; 16];
        for ((y, x), x_old) in y.chunks(16).zip(x.chunks(16)).zip(x_old.chunks(16)) {
            for (((part, y), x), o) in parts.iter_mut().zip(y).zip(x).zip(x_old) {
                *part += (y - x) * (x - o);
            }
        }
        sum += parts.iter().map(|&part| f64::from(part)).sum::<f64>();
    }
    sum
}
