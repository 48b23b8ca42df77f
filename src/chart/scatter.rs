//! The chart of speed against accuracy: SSIM over processor seconds per megapixel, with the
//! settings of a method joined by lines, and labels beside their points.

use super::axes::{Axes, ValueScale};
use super::drawing::{Anchor, Colour, Drawing, HARM, INK, Stroke};
use super::labels::{self, Area, Label};
use super::marks::mark_of;
use super::trade::{Measure, Point, Trade};

const WIDTH: f64 = 1000.0;
const FIELD: [f64; 4] = [70.0, 84.0, 980.0, 560.0];
const RADIUS: f64 = 5.0;
/// Colour of the front.
const FRONT: Colour = Colour(0xd4, 0xd4, 0xd4);
const MEASURE: Measure = Measure::Ssim;
/// Room below the untouched photos, as a share of the largest gain; lower points become arrows.
const ROOM_BELOW: f64 = 0.2;
/// Room above the best point, as a share of its distance from 1.
const ROOM_ABOVE: f64 = 0.15;

/// Draws the chart of `trade`, of photos of `megapixels`, with lines `below` it on photos, machine
/// and command.
pub fn draw(trade: &Trade, title: &str, megapixels: f64, below: &[String]) -> Drawing {
    let [left, top, right, bottom] = FIELD;
    let mut sheet = Drawing::light_and_dark(WIDTH, bottom + 56.0 + 16.0 * below.len() as f64);
    sheet.words(title, [left, 28.0], Anchor::Start, 18.0);
    let key = "hollow: no captures; dashed: time including captures; ring: the rig file's setting; \
               grey line: settings that none beats in both;";
    sheet.words(key, [left, 49.0], Anchor::Start, 12.0);
    let key = "bars: standard deviation over the photos of the difference from the rig file's \
               setting";
    sheet.words(key, [left, 66.0], Anchor::Start, 12.0);
    if let Some(panel) = ScatterPanel::new(trade, megapixels) {
        panel.frame(&mut sheet);
        sheet.line(&panel.front(), Stroke::new(FRONT, 5.0));
        panel.bars(&mut sheet);
        panel.lines(&mut sheet);
        panel.marks(&mut sheet);
        panel.labels(&mut sheet);
    }
    let axis = "processor seconds a megapixel (logarithmic)";
    sheet.words(axis, [(left + right) / 2.0, bottom + 36.0], Anchor::Middle, 13.0);
    sheet.words_upwards("SSIM", [22.0, (top + bottom) / 2.0], 13.0);
    for (n, line) in below.iter().enumerate() {
        sheet.words(line, [left, bottom + 58.0 + 16.0 * n as f64], Anchor::Start, 12.0);
    }
    sheet
}

/// The field that points are drawn into.
struct ScatterPanel<'a> {
    trade: &'a Trade,
    megapixels: f64,
    axes: Axes,
    /// SSIM of the untouched photos.
    photo: f64,
}

impl<'a> ScatterPanel<'a> {
    fn new(trade: &'a Trade, megapixels: f64) -> Option<ScatterPanel<'a>> {
        let photo = trade.photo(MEASURE)?;
        let results = trade.points.iter().filter_map(|point| point.result(MEASURE));
        let best = results.fold(photo, f64::max);
        let gain = (best - photo).max(1e-3);
        let own = |point: &Point| point.computing_seconds() / megapixels;
        let all = |point: &Point| point.seconds() / megapixels;
        let least = trade.points.iter().map(own).fold(f64::INFINITY, f64::min).max(1e-3);
        let most = trade.points.iter().map(all).fold(1e-2, f64::max);
        let axes = Axes {
            across: [FIELD[0], FIELD[2]],
            down: [FIELD[1], FIELD[3]],
            seconds: [0.7 * least, 1.8 * most],
            values: [photo - ROOM_BELOW * gain, best + ROOM_ABOVE * (1.0 - best)],
            scale: ValueScale::LogBelowOne,
        };
        Some(ScatterPanel { trade, megapixels, axes, photo })
    }

    fn x(&self, point: &Point) -> f64 {
        self.axes.x(point.computing_seconds() / self.megapixels)
    }

    fn place(&self, point: &Point) -> [f64; 2] {
        [self.x(point), self.axes.y(point.ssim())]
    }

    /// Draws the axes, and the level of the untouched photos.
    fn frame(&self, sheet: &mut Drawing) {
        self.axes.draw(sheet, true);
        let ([left, right], bottom) = (self.axes.across, self.axes.down[1]);
        let floor = self.axes.y(self.photo);
        sheet.rectangle([left, floor], [right, bottom], HARM, 0.07);
        sheet.line(&[[left, floor], [right, floor]], Stroke::new(HARM, 1.0).dashed());
        let words = "the untouched photo; results below are worse";
        sheet.words_in(HARM, words, [right - 6.0, floor + 15.0], Anchor::End, 12.0);
    }

    /// Corners of a stepped line along the points that no other point beats in speed and accuracy.
    fn front(&self) -> Vec<[f64; 2]> {
        let mut steps: Vec<[f64; 2]> = Vec::new();
        let points = &self.trade.points;
        for n in Trade::front(points, Point::computing_seconds, Point::ssim) {
            let [x, y] = self.place(&points[n]);
            if let Some(&[_, height]) = steps.last() {
                steps.push([x, height]);
            }
            steps.push([x, y]);
        }
        if let Some(&[_, height]) = steps.last() {
            steps.push([self.axes.across[1], height]);
        }
        steps
    }

    /// Draws the standard deviation of each point's gain over the photos as a bar.
    fn bars(&self, sheet: &mut Drawing) {
        for point in &self.trade.points {
            let Some(spread) = self.trade.spread(point, MEASURE).filter(|&s| s > 0.0) else {
                continue;
            };
            let x = self.x(point);
            let ends = [spread, -spread].map(|side| [x, self.axes.y(point.ssim() + side)]);
            sheet.line(&ends, Stroke::new(mark_of(&point.family).colour, 0.8));
        }
    }

    /// The points of each line, fastest first.
    fn joined(&self) -> Vec<Vec<&'a Point>> {
        let mut lines: Vec<Vec<&Point>> = Vec::new();
        for point in &self.trade.points {
            let is_on = |line: &&mut Vec<&Point>| {
                line[0].family == point.family && line[0].line == point.line
            };
            match lines.iter_mut().find(is_on) {
                Some(line) => line.push(point),
                None => lines.push(vec![point]),
            }
        }
        for line in &mut lines {
            line.sort_by(|a, b| a.computing_seconds().total_cmp(&b.computing_seconds()));
        }
        lines
    }

