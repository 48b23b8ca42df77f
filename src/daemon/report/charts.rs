//! Charts of the last day: photos per interval, drift, temperature. Lines and bars are SVG that
//! fills its box; text is HTML, legible on a phone.

use std::fmt::Write;

use super::card::GalleryPhoto;
use super::html::{photos, span};
use crate::daemon::store::pilots::PilotEntry;

/// Time drawn, before the newest event: a night and the evening before it.
const SPAN_S: u64 = 86_400;

/// Intervals of a bar and their names.
const BARS_S: [(u64, &str); 3] =
    [(60, "a minute"), (300, "5 minutes"), (900, "a quarter of an hour")];

/// Most bars, which fit on a phone.
const BARS_MAX: u64 = 96;

/// Height and width of a drawing in user units.
const SIDE: f64 = 100.0;

/// HTML of the charts of `shown`, newest first; empty without data.
pub(super) fn charts(shown: &[GalleryPhoto<'_>], pilots: &[PilotEntry]) -> String {
    let ends = shown.iter().map(|photo| photo.report.finished_unix_s);
    let events = ends.chain(pilots.iter().map(|p| p.unix_s));
    let Some(newest) = events.clone().max() else { return String::new() };
    let recent = |unix_s: u64| unix_s + SPAN_S > newest;
    let oldest = events.filter(|&unix_s| recent(unix_s)).min().unwrap_or(newest);
    let fits = |bar_s: u64| (newest - oldest) / bar_s < BARS_MAX - 1;
    let (bar_s, bar_words) = BARS_S.into_iter().find(|b| fits(b.0)).unwrap_or(BARS_S[2]);
    // Whole bars from before the oldest to after the newest event.
    let (begin, end) = (oldest / bar_s * bar_s, (newest / bar_s + 1) * bar_s);
    let mut html = String::from("<section class=\"charts\" aria-label=\"The last day\">\n");

    let night: Vec<_> = shown.iter().filter(|p| recent(p.report.finished_unix_s)).collect();
    bar_chart(&mut html, &night, (begin, end), (bar_s, bar_words));
    let line = |of: &dyn Fn(&PilotEntry) -> Option<f64>| -> Vec<(f64, f64)> {
        let recent = pilots.iter().filter(|p| recent(p.unix_s));
        let points = recent.filter_map(|p| Some(((p.unix_s - begin) as f64, of(p)?)));
        points.filter(|(_, value)| value.is_finite()).collect()
    };
    let lines = [
        ("Brightness of the pilot picture", "%", line(&|p| Some(p.drift.gain_percent))),
        ("Displacement of the pilot picture", "px", line(&|p| Some(p.drift.shift_px))),
        ("Stray light", "grey levels", line(&|p| Some(p.drift.offset_levels))),
        ("Temperature of the board", "°C", line(&|p| p.temperature_c)),
    ];
    // A line needs two points.
    let lines: Vec<_> = lines.into_iter().filter(|(.., points)| points.len() > 1).collect();
    if !lines.is_empty() {
        html.push_str("<details><summary>Drift of the box</summary>\n");
        for (title, unit, points) in lines {
            line_chart(&mut html, (title, unit), &points, (begin, end));
        }
        html.push_str("</details>\n");
    }
    html.push_str("</section>\n");
    html
}

/// A bar chart of the photos of a `night`, newest first, with bars of a duration and its name.
fn bar_chart(
    html: &mut String,
    night: &[&GalleryPhoto<'_>],
    over: (u64, u64),
    (bar_s, bar_words): (u64, &str),
) {
    let (Some(last), Some(first)) = (night.first(), night.last()) else { return };
    let mut bars = vec![0_usize; ((over.1 - over.0) / bar_s) as usize];
    for photo in night {
        bars[((photo.report.finished_unix_s - over.0) / bar_s) as usize] += 1;
    }
    let took = last.report.finished_unix_s as f64 - first.report.finished_unix_s as f64
        + first.report.seconds;
    let most = bars.iter().copied().max().unwrap_or(1);
    let width = SIDE / bars.len() as f64;
    let mut drawn = String::new();
    for (n, &count) in bars.iter().enumerate().filter(|(_, count)| **count > 0) {
        let height = SIDE * count as f64 / most as f64;
        let _ = write!(
            drawn,
            "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{height:.2}\"/>",
            n as f64 * width + 0.05 * width,
            SIDE - height,
            0.9 * width,
        );
    }
    let title = format!("{} in {}", photos(night.len()), span(took));
    let caption = format!("{title} <small>bars of {bar_words}</small>");
    figure(html, &caption, ["0", &most.to_string()], over, &drawn);
}

/// A line chart of `points`: seconds since the beginning of `over`, and values.
fn line_chart(
    html: &mut String,
    (title, unit): (&str, &str),
    points: &[(f64, f64)],
    over: (u64, u64),
) {
    // Every axis but that of temperature includes zero.
    let about = if unit == "°C" { f64::INFINITY } else { 0.0 };
    let (mut low, mut high) =
        points.iter().fold((about, -about), |(l, h), &(_, v)| (l.min(v), h.max(v)));
    if high - low < 1e-9 {
        (low, high) = (low - 0.5, high + 0.5);
    }
    let x = |at_s: f64| SIDE * at_s / (over.1 - over.0) as f64;
    let y = |value: f64| SIDE * (high - value) / (high - low);
    let path: Vec<String> =
        points.iter().map(|&(at, v)| format!("{:.2},{:.2}", x(at), y(v))).collect();
    let drawn = format!("<polyline points=\"{}\"/>", path.join(" "));
    let caption = format!("{title} <small>{unit}</small>");
    // No minus sign before zero.
    let label = |value: f64| format!("{:.1}", (10.0 * value).round() / 10.0 + 0.0);
    figure(html, &caption, [&label(low), &label(high)], over, &drawn);
}

/// A drawing with its range of values and its hours, in UTC until a script makes them local.
fn figure(html: &mut String, caption: &str, [low, high]: [&str; 2], over: (u64, u64), drawn: &str) {
    let _ = write!(
        html,
        "<figure><figcaption>{caption}</figcaption><div class=\"chart\"><span>{high}</span>\
         <span>{low}</span><svg viewBox=\"0 0 {SIDE} {SIDE}\" preserveAspectRatio=\"none\" \
         aria-hidden=\"true\">{drawn}</svg></div><p class=\"hours\">"
    );
    let span_s = over.1 - over.0;
    // Labels have minutes: none may be repeated.
    let parts = if span_s < 4 * 60 { 1 } else { 3 };
    for part in 0..=parts {
        let at = over.0 + span_s * part / parts;
        let time = jiff::Timestamp::from_second(at as i64).unwrap_or_default();
        let _ = write!(html, "<span data-hour=\"{at}\">{}</span>", time.strftime("%H:%M"));
    }
    html.push_str("</p></figure>\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::daemon::report::tests::report;
    use crate::daemon::store::report_file::Report;

    fn charts_of(reports: &[Report]) -> String {
        let newest_first = reports.iter().rev();
        let shown: Vec<_> = newest_first
            .map(|report| GalleryPhoto { report, number: 0, original: None, scene: None })
            .collect();
        charts(&shown, &[])
    }

    /// The numbers behind each `name="`.
    fn numbers(html: &str, name: &str) -> Vec<f64> {
        let attribute = format!(" {name}=\"");
        let after = html.split(&attribute).skip(1);
        after.map(|rest| rest.split('"').next().unwrap().parse().unwrap()).collect()
    }

    #[test]
    fn every_bar_is_inside_the_chart() {
        for count in [1, 4, 60, 4000] {
            let reports: Vec<Report> = (0..count).map(report).collect();
            let html = charts_of(&reports);
            let (x, width) = (numbers(&html, "x"), numbers(&html, "width"));
            assert!(!x.is_empty(), "{count} photos are drawn");
            for (x, width) in x.iter().zip(&width) {
                assert!(*x >= 0.0 && x + width <= SIDE && *width > 0.5, "{count}: {x}+{width}");
            }
        }
    }

    #[test]
    fn titles_state_number_and_duration() {
        let mut reports: Vec<Report> = (0..4).map(report).collect();
        for (n, report) in reports.iter_mut().enumerate() {
            report.finished_unix_s = 1_700_000_000 + 180 * n as u64;
            report.seconds = 180.0;
        }
        let html = charts_of(&reports);
        assert!(html.contains("4 photos in 12 min <small>bars of a minute"), "{html}");
        let one = charts_of(&reports[..1]);
        assert!(one.contains("1 photo in 3 min"));
        assert_eq!(one.matches("data-hour").count(), 2, "a minute is not divided: {one}");
        assert_eq!(charts_of(&[]), "");
    }
}
