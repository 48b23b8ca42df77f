//! How methods are told apart on a chart: a colour and a shape each.

use super::contestants::{FILED, OUTSIDE};
use super::drawing::Colour;

/// The shape of a mark, so that marks differ in grey and to the colour-blind, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outline {
    /// A regular polygon of so many corners, one of them on top.
    Polygon(usize),
    /// The same, a side on top.
    Turned(usize),
    /// A star of so many points.
    Star(usize),
    /// A cross, upright.
    Plus,
    /// A cross, turned.
    Cross,
}

/// A family's mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    /// The family.
    pub family: &'static str,
    /// Its colour.
    pub colour: Colour,
    /// Its shape.
    pub outline: Outline,
}

const fn mark(family: &'static str, colour: Colour, outline: Outline) -> Mark {
    Mark { family, colour, outline }
}

/// The paper's colour.
pub const PAPER: Colour = Colour(0xd5, 0x5e, 0x00);

/// Colours after Okabe & Ito (2008), "Color universal design", and three more; no yellow, which is
/// lost on white.
pub const MARKS: [Mark; 11] = [
    mark("paper", PAPER, Outline::Turned(4)),
    mark("residual", Colour(0xe6, 0x9f, 0x00), Outline::Cross),
    mark("unmatched", Colour(0xcc, 0x79, 0xa7), Outline::Plus),
    mark("digital", Colour(0x56, 0xb4, 0xe9), Outline::Polygon(24)),
    mark("hybrid", Colour(0x00, 0x72, 0xb2), Outline::Polygon(4)),
    mark("block-matching", Colour(0x5b, 0x3a, 0x9e), Outline::Polygon(3)),
    mark("wiener", Colour(0x77, 0x77, 0x77), Outline::Turned(3)),
    mark("richardson-lucy", Colour(0x00, 0x9e, 0x73), Outline::Polygon(5)),
    mark("total-variation", Colour(0x8c, 0x6d, 0x1f), Outline::Polygon(6)),
    mark(OUTSIDE, Colour(0x7a, 0x33, 0x99), Outline::Star(4)),
    mark(FILED, Colour(0x00, 0x00, 0x00), Outline::Star(5)),
];

impl Outline {
    /// Its corners about a place, `radius` wide.
    pub fn about(self, [x, y]: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
        let around = |count: usize, turns: f64, radius_of: &dyn Fn(usize) -> f64| {
            let corner = |n: usize| {
                let angle = std::f64::consts::TAU * (n as f64 / count as f64 + turns);
                [x + radius_of(n) * angle.sin(), y - radius_of(n) * angle.cos()]
            };
            (0..count).map(corner).collect()
        };
        // As much ink for each.
        let cross = |turns: f64| {
            let arm = 0.33 * radius;
            let corners = [
                [-arm, -1.1 * radius],
                [arm, -1.1 * radius],
                [arm, -arm],
                [1.1 * radius, -arm],
                [1.1 * radius, arm],
                [arm, arm],
                [arm, 1.1 * radius],
                [-arm, 1.1 * radius],
                [-arm, arm],
                [-1.1 * radius, arm],
                [-1.1 * radius, -arm],
                [-arm, -arm],
            ];
            let (sin, cos) = (std::f64::consts::TAU * turns).sin_cos();
            corners.map(|[u, v]| [x + cos * u - sin * v, y + sin * u + cos * v]).to_vec()
        };
        match self {
            Outline::Polygon(count) => around(count, 0.0, &|_| radius),
            Outline::Turned(count) => around(count, 0.5 / count as f64, &|_| radius),
            Outline::Star(count) => {
                around(2 * count, 0.0, &|n| if n % 2 == 0 { 1.3 * radius } else { 0.55 * radius })
            }
            Outline::Plus => cross(0.0),
            Outline::Cross => cross(0.125),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_that_is_tried_has_a_colour_and_a_shape_of_its_own() {
        let rig = crate::config::load(std::path::Path::new("study.toml"))
            .expect("it comes with the program");
        for contestant in crate::chart::contestants::contestants(&rig, false) {
            let has = MARKS.iter().any(|mark| mark.family == contestant.family);
            assert!(has, "{}", contestant.family);
        }
        for (n, mark) in MARKS.iter().enumerate() {
            let before = &MARKS[..n];
            assert!(before.iter().all(|m| m.colour != mark.colour && m.outline != mark.outline));
        }
    }
}
