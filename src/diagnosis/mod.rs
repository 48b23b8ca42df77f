//! Measurement of a rig's timing by black–white trials, for `relens check`.
//!
//! Exposures begin at set delays after a flip; the share of the new picture in each shows when the
//! panel began to change and when it settled. (Psychtoolbox's VideoCaptureLatencyTest does the same
//! with ten trials.)

mod range;

use std::fmt;
use std::ops::Range;

pub use self::range::{MeasuredRange, measure_range};
use crate::config::RigFile;
use crate::frame::{Channel, Codes, Plane};
use crate::rig::exposure::Devices;
use crate::rig::{Exposed, Moment, RigError};

/// Least white over the largest count; below it three of the sensor's bits are lost. Guess.
const WHITE_MIN: f64 = 0.125;
/// Number of trials at one delay, to measure the jitter.
const TRIALS: usize = 10;
/// Longest delay tried after a flip, in refreshes; the step is half a refresh.
const REFRESHES_MAX: usize = 16;
/// Least share of white that counts as a change; a backlight's flicker is less.
const SHARE_MIN: f64 = 0.01;
/// Largest residual share of white in a settled black frame: half a grey level of 255. A camera's
/// noise on a mean is far less.
const RESIDUAL_MAX: f64 = 0.002;
/// Number of bands of rows measured, since panel and sensor are scanned from top to bottom.
const BANDS: usize = 5;
/// Least light of a band that counts as seeing the panel, relative to the brightest band. Guess.
const LIT_SHARE: f64 = 0.2;
/// Consecutive settled delays that end the trials: two refreshes, for a slow second change.
const SETTLED_POINTS: usize = 5;
/// `rig` with a settle time long enough to measure black and white, since its own may be too short.
pub fn patient(rig: &RigFile) -> RigFile {
    let mut rig = rig.clone();
    let longest_ms = REFRESHES_MAX as f64 * 1e3 / rig.panel.refresh_hz;
    rig.panel.settle_ms = rig.panel.settle_ms.max(longest_ms);
    rig
}

/// Measured timing of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredTiming {
    /// Time from the flip to the first change on the panel.
    pub latency_ms: f64,
    /// Standard deviation of the latency over the trials.
    pub jitter_ms: f64,
    /// Time from the flip to a settled picture; infinite if the panel did not settle.
    pub settle_ms: f64,
    /// Refresh interval of the rig file.
    pub interval_ms: f64,
    /// Settle time of the rig file.
    pub file_settle_ms: f64,
    /// Level of white as a share of the largest count, 0..1.
    pub white_share: f64,
}

/// Measures the timing of `rig`, the devices opened for [`patient`]`(file)`.
///
/// # Errors
/// When a device fails, or black and white can hardly be distinguished.
pub fn measure(rig: &mut Devices, file: &RigFile) -> Result<MeasuredTiming, RigError> {
    let interval_ms = 1e3 / file.panel.refresh_hz;
    let (file_settle_ms, long_ms) = (file.panel.settle_ms, rig.timing.settle_ms);
    let ends = Ends { black: after(rig, 0, long_ms)?, white: after(rig, 255, long_ms)? };
    let (black, white) = (ends.black[BANDS / 2], ends.white[BANDS / 2]);
    if white < black * 1.5 + 1.0 {
        return Err(RigError::NoMarks {
            what: format!(
                "black gives {black:.1} counts and white {white:.1}; is the panel in view and lit?"
            ),
        });
    }
    let mut curve: Vec<BothFlips> = Vec::new();
    for half in 0..=2 * REFRESHES_MAX {
        curve.push(trial(rig, half as f64 * interval_ms / 2.0, &ends)?);
        if curve.iter().rev().take_while(|trial| trial.is_settled()).count() >= SETTLED_POINTS {
            break;
        }
    }
    let white_share = white / f64::from(file.camera.count_max());
    let settled = curve.iter().rev().take_while(|trial| trial.is_settled()).last();
    let settle_ms = settled.map_or(f64::INFINITY, |trial| trial.delay_ms);
    let exposure_ms = rig.timing.exposure_ms;
    let begun = curve.iter().find(|trial| trial.middle() > SHARE_MIN);
    let begun = begun.map_or(0.0, |trial| trial.delay_ms);
    let mut latencies = Vec::new();
    for _ in 0..TRIALS {
        // The share of white is the part of the exposure that follows the change.
        let share = white_at(rig, begun, &ends)?[BANDS / 2].unwrap_or(0.0);
        latencies.push((begun + exposure_ms * (1.0 - share)).max(0.0));
    }
    let latency_ms = latencies.iter().sum::<f64>() / TRIALS as f64;
    let spread =
        latencies.iter().map(|l| (l - latency_ms).powi(2)).sum::<f64>() / (TRIALS - 1) as f64;
    Ok(MeasuredTiming {
        latency_ms,
        jitter_ms: spread.sqrt(),
        settle_ms,
        interval_ms,
        file_settle_ms,
        white_share,
    })
}

