//! Words in pixels: one bold face, set in lines that fit.

use std::sync::OnceLock;

use ab_glyph::{Font as _, FontRef, PxScale, ScaleFont as _};

/// DejaVu Sans Bold, cut down to Latin, Greek and Cyrillic; its licence lies beside it.
const FACE: &[u8] = include_bytes!("font/DejaVuSans-Bold-subset.ttf");

/// Letters of a word and words of a text that any screen has room for; what comes after is not
/// looked at.
const LETTERS_MAX: usize = 100;
const WORDS_MAX: usize = 200;

/// The face; `None` if the file built in were damaged, which a test rules out.
fn face() -> Option<&'static FontRef<'static>> {
    static PARSED: OnceLock<Option<FontRef<'static>>> = OnceLock::new();
    PARSED.get_or_init(|| FontRef::try_from_slice(FACE).ok()).as_ref()
}

/// Width in pixels of `text` in letters `height_px` high (ascent to descent).
pub fn width(text: &str, height_px: f32) -> f32 {
    let Some(face) = face() else { return 0.0 };
    let face = face.as_scaled(PxScale::from(height_px));
    text.chars().map(|c| face.h_advance(face.glyph_id(c))).sum()
}

/// Sets `text` with its upper left corner at (`x`, `y`): calls `ink` with place and coverage, 0..1,
/// of each pixel.
pub fn set(text: &str, (x, y): (f32, f32), height_px: f32, ink: &mut dyn FnMut(i32, i32, f32)) {
    let Some(face) = face() else { return };
    let scaled = face.as_scaled(PxScale::from(height_px));
    let (mut x, base) = (x, y + scaled.ascent());
    for c in text.chars() {
        let id = scaled.glyph_id(c);
        let glyph = id.with_scale_and_position(PxScale::from(height_px), ab_glyph::point(x, base));
        if let Some(outline) = face.outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            outline.draw(|dx, dy, coverage| {
                ink(corner.x as i32 + dx as i32, corner.y as i32 + dy as i32, coverage.min(1.0));
            });
        }
        x += scaled.h_advance(id);
    }
}

/// `text` in lines no wider than `width_px` and at most `lines_max` of them; what does not fit ends
/// in `…`. A word too long for a line is cut in its middle, so that the ending of a file's name
/// stays.
pub fn wrapped(text: &str, height_px: f32, width_px: f32, lines_max: usize) -> Vec<String> {
    let fits = |line: &str| width(line, height_px) <= width_px;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace().take(WORDS_MAX) {
        let word = shortened(word, &fits);
        let full = lines.len() >= lines_max;
        match lines.last_mut() {
            Some(line) if fits(&format!("{line} {word}")) => {
                line.push(' ');
                line.push_str(&word);
            }
            Some(last) if full => {
                while !fits(&format!("{last} …")) && last.pop().is_some() {}
                last.push_str(" …");
                break;
            }
            _ => lines.push(word),
        }
    }
    lines
}

/// `word` with as much of its middle left out as `fits` asks for.
fn shortened(word: &str, fits: &dyn Fn(&str) -> bool) -> String {
    if fits(word) {
        return word.to_owned();
    }
    let letters: Vec<char> = word.chars().collect();
    for kept in (2..letters.len().min(LETTERS_MAX)).rev() {
        let (head, tail) = (kept.div_ceil(2), kept / 2);
        let cut = letters[..head].iter().chain(&['…']).chain(&letters[letters.len() - tail..]);
        let cut: String = cut.collect();
        if fits(&cut) {
            return cut;
        }
    }
    "…".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_face_is_whole_and_has_the_letters_of_the_screens() {
        let face = face().expect("a font");
        for c in "Ready.0123456789 äöüß éèñ øå čšž ąęł … · × — →".chars() {
            assert_ne!(face.glyph_id(c).0, 0, "no letter {c}");
        }
    }

    #[test]
    fn lines_fit_and_what_does_not_is_marked() {
        let text =
            "No frame came from the camera, and the panel is gone as well, and so is the light";
        let lines = wrapped(text, 20.0, 300.0, 2);
        assert_eq!(lines.len(), 2);
        assert!(
            lines.iter().all(|l| width(l, 20.0) <= 300.0) && lines[1].ends_with('…'),
            "{lines:?}"
        );
        assert_eq!(wrapped(text, 20.0, 1e6, 2), [text]);
    }

    #[test]
    fn a_long_name_keeps_its_ending() {
        let name = "a".repeat(200) + ".jpg";
        let lines = wrapped(&name, 20.0, 300.0, 1);
        assert!(
            lines[0].ends_with(".jpg") && lines[0].contains('…') && width(&lines[0], 20.0) <= 300.0
        );
    }
}
