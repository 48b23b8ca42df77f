//! Line drawings as self-contained SVG; places are [x, y] from the upper left corner.

use std::fmt::{self, Display, Formatter};

/// A colour: red, green, blue, 0..255.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Colour of words and axes.
pub const INK: Colour = Colour(0x33, 0x33, 0x33);
/// Colour of grid lines.
pub const FAINT: Colour = Colour(0xee, 0xee, 0xee);
const SHEET: Colour = Colour(0xff, 0xff, 0xff);
/// Colour of results below the untouched photo.
pub const HARM: Colour = Colour(0xaa, 0x33, 0x33);

/// Style of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Colour of the line.
    pub colour: Colour,
    /// Width of the line, in units of the sheet.
    pub width: f64,
    /// Whether the line is dashed.
    pub dashed: bool,
}

impl Stroke {
    /// A solid line.
    pub const fn new(colour: Colour, width: f64) -> Self {
        Stroke { colour, width, dashed: false }
    }

    /// This line, dashed.
    #[must_use]
    pub const fn dashed(self) -> Self {
        Stroke { dashed: true, ..self }
    }
}

/// Alignment of words with their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The place is the beginning of the words.
    Start,
    /// The place is the middle of the words.
    Middle,
    /// The place is the end of the words.
    End,
}

/// A white sheet; later elements cover earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    width: f64,
    height: f64,
    elements: String,
    dark_too: bool,
}

/// Style that recolours sheet, words, axes and grid on a dark page; other colours stay.
const ON_DARK: &str = "<style>text:not([fill]){fill:#222}\
    @media(prefers-color-scheme:dark){.sheet{fill:#14161a}text:not([fill]){fill:#ddd}\
    text[fill]{filter:brightness(1.7)}[stroke=\"#333333\"]{stroke:#ccc}\
    [stroke=\"#eeeeee\"]{stroke:#2c2f36}[stroke=\"#000000\"]{stroke:#fff}\
    [fill=\"#000000\"]{fill:#fff}[fill=\"#ffffff\"]{fill:#14161a}}</style>";

impl Drawing {
    /// An empty sheet.
    pub fn new(width: f64, height: f64) -> Self {
        Drawing { width, height, elements: String::new(), dark_too: false }
    }

    /// An empty sheet that turns dark on a dark page.
    pub fn light_and_dark(width: f64, height: f64) -> Self {
        Drawing { dark_too: true, ..Drawing::new(width, height) }
    }

    /// The drawing as an SVG document.
    pub fn svg(&self) -> String {
        let Drawing { width, height, elements, dark_too } = self;
        let style = if *dark_too { ON_DARK } else { "" };
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\">{style}<rect class=\"sheet\" width=\"{width}\" \
             height=\"{height}\" fill=\"white\"/>\n{elements}</svg>\n"
        )
    }

    /// Draws a line through `points`.
    pub fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        self.element(&format!("<path d=\"{}\" {stroke}", Path(points)), "path", "");
    }

    /// Draws a filled polygon with opacity 0..1 and a tooltip.
    pub fn area(&mut self, corners: &[[f64; 2]], fill: Colour, opacity: f64, tip: &str) {
        let opacity = match opacity {
            1.0.. => String::new(),
            opacity => format!(" opacity=\"{opacity}\""),
        };
        self.element(
            &format!("<path d=\"{}Z\" fill=\"{fill}\"{opacity}", Path(corners)),
            "path",
            tip,
        );
    }

    /// Draws a closed outline with a tooltip, filled with `fill` or else with the sheet's colour.
    pub fn outline(
        &mut self,
        corners: &[[f64; 2]],
        fill: Option<Colour>,
        Stroke { colour, width, .. }: Stroke,
        tip: &str,
    ) {
        let fill = fill.unwrap_or(SHEET);
        let opening = format!(
            "<path d=\"{}Z\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"{width}\"",
            Path(corners)
        );
        self.element(&opening, "path", tip);
    }

    /// Draws a filled rectangle between two opposite corners.
    pub fn rectangle(
        &mut self,
        [left, top]: [f64; 2],
        [right, bottom]: [f64; 2],
        fill: Colour,
        opacity: f64,
    ) {
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        self.area(&corners, fill, opacity, "");
    }

    /// Draws a filled circle with a tooltip.
    pub fn disc(&mut self, [x, y]: [f64; 2], radius: f64, fill: Colour, tip: &str) {
        let circle = format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\"");
        self.element(&circle, "circle", tip);
    }

    /// Draws the rim of a circle.
    pub fn ring(&mut self, [x, y]: [f64; 2], radius: f64, stroke: Stroke) {
        let circle = format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {stroke}");
        self.element(&circle, "circle", "");
    }

    /// Writes `words` in letters of height `size`; `at` is a place on their base line.
    pub fn words(&mut self, words: &str, at: [f64; 2], anchor: Anchor, size: f64) {
        self.text("", words, at, anchor, size);
    }

    /// Writes `words` as [`Drawing::words`] does, in `colour`.
    pub fn words_in(
        &mut self,
        colour: Colour,
        words: &str,
        at: [f64; 2],
        anchor: Anchor,
        size: f64,
    ) {
        self.text(&format!(" fill=\"{colour}\""), words, at, anchor, size);
    }

    fn text(&mut self, fill: &str, words: &str, [x, y]: [f64; 2], anchor: Anchor, size: f64) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let words = escaped(words);
        self.elements += &format!(
            "<text{fill} x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\">\
             {words}</text>\n"
        );
    }

    /// Writes words running upwards, centred on their place.
    pub fn words_upwards(&mut self, words: &str, [x, y]: [f64; 2], size: f64) {
        let words = escaped(words);
        self.elements += &format!(
            "<text transform=\"translate({x:.1} {y:.1}) rotate(-90)\" text-anchor=\"middle\" \
             font-size=\"{size}\">{words}</text>\n"
        );
    }

    fn element(&mut self, opening: &str, name: &str, tip: &str) {
        self.elements += opening;
        self.elements += &match tip {
            "" => "/>\n".to_owned(),
            tip => format!("><title>{}</title></{name}>\n", escaped(tip)),
        };
    }
}

struct Path<'a>(&'a [[f64; 2]]);

impl Display for Path<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (n, [x, y]) in self.0.iter().enumerate() {
            write!(f, "{}{x:.1} {y:.1}", if n == 0 { "M" } else { "L" })?;
        }
        Ok(())
    }
}

impl Display for Colour {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

impl Display for Stroke {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"", self.colour, self.width)?;
        if self.dashed { f.write_str(" stroke-dasharray=\"6 4\"") } else { Ok(()) }
    }
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_cannot_break_out_of_their_element() {
        let mut drawing = Drawing::new(10.0, 10.0);
        drawing.words("a<b & c", [1.0, 2.0], Anchor::End, 5.0);
        drawing.disc([3.0, 4.0], 1.0, Colour(255, 0, 16), "</svg>");
        let svg = drawing.svg();
        assert!(
            svg.contains(">a&lt;b &amp; c</text>") && svg.contains("text-anchor=\"end\""),
            "{svg}"
        );
        assert!(svg.contains("fill=\"#ff0010\"><title>&lt;/svg&gt;</title></circle>"), "{svg}");
        assert_eq!(svg.matches("</svg>").count(), 1);
        assert!(!svg.contains("prefers-color-scheme"));
        assert!(Drawing::light_and_dark(1.0, 1.0).svg().contains("prefers-color-scheme:dark"));
    }
}
