//! Marks of the methods on a chart; each has a colour and a shape.

use super::drawing::Colour;

/// Shape of a mark, by which methods differ even without colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outline {
    /// A regular polygon with this number of corners, one of them at the top.
    Polygon(usize),
    /// A regular polygon with this number of corners and a side at the top.
    Turned(usize),
    /// A star with this number of points.
    Star(usize),
}

/// Mark of a family of methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    /// Family of methods.
    pub family: &'static str,
    /// Colour of the mark.
    pub colour: Colour,
    /// Shape of the mark.
    pub outline: Outline,
}

const fn mark(family: &'static str, colour: Colour, outline: Outline) -> Mark {
    Mark { family, colour, outline }
}

/// Colours after Okabe & Ito (2008), "Color universal design", some darker; no yellow, which is
/// lost on white.
const MARKS: [Mark; 7] = [
    mark("paper", Colour(0xc2, 0x4e, 0x00), Outline::Turned(4)),
    mark("digital", Colour(0x2f, 0x8f, 0xd0), Outline::Polygon(24)),
    mark("hybrid", Colour(0x00, 0x59, 0x9c), Outline::Polygon(4)),
    mark("block-matching", Colour(0x7b, 0x3a, 0x9e), Outline::Polygon(3)),
    mark("wiener", Colour(0x77, 0x77, 0x77), Outline::Turned(3)),
    mark("richardson-lucy", Colour(0x00, 0x85, 0x61), Outline::Polygon(5)),
    mark("total-variation", Colour(0x8c, 0x6d, 0x1f), Outline::Polygon(6)),
];

/// Mark of all families that are not in [`MARKS`].
const OTHER: Mark = mark("", Colour(0x44, 0x44, 0x44), Outline::Star(4));

/// The mark of `family`.
pub fn mark_of(family: &str) -> Mark {
    MARKS.into_iter().find(|mark| mark.family == family).unwrap_or(OTHER)
}

impl Outline {
    /// Corners of the outline around a centre, at a distance of about `radius`.
    pub fn corners(self, [x, y]: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
        let around = |count: usize, turns: f64, radius_of: &dyn Fn(usize) -> f64| {
            let corner = |n: usize| {
                let angle = std::f64::consts::TAU * (n as f64 / count as f64 + turns);
                [x + radius_of(n) * angle.sin(), y - radius_of(n) * angle.cos()]
            };
            (0..count).map(corner).collect()
        };
        match self {
            Outline::Polygon(count) => around(count, 0.0, &|_| radius),
            Outline::Turned(count) => around(count, 0.5 / count as f64, &|_| radius),
            Outline::Star(count) => {
                around(2 * count, 0.0, &|n| if n % 2 == 0 { 1.3 * radius } else { 0.55 * radius })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::MethodName;

    #[test]
    fn every_method_has_a_colour_and_a_shape_of_its_own() {
        for method in MethodName::ALL {
            assert_ne!(mark_of(method.name()), OTHER, "{}", method.name());
        }
        for (n, mark) in MARKS.iter().enumerate() {
            let before = &MARKS[..n];
            assert!(before.iter().all(|m| m.colour != mark.colour && m.outline != mark.outline));
        }
    }
}
