//! The chart of seconds against quality: a panel for each measure, settings of a method joined,
//! labels beside their points; below, what an eye and a line of print become along the front.

use super::drawing::{Anchor, Colour, Drawing, FAINT, HARM, INK, Stroke};
use super::marks::{MARKS, Mark, Outline, PAPER};
use super::strip::Strip;
use super::trade::{BALANCED, BEST, FAST, Measure, Point, Trade};

const WIDTH: f64 = 1000.0;
/// Left and right end of what is drawn into; labels stand to the right of it.
const FIELD: [f64; 2] = [74.0, 744.0];
/// Where the first panel begins, how high each is, and the room to the next.
const TOP: f64 = 62.0;
const PANEL: f64 = 270.0;
const BETWEEN: f64 = 26.0;
const RADIUS: f64 = 5.0;
/// Between the base lines of two labels.
const LINE: f64 = 14.5;
/// Below what the photo has, panels go on for this share of what can be gained: what does more harm
/// is an arrow at the edge.
const HARM_SHOWN: f64 = 0.25;

/// What is said about a chart.
#[derive(Debug, Clone)]
pub struct Words {
    /// Its heading.
    pub title: String,
    /// How large its photos are.
    pub megapixels: f64,
    /// What it stands for: the photos, the machine, the command; a line each.
    pub below: Vec<String>,
}

/// What one panel shows.
#[derive(Debug, Clone)]
pub struct PanelOf<'a> {
    /// What was measured.
    pub trade: &'a Trade,
    /// By which measure.
    pub measure: Measure,
    /// Words over the panel; empty where the heading says all.
    pub words: String,
}

/// One panel.
struct MeasurePanel {
    measure: Measure,
    /// What the untouched photos have.
    photo: f64,
    range: [f64; 2],
    megapixels: f64,
    /// Least and most that is drawn, a megapixel.
    seconds: [f64; 2],
    /// Upper and lower end.
    field: [f64; 2],
}

impl MeasurePanel {
    fn of(
        shown: &PanelOf<'_>,
        (megapixels, seconds): (f64, [f64; 2]),
        nth: usize,
    ) -> Option<MeasurePanel> {
        let &PanelOf { trade, measure, .. } = shown;
        let photo = trade.photo_by(measure)?;
        let best = trade.points.iter().filter_map(|p| p.by(measure)).fold(photo, f64::max);
        let gain = (best - photo).max(1e-3);
        let top = TOP + nth as f64 * (PANEL + BETWEEN);
        Some(MeasurePanel {
            measure,
            photo,
            range: [photo - HARM_SHOWN * gain, best + 0.12 * gain],
            megapixels,
            seconds,
            field: [top, top + PANEL],
        })
    }

    fn x(&self, seconds: f64) -> f64 {
        let [from, to] = self.seconds.map(f64::ln);
        let share = (seconds.max(1e-3).ln() - from) / (to - from);
        FIELD[0] + share.clamp(0.0, 1.0) * (FIELD[1] - FIELD[0])
    }

    fn y(&self, worth: f64) -> f64 {
        let share = (worth - self.range[0]) / (self.range[1] - self.range[0]);
        self.field[1] - share.clamp(0.0, 1.0) * (self.field[1] - self.field[0])
    }

    fn place(&self, point: &Point) -> Option<[f64; 2]> {
        Some([self.x_of(point), self.y(point.by(self.measure)?)])
    }

    fn x_of(&self, point: &Point) -> f64 {
        self.x(point.seconds_a_megapixel(self.megapixels))
    }
}

/// The chart of `trade`, a panel for each measure, and what it looks like along the front.
pub fn draw(trade: &Trade, words: &Words) -> Drawing {
    let measured = Measure::ALL.into_iter().filter(|&measure| trade.photo_by(measure).is_some());
    let shown = measured.map(|measure| PanelOf { trade, measure, words: String::new() });
    sheet_of(&shown.collect::<Vec<_>>(), words, Strip::of(trade, words.megapixels).as_ref())
}