/// Mean green counts of the bands from top to bottom, over the middle quarter of the columns.
type Levels = [f64; BANDS];

struct Ends {
    black: Levels,
    white: Levels,
}

impl Ends {
    /// Shares of white in `levels`; `None` for the bands that do not see the panel.
    fn shares(&self, levels: &Levels) -> [Option<f64>; BANDS] {
        let light = |n: usize| self.white[n] - self.black[n];
        let brightest = (0..BANDS).map(light).fold(0.0, f64::max);
        std::array::from_fn(|n| {
            let is_lit = light(n) >= LIT_SHARE * brightest;
            is_lit.then(|| (levels[n] - self.black[n]) / light(n))
        })
    }
}

/// Shares of white in exposures begun `delay_ms` after a flip.
struct BothFlips {
    delay_ms: f64,
    /// Shares of white after the flip from black to white.
    white: [Option<f64>; BANDS],
    /// Shares of white after the flip from white to black.
    residual: [Option<f64>; BANDS],
}

impl BothFlips {
    fn middle(&self) -> f64 {
        self.white[BANDS / 2].unwrap_or(0.0)
    }

    /// Whether no trace of the old picture remains.
    fn is_settled(&self) -> bool {
        self.white.iter().flatten().all(|share| (share - 1.0).abs() < SHARE_MIN)
            && self.residual.iter().flatten().all(|share| share.abs() < RESIDUAL_MAX)
    }
}

/// Levels in an exposure begun `settle_ms` after showing `code`.
fn after(rig: &mut Devices, code: u8, settle_ms: f64) -> Result<Levels, RigError> {
    let codes = Codes::filled(rig.panel.size(), code);
    let flip = rig.panel.show(&codes)?;
    levels_at(rig, Moment(flip.at.0 + settle_ms / 1e3))
}

/// Levels in an exposure begun at `moment`, or in a later one if that frame is lost.
fn levels_at(rig: &mut Devices, moment: Moment) -> Result<Levels, RigError> {
    let exposed = exposed_at(rig, moment)?;
    let plane = exposed.counts.plane(Channel::Green);
    let (width, height) = (plane.width(), plane.height());
    Ok(std::array::from_fn(|band| {
        let rows = band * height / BANDS..(band + 1) * height / BANDS;
        mean(plane, rows, width * 3 / 8..width * 5 / 8)
    }))
}

/// Mean of a rectangle.
fn mean(plane: &Plane<u16>, rows: Range<usize>, columns: Range<usize>) -> f64 {
    let counts = rows.flat_map(|y| &plane.row(y)[columns.clone()]);
    let (sum, count) =
        counts.fold((0.0, 0.0), |(sum, count), &v| (sum + f64::from(v), count + 1.0));
    sum / f64::max(count, 1.0)
}

/// The exposure begun at `moment`, or a later one if its frame is lost.
fn exposed_at(rig: &mut Devices, moment: Moment) -> Result<Exposed, RigError> {
    rig.clock.wait_until(moment);
    let fired = rig.pulse()?;
    let deadline = Moment(fired.0 + rig.timing.deadline_ms / 1e3);
    loop {
        let exposed = rig.camera.frame(deadline)?;
        if exposed.at >= fired {
            return Ok(exposed);
        }
    }
}

/// Shares of white in an exposure begun `delay_ms` after the flip from black to white.
fn white_at(
    rig: &mut Devices,
    delay_ms: f64,
    ends: &Ends,
) -> Result<[Option<f64>; BANDS], RigError> {
    let flip = rig.panel.show(&Codes::filled(rig.panel.size(), 0))?;
    rig.clock.wait_until(Moment(flip.at.0 + rig.timing.settle_ms / 1e3));
    Ok(ends.shares(&after(rig, 255, delay_ms)?))
}

/// Measures the shares of white `delay_ms` after each of the two flips.
fn trial(rig: &mut Devices, delay_ms: f64, ends: &Ends) -> Result<BothFlips, RigError> {
    let white = white_at(rig, delay_ms, ends)?;
    rig.clock.wait_until(Moment(rig.clock.now().0 + rig.timing.settle_ms / 1e3));
    let residual = ends.shares(&after(rig, 0, delay_ms)?);
    Ok(BothFlips { delay_ms, white, residual })
}

