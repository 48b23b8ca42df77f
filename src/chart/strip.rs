//! A strip of crops below a chart: what an eye and a line of print become along its front.

use super::contestants::FILED;
use super::crops::{self, Crop, PARTS};
use super::drawing::{Anchor, Drawing};
use super::scenes::Scene;
use super::trade::{Measure, Point, Trade};

/// Width and height of a crop.
const CROP: [f64; 2] = [96.0, 72.0];
/// From one crop to the next.
const PITCH: [f64; 2] = [102.0, 78.0];
/// Room for the words over a column.
const HEAD: f64 = 50.0;
/// So many points of the front are looked at.
const POINTS_MAX: usize = 6;

/// What is shown.
pub(super) struct Strip<'a> {
    trade: &'a Trade,
    megapixels: f64,
    /// The points that are looked at, fastest first.
    points: Vec<usize>,
    rows: Vec<(Scene, &'static str)>,
}

impl<'a> Strip<'a> {
    /// Of the front by SSIM; `None` where no pictures were kept.
    pub(super) fn of(trade: &'a Trade, megapixels: f64) -> Option<Strip<'a>> {
        let kept = |scene: Scene, name: &str| {
            trade.crops.iter().any(|crop| crop.scene == scene && crop.of == name)
        };
        let rows = PARTS.iter().map(|&(scene, what, _)| (scene, what));
        let rows: Vec<_> = rows.filter(|(scene, _)| kept(*scene, crops::SCENE)).collect();
        let front: Vec<usize> = (trade.front(Measure::Ssim).into_iter())
            .filter(|&n| rows.iter().all(|(scene, _)| kept(*scene, &trade.points[n].name())))
            .collect();
        // Evenly along the front, its ends too.
        let shown = front.len().min(POINTS_MAX);
        let nth = |n: usize| front[n * (front.len() - 1) / (shown - 1).max(1)];
        let points: Vec<usize> = (0..shown).map(nth).collect();
        (!rows.is_empty() && !points.is_empty()).then_some(Strip {
            trade,
            megapixels,
            points,
            rows,
        })
    }

    /// How much room it takes below a chart.
    pub(super) fn height(&self) -> f64 {
        HEAD + PITCH[1] * self.rows.len() as f64
    }

    /// The points it is of, each with the letter that stands beside it in the chart.
    pub(super) fn lettered(&self) -> impl Iterator<Item = (&'a Point, char)> {
        self.points.iter().map(|&n| &self.trade.points[n]).zip('A'..)
    }

    /// Draws it, its upper left corner at a place.
    pub(super) fn draw(&self, sheet: &mut Drawing, [left, top]: [f64; 2]) {
        let mut columns: Vec<(String, [String; 2])> = [crops::SCENE, crops::PHOTO]
            .map(|of| (of.to_owned(), [of.to_owned(), "".into()]))
            .into();
        let about = |point: &Point, name: String| {
            let seconds = point.seconds_a_megapixel(self.megapixels);
            (point.name(), [name, format!("{seconds:.2} s a Mpx")])
        };
        columns
            .extend(self.lettered().map(|(p, letter)| about(p, format!("{letter} {}", p.family))));
        let filed = self.trade.points.iter().find(|point| point.family == FILED);
        columns.extend(filed.map(|point| about(point, "rig file's".to_owned())));
        for (column, (of, words)) in columns.iter().enumerate() {
            let x = left + PITCH[0] * column as f64;
            for (line, words) in words.iter().enumerate() {
                sheet.words(words, [x, top + 26.0 + 14.0 * line as f64], Anchor::Start, 11.0);
            }
            for (row, (scene, what)) in self.rows.iter().enumerate() {
                let is = |crop: &&Crop| crop.scene == *scene && crop.of == *of;
                let Some(crop) = self.trade.crops.iter().find(is) else { continue };
                let y = top + HEAD + PITCH[1] * row as f64;
                sheet.picture([x, y], CROP, &crop.png(), &format!("{what}: {of}"));
            }
        }
    }
}
