//! Waiting until the rig no longer changes. A panel was measured to take 70 minutes to become
//! steady (colour work; a web source), and a lens and its mount warm up as well.

use super::pilot::{Drift, DriftLimits};

/// Pilots in a row that must agree.
const STEADY_PILOTS: usize = 3;

/// They agree when they differ by less than this share of the limits. Guess.
const STEADY_SHARE: f64 = 0.25;

/// The pilots of a warm-up.
#[derive(Debug, Clone)]
pub struct WarmUp {
    begun_s: f64,
    seen: Vec<Drift>,
}

/// Whether to wait on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Warmth {
    /// The rig still changes, or is not known not to.
    Warming,
    /// It has become steady.
    Steady,
    /// It has not, and the time given to it is over.
    OutOfTime,
}

impl WarmUp {
    /// A warm-up that begins at the monotonic time `now_s`.
    pub fn new(now_s: f64) -> WarmUp {
        WarmUp { begun_s: now_s, seen: Vec::new() }
    }

    /// Takes one pilot more, read at `now_s`.
    pub fn take(&mut self, drift: Drift, limits: &DriftLimits, now_s: f64, max_s: f64) -> Warmth {
        self.seen.push(drift);
        let last = &self.seen[self.seen.len().saturating_sub(STEADY_PILOTS)..];
        let agree = |a: &Drift| last.iter().all(|b| a.difference(b, limits) < STEADY_SHARE);
        if last.len() == STEADY_PILOTS && last.iter().all(agree) {
            Warmth::Steady
        } else if now_s - self.begun_s >= max_s {
            Warmth::OutOfTime
        } else {
            Warmth::Warming
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: DriftLimits = DriftLimits {
        shift_max_px: 0.25,
        gain_max_percent: 3.0,
        offset_max_levels: 1.0,
        noise_max_ratio: 1.5,
    };

    fn brighter_by(percent: f64) -> Drift {
        Drift { gain_percent: percent, ..Drift::default() }
    }

    #[test]
    fn a_panel_that_grows_brighter_is_waited_for() {
        let mut warm_up = WarmUp::new(0.0);
        // 8 % to come, with a time constant of ten pilots.
        let warmth = |n: i32| {
            let missing = -8.0 * (-f64::from(n) / 10.0).exp();
            warm_up.take(brighter_by(missing), &LIMITS, 30.0 * f64::from(n), 3600.0)
        };
        let all: Vec<Warmth> = (0..60).map(warmth).collect();
        let steady = all.iter().position(|w| *w == Warmth::Steady).unwrap();
        // Three pilots then differ by less than a quarter of 3 %.
        assert!((5..20).contains(&steady), "{steady}");
        assert!(all[..steady].iter().all(|w| *w == Warmth::Warming));
    }

    #[test]
    fn one_that_never_settles_is_not_waited_for_for_ever() {
        let mut warm_up = WarmUp::new(0.0);
        let mut last = Warmth::Warming;
        for n in 0..100 {
            last = warm_up.take(brighter_by(f64::from(n)), &LIMITS, 30.0 * f64::from(n), 600.0);
            assert_eq!(last, if n < 20 { Warmth::Warming } else { Warmth::OutOfTime });
        }
        assert_eq!(last, Warmth::OutOfTime);
    }
}
