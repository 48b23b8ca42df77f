//! The chart of seconds against SSIM.

use super::contestants::{FILED, OUTSIDE};
use super::drawing::{Anchor, Colour, Drawing, FAINT, HARM, INK, Stroke};
use super::trade::{Point, Trade, Within};

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 640.0;
/// Left, right, top and bottom of the field that is drawn into.
const FIELD: [f64; 4] = [80.0, 790.0, 56.0, 570.0];
const PAPER: Colour = Colour(0xd5, 0x5e, 0x00);
/// One colour for each family, told apart by the colour-blind too (Okabe & Ito 2008).
const COLOURS: [(&str, Colour); 11] = [
    ("paper", PAPER),
    ("residual", Colour(0xe6, 0x9f, 0x00)),
    ("unmatched", Colour(0xcc, 0x79, 0xa7)),
    ("digital", Colour(0x56, 0xb4, 0xe9)),
    ("hybrid", Colour(0x00, 0x72, 0xb2)),
    ("block-matching", Colour(0xf0, 0xe4, 0x42)),
    ("wiener", Colour(0x99, 0x99, 0x99)),
    ("richardson-lucy", Colour(0x00, 0x9e, 0x73)),
    ("total-variation", Colour(0x8c, 0x6d, 0x1f)),
    (OUTSIDE, Colour(0x7a, 0x33, 0x99)),
    (FILED, Colour(0x00, 0x00, 0x00)),
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

    fn place(&self, point: &Point) -> [f64; 2] {
        [self.x(point.seconds()), self.y(point.ssim)]
    }
}

/// The chart of `trade`, headed `title`.
pub fn draw(trade: &Trade, title: &str) -> Drawing {
    let axes = Axes::of(trade);
    let mut sheet = Drawing::new(WIDTH, HEIGHT);
    sheet.words(title, [FIELD[0], 28.0], Anchor::Start, 18.0);
    frame(&mut sheet, trade, &axes);
    front(&mut sheet, trade, &axes);
    for &(family, colour) in &COLOURS {
        for point in trade.points.iter().filter(|p| p.family == family) {
            marker(&mut sheet, &axes, point, colour);
        }
    }
    notes(&mut sheet, trade, &axes);
    legend(&mut sheet, trade);
    sheet
}

/// Axes, their labels, and the floor.
fn frame(sheet: &mut Drawing, trade: &Trade, axes: &Axes) {
    let [left, right, top, bottom] = FIELD;
    for decade in -3..5 {
        for step in [1.0, 2.0, 5.0] {
            let seconds = step * 10f64.powi(decade);
            if (axes.seconds[0]..=axes.seconds[1]).contains(&seconds) {
                let x = axes.x(seconds);
                sheet.line(&[[x, top], [x, bottom]], Stroke::new(FAINT, 1.0));
                let decimals = (-decade).max(0) as usize;
                sheet.words(
                    &format!("{seconds:.decimals$}"),
                    [x, bottom + 18.0],
                    Anchor::Middle,
                    12.0,
                );
            }
        }
    }
    let span = axes.ssim[1] - axes.ssim[0];
    let step =
        [0.005, 0.01, 0.02, 0.05, 0.1].into_iter().find(|step| span / step < 10.0).unwrap_or(0.2);
    let mut tick = (axes.ssim[0] / step).ceil() * step;
    while tick <= axes.ssim[1] {
        let y = axes.y(tick);
        sheet.line(&[[left, y], [right, y]], Stroke::new(FAINT, 1.0));
        sheet.words(&format!("{tick:.3}"), [left - 8.0, y + 4.0], Anchor::End, 12.0);
        tick += step;
    }
    sheet.line(&[[left, top], [left, bottom], [right, bottom]], Stroke::new(INK, 1.0));
    let seconds = "seconds a photo: captures and computing (logarithmic)";
    sheet.words(seconds, [(left + right) / 2.0, bottom + 42.0], Anchor::Middle, 14.0);
    let middle = [22.0, (top + bottom) / 2.0];
    sheet.words_upwards("SSIM, mean of the scenes", middle, 14.0);
    let floor = axes.y(trade.photo_ssim);
    sheet.rectangle([left, floor], [right, bottom], PAPER, 0.08);
    sheet.line(&[[left, floor], [right, floor]], Stroke::new(HARM, 1.0).dashed());
    let words = format!("the blurred photo, {:.3}: below, a method does harm", trade.photo_ssim);
    sheet.words(&words, [right - 6.0, floor + 16.0], Anchor::End, 12.0);
}

