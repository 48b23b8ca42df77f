//! Nesterov's momentum as in FISTA (Beck & Teboulle 2009), restarted when it points uphill (O'Donoghue &
//! Candès 2015): the inner product of pictures already in memory decides, so no capture is spent on it.

use crate::frame::Plane;

/// The momentum of one channel's iteration.
#[derive(Debug, Clone)]
pub struct Momentum {
    previous: Plane,
    t: f64,
}

impl Momentum {
    /// Starts from `start`.
    pub fn new(start: &Plane) -> Self {
        Momentum { previous: start.clone(), t: 1.0 }
    }

    /// Given the point `looked_at` where the gradient was taken and the `stepped` picture it led to, turns
    /// `looked_at` into the next point to look at. Returns whether the momentum was restarted.
    pub fn next(&mut self, looked_at: &mut Plane, stepped: &Plane) -> bool {
        let mut uphill = 0.0f64;
        let rows = looked_at
            .data()
            .chunks(4096)
            .zip(stepped.data().chunks(4096))
            .zip(self.previous.data().chunks(4096));
        for ((y, x), x_old) in rows {
            let part: f32 = y.iter().zip(x).zip(x_old).map(|((y, x), o)| (y - x) * (x - o)).sum();
            uphill += f64::from(part);
        }
        let restart = uphill > 0.0;
        let t = if restart { 1.0 } else { self.t };
        let t_next = (1.0 + (1.0 + 4.0 * t * t).sqrt()) / 2.0;
        let weight = if restart { 0.0 } else { ((t - 1.0) / t_next) as f32 };
        let targets = looked_at.data_mut().iter_mut().zip(self.previous.data_mut()).zip(stepped.data());
        for ((y, x_old), &x) in targets {
            *y = x + weight * (x - *x_old);
            *x_old = x;
        }
        self.t = t_next;
        restart
    }
}
