//! Everything that was seen of a rig last, as lines for a terminal and as a page with a picture.

use std::fmt::Write;

use super::{
    Adjustment, Aim, Brightness, FocusHistory, FocusLook, FocusTurn, PLACES, Sharpness, flickers,
};
use crate::config::RigFile;
use crate::frame::{Frame, Plane, Size, Work};

/// Looks over which flicker and the rate are counted.
const KEPT: usize = 200;
/// A panel seen this much larger or smaller was moved: figures of focus are no longer comparable.
const MOVED_SHARE: f64 = 0.02;
/// Widest that the page's picture is.
const PICTURE_PX: usize = 640;

/// The last of everything.
pub struct AlignmentReport {
    name: String,
    panel: Size,
    sensor: Size,
    refresh_hz: f64,
    /// Sensor pixels from the lens to its image, where that is known.
    image_distance_px: Option<f64>,
    looks: u64,
    sharpness: Sharpness,
    best: Sharpness,
    best_mean: f64,
    focus: Adjustment,
    history: FocusHistory,
    /// Light of the last looks, and when they were.
    light: Vec<(f64, f64)>,
    brightness: Option<Brightness>,
    aim: Option<Aim>,
    seen: Option<Plane>,
}

impl AlignmentReport {
    /// Of a rig nobody has looked at yet. The lens's image lies `image_distance_px` sensor pixels
    /// behind it, if that is known.
    pub fn new(rig: &RigFile, image_distance_px: Option<f64>) -> AlignmentReport {
        AlignmentReport {
            name: rig.name.clone(),
            panel: rig.panel.size(),
            sensor: rig.photo_grid().sensor,
            refresh_hz: rig.panel.refresh_hz,
            image_distance_px,
            looks: 0,
            sharpness: Sharpness([0.0; PLACES]),
            best: Sharpness([0.0; PLACES]),
            best_mean: 0.0,
            focus: Adjustment::Focus(FocusTurn::PastTheBest),
            history: FocusHistory::default(),
            light: Vec::new(),
            brightness: None,
            aim: None,
            seen: None,
        }
    }

    /// One more look, at `now_s` of the rig's clock.
    pub fn looked(&mut self, look: &FocusLook, now_s: f64) {
        self.looks += 1;
        self.sharpness = look.sharpness;
        self.best = self.best.or_better(&look.sharpness);
        self.best_mean = self.best_mean.max(look.sharpness.mean());
        self.focus = self.history.turned(look.sharpness.mean());
        if self.light.len() == KEPT {
            self.light.remove(0);
        }
        self.light.push((look.light, now_s));
    }

    /// One more look at white.
    pub fn lit(&mut self, brightness: Brightness) {
        self.brightness = Some(brightness);
    }

    /// One more look at the dots, and what the camera saw.
    pub fn aimed(&mut self, aim: Option<Aim>, seen: Plane) {
        let moved = |(before, now): (Aim, Aim)| {
            (now.magnification / before.magnification - 1.0).abs() > MOVED_SHARE
        };
        if self.aim.zip(aim).is_some_and(moved) {
            self.forget_focus();
        }
        (self.aim, self.seen) = (aim, Some(seen));
    }

    /// Figures from before are no longer comparable.
    fn forget_focus(&mut self) {
        self.history = FocusHistory::default();
        (self.best, self.best_mean) = (Sharpness([0.0; PLACES]), 0.0);
        self.light.clear();
    }

    /// What to do, most urgent first: nothing but "this is the best" where all is well.
    pub fn adjustments(&self) -> Vec<Adjustment> {
        let mut all = Vec::new();
        match (&self.aim, &self.seen) {
            (Some(aim), _) => all.extend(aim.adjustments(self.panel, self.sensor)),
            (None, Some(_)) => all.push(Adjustment::Find),
            (None, None) => {}
        }
        if let Some(brightness) = &self.brightness {
            let light = brightness.adjustments(self.refresh_hz);
            // Where the panel lies says more than where no light comes from.
            let known = self.aim.is_some();
            all.extend(light.into_iter().filter(|a| !(known && matches!(a, Adjustment::Light(_)))));
        }
        all.extend(flickers(self.flicker()));
        all.push(self.focus.clone());
        all
    }

