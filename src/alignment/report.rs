//! The latest readings of a rig, as lines for a terminal and as a page with a picture.

use std::fmt::Write;

use super::{
    Action, Advice, Aim, Brightness, FocusHistory, FocusReading, FocusTurn, PLACES, Sharpness,
};
use crate::config::RigFile;
use crate::frame::{Frame, Plane, Size, Work};

/// Readings that flicker and rate are computed from.
const KEPT: usize = 200;
/// Change of the panel's size in the picture that makes focus figures incomparable.
const MOVED_SHARE: f64 = 0.02;
/// Largest width of the page's picture.
const PICTURE_PX: usize = 640;

/// The light of one reading.
struct LightSample {
    light: f64,
    at_s: f64,
}

/// The latest readings of a rig.
pub struct AlignmentReport {
    name: String,
    panel: Size,
    sensor: Size,
    refresh_hz: f64,
    /// Sensor pixels from the lens to its image, if known.
    image_distance_px: Option<f64>,
    readings: u64,
    sharpness: Sharpness,
    best: Sharpness,
    best_mean: f64,
    focus: FocusTurn,
    history: FocusHistory,
    /// The last [`KEPT`] readings.
    light: Vec<LightSample>,
    brightness: Option<Brightness>,
    aim: Option<Aim>,
    seen: Option<Plane>,
}

impl AlignmentReport {
    /// An empty report. The lens's image lies `image_distance_px` sensor pixels behind it, if
    /// known.
    pub fn new(rig: &RigFile, image_distance_px: Option<f64>) -> AlignmentReport {
        AlignmentReport {
            name: rig.name.clone(),
            panel: rig.panel.size(),
            sensor: rig.photo_grid().sensor,
            refresh_hz: rig.panel.refresh_hz,
            image_distance_px,
            readings: 0,
            sharpness: Sharpness([0.0; PLACES]),
            best: Sharpness([0.0; PLACES]),
            best_mean: 0.0,
            focus: FocusTurn::PassBest,
            history: FocusHistory::default(),
            light: Vec::new(),
            brightness: None,
            aim: None,
            seen: None,
        }
    }

    /// Adds a reading of the focus pattern, at `now_s` on the rig's clock.
    pub fn add_focus(&mut self, reading: &FocusReading, now_s: f64) {
        let mean = reading.sharpness.mean();
        self.readings += 1;
        self.sharpness = reading.sharpness;
        self.best = self.best.or_better(&reading.sharpness);
        self.best_mean = self.best_mean.max(mean);
        self.focus = self.history.add(mean);
        if self.light.len() == KEPT {
            self.light.remove(0);
        }
        self.light.push(LightSample { light: reading.light, at_s: now_s });
    }

    /// Adds a reading of white.
    pub fn add_brightness(&mut self, brightness: Brightness) {
        self.brightness = Some(brightness);
    }

    /// Adds a reading of the dots and the captured light.
    pub fn add_aim(&mut self, aim: Option<Aim>, seen: Plane) {
        let moved = |(before, now): (Aim, Aim)| {
            (now.magnification / before.magnification - 1.0).abs() > MOVED_SHARE
        };
        if self.aim.zip(aim).is_some_and(moved) {
            self.forget_focus();
        }
        (self.aim, self.seen) = (aim, Some(seen));
    }

    /// Drops focus figures that are no longer comparable.
    fn forget_focus(&mut self) {
        self.history = FocusHistory::default();
        (self.best, self.best_mean) = (Sharpness([0.0; PLACES]), 0.0);
        self.light.clear();
    }

    /// Advice, most urgent first, ending with the focus ring.
    pub fn advice(&self) -> Vec<Advice> {
        let mut all = Vec::new();
        match (&self.aim, &self.seen) {
            (Some(aim), _) => all.extend(aim.advice(self.panel, self.sensor)),
            (None, Some(_)) => all.push(Advice::find()),
            (None, None) => {}
        }
        if let Some(brightness) = &self.brightness {
            let light = brightness.advice(self.refresh_hz);
            // Advice on the aim is more precise than a list of unlit places.
            let is_wanted = |advice: &Advice| self.aim.is_none() || advice.action != Action::Cover;
            all.extend(light.into_iter().filter(is_wanted));
        }
        all.extend(Advice::flicker(self.flicker()));
        all.push(Advice::focus(self.focus));
        all
    }

