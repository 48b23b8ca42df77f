//! The chart of seconds against SSIM, as a drawing in SVG that needs nothing else.

use std::fmt::Write;

use super::trade::{BALANCED_WITHIN, Point, Trade};

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 640.0;
/// Left, right, top and bottom of the field that is drawn into.
const FIELD: [f64; 4] = [80.0, 790.0, 56.0, 570.0];
/// One colour for each family, told apart by the colour-blind too (Okabe & Ito 2008).
const COLOURS: [(&str, &str); 9] = [
    ("paper", "#d55e00"),
    ("residual", "#e69f00"),
    ("unmatched", "#cc79a7"),
    ("digital", "#56b4e9"),
    ("hybrid", "#0072b2"),
    ("wiener", "#999999"),
    ("richardson-lucy", "#009e73"),
    ("total-variation", "#8c6d1f"),
    ("as filed", "#000000"),
];

/// Where things go.
struct Axes {
    seconds: [f64; 2],
    ssim: [f64; 2],
}

impl Axes {
    fn of(trade: &Trade) -> Axes {
        let times = trade.points.iter().map(|p| p.seconds().max(1e-3));
        let (least, most) = times.fold((f64::INFINITY, 1e-2f64), |(a, b), t| (a.min(t), b.max(t)));
        let best = trade.points.iter().map(|p| p.ssim).fold(trade.photo_ssim, f64::max);
        // Methods that do harm are clipped to the lower edge, so that the rest can be told apart.
        let below = trade.photo_ssim - 0.35 * (best - trade.photo_ssim).max(0.01);
        Axes { seconds: [least * 0.7, most * 1.4], ssim: [below, best + 0.08 * (best - below)] }
    }

    fn x(&self, seconds: f64) -> f64 {
        let [from, to] = self.seconds.map(f64::ln);
        let share = (seconds.max(1e-3).ln() - from) / (to - from);
        FIELD[0] + share.clamp(0.0, 1.0) * (FIELD[1] - FIELD[0])
    }

    fn y(&self, ssim: f64) -> f64 {
        let share = (ssim - self.ssim[0]) / (self.ssim[1] - self.ssim[0]);
        FIELD[3] - share.clamp(0.0, 1.0) * (FIELD[3] - FIELD[2])
    }
}

/// The chart of `trade`, headed `title`.
pub fn svg(trade: &Trade, title: &str) -> String {
    let axes = Axes::of(trade);
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = draw(&mut out, trade, title, &axes);
    out
}

fn draw(out: &mut String, trade: &Trade, title: &str, axes: &Axes) -> std::fmt::Result {
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"13\"><rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>"
    )?;
    text(out, FIELD[0], 28.0, "start", 18, &escaped(title))?;
    frame(out, trade, axes)?;
    front(out, trade, axes)?;
    for &(family, colour) in &COLOURS {
        for point in trade.points.iter().filter(|p| p.family == family) {
            marker(out, axes, point, colour)?;
        }
    }
    notes(out, trade, axes)?;
    legend(out, trade)?;
    out.push_str("</svg>\n");
    Ok(())
}

fn text(out: &mut String, x: f64, y: f64, anchor: &str, size: u32, words: &str) -> std::fmt::Result {
    writeln!(
        out,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\">{words}</text>"
    )
}

/// Axes, their labels, and the floor.
fn frame(out: &mut String, trade: &Trade, axes: &Axes) -> std::fmt::Result {
    let [left, right, top, bottom] = FIELD;
    for decade in -3..5 {
        for step in [1.0, 2.0, 5.0] {
            let seconds = step * 10f64.powi(decade);
            if (axes.seconds[0]..=axes.seconds[1]).contains(&seconds) {
                let x = axes.x(seconds);
                writeln!(out, "<path d=\"M{x:.1} {top}V{bottom}\" stroke=\"#eee\"/>")?;
                text(out, x, bottom + 18.0, "middle", 12, &format!("{seconds}"))?;
            }
        }
    }
    let span = axes.ssim[1] - axes.ssim[0];
    let step = [0.005, 0.01, 0.02, 0.05, 0.1].into_iter().find(|step| span / step < 10.0).unwrap_or(0.2);
    let mut tick = (axes.ssim[0] / step).ceil() * step;
    while tick <= axes.ssim[1] {
        let y = axes.y(tick);
        writeln!(out, "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#eee\"/>")?;
        text(out, left - 8.0, y + 4.0, "end", 12, &format!("{tick:.3}"))?;
        tick += step;
    }
    writeln!(out, "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#333\"/>")?;
    text(
        out,
        (left + right) / 2.0,
        bottom + 42.0,
        "middle",
        14,
        "seconds a photo: captures and computing (logarithmic)",
    )?;
    let middle = (top + bottom) / 2.0;
    writeln!(
        out,
        "<text transform=\"translate(22 {middle}) rotate(-90)\" text-anchor=\"middle\" font-size=\"14\">SSIM, mean of \
         the scenes</text>"
    )?;
    let floor = axes.y(trade.photo_ssim);
    writeln!(
        out,
        "<rect x=\"{left}\" y=\"{floor:.1}\" width=\"{}\" height=\"{:.1}\" fill=\"#d55e00\" opacity=\"0.08\"/>\
         <path d=\"M{left} {floor:.1}H{right}\" stroke=\"#a33\" stroke-dasharray=\"6 4\"/>",
        right - left,
        bottom - floor
    )?;
    let words = format!("the blurred photo, {:.3}: below, a method does harm", trade.photo_ssim);
    text(out, right - 6.0, floor + 16.0, "end", 12, &words)
}

