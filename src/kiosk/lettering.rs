//! Text in pixels: one bold face, broken into lines that fit.

use std::sync::OnceLock;

use ab_glyph::{Font as _, FontRef, PxScale, ScaleFont as _};

/// DejaVu Sans Bold, subset to Latin, Greek and Cyrillic; its licence is beside it.
const FACE: &[u8] = include_bytes!("font/DejaVuSans-Bold-subset.ttf");

/// Limits of letters in a word and words in a text, beyond which text is ignored: no screen holds
/// so many.
const LETTERS_MAX: usize = 100;
const WORDS_MAX: usize = 200;

/// Parsed font; `None` if the file is damaged, which a test excludes.
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

/// Draws `text` with its upper left corner at (`x`, `y`) by calling `ink` with the position and
/// coverage, 0..1, of each pixel.
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

/// Breaks `text` into lines no wider than `width_px`. A word too long for a line is shortened in
/// its middle, so that a file name keeps its extension.
pub fn wrapped(text: &str, height_px: f32, width_px: f32) -> Vec<String> {
    let fits = |line: &str| width(line, height_px) <= width_px;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace().take(WORDS_MAX) {
        let word = shortened(word, &fits);
        match lines.last_mut() {
            Some(line) if fits(&format!("{line} {word}")) => {
                line.push(' ');
                line.push_str(&word);
            }
            _ => lines.push(word),
        }
    }
    lines
}

/// Line spacing, in line heights.
pub const SPACING: f32 = 1.2;
/// Extra spacing between two texts, in line heights.
pub const GAP: f32 = 0.35;

/// Breaks `texts` into lines that fit into `room` (width, height), in letters at most `height_px`
/// high; returns the letters' height and the lines of each text. If even letters of a third of that
/// height do not fit, the last lines are dropped.
pub fn fitted(texts: &[&str], height_px: f32, room: (f32, f32)) -> (f32, Vec<Vec<String>>) {
    let set = |px: f32| -> Vec<Vec<String>> {
        texts.iter().map(|text| wrapped(text, px, room.0)).collect()
    };
    let needed = |px: f32, lines: &[Vec<String>]| {
        let count: usize = lines.iter().map(Vec::len).sum();
        px * (SPACING * count as f32 + GAP * lines.len().saturating_sub(1) as f32)
    };
    let mut px = height_px;
    loop {
        let mut lines = set(px);
        if needed(px, &lines) <= room.1 {
            return (px, lines);
        }
        if px <= height_px / 3.0 {
            while needed(px, &lines) > room.1
                && let Some(last) = lines.iter_mut().rev().find(|lines| !lines.is_empty())
            {
                last.pop();
            }
            return (px, lines);
        }
        px *= 0.95;
    }
}

/// Replaces as little as possible of the middle of `word` by an ellipsis, so that it `fits`.
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
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_face_has_the_letters_of_the_screens() {
        let face = face().expect("a font");
        for c in "Ready.0123456789 äöüß éèñ øå čšž ąęł … · × — →".chars() {
            assert_ne!(face.glyph_id(c).0, 0, "no letter {c}");
        }
    }

    #[test]
    fn text_shrinks_until_it_fits() {
        let text =
            "No frame came from the camera, and the panel is gone as well, and so is the light";
        let (px, lines) = fitted(&[text, "Help."], 40.0, (300.0, 150.0));
        assert!((14.0..40.0).contains(&px), "{px}");
        assert!(lines[0].iter().all(|line| width(line, px) <= 300.0));
        assert_eq!(lines[0].join(" "), text);
        assert_eq!(lines[1], ["Help."]);
        assert_eq!(fitted(&[text], 20.0, (1e6, 100.0)), (20.0, vec![vec![text.to_owned()]]));
        // Text that is far too long ends with a full line, without an ellipsis.
        let (_, lines) = fitted(&[&"light ".repeat(1000)], 40.0, (300.0, 150.0));
        assert!(lines[0].len() > 3 && lines[0].iter().all(|line| line.ends_with("light")));
    }

    #[test]
    fn a_long_name_keeps_its_extension() {
        let name = "a".repeat(200) + ".jpg";
        let lines = wrapped(&name, 20.0, 300.0);
        assert!(
            lines[0].ends_with(".jpg") && lines[0].contains('…') && width(&lines[0], 20.0) <= 300.0
        );
    }
}
