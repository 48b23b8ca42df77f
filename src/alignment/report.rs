//! The latest readings of a rig, as lines for a terminal.

use super::{
    Action, Advice, Aim, Brightness, FocusHistory, FocusReading, FocusTurn, PLACES, Sharpness,
};
use crate::config::RigFile;
use crate::frame::Size;

/// Number of readings from which flicker is computed.
const KEPT: usize = 200;
/// Relative change of the panel's size in the picture that makes focus figures incomparable.
const MOVED_SHARE: f64 = 0.02;

/// The latest readings of a rig.
pub struct AlignmentReport {
    panel: Size,
    sensor: Size,
    refresh_hz: f64,
    readings: u64,
    sharpness: Sharpness,
    best: Sharpness,
    best_mean: f64,
    focus: FocusTurn,
    history: FocusHistory,
    /// Light of the last [`KEPT`] readings.
    light: Vec<f64>,
    brightness: Option<Brightness>,
    /// Position of the panel: `None` if not measured, `Some(None)` if the panel was not in view.
    aim: Option<Option<Aim>>,
}

impl AlignmentReport {
    /// An empty report on `rig`.
    pub fn new(rig: &RigFile) -> AlignmentReport {
        AlignmentReport {
            panel: rig.panel.size(),
            sensor: rig.photo_grid().sensor,
            refresh_hz: rig.panel.refresh_hz,
            readings: 0,
            sharpness: Sharpness([0.0; PLACES]),
            best: Sharpness([0.0; PLACES]),
            best_mean: 0.0,
            focus: FocusTurn::PassBest,
            history: FocusHistory::default(),
            light: Vec::new(),
            brightness: None,
            aim: None,
        }
    }

    /// Adds a reading of the focus pattern.
    pub fn add_focus(&mut self, reading: &FocusReading) {
        let mean = reading.sharpness.mean();
        self.readings += 1;
        self.sharpness = reading.sharpness;
        let better = |n: usize| self.best.0[n].max(reading.sharpness.0[n]);
        self.best = Sharpness(std::array::from_fn(better));
        self.best_mean = self.best_mean.max(mean);
        self.focus = self.history.add(mean);
        if self.light.len() == KEPT {
            self.light.remove(0);
        }
        self.light.push(reading.light);
    }

    /// Adds a reading of white.
    pub fn add_brightness(&mut self, brightness: Brightness) {
        self.brightness = Some(brightness);
    }

    /// Adds a reading of the dots.
    pub fn add_aim(&mut self, aim: Option<Aim>) {
        let moved = |(before, now): (Aim, Aim)| {
            (now.magnification / before.magnification - 1.0).abs() > MOVED_SHARE
        };
        if self.aim.flatten().zip(aim).is_some_and(moved) {
            // Focus figures are no longer comparable.
            self.history = FocusHistory::default();
            (self.best, self.best_mean) = (Sharpness([0.0; PLACES]), 0.0);
            self.light.clear();
        }
        self.aim = Some(aim);
    }

    /// Advice, most urgent first, ending with the focus ring.
    pub fn advice(&self) -> Vec<Advice> {
        let mut all = Vec::new();
        match &self.aim {
            Some(Some(aim)) => all.extend(aim.advice(self.panel, self.sensor)),
            Some(None) => all.push(Advice::find()),
            None => {}
        }
        if let Some(brightness) = &self.brightness {
            let light = brightness.advice(self.refresh_hz);
            // Advice on the aim is more precise than a list of unlit places.
            let is_aimed = self.aim.flatten().is_some();
            let is_wanted = |advice: &Advice| !is_aimed || advice.action != Action::Cover;
            all.extend(light.into_iter().filter(is_wanted));
        }
        all.extend(Advice::flicker(self.flicker()));
        all.push(Advice::focus(self.focus));
        all
    }

    /// Standard deviation of the light between readings, as a share. It is computed from the median
    /// change, so that a hand in the picture does not count as flicker.
    fn flicker(&self) -> f64 {
        let change = |pair: &[f64]| (pair[1] / pair[0] - 1.0).abs();
        let mut changes: Vec<f64> = self.light.windows(2).map(change).collect();
        changes.sort_by(f64::total_cmp);
        // The median of |x| is 0.6745 σ for a normal x.
        changes.get(changes.len() / 2).map_or(0.0, |median| median / 0.6745 / 2f64.sqrt())
    }

    /// Contrast at place `n`, and its ratio to the best contrast there, both in per cent.
    fn cell(&self, n: usize) -> (f64, f64) {
        let (now, best) = (self.sharpness.0[n], self.best.0[n].max(f64::MIN_POSITIVE));
        (100.0 * now, 100.0 * now / best)
    }

    fn light_line(&self) -> Option<String> {
        let light = self.brightness.as_ref()?;
        Some(format!(
            "white {:.0} % of the range, {:.2} % saturated; exposed {:.2} ms, {:.2} refreshes; \
             flicker {:.2} %",
            100.0 * light.white,
            100.0 * light.clipped_share,
            light.exposed_ms,
            light.exposed_ms * self.refresh_hz / 1000.0,
            100.0 * self.flicker()
        ))
    }

    fn aim_lines(&self) -> Vec<String> {
        let Some(Some(aim)) = &self.aim else { return Vec::new() };
        // Avoids −0.
        let [x, y] = aim.offset_px.map(|px| px.round() + 0.0);
        let [left, right, top, bottom] = aim.reserve_px;
        let size = |larger: f64, side: &str| {
            let how = if larger < 0.0 { "farther" } else { "nearer" };
            format!("{:.2} % {how} {side}", 100.0 * larger.abs())
        };
        vec![
            format!(
                "panel {x:+.0} px right, {y:+.0} px down, {:+.1}° clockwise; {:.2} sensor px per \
                 panel px",
                aim.rotation_deg, aim.magnification
            ),
            format!(
                "{}, {}; {} than the sensor",
                size(aim.keystone[0], "on the right"),
                size(aim.keystone[1], "below"),
                if aim.magnification > 1.0 { "coarser" } else { "finer" }
            ),
            format!(
                "panel reserve: {left:.0} px left, {right:.0} right, {top:.0} above, {bottom:.0} \
                 below: {}",
                if aim.covers() { "it covers the sensor" } else { "the sensor sees past it" }
            ),
        ]
    }

    /// The report as lines for a terminal.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "focus {:5.1} %, best {:5.1} %   reading {}",
            100.0 * self.sharpness.mean(),
            100.0 * self.best_mean,
            self.readings
        )];
        for row in 0..3 {
            let cells = (0..3).map(|column| {
                let (now, of_best) = self.cell(3 * row + column);
                format!("{now:5.1} % ({of_best:3.0})")
            });
            lines.push(format!("  {}", cells.collect::<Vec<String>>().join("  ")));
        }
        lines.extend(self.light_line());
        lines.extend(self.aim_lines());
        lines.extend(self.advice().iter().map(|advice| format!("-> {advice}")));
        lines
    }
}