/// The line through what nothing beats.
fn front(out: &mut String, trade: &Trade, axes: &Axes) -> std::fmt::Result {
    let mut path = String::new();
    let mut height = None;
    for n in trade.front() {
        let (x, y) = (axes.x(trade.points[n].seconds()), axes.y(trade.points[n].ssim));
        match height {
            None => write!(path, "M{x:.1} {y:.1}")?,
            Some(_) => write!(path, "H{x:.1}V{y:.1}")?,
        }
        height = Some(y);
    }
    if height.is_some() {
        write!(path, "H{}", FIELD[1])?;
    }
    writeln!(out, "<path d=\"{path}\" fill=\"none\" stroke=\"#333\" stroke-width=\"1.5\"/>")
}

fn marker(out: &mut String, axes: &Axes, point: &Point, colour: &str) -> std::fmt::Result {
    let (x, y) = (axes.x(point.seconds()), axes.y(point.ssim));
    let title = escaped(&format!(
        "{}, {}: {:.2} s ({:.1} captures), SSIM {:.4}, {:.2} dB",
        point.family,
        point.setting,
        point.seconds(),
        point.captures,
        point.ssim,
        point.psnr_db
    ));
    if point.ssim < axes.ssim[0] {
        // Off the chart: an arrow at the edge.
        let (a, b, c) = (x - 5.0, x + 5.0, y - 9.0);
        return writeln!(
            out,
            "<path d=\"M{a:.1} {c:.1}H{b:.1}L{x:.1} {y:.1}Z\" fill=\"{colour}\"><title>{title}</title></path>"
        );
    }
    writeln!(
        out,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{colour}\"><title>{title}</title></circle>"
    )
}

/// The operating point and the paper's own setting.
fn notes(out: &mut String, trade: &Trade, axes: &Axes) -> std::fmt::Result {
    if let Some(point) = trade.points.iter().find(|p| p.printed) {
        let (x, y) = (axes.x(point.seconds()), axes.y(point.ssim));
        let below =
            if point.ssim < axes.ssim[0] { format!(", SSIM {:.2}", point.ssim) } else { String::new() };
        writeln!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{:.1}\" r=\"10\" fill=\"none\" stroke=\"#d55e00\"/>",
            y - 4.0
        )?;
        text(
            out,
            x.min(FIELD[1] - 100.0),
            y - 20.0,
            "middle",
            12,
            &format!("the paper, 11 iterations{below}"),
        )?;
    }
    if let Some(n) = trade.operating_point(BALANCED_WITHIN) {
        let point = &trade.points[n];
        let (x, y) = (axes.x(point.seconds()), axes.y(point.ssim));
        writeln!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"11\" fill=\"none\" stroke=\"black\" stroke-width=\"2\"/>"
        )?;
        let words = format!("operating point: {}, {}", point.family, point.setting);
        text(out, x.min(FIELD[1] - 160.0), y - 18.0, "middle", 13, &escaped(&words))?;
    }
    Ok(())
}

fn legend(out: &mut String, trade: &Trade) -> std::fmt::Result {
    let mut y = FIELD[2] + 10.0;
    for &(family, colour) in &COLOURS {
        if trade.points.iter().any(|p| p.family == family) {
            writeln!(out, "<circle cx=\"812\" cy=\"{:.1}\" r=\"5\" fill=\"{colour}\"/>", y - 4.0)?;
            text(out, 824.0, y, "start", 13, family)?;
            y += 22.0;
        }
    }
    writeln!(out, "<path d=\"M806 {:.1}h12\" stroke=\"#333\" stroke-width=\"1.5\"/>", y - 4.0)?;
    text(out, 824.0, y, "start", 13, "nothing beats these")?;
    text(out, 806.0, y + 24.0, "start", 11, "triangles: below the chart")
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
