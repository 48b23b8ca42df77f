//! Labels beside their points: each at the free place nearest to its point.

use super::drawing::{Anchor, Colour, Drawing, Stroke};

/// Label of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// The words.
    pub words: String,
    /// The point's place on the sheet.
    pub point: [f64; 2],
    /// Colour of the words.
    pub colour: Colour,
    /// Height of the letters.
    pub size: f64,
}

/// A rectangle of the sheet: left, top, right, bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area(pub [f64; 4]);

impl Area {
    /// The square about `[x, y]`, `half` to each side.
    pub fn about([x, y]: [f64; 2], half: f64) -> Area {
        Area([x - half, y - half, x + half, y + half])
    }

    fn overlap(&self, other: &Area) -> f64 {
        let (a, b) = (self.0, other.0);
        let [width, height] = [0, 1].map(|n| a[n + 2].min(b[n + 2]) - a[n].max(b[n]));
        width.max(0.0) * height.max(0.0)
    }

    fn size(&self) -> f64 {
        (self.0[2] - self.0[0]) * (self.0[3] - self.0[1])
    }
}

/// Mean ratio of a letter's width to its height in a sans-serif face.
const LETTER: f64 = 0.54;
/// Distances of a label from its point that are tried.
const DISTANCES: [f64; 5] = [8.0, 14.0, 24.0, 38.0, 56.0];
/// Directions of a label from its point that are tried, the preferred ones first.
const DIRECTIONS: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [0.0, -1.0],
    [0.0, 1.0],
    [-1.0, 0.0],
    [0.8, -0.8],
    [0.8, 0.8],
    [-0.8, -0.8],
    [-0.8, 0.8],
];

/// Draws `labels` within `field`, clear of `obstacles` and of each other as far as there is room. A
/// thin line leads to the point if the nearest places are taken.
pub fn draw(sheet: &mut Drawing, labels: &[Label], field: Area, obstacles: &[Area]) {
    let mut taken = obstacles.to_vec();
    for label in labels {
        let area = place(label, &field, &taken);
        let [left, top, right, bottom] = area.0;
        let nearest = [label.point[0].clamp(left, right), label.point[1].clamp(top, bottom)];
        let away = (nearest[0] - label.point[0]).hypot(nearest[1] - label.point[1]);
        if away > DISTANCES[1] + 1.0 {
            sheet.line(&[label.point, nearest], Stroke::new(label.colour, 0.6));
        }
        let base = [left, bottom - 0.25 * label.size];
        sheet.words_in(label.colour, &label.words, base, Anchor::Start, label.size);
        taken.push(area);
    }
}

/// The area of `label` that covers least of `taken`, preferring places inside `field` and nearby.
fn place(label: &Label, field: &Area, taken: &[Area]) -> Area {
    let width = LETTER * label.size * label.words.chars().count() as f64;
    let height = 1.15 * label.size;
    let mut best = (f64::INFINITY, Area::about(label.point, 0.0));
    for (far, distance) in DISTANCES.into_iter().enumerate() {
        for (turn, [dx, dy]) in DIRECTIONS.into_iter().enumerate() {
            let x =
                label.point[0] + distance * dx + 0.5 * width * dx.signum() * f64::from(dx != 0.0);
            let y = label.point[1] + distance * dy + 0.5 * height * dy;
            let area = Area([x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height]);
            let covered: f64 = taken.iter().map(|other| area.overlap(other)).sum();
            let outside = area.size() - area.overlap(field);
            let cost = 4.0 * covered + 10.0 * outside + 12.0 * far as f64 + turn as f64;
            if cost < best.0 {
                best = (cost, area);
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::drawing::INK;

    #[test]
    fn labels_of_near_points_do_not_cover_each_other_or_leave_the_field() {
        let field = Area([0.0, 0.0, 400.0, 300.0]);
        let points = [[390.0, 150.0], [385.0, 152.0], [380.0, 148.0], [200.0, 298.0]];
        let mut taken: Vec<Area> = points.iter().map(|&at| Area::about(at, 5.0)).collect();
        for point in points {
            let words = "16+4 steps".to_owned();
            let area = place(&Label { words, point, colour: INK, size: 12.0 }, &field, &taken);
            assert!(taken.iter().all(|other| area.overlap(other) == 0.0), "{area:?}");
            assert!(area.overlap(&field) > area.size() - 1e-9, "{area:?}");
            taken.push(area);
        }
    }
}
