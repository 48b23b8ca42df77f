//! Screens of the panel between jobs: the state in large letters, never black.

use super::drawing::{PanelColour, Sheet};
use super::lettering;
use crate::frame::{Codes, Frame, Size, Work};

/// Contents of a screen; [`draw`] adds the fixed words. `others` describes incomplete photos and is
/// empty if there are none; `words` are sentences; `hint` and `to_do` state the next action;
/// `number` counts from 1.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // The names of fields are described above.
pub enum Screen {
    /// No photo waits.
    Ready { hint: String },
    /// Photos wait for the button.
    Waiting { photos: usize, others: String },
    /// Countdown to a photo.
    Counting { seconds: u32 },
    /// A photo is being taken.
    Taking,
    /// Photos wait until the panel is before the lens.
    Asking { photos: usize, words: String, others: String },
    /// The lens is being measured because the panel was moved; `why` describes the drift.
    Measuring { why: String },
    /// A photo is being computed; captures follow on this panel.
    Working { photo: String, number: usize, of: usize },
    /// The last photo, before and after.
    Result { photo: String, untouched: bool, words: String, hint: String },
    /// Photos wait for the night.
    Resting { words: String, photos: usize, others: String },
    /// The operator is needed.
    Trouble { what: String, to_do: String },
    /// Maintenance.
    Maintenance { words: String },
}

/// Hint of a box that waits for photos and the button.
pub(crate) const DROP_AND_PRESS: &str = "Put photos into the inbox, then press the button.";

/// Hint of a box that waits for photos.
pub(crate) const DROP: &str = "Put photos into the inbox.";

/// Hint of a box that takes photos.
pub(crate) const AIM: &str = "Aim the camera, then press the button.";

/// Hint beside a result.
pub(crate) const RESULT_IN_OUTBOX: &str = "The result is in the outbox.";

/// Request to put the panel before the lens.
pub(crate) const ASK: &str =
    "The photo is saved. Put this panel before the lens, or the camera into its dock.";

/// Text of an idle box in maintenance.
pub(crate) const IDLE: &str = "The box waits for you.";

const FLICKER: &str = "Test pictures will flicker here while the box works.";
const KEEP_STILL: &str = "Keep still until the white lamp goes out.";
const ASKING_KEYS: &str = "Short press: take another. Long press: not now.";
const MAINTENANCE_KEYS: &str =
    "Photos wait. Short press: back to work. Long press: measure the lens.";
const RECOVERS: &str = "This message disappears once the problem is fixed. No photo is lost.";

/// The symbol beside the title: one shape per kind of state, legible without colours.
#[derive(Clone, Copy)]
enum Symbol {
    Disc,
    Ring,
    Triangle,
    Bars,
    Square,
    Moon,
}

struct ScreenContent {
    ground: PanelColour,
    symbol: Symbol,
    symbol_colour: PanelColour,
    title: String,
    lines: Vec<(String, PanelColour)>,
}

impl ScreenContent {
    fn new(
        symbol: Symbol,
        title: impl Into<String>,
        lines: Vec<(String, PanelColour)>,
    ) -> ScreenContent {
        let (ground, symbol_colour) = match symbol {
            Symbol::Disc => (SLATE, GREEN),
            Symbol::Ring | Symbol::Bars => (SLATE, SKY),
            Symbol::Square => (SLATE, AMBER),
            Symbol::Moon => (NIGHT, AMBER),
            Symbol::Triangle => (RUST, AMBER),
        };
        ScreenContent { ground, symbol, symbol_colour, title: title.into(), lines }
    }
}

/// Dark but not black, so that the panel is visibly on.
const SLATE: PanelColour = [28, 38, 54];
const RUST: PanelColour = [96, 24, 16];
const NIGHT: PanelColour = [16, 22, 60];
const PAPER: PanelColour = [245, 243, 236];
const SOFT: PanelColour = [176, 186, 200];
const GREEN: PanelColour = [96, 214, 140];
const AMBER: PanelColour = [255, 194, 74];
const SKY: PanelColour = [110, 190, 255];

pub(crate) fn photos(count: usize) -> String {
    if count == 1 { "1 photo".to_owned() } else { format!("{count} photos") }
}

pub(crate) fn photos_wait(count: usize) -> String {
    if count == 1 { "1 photo waits".to_owned() } else { format!("{count} photos wait") }
}