    /// Change of the light from one look to the next, as a share of it. The median's: a hand that
    /// turns something is no flicker.
    fn flicker(&self) -> f64 {
        let changed = |pair: &[(f64, f64)]| (pair[1].0 / pair[0].0 - 1.0).abs();
        let mut changes: Vec<f64> = self.light.windows(2).map(changed).collect();
        changes.sort_by(f64::total_cmp);
        // The median of a bell's absolute values is 0.6745 of its standard deviation.
        changes.get(changes.len() / 2).map_or(0.0, |median| median / 0.6745 / 2f64.sqrt())
    }

    /// Looks a second on the rig's clock.
    pub fn looks_a_second(&self) -> f64 {
        match (self.light.first(), self.light.last()) {
            (Some(first), Some(last)) if last.1 > first.1 => {
                (self.light.len() - 1) as f64 / (last.1 - first.1)
            }
            _ => 0.0,
        }
    }

    /// Nine places: contrast in per cent, and how much of the best that is.
    fn cell(&self, n: usize) -> (f64, f64) {
        let (now, best) = (self.sharpness.0[n], self.best.0[n].max(f64::MIN_POSITIVE));
        (100.0 * now, 100.0 * now / best)
    }

    /// The line on light, if it was looked at.
    fn light_line(&self) -> Option<String> {
        let light = self.brightness.as_ref()?;
        Some(format!(
            "white {:.0} % of the range, {:.2} % full; exposed {:.2} ms, {:.2} refreshes; flicker \
             {:.2} %",
            100.0 * light.white,
            100.0 * light.clipped_share,
            light.exposed_ms,
            light.exposed_ms * self.refresh_hz / 1000.0,
            100.0 * self.flicker()
        ))
    }

    /// The lines on where the panel is, if it was looked for.
    fn aim_lines(&self) -> Vec<String> {
        let Some(aim) = &self.aim else { return Vec::new() };
        // Without a sign before a zero.
        let [x, y] = aim.offset_px.map(|px| px.round() + 0.0);
        let [left, right, top, bottom] = aim.spare_px;
        let size = |larger: f64, side: &str, degrees: Option<f64>| {
            let tilt = degrees.map_or(String::new(), |deg| format!(" (tilt {:.1}°)", deg.abs()));
            let how = if larger < 0.0 { "farther" } else { "nearer" };
            format!("{:.2} % {how} {side}{tilt}", 100.0 * larger.abs())
        };
        let tilt = self.image_distance_px.map(|distance| aim.tilt_deg(distance, self.sensor));
        vec![
            format!(
                "panel {x:+.0} px right, {y:+.0} px down, {:+.1}° clockwise; {:.2} sensor px a \
                 panel px",
                aim.turned_deg, aim.magnification
            ),
            format!(
                "{}, {}; {} than the sensor",
                size(aim.keystone[0], "on the right", tilt.map(|tilt| tilt[0])),
                size(aim.keystone[1], "below", tilt.map(|tilt| tilt[1])),
                if aim.magnification > 1.0 { "coarser" } else { "finer" }
            ),
            format!(
                "panel px to spare: {left:.0} left, {right:.0} right, {top:.0} above, {bottom:.0} \
                 below: {}",
                if aim.covers() { "it covers the sensor" } else { "the sensor sees past it" }
            ),
        ]
    }

