//! Line charts with axes, ticks and a legend.

use relens::chart::drawing::{Anchor, Colour, Drawing, FAINT, HARM, INK, Stroke};

/// Left, right, top and bottom of the field.
const FIELD: [f64; 4] = [78.0, 640.0, 48.0, 400.0];
const WIDTH: f64 = 910.0;
const HEIGHT: f64 = 460.0;

/// Colours that colour-blind readers can tell apart (Okabe & Ito 2008), and two darker ones.
pub(crate) const PALETTE: [Colour; 9] = [
    Colour(0x00, 0x72, 0xb2),
    Colour(0xd5, 0x5e, 0x00),
    Colour(0x00, 0x9e, 0x73),
    Colour(0xe6, 0x9f, 0x00),
    Colour(0xcc, 0x79, 0xa7),
    Colour(0x56, 0xb4, 0xe9),
    Colour(0x8c, 0x6d, 0x1f),
    Colour(0x55, 0x55, 0x99),
    Colour(0x99, 0x99, 0x99),
];

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Scale {
    /// Proportional.
    Linear,
    /// Logarithmic above a number, proportional below it, so that 0 has a place.
    LogAbove(f64),
}

impl Scale {
    fn place(self, value: f64) -> f64 {
        match self {
            Scale::Linear => value,
            Scale::LogAbove(knee) if value <= knee => value / knee,
            Scale::LogAbove(knee) => 1.0 + (value / knee).ln(),
        }
    }
}

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Series {
    /// Name in the legend.
    pub(crate) name: String,
    /// Colour of the curve.
    pub(crate) colour: Colour,
    /// Whether the curve is dashed.
    pub(crate) dashed: bool,
    /// Points of the curve.
    pub(crate) points: Vec<[f64; 2]>,
}

/// A line chart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LineChart {
    /// Heading.
    pub(crate) title: String,
    /// Label of the x axis.
    pub(crate) x_label: String,
    /// Label of the y axis.
    pub(crate) y_label: String,
    /// Scale of the x axis.
    pub(crate) x_scale: Scale,
    /// Numbers marked on the x axis.
    pub(crate) x_ticks: Vec<f64>,
    /// Least y shown, with points below it at the edge; `None` for the least of all points.
    pub(crate) y_least: Option<f64>,
    /// Level of the untouched photo, and its name.
    pub(crate) floor: Option<(f64, String)>,
    /// The curves, in the order of the legend.
    pub(crate) series: Vec<Series>,
}

impl LineChart {
    /// Draws the chart.
    pub(crate) fn draw(&self) -> Drawing {
        let mut sheet = Drawing::new(WIDTH, HEIGHT);
        let [left, right, top, bottom] = FIELD;
        let points = || self.series.iter().flat_map(|s| &s.points);
        let ends = |of: &mut dyn Iterator<Item = f64>| {
            of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (x0, x1) = ends(&mut points().map(|p| self.x_scale.place(p[0])));
        let floor = self.floor.iter().map(|(level, _)| *level);
        let (low, high) = ends(&mut points().map(|p| p[1]).chain(floor));
        let low = self.y_least.unwrap_or(low);
        let room = 0.06 * (high - low).max(1e-6);
        let (y0, y1) = (low - room, high + room);
        let x = |v: f64| left + (self.x_scale.place(v) - x0) / (x1 - x0).max(1e-9) * (right - left);
        let y = |v: f64| bottom - ((v - y0) / (y1 - y0)).clamp(0.0, 1.0) * (bottom - top);

        sheet.words(&self.title, [left, 26.0], Anchor::Start, 16.0);
        for &tick in &self.x_ticks {
            sheet.line(&[[x(tick), top], [x(tick), bottom]], Stroke::new(FAINT, 1.0));
            sheet.words(&format!("{tick}"), [x(tick), bottom + 18.0], Anchor::Middle, 12.0);
        }
        let steps = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
        let step = steps.into_iter().find(|step| (y1 - y0) / step < 9.0).unwrap_or(10.0);
        let decimals = if step < 0.01 {
            3
        } else if step < 1.0 {
            2
        } else {
            0
        };
        let mut tick = (y0 / step).ceil() * step;
        while tick <= y1 {
            sheet.line(&[[left, y(tick)], [right, y(tick)]], Stroke::new(FAINT, 1.0));
            sheet.words(
                &format!("{tick:.decimals$}"),
                [left - 8.0, y(tick) + 4.0],
                Anchor::End,
                12.0,
            );
            tick += step;
        }
        if let Some((level, name)) = &self.floor {
            sheet.line(&[[left, y(*level)], [right, y(*level)]], Stroke::new(HARM, 1.2).dashed());
            sheet.words(name, [right - 6.0, y(*level) - 5.0], Anchor::End, 12.0);
        }
        sheet.line(&[[left, top], [left, bottom], [right, bottom]], Stroke::new(INK, 1.0));
        sheet.words(&self.x_label, [(left + right) / 2.0, bottom + 42.0], Anchor::Middle, 14.0);
        sheet.words_upwards(&self.y_label, [22.0, (top + bottom) / 2.0], 14.0);
        for (n, series) in self.series.iter().enumerate() {
            let line = series.points.iter().map(|p| [x(p[0]), y(p[1])]).collect();
            draw_series(&mut sheet, series, line, n);
        }
        sheet
    }
}

/// Draws the `n`-th series along the places of its points, and its line of the legend.
fn draw_series(sheet: &mut Drawing, series: &Series, line: Vec<[f64; 2]>, n: usize) {
    let [_, right, top, _] = FIELD;
    let stroke = Stroke::new(series.colour, 2.0);
    let stroke = if series.dashed { stroke.dashed() } else { stroke };
    for &place in &line {
        sheet.disc(place, 2.6, series.colour, "");
    }
    sheet.line(&line, stroke);
    let at = top + 12.0 + 21.0 * n as f64;
    sheet.line(&[[right + 16.0, at - 4.0], [right + 40.0, at - 4.0]], stroke);
    sheet.words(&series.name, [right + 46.0, at], Anchor::Start, 12.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_lie_in_the_field_and_higher_values_lie_higher() {
        let series = Series {
            name: "a".to_owned(),
            colour: INK,
            dashed: false,
            points: vec![[0.0, 0.2], [1.0, 0.9], [45.0, -4.0]],
        };
        let chart = LineChart {
            title: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            x_scale: Scale::LogAbove(1.0),
            x_ticks: vec![0.0, 1.0, 45.0],
            y_least: Some(0.0),
            floor: None,
            series: vec![series],
        };
        let svg = chart.draw().svg();
        let number = |circle: &str, name: &str| -> f64 {
            let value = circle.split(&format!("{name}=\"")).nth(1).unwrap();
            value.split('"').next().unwrap().parse().unwrap()
        };
        let circles = svg.split("<circle").skip(1);
        let discs: Vec<[f64; 2]> = circles.map(|c| [number(c, "cx"), number(c, "cy")]).collect();
        assert_eq!((discs[0][0], discs[2]), (FIELD[0], [FIELD[1], FIELD[3]]));
        assert!(discs[1][1] < discs[0][1] && discs[0][0] < discs[1][0]);
    }
}