/// Makes a sentence of `words`, with a capital and a full stop.
pub(crate) fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", letters.as_str().trim_end_matches('.'))
}

fn content(screen: &Screen) -> ScreenContent {
    let main = |words: &str| (words.to_owned(), PAPER);
    let soft = |words: &str| (words.to_owned(), SOFT);
    let alert = |words: &str| (words.to_owned(), AMBER);
    let mut content = match screen {
        Screen::Ready { hint } => ScreenContent::new(Symbol::Disc, "Ready", vec![main(hint)]),
        Screen::Waiting { photos: count, others } => {
            let lines = vec![main(&format!("{} to restore", photos(*count))), soft(others)];
            ScreenContent::new(Symbol::Disc, "Press the button", lines)
        }
        Screen::Counting { seconds } => {
            let lines = vec![main("Keep still."), soft("Press again to cancel.")];
            ScreenContent::new(Symbol::Ring, format!("Photo in {seconds} s"), lines)
        }
        Screen::Taking => {
            ScreenContent::new(Symbol::Ring, "Taking the photo", vec![main(KEEP_STILL)])
        }
        Screen::Asking { photos: count, words, others } => {
            let to_restore = photos(*count);
            let keys = soft(&format!("{to_restore} to restore. {ASKING_KEYS}"));
            let lines = vec![main(words), keys, soft(others)];
            let content = ScreenContent::new(Symbol::Square, "Put me before the lens", lines);
            ScreenContent { symbol_colour: GREEN, ..content }
        }
        Screen::Measuring { why } => {
            let lines = vec![main(&sentence(why)), soft(FLICKER)];
            ScreenContent::new(Symbol::Bars, "Measuring the lens", lines)
        }
        Screen::Working { photo, number, of } => {
            let title = match of {
                0 | 1 => "Working".to_owned(),
                of => format!("Working: {number} of {of}"),
            };
            ScreenContent::new(Symbol::Bars, title, vec![main(photo), soft(FLICKER)])
        }
        Screen::Result { photo, untouched, words, hint } => {
            let title = if *untouched { "Returned unchanged" } else { "Done" };
            ScreenContent::new(Symbol::Disc, title, vec![main(photo), soft(words), soft(hint)])
        }
        Screen::Resting { words, photos: count, others } => {
            let title = if *count == 0 { "Resting".to_owned() } else { photos_wait(*count) };
            ScreenContent::new(Symbol::Moon, title, vec![main(&sentence(words)), soft(others)])
        }
        Screen::Trouble { what, to_do } => {
            let lines = vec![main(what), alert(to_do), soft(RECOVERS)];
            ScreenContent::new(Symbol::Triangle, "Please help", lines)
        }
        Screen::Maintenance { words } => {
            let lines = vec![main(words), soft(MAINTENANCE_KEYS)];
            ScreenContent::new(Symbol::Square, "Maintenance", lines)
        }
    };
    content.lines.retain(|(text, _)| !text.is_empty());
    content
}

/// Photo and result, shown side by side.
#[derive(Debug, Clone, Copy)]
pub struct PhotoPair<'a> {
    /// The photo, linear light 0..255.
    pub before: &'a Frame<Work>,
    /// The result, linear light 0..255.
    pub after: &'a Frame<Work>,
}

