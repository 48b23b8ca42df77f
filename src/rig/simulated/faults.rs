//! Faults of exposures, drawn from seed and exposure number.

use rand::RngExt;

use super::sensor::{Stream, random};
use crate::config::Faults;

/// Fault of an exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fault {
    /// No fault.
    None,
    /// The frame shows the previous picture.
    Stale,
    /// The last frame is delivered again, with its number.
    Duplicate,
    /// No frame arrives.
    Missing,
    /// Rows above this share of the height show the previous picture.
    Mixed(f64),
    /// The camera disconnects.
    Unplugged,
}

/// Draws the fault of exposure `number`.
pub(super) fn draw(faults: &Faults, seed: u64, number: u64) -> Fault {
    let mut random = random(seed, Stream::Fault, number, 0);
    let (mut lot, height): (f64, f64) = (random.random(), random.random());
    let each = [
        (faults.stale, Fault::Stale),
        (faults.duplicate, Fault::Duplicate),
        (faults.missing, Fault::Missing),
        (faults.mixed, Fault::Mixed(height)),
        (faults.unplugged, Fault::Unplugged),
    ];
    for (probability, fault) in each {
        if lot < probability {
            return fault;
        }
        lot -= probability;
    }
    Fault::None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_have_their_probabilities_and_are_reproducible() {
        let faults = Faults {
            stale: 0.1,
            duplicate: 0.0,
            missing: 0.2,
            mixed: 0.3,
            unplugged: 0.0,
            unplugged_ms: 1.0,
        };
        let drawn: Vec<Fault> = (0..10_000).map(|n| draw(&faults, 5, n)).collect();
        let share =
            |test: fn(&Fault) -> bool| drawn.iter().filter(|f| test(f)).count() as f64 / 1e4;
        assert!((share(|f| *f == Fault::Stale) - 0.1).abs() < 0.015);
        assert!((share(|f| *f == Fault::Missing) - 0.2).abs() < 0.02);
        assert!((share(|f| matches!(f, Fault::Mixed(_))) - 0.3).abs() < 0.02);
        assert!((share(|f| *f == Fault::None) - 0.4).abs() < 0.02);
        assert!(drawn.iter().enumerate().all(|(n, f)| *f == draw(&faults, 5, n as u64)));
    }
}
