//! The last day in lines: photos an hour, drift, temperature. Drawn as SVG inside the page.

use std::fmt::Write;

use crate::daemon::store::pilots::PilotEntry;
use crate::daemon::store::report_file::Report;

/// What is drawn: this long before the newest event. A night and the evening before it.
const SPAN_S: f64 = 86_400.0;

/// Width of one bar of the throughput.
const BAR_S: f64 = 900.0;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 120.0;
/// Room for the numbers at the left, and the hours below.
const LEFT: f64 = 46.0;
const BELOW: f64 = 18.0;

/// The charts' HTML; empty when there is nothing to draw.
pub(super) fn charts(reports: &[Report], pilots: &[PilotEntry]) -> String {
    let newest =
        reports.iter().map(|r| r.finished_unix_s).chain(pilots.iter().map(|p| p.unix_s)).max();
    let Some(newest) = newest.map(|unix_s| unix_s as f64) else { return String::new() };
    let oldest = newest - SPAN_S;
    let recent = |unix_s: u64| unix_s as f64 >= oldest;
    let mut bars = vec![0.0; (SPAN_S / BAR_S) as usize + 1];
    for report in reports.iter().filter(|r| recent(r.finished_unix_s)) {
        bars[((report.finished_unix_s as f64 - oldest) / BAR_S) as usize] += 3600.0 / BAR_S;
    }
    let throughput: Vec<(f64, f64)> =
        bars.iter().enumerate().map(|(n, &v)| (oldest + n as f64 * BAR_S, v)).collect();
    let line = |of: &dyn Fn(&PilotEntry) -> Option<f64>| -> Vec<(f64, f64)> {
        pilots
            .iter()
            .filter(|p| recent(p.unix_s))
            .filter_map(|p| Some((p.unix_s as f64, of(p)?)))
            .collect()
    };
    let drawn = [
        ("Photos an hour", "", throughput, true),
        ("Brightness of the pilot picture", "%", line(&|p| Some(p.drift.gain_percent)), false),
        ("Displacement of the pilot picture", "px", line(&|p| Some(p.drift.shift_px)), false),
        ("Stray light", "levels", line(&|p| Some(p.drift.offset_levels)), false),
        ("Temperature of the board", "°C", line(&|p| p.temperature_c), false),
    ];
    let mut html = String::from("<section class=\"charts\">\n");
    for (title, unit, points, bars) in drawn {
        // One point is no course of a night.
        if points.len() > 1 {
            chart(&mut html, (title, unit), &points, (oldest, newest), bars);
        }
    }
    html.push_str("</section>\n");
    html
}

fn chart(
    html: &mut String,
    (title, unit): (&str, &str),
    points: &[(f64, f64)],
    span: (f64, f64),
    bars: bool,
) {
    let finite = points.iter().map(|p| p.1).filter(|v| v.is_finite());
    // Zero belongs to every one of them but temperature, which is near nothing.
    let about = if unit == "°C" { f64::INFINITY } else { 0.0 };
    let (mut low, mut high) =
        finite.fold((about, if bars { 1.0 } else { -about }), |(l, h), v| (l.min(v), h.max(v)));
    if high - low < 1e-9 {
        (low, high) = (low - 0.5, high + 0.5);
    }
    let x = |unix_s: f64| LEFT + (WIDTH - LEFT) * (unix_s - span.0) / (span.1 - span.0);
    let y =
        |value: f64| 6.0 + (HEIGHT - BELOW - 6.0) * (high - value.clamp(low, high)) / (high - low);
    // Writing to a string cannot fail.
    let _ = write!(
        html,
        "<figure><figcaption>{title} <small>{unit}</small></figcaption><svg viewBox=\"0 0 {WIDTH} \
         {HEIGHT}\" role=\"img\" \
         aria-label=\"{title}, {low:.1} to {high:.1} {unit}\">\
         <text x=\"{0}\" y=\"12\" text-anchor=\"end\">{high:.1}</text>\
         <text x=\"{0}\" y=\"{1:.0}\" text-anchor=\"end\">{low:.1}</text>\
         <line class=\"axis\" x1=\"{LEFT}\" x2=\"{WIDTH}\" y1=\"{2:.1}\" y2=\"{2:.1}\"/>",
        LEFT - 6.0,
        HEIGHT - BELOW,
        y(0.0f64.clamp(low, high)),
    );
    if bars {
        let width = (x(span.0 + BAR_S) - x(span.0) - 1.0).max(1.0);
        for &(at, value) in points.iter().filter(|p| p.1 > 0.0) {
            let top = y(value);
            let _ = write!(
                html,
                "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{:.1}\"/>",
                x(at),
                y(0.0) - top
            );
        }
    } else {
        let path: Vec<String> = points
            .iter()
            .filter(|p| p.1.is_finite())
            .map(|&(at, v)| format!("{:.1},{:.1}", x(at), y(v)))
            .collect();
        let _ = write!(html, "<polyline points=\"{}\"/>", path.join(" "));
    }
    for quarter in 0..=4 {
        let at = span.0 + (span.1 - span.0) * f64::from(quarter) / 4.0;
        let anchor = ["start", "middle", "middle", "middle", "end"][quarter as usize];
        let _ = write!(
            html,
            "<text class=\"hour\" x=\"{:.1}\" y=\"{:.0}\" text-anchor=\"{anchor}\" \
             data-hour=\"{at:.0}\"></text>",
            x(at),
            HEIGHT - 4.0
        );
    }
    html.push_str("</svg></figure>\n");
}
