//! Line drawings: marks on a sheet, written out as SVG ([`svg`]) and as pixels ([`pixels`]) from
//! the same list.

mod lines;
mod pixels;
mod svg;

pub use lines::{LineChart, Scale, Series};

/// A colour: red, green, blue, 0..255.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Ink of words and axes.
pub const INK: Colour = Colour(0x33, 0x33, 0x33);
/// Grid lines.
pub const FAINT: Colour = Colour(0xee, 0xee, 0xee);
/// Harm: whatever lies below the untouched photo.
pub const HARM: Colour = Colour(0xaa, 0x33, 0x33);

/// Colours told apart by the colour-blind too (Okabe & Ito 2008), and two more, darker.
pub const PALETTE: [Colour; 9] = [
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

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Its colour.
    pub colour: Colour,
    /// Its width, in units of the sheet.
    pub width: f64,
    /// Broken into dashes.
    pub dashed: bool,
}

impl Stroke {
    /// A whole line.
    pub const fn new(colour: Colour, width: f64) -> Self {
        Stroke { colour, width, dashed: false }
    }

    /// The same line in dashes.
    #[must_use]
    pub const fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }
}

/// Where words stand relative to their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The place is where they begin.
    Start,
    /// The place is their middle.
    Middle,
    /// The place is where they end.
    End,
}

/// One thing drawn; places are [x, y] from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A line through points.
    Line(Vec<[f64; 2]>, Stroke),
    /// A filled polygon: corners, colour, opacity 0..1, and words shown when pointed at.
    Area(Vec<[f64; 2]>, Colour, f64, String),
    /// A filled circle: centre, radius, colour, and words shown when pointed at.
    Disc([f64; 2], f64, Colour, String),
    /// A circle's rim: centre and radius.
    Ring([f64; 2], f64, Stroke),
    /// Words on a base line at a place, in letters of a size.
    Words(String, [f64; 2], Anchor, f64),
    /// Words that run upwards, their middle at a place.
    Upwards(String, [f64; 2], f64),
}

/// A sheet with marks on it, the later ones above the earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Width of the sheet.
    pub width: f64,
    /// Its height.
    pub height: f64,
    /// What is on it.
    pub marks: Vec<Mark>,
}

impl Drawing {
    /// An empty white sheet.
    pub fn new(width: f64, height: f64) -> Self {
        Drawing { width, height, marks: Vec::new() }
    }

    /// Draws a line.
    pub fn line(&mut self, points: impl Into<Vec<[f64; 2]>>, stroke: Stroke) {
        self.marks.push(Mark::Line(points.into(), stroke));
    }

    /// Fills the rectangle from corner to corner.
    pub fn rectangle(
        &mut self,
        [left, top]: [f64; 2],
        [right, bottom]: [f64; 2],
        fill: Colour,
        opacity: f64,
    ) {
        let corners = vec![[left, top], [right, top], [right, bottom], [left, bottom]];
        self.marks.push(Mark::Area(corners, fill, opacity, String::new()));
    }

    /// Writes words.
    pub fn words(&mut self, words: impl Into<String>, at: [f64; 2], anchor: Anchor, size: f64) {
        self.marks.push(Mark::Words(words.into(), at, anchor, size));
    }
}