    /// Standard deviation of the light between readings, as a share, from the median change:
    /// a hand in the picture is no flicker.
    fn flicker(&self) -> f64 {
        let change = |pair: &[LightSample]| (pair[1].light / pair[0].light - 1.0).abs();
        let mut changes: Vec<f64> = self.light.windows(2).map(change).collect();
        changes.sort_by(f64::total_cmp);
        // The median of |x| is 0.6745 σ for a normal x.
        changes.get(changes.len() / 2).map_or(0.0, |median| median / 0.6745 / 2f64.sqrt())
    }

    /// Readings per second on the rig's clock.
    pub fn rate(&self) -> f64 {
        match (self.light.first(), self.light.last()) {
            (Some(first), Some(last)) if last.at_s > first.at_s => {
                (self.light.len() - 1) as f64 / (last.at_s - first.at_s)
            }
            _ => 0.0,
        }
    }

    /// Contrast of place `n`, per cent, and the same relative to its best, per cent.
    fn cell(&self, n: usize) -> (f64, f64) {
        let (now, best) = (self.sharpness.0[n], self.best.0[n].max(f64::MIN_POSITIVE));
        (100.0 * now, 100.0 * now / best)
    }

    /// The line on light, if measured.
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

    /// The lines on the panel's position, if measured.
    fn aim_lines(&self) -> Vec<String> {
        let Some(aim) = &self.aim else { return Vec::new() };
        // Avoids −0.
        let [x, y] = aim.offset_px.map(|px| px.round() + 0.0);
        let [left, right, top, bottom] = aim.reserve_px;
        let size = |larger: f64, side: &str, degrees: Option<f64>| {
            let tilt = degrees.map_or(String::new(), |deg| format!(" (tilt {:.1}°)", deg.abs()));
            let how = if larger < 0.0 { "farther" } else { "nearer" };
            format!("{:.2} % {how} {side}{tilt}", 100.0 * larger.abs())
        };
        let tilt = self.image_distance_px.map(|distance| aim.tilt_deg(distance, self.sensor));
        vec![
            format!(
                "panel {x:+.0} px right, {y:+.0} px down, {:+.1}° clockwise; {:.2} sensor px per \
                 panel px",
                aim.rotation_deg, aim.magnification
            ),
            format!(
                "{}, {}; {} than the sensor",
                size(aim.keystone[0], "on the right", tilt.map(|tilt| tilt[0])),
                size(aim.keystone[1], "below", tilt.map(|tilt| tilt[1])),
                if aim.magnification > 1.0 { "coarser" } else { "finer" }
            ),
            format!(
                "panel reserve: {left:.0} px left, {right:.0} right, {top:.0} above, {bottom:.0} \
                 below: {}",
                if aim.covers() { "it covers the sensor" } else { "the sensor sees past it" }
            ),
        ]
    }

    /// The lines on light and position.
    fn measurements(&self) -> Vec<String> {
        let mut lines: Vec<String> = self.light_line().into_iter().collect();
        if let Some(light) = &self.brightness {
            lines.push(format!("histogram of white |{}|", light.histogram.line()));
        }
        lines.extend(self.aim_lines());
        lines
    }

