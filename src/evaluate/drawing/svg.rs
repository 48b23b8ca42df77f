//! A drawing as SVG that needs nothing else.

use std::fmt::{self, Display, Formatter, Write};

use super::{Anchor, Colour, Drawing, Mark, Stroke};

impl Drawing {
    /// The drawing as an SVG document.
    pub fn svg(&self) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        let _ = self.write_svg(&mut out);
        out
    }

    fn write_svg(&self, out: &mut String) -> fmt::Result {
        let (width, height) = (self.width, self.height);
        writeln!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\"><rect width=\"{width}\" height=\"{height}\" \
             fill=\"white\"/>"
        )?;
        self.marks.iter().try_for_each(|mark| mark.write_svg(out))?;
        out.write_str("</svg>\n")
    }
}

impl Mark {
    fn write_svg(&self, out: &mut String) -> fmt::Result {
        match self {
            Mark::Line(points, stroke) => writeln!(out, "<path d=\"{}\" {stroke}/>", Path(points)),
            Mark::Area(corners, fill, opacity, words) => {
                write!(out, "<path d=\"{}Z\" fill=\"{fill}\"", Path(corners))?;
                if *opacity < 1.0 {
                    write!(out, " opacity=\"{opacity}\"")?;
                }
                ended(out, "path", words)
            }
            Mark::Disc([x, y], radius, fill, words) => {
                write!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\"")?;
                ended(out, "circle", words)
            }
            Mark::Ring([x, y], radius, stroke) => {
                writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {stroke}/>")
            }
            Mark::Words(words, [x, y], anchor, size) => {
                let anchor = match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                let words = escaped(words);
                writeln!(
                    out,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" \
                     font-size=\"{size}\">{words}</text>"
                )
            }
            Mark::Upwards(words, [x, y], size) => {
                let words = escaped(words);
                writeln!(
                    out,
                    "<text transform=\"translate({x:.1} {y:.1}) rotate(-90)\" \
                     text-anchor=\"middle\" \
                     font-size=\"{size}\">{words}</text>"
                )
            }
        }
    }
}

/// Ends an element, with the words that show when it is pointed at.
fn ended(out: &mut String, element: &str, words: &str) -> fmt::Result {
    match words {
        "" => writeln!(out, "/>"),
        words => writeln!(out, "><title>{}</title></{element}>", escaped(words)),
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
        drawing.marks.push(Mark::Disc([3.0, 4.0], 1.0, Colour(255, 0, 16), "</svg>".to_owned()));
        let svg = drawing.svg();
        assert!(
            svg.contains(">a&lt;b &amp; c</text>") && svg.contains("text-anchor=\"end\""),
            "{svg}"
        );
        assert!(svg.contains("fill=\"#ff0010\"><title>&lt;/svg&gt;</title></circle>"), "{svg}");
        assert_eq!(svg.matches("</svg>").count(), 1);
    }
}