    /// Lines for a terminal.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "focus {:5.1} %, best {:5.1} %   look {}, {:.1} a second",
            100.0 * self.sharpness.mean(),
            100.0 * self.best_mean,
            self.looks,
            self.looks_a_second()
        )];
        for row in 0..3 {
            let cells = (0..3).map(|column| {
                let (now, of_best) = self.cell(3 * row + column);
                format!("{now:5.1} % ({of_best:3.0})")
            });
            lines.push(format!("  {}", cells.collect::<Vec<String>>().join("  ")));
        }
        lines.extend(self.light_line());
        if let Some(light) = &self.brightness {
            lines.push(format!("white's histogram |{}|", light.histogram.line()));
        }
        lines.extend(self.aim_lines());
        lines.extend(self.adjustments().iter().map(|todo| format!("-> {todo}")));
        lines
    }

    /// What the camera saw of the dots, for the page: grey, linear light 0..255; `None` before the
    /// first look.
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

    /// A page of it, which loads itself anew each second, with the picture `picture` beside it.
    pub fn page(&self, picture: &str) -> String {
        let mut page = String::from(HEAD);
        let (width, height) = (self.sensor.width, self.sensor.height);
        let _ = write!(
            page,
            "<h1>{}</h1>\n<p class=\"figure\">focus {:.1} % <small>best {:.1} %</small></p>\n\
             <svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"What the camera sees, \
             and how sharp at nine places\"><image href=\"{picture}?{}\" width=\"{width}\" \
             height=\"{height}\" preserveAspectRatio=\"none\"/>\n",
            escaped(&self.name),
            100.0 * self.sharpness.mean(),
            100.0 * self.best_mean,
            self.looks
        );
        let (cell_width, cell_height) = (width as f64 / 3.0, height as f64 / 3.0);
        let letters = cell_height / 5.0;
        for n in 0..PLACES {
            let (now, of_best) = self.cell(n);
            let (x, y) = ((n % 3) as f64 * cell_width, (n / 3) as f64 * cell_height);
            let _ = writeln!(
                page,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{cell_width:.1}\" \
                 height=\"{cell_height:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\" \
                 font-size=\"{letters:.1}\">{now:.1} %</text><text x=\"{:.1}\" y=\"{:.1}\" \
                 font-size=\"{:.1}\">{of_best:.0} of 100</text>",
                x + 0.5 * cell_width,
                y + 0.5 * cell_height,
                x + 0.5 * cell_width,
                y + 0.5 * cell_height + letters,
                0.7 * letters
            );
        }
        page.push_str("</svg>\n<ol>\n");
        for todo in self.adjustments() {
            let _ = writeln!(page, "<li>{}</li>", escaped(&todo.to_string()));
        }
        page.push_str("</ol>\n");
        for line in self.light_line().into_iter().chain(self.aim_lines()) {
            let _ = writeln!(page, "<p>{}</p>", escaped(&line));
        }
        if let Some(light) = &self.brightness {
            page.push_str(
                "<svg class=\"histogram\" viewBox=\"0 0 320 64\" role=\"img\" \
                 aria-label=\"Histogram of white\">",
            );
            for (n, height) in light.histogram.heights().into_iter().enumerate() {
                let high = (60.0 * height).max(if height > 0.0 { 1.0 } else { 0.0 });
                let (x, y) = (10 * n, 62.0 - high);
                let _ =
                    write!(page, "<rect x=\"{x}\" y=\"{y:.1}\" width=\"9\" height=\"{high:.1}\"/>");
            }
            page.push_str(
                "</svg>\n<p><small>white's histogram: black on the left, full on the \
                           right</small></p>\n",
            );
        }
        let _ = write!(
            page,
            "<p><small>look {}, {:.1} a second; written while relens align runs</small></p>\n\
             </body></html>\n",
            self.looks,
            self.looks_a_second()
        );
        page
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
svg.histogram { background: none; border-bottom: 1px solid; }
svg.histogram rect { fill: currentColor; stroke: none; }
ol { font-size: 1.2rem; padding-left: 1.5rem; }
p { margin: .3rem 0; }
</style></head><body>
";

/// Text for HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