/// A chart of panels, one above the other, over the same seconds.
pub fn draw_panels(shown: &[PanelOf<'_>], words: &Words) -> Drawing {
    sheet_of(shown, words, None)
}

fn sheet_of(shown: &[PanelOf<'_>], words: &Words, strip: Option<&Strip<'_>>) -> Drawing {
    let a_megapixel = |point: &Point| point.seconds_a_megapixel(words.megapixels).max(1e-3);
    let times = shown.iter().flat_map(|s| s.trade.points.iter().map(a_megapixel));
    let (least, most) = times.fold((f64::INFINITY, 1e-2f64), |(a, b), t| (a.min(t), b.max(t)));
    let scale = (words.megapixels, [least * 0.7, most * 1.4]);
    let panels: Vec<(&PanelOf<'_>, MeasurePanel)> = (shown.iter().enumerate())
        .filter_map(|(nth, s)| Some((s, MeasurePanel::of(s, scale, nth)?)))
        .collect();
    let bottom = panels.last().map_or(TOP, |(_, panel)| panel.field[1]);
    let below = bottom + 44.0 + strip.map_or(0.0, Strip::height);
    let height = below + 22.0 + 16.0 * words.below.len() as f64;
    let mut sheet = Drawing::light_and_dark(WIDTH, height);
    sheet.words(&words.title, [FIELD[0], 26.0], Anchor::Start, 18.0);
    let key = "hollow: no capture, so no certificate; black line: nothing beats these; bands and \
               bars: how far single photos stray";
    sheet.words(key, [FIELD[0], 46.0], Anchor::Start, 12.0);
    for (nth, (PanelOf { trade, words, .. }, panel)) in panels.iter().enumerate() {
        frame(&mut sheet, panel);
        sheet.words(words, [FIELD[0] + 8.0, panel.field[0] + 16.0], Anchor::Start, 13.0);
        bands(&mut sheet, trade, panel);
        front(&mut sheet, trade, panel);
        for mark in &MARKS {
            family(&mut sheet, trade, panel, mark);
        }
        labels(&mut sheet, trade, panel);
        for (point, letter) in strip.filter(|_| nth == 0).iter().flat_map(|s| s.lettered()) {
            let Some([x, y]) = panel.place(point) else { continue };
            sheet.words(&letter.to_string(), [x, y - 9.0], Anchor::Middle, 13.0);
        }
    }
    let middle = (FIELD[0] + FIELD[1]) / 2.0;
    let axis = "seconds a megapixel: captures, and computing as processor time (logarithmic)";
    sheet.words(axis, [middle, bottom + 38.0], Anchor::Middle, 14.0);
    if let Some(strip) = strip {
        strip.draw(&mut sheet, [FIELD[0], bottom + 44.0]);
    }
    for (n, line) in words.below.iter().enumerate() {
        sheet.words(line, [FIELD[0], below + 18.0 + 16.0 * n as f64], Anchor::Start, 12.0);
    }
    sheet
}

/// Axes, their labels, and the floor.
fn frame(sheet: &mut Drawing, panel: &MeasurePanel) {
    let ([left, right], [top, bottom]) = (FIELD, panel.field);
    for decade in -3..5 {
        for step in [1.0, 2.0, 5.0] {
            let seconds = step * 10f64.powi(decade);
            if (panel.seconds[0]..=panel.seconds[1]).contains(&seconds) {
                let x = panel.x(seconds);
                sheet.line(&[[x, top], [x, bottom]], Stroke::new(FAINT, 1.0));
                let words = format!("{seconds:.*}", (-decade).max(0) as usize);
                sheet.words(&words, [x, bottom + 16.0], Anchor::Middle, 12.0);
            }
        }
    }
    let span = panel.range[1] - panel.range[0];
    let steps = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
    let step = steps.into_iter().find(|step| span / step < 8.0).unwrap_or(10.0);
    let mut tick = (panel.range[0] / step).ceil() * step;
    while tick <= panel.range[1] {
        let y = panel.y(tick);
        sheet.line(&[[left, y], [right, y]], Stroke::new(FAINT, 1.0));
        let words = match panel.measure {
            Measure::Ssim => format!("{tick:.3}"),
            Measure::Psnr => format!("{tick:.1}"),
            Measure::EdgeDifference => format!("{:.1}", -tick),
        };
        sheet.words(&words, [left - 7.0, y + 4.0], Anchor::End, 12.0);
        tick += step;
    }
    sheet.line(&[[left, top], [left, bottom], [right, bottom]], Stroke::new(INK, 1.0));
    let words = match panel.measure {
        Measure::Ssim => "SSIM",
        Measure::Psnr => "PSNR, dB",
        Measure::EdgeDifference => "ΔE at edges (down: worse)",
    };
    sheet.words_upwards(words, [20.0, (top + bottom) / 2.0], 14.0);
    let floor = panel.y(panel.photo);
    sheet.rectangle([left, floor], [right, bottom], PAPER, 0.08);
    sheet.line(&[[left, floor], [right, floor]], Stroke::new(HARM, 1.0).dashed());
    let words = "the photo as it is: below, a method does harm";
    sheet.words(words, [right - 6.0, floor + 15.0], Anchor::End, 12.0);
}

/// The line through what nothing beats.
fn front(sheet: &mut Drawing, trade: &Trade, panel: &MeasurePanel) {
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for n in trade.front(panel.measure) {
        let Some([x, y]) = panel.place(&trade.points[n]) else { continue };
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

/// The lines of a family, each fastest first.
fn lines<'a>(trade: &'a Trade, family: &str) -> Vec<Vec<&'a Point>> {
    let mut lines: Vec<Vec<&Point>> = Vec::new();
    for point in trade.points.iter().filter(|p| p.family == family) {
        match lines.iter_mut().find(|line| !point.line.is_empty() && line[0].line == point.line) {
            Some(line) => line.push(point),
            None => lines.push(vec![point]),
        }
    }
    for line in &mut lines {
        line.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
    }
    lines
}

/// How far single photos stray from what a setting gains over the rig file's.
fn bands(sheet: &mut Drawing, trade: &Trade, panel: &MeasurePanel) {
    for mark in &MARKS {
        for line in lines(trade, mark.family) {
            let ends: Option<Vec<[[f64; 2]; 2]>> = (line.iter())
                .map(|point| {
                    let (spread, worth) =
                        trade.spread(point, panel.measure).zip(point.by(panel.measure))?;
                    let x = panel.x_of(point);
                    Some([1.0, -1.0].map(|side| [x, panel.y(worth + side * spread)]))
                })
                .collect();
            let Some(ends) = ends else { continue };
            if let [[above, below]] = ends[..] {
                sheet.line(&[above, below], Stroke::new(mark.colour, 0.7));
                continue;
            }
            let mut corners: Vec<[f64; 2]> = ends.iter().map(|[above, _]| *above).collect();
            corners.extend(ends.iter().rev().map(|[_, below]| *below));
            sheet.area(&corners, mark.colour, 0.1, "");
        }
    }
}

/// A family's points, joined where they differ in one number.
fn family(sheet: &mut Drawing, trade: &Trade, panel: &MeasurePanel, mark: &Mark) {
    for line in lines(trade, mark.family) {
        let places: Vec<[f64; 2]> = line.iter().filter_map(|point| panel.place(point)).collect();
        sheet.line(&places, Stroke::new(mark.colour, 1.0));
        for point in line {
            let Some([x, y]) = panel.place(point) else { continue };
            let below = point.by(panel.measure).is_some_and(|worth| worth < panel.range[0]);
            let edges = point.edge_difference.map_or(String::new(), |d| format!(", ΔE {d:.2}"));
            let words = format!(
                "{}, {}: {:.2} s a photo ({:.1} captures), SSIM {:.4}, {:.2} dB{edges}",
                point.family,
                point.setting,
                point.seconds(),
                point.captures,
                point.ssim,
                point.psnr_db
            );
            let fill = (point.captures > 0.0).then_some(mark.colour);
            // Off the chart: an arrow at the edge.
            let outline = match below {
                true => vec![[x - 5.0, y - 10.0], [x + 5.0, y - 10.0], [x, y - 1.0]],
                false => mark.outline.about([x, y], RADIUS),
            };
            sheet.outline(&outline, fill, Stroke::new(mark.colour, 1.4), &words);
        }
    }
}

/// Words at the right end of a panel, and the point that they are of.
struct Label {
    words: String,
    place: [f64; 2],
    colour: Colour,
    outline: Option<Outline>,
}

/// Names of the families beside their best points, and of what was chosen.
fn labels(sheet: &mut Drawing, trade: &Trade, panel: &MeasurePanel) {
    let worth = |point: &&Point| point.by(panel.measure).unwrap_or(f64::NEG_INFINITY);
    let mut all: Vec<Label> = Vec::new();
    for mark in &MARKS {
        let own = trade.points.iter().filter(|point| point.family == mark.family);
        let best = own.max_by(|a, b| worth(a).total_cmp(&worth(b)));
        let Some((point, place)) = best.and_then(|p| Some((p, panel.place(p)?))) else { continue };
        let words = match mark.family {
            super::contestants::FILED => format!("as the rig file has it: {}", point.setting),
            family => family.to_owned(),
        };
        all.push(Label { words, place, colour: mark.colour, outline: Some(mark.outline) });
    }
    if let Some(point) = trade.points.iter().find(|p| p.printed) {
        let words = format!("the paper's own, {}", point.setting);
        let place = panel.place(point);
        all.extend(place.map(|place| Label { words, place, colour: PAPER, outline: None }));
    }
    let mut chosen: Vec<(usize, String)> = Vec::new();
    for (name, keeps) in [("fast", FAST), ("balanced", BALANCED), ("best", BEST)] {
        let Some(n) = trade.operating_point(keeps) else { continue };
        match chosen.iter_mut().find(|(other, _)| *other == n) {
            Some((_, names)) => *names = format!("{names} and {name}"),
            None => chosen.push((n, name.to_owned())),
        }
    }
    for (n, names) in chosen {
        let point = &trade.points[n];
        let Some(place) = panel.place(point) else { continue };
        let words = format!("{names}: {}", point.family);
        all.push(Label { words, place, colour: Colour(0, 0, 0), outline: None });
    }
    all.sort_by(|a, b| a.place[1].total_cmp(&b.place[1]));
    for (y, label) in spread_out(&all, panel.field).into_iter().zip(&all) {
        let [x0, y0] = label.place;
        let pale = Stroke::new(label.colour, 0.5);
        if label.outline.is_none() {
            sheet.ring([x0, y0], RADIUS + 4.0, Stroke::new(label.colour, 1.5));
        }
        sheet.line(&[[x0 + RADIUS + 1.0, y0], [FIELD[1] + 4.0, y], [FIELD[1] + 9.0, y]], pale);
        if let Some(of) = label.outline {
            let outline = of.about([FIELD[1] + 17.0, y], RADIUS);
            let stroke = Stroke::new(label.colour, 1.0);
            sheet.outline(&outline, Some(label.colour), stroke, "");
        } else {
            sheet.ring([FIELD[1] + 17.0, y], RADIUS, Stroke::new(label.colour, 1.5));
        }
        sheet.words(&label.words, [FIELD[1] + 27.0, y + 4.0], Anchor::Start, 12.0);
    }
}

/// Heights of `labels`, sorted by their points', as near to these as leaves each a line of its own.
fn spread_out(labels: &[Label], [top, bottom]: [f64; 2]) -> Vec<f64> {
    let mut heights: Vec<f64> = labels.iter().map(|label| label.place[1]).collect();
    let mut least = top;
    for y in &mut heights {
        *y = y.max(least);
        least = *y + LINE;
    }
    let mut most = bottom;
    for y in heights.iter_mut().rev() {
        *y = y.min(most);
        most = *y - LINE;
    }
    heights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_keep_their_order_and_a_line_each() {
        let label = |y| Label { words: String::new(), place: [0.0, y], colour: INK, outline: None };
        let labels: Vec<Label> = [10.0, 11.0, 12.0, 90.0, 99.0].map(label).into();
        let heights = spread_out(&labels, [0.0, 100.0]);
        assert!(heights.windows(2).all(|pair| pair[1] - pair[0] >= LINE - 1e-9), "{heights:?}");
        assert!(heights[0] >= 0.0 && heights[4] <= 100.0 && heights[3] > 60.0, "{heights:?}");
    }
}