/// The line through what nothing beats.
fn front(sheet: &mut Drawing, trade: &Trade, axes: &Axes) {
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for n in trade.front() {
        let [x, y] = axes.place(&trade.points[n]);
        if let Some(&[_, height]) = steps.last() {
            steps.push([x, height]);
        }
        steps.push([x, y]);
    }
    if let Some(&[_, height]) = steps.last() {
        steps.push([FIELD[1], height]);
    }
    sheet.line(&steps, Stroke::new(INK, 1.5));
}

fn marker(sheet: &mut Drawing, axes: &Axes, point: &Point, colour: Colour) {
    let [x, y] = axes.place(point);
    let words = format!(
        "{}, {}: {:.2} s ({:.1} captures), SSIM {:.4}, {:.2} dB",
        point.family,
        point.setting,
        point.seconds(),
        point.captures,
        point.ssim,
        point.psnr_db
    );
    if point.ssim < axes.ssim[0] {
        // Off the chart: an arrow at the edge.
        let corners = [[x - 5.0, y - 9.0], [x + 5.0, y - 9.0], [x, y]];
        sheet.area(&corners, colour, 1.0, &words);
    } else {
        sheet.disc([x, y], 5.0, colour, &words);
    }
}

/// Width of a letter of 13 units, about.
const LETTER: f64 = 7.5;

/// The operating point and the paper's own setting.
fn notes(sheet: &mut Drawing, trade: &Trade, axes: &Axes) {
    if let Some(point) = trade.points.iter().find(|p| p.printed) {
        let [x, y] = axes.place(point);
        let below = if point.ssim < axes.ssim[0] {
            format!(", SSIM {:.2}", point.ssim)
        } else {
            String::new()
        };
        sheet.ring([x, y - 4.0], 10.0, Stroke::new(PAPER, 1.0));
        let words = format!("the paper, 11 iterations{below}");
        sheet.words(&words, [x.min(FIELD[1] - 100.0), y - 20.0], Anchor::Middle, 12.0);
    }
    if let Some(n) = trade.operating_point(Within::BALANCED) {
        let point = &trade.points[n];
        let [x, y] = axes.place(point);
        sheet.ring([x, y], 11.0, Stroke::new(Colour(0, 0, 0), 2.0));
        let words = format!("operating point: {}, {}", point.family, point.setting);
        // Above the field, where no point is.
        let half = 0.5 * LETTER * words.len() as f64;
        let middle = x.clamp(FIELD[0] + half, (FIELD[1] - half).max(FIELD[0] + half));
        sheet.words(&words, [middle, FIELD[2] - 8.0], Anchor::Middle, 13.0);
        sheet.line(&[[x, FIELD[2] - 4.0], [x, y - 11.0]], Stroke::new(INK, 1.0));
    }
}

fn legend(sheet: &mut Drawing, trade: &Trade) {
    let mut y = FIELD[2] + 10.0;
    for &(family, colour) in &COLOURS {
        if trade.points.iter().any(|p| p.family == family) {
            sheet.disc([812.0, y - 4.0], 5.0, colour, "");
            sheet.words(family, [824.0, y], Anchor::Start, 13.0);
            y += 22.0;
        }
    }
    sheet.line(&[[806.0, y - 4.0], [818.0, y - 4.0]], Stroke::new(INK, 1.5));
    sheet.words("nothing beats these", [824.0, y], Anchor::Start, 13.0);
    sheet.words("triangles: below the chart", [806.0, y + 24.0], Anchor::Start, 11.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_that_is_tried_has_a_colour_of_its_own() {
        let rig = crate::config::load(std::path::Path::new("study.toml"))
            .expect("it comes with the program");
        for contestant in crate::chart::contestants::contestants(&rig, false) {
            assert!(
                COLOURS.iter().any(|(family, _)| *family == contestant.family),
                "{}",
                contestant.family
            );
        }
        let unlike = |n: usize| COLOURS[..n].iter().all(|(_, colour)| *colour != COLOURS[n].1);
        assert!((0..COLOURS.len()).all(unlike));
    }
}