/// Draws `screen` for a panel of `size`; `pair` is drawn on a [`Screen::Result`] only.
pub fn draw(screen: &Screen, size: Size, pair: Option<PhotoPair<'_>>) -> Codes {
    let ScreenContent { ground, symbol, symbol_colour, mut title, mut lines } = content(screen);
    let mut sheet = Sheet::new(size, ground);
    let (width, height) = (size.width as f32, size.height as f32);
    // Dimensions scale with the panel's height; 0.06 of it keeps clear of edges that panels crop.
    let edge = (0.06 * height).max(2.0);
    let pair = pair.filter(|_| matches!(screen, Screen::Result { .. }));
    let (top, title_px, line_px) = match pair {
        Some(pair) => {
            let below = 0.27 * height;
            (draw_pair(&mut sheet, pair, height - below, ground) + 0.2 * edge, 0.1, 0.06)
        }
        None => (edge, 0.17, 0.085),
    };
    let (title_px, line_px) = (title_px * height, line_px * height);
    let room = width - 2.0 * edge;
    let side = title_px * 0.8;
    draw_symbol(&mut sheet, (symbol, symbol_colour), (edge, top + 0.1 * title_px), side);
    let words_at = edge + side * 1.35;
    // A title is one line, shrunk if necessary.
    let shrunk = |title: &str| {
        let needed = lettering::width(title, title_px);
        title_px * ((width - edge - words_at) / needed.max(1.0)).min(1.0)
    };
    // Below pictures there is little room: a short name goes into the title.
    let named = format!("{title}: {}", lines.first().map_or("", |(name, _)| name));
    if pair.is_some() && lines.len() > 1 && shrunk(&named) > 0.5 * title_px {
        (title, lines) = (named, lines.split_off(1));
    }
    let shrunk = shrunk(&title);
    sheet.line(&title, (words_at, top + (title_px - shrunk) / 2.0), shrunk, PAPER);
    let mut y = top + title_px * 1.2;
    let texts: Vec<&str> = lines.iter().map(|(text, _)| text.as_str()).collect();
    let (px, set) = lettering::fitted(&texts, line_px, (room, height - y - 0.5 * edge));
    for (text, (_, colour)) in set.iter().zip(&lines) {
        for line in text {
            sheet.line(line, (edge, y), px, *colour);
            y += px * lettering::SPACING;
        }
        y += px * lettering::GAP;
    }
    sheet.codes
}

/// Draws `pair` side by side from edge to edge, at most `tall_px` high; returns the height used.
fn draw_pair(sheet: &mut Sheet, pair: PhotoPair<'_>, tall_px: f32, ground: PanelColour) -> f32 {
    let size = sheet.codes.size();
    let gap = (size.width / 200).max(1) as i32;
    let half = (size.width as i32 - gap) / 2;
    let shape = pair.before.size();
    let tall = (half as f32 * shape.height as f32 / shape.width as f32).min(tall_px);
    for (n, (picture, word)) in
        [(pair.before, "before"), (pair.after, "after")].into_iter().enumerate()
    {
        let left = n as i32 * (size.width as i32 - half);
        let place = sheet.picture(picture, (left, 0), (half, tall.ceil() as i32));
        let px = 0.045 * size.height as f32;
        let (wide, high) = ((lettering::width(word, px) + px) as i32, (1.3 * px) as i32);
        let corner = (place.0, tall as i32 - high);
        sheet.rectangle(corner, (wide, high), ground);
        sheet.line(word, (corner.0 as f32 + 0.5 * px, corner.1 as f32 + 0.15 * px), px, PAPER);
    }
    tall
}

fn draw_symbol(
    sheet: &mut Sheet,
    (symbol, colour): (Symbol, PanelColour),
    (x, y): (f32, f32),
    side: f32,
) {
    let unit = move |at: (f32, f32)| (at.0 / side, at.1 / side);
    let from_centre = |(u, v): (f32, f32)| ((u - 0.5).powi(2) + (v - 0.5).powi(2)).sqrt();
    let place = (x as i32, y as i32);
    let whole = (side.ceil() as i32, side.ceil() as i32);
    sheet.shape(place, whole, colour, |px, py| {
        let (u, v) = unit((px, py));
        match symbol {
            Symbol::Disc => from_centre((u, v)) < 0.5,
            Symbol::Ring => (0.34..0.5).contains(&from_centre((u, v))),
            Symbol::Triangle => {
                let inside = v < 0.95 && (u - 0.5).abs() < 0.53 * v;
                // The triangle contains an exclamation mark.
                let bar = (u - 0.5).abs() < 0.06 && (0.35..0.68).contains(&v);
                let dot = (u - 0.5).abs() < 0.06 && (0.76..0.88).contains(&v);
                inside && !bar && !dot
            }
            Symbol::Bars => {
                (u * 5.0) as i32 % 2 == 0 && v > [0.55, 0.0, 0.3, 0.0, 0.0][(u * 5.0) as usize % 5]
            }
            Symbol::Square => (u - 0.5).abs().max((v - 0.5).abs()) > 0.32,
            Symbol::Moon => from_centre((u, v)) < 0.5 && from_centre((u - 0.22, v + 0.12)) > 0.42,
        }
    });
}

#[cfg(test)]
#[path = "screen_tests.rs"]
mod tests;