impl MeasuredTiming {
    /// The settle time for the rig file: half a refresh, the trials' step, above the measured one.
    pub fn settle_to_write_ms(&self) -> f64 {
        (self.settle_ms + self.interval_ms / 2.0).ceil()
    }

    /// The faults found, one sentence each, with their remedies.
    pub fn faults(&self) -> Vec<String> {
        let mut all = Vec::new();
        if !self.settle_ms.is_finite() {
            all.push(format!(
                "the panel did not settle within {REFRESHES_MAX} refreshes: switch its picture \
                 processing off (game or PC mode)"
            ));
        } else if self.settle_ms > self.file_settle_ms {
            all.push(format!(
                "panel.settle-ms = {:.0} is too short: set it to {:.0}",
                self.file_settle_ms,
                self.settle_to_write_ms()
            ));
        }
        if self.white_share < WHITE_MIN {
            all.push(format!(
                "white reaches {:.1} % of the largest count, allowed {:.0} or more: camera.bits \
                 may exceed the sensor's, the exposure may be too short, or the aperture too small",
                100.0 * self.white_share,
                100.0 * WHITE_MIN
            ));
        }
        if self.jitter_ms > self.interval_ms / 2.0 {
            all.push(
                "the panel's delay varies by more than half a refresh: switch its picture \
             processing and variable refresh off"
                    .to_owned(),
            );
        }
        all
    }
}

impl fmt::Display for MeasuredTiming {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let refreshes = |ms: f64| ms / self.interval_ms;
        writeln!(f, "{:<28}{:>10}{:>12}", "timing", "ms", "refreshes")?;
        let mut line =
            |what: &str, ms: f64| writeln!(f, "{what:<28}{ms:>10.1}{:>12.2}", refreshes(ms));
        line("flip to first change", self.latency_ms)?;
        line("  its jitter (σ)", self.jitter_ms)?;
        line("flip to settled picture", self.settle_ms)?;
        line("settle time in the rig file", self.file_settle_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config, rig};

    #[test]
    #[ignore = "a minute: the gate runs it"]
    fn the_simulated_panel_s_timing_is_measured() {
        let text = include_str!("../../rig-config/small.toml");
        let text = text.replacen(
            "margin-px = 8",
            "margin-px = 8\n\n[marks]\nfrom-edge-px = 1\nheight-px = 4",
            1,
        );
        let config = config::parse(&text, "small.toml").unwrap_or_else(|e| panic!("{e}"));
        let mut devices = rig::open(&patient(&config)).unwrap_or_else(|e| panic!("{e}"));
        let timing = measure(&mut devices, &config).unwrap_or_else(|e| panic!("{e}"));
        // Two refreshes of latency, then an exponential approach of 5 ms. The linear estimate
        // counts the response time as latency.
        assert!((33.0..=40.0).contains(&timing.latency_ms), "{timing}");
        assert!((50.0..=90.0).contains(&timing.settle_ms), "{timing}");
        assert!(timing.jitter_ms < 1.0, "{timing}");
        assert!(timing.faults().is_empty(), "{:?}", timing.faults());
        // The settle time is measured, and the fault reported, even if the file's is far too short.
        let mut hasty = config.clone();
        hasty.panel.settle_ms = 10.0;
        let mut devices = rig::open(&patient(&hasty)).unwrap_or_else(|e| panic!("{e}"));
        let again = measure(&mut devices, &hasty).unwrap_or_else(|e| panic!("{e}"));
        assert!((again.settle_ms - timing.settle_ms).abs() < timing.interval_ms, "{again}");
        let faults = again.faults();
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert!(faults[0].contains("panel.settle-ms = 10 is too short: set it to"), "{faults:?}");
    }

    #[test]
    fn more_bits_than_the_sensor_has_are_a_fault() {
        let timing = MeasuredTiming {
            latency_ms: 30.0,
            jitter_ms: 0.1,
            settle_ms: 50.0,
            interval_ms: 16.7,
            file_settle_ms: 100.0,
            // Counts of a ten-bit sensor, taken for sixteen bits.
            white_share: 1.0 / 64.0,
        };
        let faults = timing.faults();
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert!(faults[0].contains("camera.bits may exceed"), "{faults:?}");
        assert!(MeasuredTiming { white_share: 0.8, ..timing }.faults().is_empty());
    }
}