    /// The report as lines for a terminal.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "focus {:5.1} %, best {:5.1} %   reading {}, {:.1} per second",
            100.0 * self.sharpness.mean(),
            100.0 * self.best_mean,
            self.readings,
            self.rate()
        )];
        for row in 0..3 {
            let cells = (0..3).map(|column| {
                let (now, of_best) = self.cell(3 * row + column);
                format!("{now:5.1} % ({of_best:3.0})")
            });
            lines.push(format!("  {}", cells.collect::<Vec<String>>().join("  ")));
        }
        lines.extend(self.measurements());
        lines.extend(self.advice().iter().map(|advice| format!("-> {advice}")));
        lines
    }

    /// The captured dots for the page: grey, linear light 0..255; `None` before the first reading.
    pub fn picture(&self) -> Option<Frame<Work>> {
        let seen = self.seen.as_ref()?;
        let every = seen.width().div_ceil(PICTURE_PX).max(1);
        let size = Size::new(seen.width() / every, seen.height() / every);
        let most = seen.data().iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let plane = Plane::from_fn(size, |x, y| {
            let mut sum = 0.0;
            for row in 0..every {
                sum += seen.row(y * every + row)[x * every..][..every].iter().sum::<f32>();
            }
            (255.0 * sum / (every * every) as f32 / most).clamp(0.0, 255.0)
        });
        Some(Frame::from_fn(|_| plane.clone()))
    }

    /// The report as an HTML page that reloads itself every second; `picture` is the picture's URL.
    pub fn page(&self, picture: &str) -> String {
        let mut page = String::from(HEAD);
        let _ = write!(
            page,
            "<h1>{}</h1>\n<p class=\"figure\">focus {:.1} % <small>best {:.1} %</small></p>\n",
            escape(&self.name),
            100.0 * self.sharpness.mean(),
            100.0 * self.best_mean
        );
        self.write_places(&mut page, picture);
        let advice: Vec<String> = self.advice().iter().map(Advice::to_string).collect();
        let _ = write!(
            page,
            "<ol>\n<li>{}</li>\n</ol>\n<p>{}</p>\n<p><small>reading {}, {:.1} per second; updated \
             while relens align runs</small></p>\n</body></html>\n",
            escape(&advice.join("\n")).replace('\n', "</li>\n<li>"),
            escape(&self.measurements().join("\n")).replace('\n', "</p>\n<p>"),
            self.readings,
            self.rate()
        );
        page
    }

    /// The picture with the sharpness of each place drawn over it.
    fn write_places(&self, page: &mut String, picture: &str) {
        let (width, height) = (self.sensor.width, self.sensor.height);
        let _ = writeln!(
            page,
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"Camera picture with \
             sharpness at nine places\"><image href=\"{picture}?{}\" width=\"{width}\" \
             height=\"{height}\" preserveAspectRatio=\"none\"/>",
            self.readings
        );
        let (cell_width, cell_height) = (width as f64 / 3.0, height as f64 / 3.0);
        let letters = cell_height / 5.0;
        for n in 0..PLACES {
            let (now, of_best) = self.cell(n);
            let (x, y) = ((n % 3) as f64 * cell_width, (n / 3) as f64 * cell_height);
            let (middle, centre) = (x + 0.5 * cell_width, y + 0.5 * cell_height);
            let _ = writeln!(
                page,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{cell_width:.1}\" \
                 height=\"{cell_height:.1}\"/><text x=\"{middle:.1}\" y=\"{centre:.1}\" \
                 font-size=\"{letters:.1}\">{now:.1} %</text><text x=\"{middle:.1}\" \
                 y=\"{:.1}\" font-size=\"{:.1}\">{of_best:.0} of 100</text>",
                centre + letters,
                0.7 * letters
            );
        }
        page.push_str("</svg>\n");
    }
}

const HEAD: &str = "<!doctype html>
<html lang=\"en\"><head><meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<meta http-equiv=\"refresh\" content=\"1\">
<title>relens align</title>
<style>
:root { color-scheme: light dark; font: 16px/1.4 system-ui, sans-serif; }
body { max-width: 44rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1rem; margin: 0; }
.figure { font-size: 3rem; margin: .2rem 0; }
.figure small { font-size: 1.2rem; }
svg { width: 100%; height: auto; background: #000; }
svg rect { fill: none; stroke: #6c6; stroke-width: .3%; }
svg text { fill: #fff; stroke: #000; stroke-width: .15em; paint-order: stroke; \
text-anchor: middle; }
ol { font-size: 1.2rem; padding-left: 1.5rem; }
p { margin: .3rem 0; }
</style></head><body>
";

/// `text` with HTML's special characters escaped.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