    fn lines(&self, sheet: &mut Drawing) {
        for line in self.joined() {
            let colour = mark_of(&line[0].family).colour;
            let places: Vec<[f64; 2]> = line.iter().map(|point| self.place(point)).collect();
            sheet.line(&places, Stroke::new(colour, 1.2));
            for point in line {
                let ([x, y], end) = (self.place(point), point.seconds() / self.megapixels);
                sheet.line(&[[x, y], [self.axes.x(end), y]], Stroke::new(colour, 0.8).dashed());
            }
        }
    }

    fn marks(&self, sheet: &mut Drawing) {
        for point in &self.trade.points {
            let ([x, y], mark) = (self.place(point), mark_of(&point.family));
            let captures = point.mean(|s| s.captures as f64);
            let fill = (captures > 0.0).then_some(mark.colour);
            let is_below = point.ssim() < self.axes.values[0];
            let corners = match is_below {
                true => vec![[x - 5.0, y - 11.0], [x + 5.0, y - 11.0], [x, y - 2.0]],
                false => mark.outline.corners([x, y], RADIUS),
            };
            let tip = format!(
                "{}: {:.2} s a photo ({captures:.1} captures), SSIM {:.4}, {:.2} dB",
                point.name(),
                point.seconds(),
                point.ssim(),
                point.psnr_db()
            );
            sheet.outline(&corners, fill, Stroke::new(mark.colour, 1.4), &tip);
            if point.is_filed {
                sheet.ring([x, y], RADIUS + 4.0, Stroke::new(INK, 1.6));
            }
        }
    }

    /// Labels the best point of each line with its full name, and the others with their setting.
    fn labels(&self, sheet: &mut Drawing) {
        let lines = self.joined();
        let mut obstacles: Vec<Area> = Vec::new();
        for pair in self.front().windows(2) {
            obstacles.extend(along([pair[0], pair[1]]));
        }
        let (mut names, mut settings) = (Vec::new(), Vec::new());
        for line in &lines {
            let best = line.iter().max_by(|a, b| a.ssim().total_cmp(&b.ssim()));
            for point in line {
                let place = self.place(point);
                obstacles.push(Area::about(place, RADIUS + 2.0));
                let end = self.axes.x(point.seconds() / self.megapixels);
                obstacles.extend(along([place, [end, place[1]]]));
                let is_best = best.is_some_and(|best| std::ptr::eq(*best, *point));
                let (words, size) = match (point.is_filed, is_best) {
                    (true, _) => (format!("{} (as filed)", point.name()), 12.5),
                    (false, true) => (point.name(), 12.5),
                    (false, false) => (point.setting.clone(), 11.0),
                };
                let point = [place[0], place[1].min(self.axes.down[1] - 8.0)];
                let label = Label { words, point, colour: mark_of(&line[0].family).colour, size };
                if size > 12.0 { &mut names } else { &mut settings }.push(label);
            }
            for pair in line.windows(2) {
                let ends = [pair[0], pair[1]].map(|point| self.place(point));
                obstacles.extend(along(ends));
            }
        }
        names.append(&mut settings);
        labels::draw(sheet, &names, Area(FIELD), &obstacles);
    }
}

/// Small areas along a segment, as obstacles that keep labels off it.
fn along([from, to]: [[f64; 2]; 2]) -> impl Iterator<Item = Area> {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let count = (length / 5.0).ceil().max(1.0) as usize;
    (1..count).map(move |n| {
        let share = n as f64 / count as f64;
        let at = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        Area::about(at, 1.5)
    })
}
