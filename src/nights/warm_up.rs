//! Waiting until the rig is steady. A panel needs 70 minutes (colour work; a web source), and lens
//! and mount warm up as well.

use super::pilot::Drift;

/// Consecutive pilots that must agree.
const STEADY_PILOTS: usize = 3;

/// Largest difference between agreeing pilots, as a share of the limits. Guess.
const STEADY_SHARE: f64 = 0.25;

/// Longest warm-up, minutes. Guess.
pub const WARM_UP_MAX_MIN: f64 = 60.0;

/// The pilots of a warm-up.
#[derive(Debug, Clone)]
pub struct WarmUp {
    begun_s: f64,
    seen: Vec<Drift>,
}

/// State of a warm-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Warmth {
    /// The rig still changes, or too few pilots were shown.
    Warming,
    /// The rig is steady.
    Steady,
    /// The rig is not steady within the time allowed.
    OutOfTime,
}

impl WarmUp {
    /// A warm-up begun at the monotonic time `now_s`.
    pub fn new(now_s: f64) -> WarmUp {
        WarmUp { begun_s: now_s, seen: Vec::new() }
    }

    /// Adds the `drift` that a pilot measured at `now_s`; returns the state of the warm-up.
    pub fn add(&mut self, drift: Drift, now_s: f64) -> Warmth {
        self.seen.push(drift);
        let last = &self.seen[self.seen.len().saturating_sub(STEADY_PILOTS)..];
        let agree = |a: &Drift| last.iter().all(|b| a.difference(b) < STEADY_SHARE);
        if last.len() == STEADY_PILOTS && last.iter().all(agree) {
            Warmth::Steady
        } else if now_s - self.begun_s >= 60.0 * WARM_UP_MAX_MIN {
            Warmth::OutOfTime
        } else {
            Warmth::Warming
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brighter_by(percent: f64) -> Drift {
        Drift { gain_percent: percent, ..Drift::default() }
    }

    #[test]
    fn a_panel_that_grows_brighter_is_warming() {
        let mut warm_up = WarmUp::new(0.0);
        // 8 % below its final brightness, with a time constant of ten pilots.
        let warmth = |n: i32| {
            let missing = -8.0 * (-f64::from(n) / 10.0).exp();
            warm_up.add(brighter_by(missing), 30.0 * f64::from(n))
        };
        let all: Vec<Warmth> = (0..60).map(warmth).collect();
        let steady = all.iter().position(|w| *w == Warmth::Steady).unwrap();
        // Three pilots then differ by less than a quarter of 3 %.
        assert!((5..20).contains(&steady), "{steady}");
        assert!(all[..steady].iter().all(|w| *w == Warmth::Warming));
    }

    #[test]
    fn a_panel_that_never_settles_runs_out_of_time() {
        let mut warm_up = WarmUp::new(0.0);
        let mut last = Warmth::Warming;
        for n in 0..100 {
            last = warm_up.add(brighter_by(f64::from(n)), 180.0 * f64::from(n));
            assert_eq!(last, if n < 20 { Warmth::Warming } else { Warmth::OutOfTime });
        }
        assert_eq!(last, Warmth::OutOfTime);
    }
}
