//! Line drawings as SVG that needs nothing else; places are [x, y] from the upper left corner.

use std::fmt::{self, Display, Formatter};

/// A colour: red, green, blue, 0..255.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Ink of words and axes.
pub const INK: Colour = Colour(0x33, 0x33, 0x33);
/// Grid lines.
pub const FAINT: Colour = Colour(0xee, 0xee, 0xee);
/// The sheet itself.
const SHEET: Colour = Colour(0xff, 0xff, 0xff);
/// Harm: whatever lies below the untouched photo.
pub const HARM: Colour = Colour(0xaa, 0x33, 0x33);

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
    pub const fn dashed(self) -> Self {
        Stroke { dashed: true, ..self }
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

/// A white sheet; what is drawn later lies above what was drawn before.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    width: f64,
    height: f64,
    elements: String,
    dark_too: bool,
}

/// What a dark page makes of sheet, words, axes and grid; colours stay.
const ON_DARK: &str = "<style>text{fill:#222}@media(prefers-color-scheme:dark){\
    .sheet{fill:#14161a}text{fill:#ddd}[stroke=\"#333333\"]{stroke:#ccc}\
    [stroke=\"#eeeeee\"]{stroke:#2c2f36}[stroke=\"#000000\"]{stroke:#fff}\
    [fill=\"#000000\"]{fill:#fff}[fill=\"#ffffff\"]{fill:#14161a}}</style>";

impl Drawing {
    /// An empty sheet.
    pub fn new(width: f64, height: f64) -> Self {
        Drawing { width, height, elements: String::new(), dark_too: false }
    }

    /// An empty sheet that is dark where the page about it is.
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

    /// A line through points.
    pub fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        self.element(&format!("<path d=\"{}\" {stroke}", Path(points)), "path", "");
    }

    /// A filled polygon of an opacity 0..1, with words shown when it is pointed at.
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

    /// A closed outline, filled with a colour or with the sheet's, with words shown when it is
    /// pointed at.
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

    /// The filled rectangle from corner to corner.
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

    /// A filled circle, with words shown when it is pointed at.
    pub fn disc(&mut self, [x, y]: [f64; 2], radius: f64, fill: Colour, tip: &str) {
        let circle = format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\"");
        self.element(&circle, "circle", tip);
    }

    /// A circle's rim.
    pub fn ring(&mut self, [x, y]: [f64; 2], radius: f64, stroke: Stroke) {
        let circle = format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {stroke}");
        self.element(&circle, "circle", "");
    }

    /// A picture, its pixels kept apart, from a PNG file; with words shown when it is pointed at.
    pub fn picture(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], png: &[u8], tip: &str) {
        let opening = format!(
            "<image x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width}\" height=\"{height}\" \
             preserveAspectRatio=\"none\" style=\"image-rendering:pixelated\" \
             href=\"data:image/png;base64,{}\"",
            base64(png)
        );
        self.element(&opening, "image", tip);
    }

    /// Words on a base line, in letters of a size.
    pub fn words(&mut self, words: &str, [x, y]: [f64; 2], anchor: Anchor, size: f64) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let words = escaped(words);
        self.elements += &format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\">\
             {words}</text>\n"
        );
    }

    /// Words that run upwards, their middle at a place.
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

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let at = |n: usize| u32::from(group.get(n).copied().unwrap_or(0));
        let whole = at(0) << 16 | at(1) << 8 | at(2);
        for n in 0..4 {
            text.push(match n <= group.len() {
                true => char::from(DIGITS[(whole >> (18 - 6 * n) & 63) as usize]),
                false => '=',
            });
        }
    }
    text
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_written_as_the_rfc_has_them() {
        for (bytes, text) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

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
