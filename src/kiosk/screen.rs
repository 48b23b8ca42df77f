//! What the panel shows between jobs: the state in large plain words. Never black without a reason.

use super::drawing::{PanelColour, Sheet};
use super::lettering;
use crate::frame::{Codes, Frame, Size, Work};

/// A screen. What the words are about is in their fields; [`draw`] knows the words.
#[derive(Debug, Clone, PartialEq)]
pub enum Screen {
    /// Devices are being opened.
    Starting {
        /// What is going on.
        words: String,
    },
    /// Nothing waits.
    Ready {
        /// What one may do now.
        hint: String,
    },
    /// Photos wait for the button.
    Waiting {
        /// How many.
        photos: usize,
        /// Those that cannot be taken yet, in words; empty when there are none.
        others: String,
    },
    /// A photo is about to be taken.
    Counting {
        /// In so many seconds.
        seconds: u32,
    },
    /// A photo is being taken.
    Taking,
    /// Photos wait for the panel to be put before the lens.
    Asking {
        /// How many.
        photos: usize,
        /// How, or what is wrong with how it stands.
        words: String,
        /// Those that cannot be taken yet, in words; empty when there are none.
        others: String,
    },
    /// The panel stands otherwise than it did.
    Measuring {
        /// By how much.
        why: String,
    },
    /// A photo is being read and computed; its captures will follow on this panel.
    Working {
        /// Its name.
        photo: String,
        /// Its number in this go, from 1.
        number: usize,
        /// How many there are in this go.
        of: usize,
    },
    /// The photo restored last, before and after.
    Result {
        /// Its name.
        photo: String,
        /// The photo itself is the result.
        untouched: bool,
        /// The certificate in words, or why it was left as it was.
        words: String,
        /// What one may do now.
        hint: String,
    },
    /// Photos wait for their time.
    Resting {
        /// For what.
        words: String,
        /// How many wait.
        photos: usize,
        /// Those that cannot be taken yet, in words; empty when there are none.
        others: String,
    },
    /// Photos wait for their time, and the last night passed them by.
    Missed {
        /// Since when, and what passed.
        what: String,
        /// Why.
        why: String,
        /// How many wait.
        photos: usize,
        /// Those that cannot be taken yet, in words; empty when there are none.
        others: String,
    },
    /// Somebody is needed.
    Trouble {
        /// What is wrong.
        what: String,
        /// What to do.
        to_do: String,
    },
    /// The button was held at the start.
    Maintenance {
        /// What is going on.
        words: String,
    },
}

/// The symbol beside the title: a shape a state, so that no state is told by colour alone.
#[derive(Clone, Copy)]
enum Symbol {
    Disc,
    Ring,
    Triangle,
    Bars,
    Square,
    Moon,
}

/// Everything a screen says.
struct Said {
    ground: PanelColour,
    symbol: (Symbol, PanelColour),
    title: String,
    lines: Vec<(String, PanelColour)>,
    progress: Option<f32>,
}

/// Dark, and clearly not black: a panel that is on looks on.
const SLATE: PanelColour = [28, 38, 54];
const RUST: PanelColour = [96, 24, 16];
const NIGHT: PanelColour = [16, 22, 60];
const PAPER: PanelColour = [245, 243, 236];
const SOFT: PanelColour = [176, 186, 200];
const GREEN: PanelColour = [96, 214, 140];
const AMBER: PanelColour = [255, 194, 74];
const SKY: PanelColour = [110, 190, 255];

fn photos(count: usize) -> String {
    if count == 1 { "1 photo".to_owned() } else { format!("{count} photos") }
}

fn wait(count: usize) -> String {
    match count {
        0 => "Resting".to_owned(),
        1 => "1 photo waits".to_owned(),
        n => format!("{n} photos wait"),
    }
}

/// With a capital and a full stop.
pub(crate) fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", letters.as_str().trim_end_matches('.'))
}

/// `lines`, and the `others` under them, if there are any.
fn with(others: &str, lines: Vec<(String, PanelColour)>) -> Vec<(String, PanelColour)> {
    let last = Some(others).filter(|words| !words.is_empty());
    lines.into_iter().chain(last.map(|words| (words.to_owned(), SOFT))).collect()
}

fn said(screen: &Screen) -> Said {
    let plain = |symbol, title: &str, lines: Vec<(String, PanelColour)>| Said {
        ground: SLATE,
        symbol,
        title: title.to_owned(),
        lines,
        progress: None,
    };
    match screen {
        Screen::Starting { words } => {
            plain((Symbol::Ring, SKY), "One moment", vec![(words.clone(), PAPER)])
        }
        Screen::Ready { hint } => {
            plain((Symbol::Disc, GREEN), "Ready", vec![(hint.clone(), PAPER)])
        }
        Screen::Waiting { photos: count, others } => plain(
            (Symbol::Disc, GREEN),
            "Press the button",
            with(others, vec![(format!("{} to restore", photos(*count)), PAPER)]),
        ),
        Screen::Counting { seconds } => plain(
            (Symbol::Ring, SKY),
            &format!("Photo in {seconds} s"),
            vec![
                ("Keep still.".to_owned(), PAPER),
                ("Press again to take no photo.".to_owned(), SOFT),
            ],
        ),
        Screen::Taking => {
            let words = "Keep still until the white lamp goes out.".to_owned();
            plain((Symbol::Ring, SKY), "Taking the photo", vec![(words, PAPER)])
        }
        Screen::Asking { photos: count, words, others } => {
            let count = photos(*count);
            let press =
                format!("{count} to restore. Short press: take another. Long press: not now.");
            plain(
                (Symbol::Square, GREEN),
                "Put me before the lens",
                with(others, vec![(words.clone(), PAPER), (press, SOFT)]),
            )
        }
        Screen::Measuring { why } => plain(
            (Symbol::Bars, SKY),
            "Measuring the lens",
            vec![
                (sentence(why), PAPER),
                ("Test pictures will flicker here: that is the work.".to_owned(), SOFT),
            ],
        ),
        Screen::Working { photo, number, of } => Said {
            progress: Some((number.saturating_sub(1)) as f32 / (*of).max(1) as f32),
            ..plain(
                (Symbol::Bars, SKY),
                &if *of > 1 { format!("Working: {number} of {of}") } else { "Working".to_owned() },
                vec![
                    (photo.clone(), PAPER),
                    ("Test pictures will flicker here: that is the work.".to_owned(), SOFT),
                ],
            )
        },
        Screen::Result { photo, untouched, words, hint } => plain(
            (Symbol::Disc, GREEN),
            if *untouched { "Left as it was" } else { "Done" },
            vec![(photo.clone(), PAPER), (words.clone(), SOFT), (hint.clone(), SOFT)],
        ),
        Screen::Resting { words, photos: count, others } => Said {
            ground: NIGHT,
            ..plain(
                (Symbol::Moon, AMBER),
                &wait(*count),
                with(others, vec![(sentence(words), PAPER)]),
            )
        },
        Screen::Missed { what, why, photos: count, others } => Said {
            ground: RUST,
            ..plain(
                (Symbol::Triangle, AMBER),
                &wait(*count),
                with(others, vec![(sentence(what), PAPER), (sentence(why), AMBER)]),
            )
        },
        Screen::Trouble { what, to_do } => Said {
            ground: RUST,
            ..plain(
                (Symbol::Triangle, AMBER),
                "Please help",
                vec![
                    (what.clone(), PAPER),
                    (to_do.clone(), AMBER),
                    (
                        "This goes away by itself when it is well again. No photo is lost."
                            .to_owned(),
                        SOFT,
                    ),
                ],
            )
        },
        Screen::Maintenance { words } => plain(
            (Symbol::Square, AMBER),
            "Maintenance",
            vec![
                (words.clone(), PAPER),
                (
                    "Photos wait. Short press: back to work. Long press: measure the lens anew."
                        .to_owned(),
                    SOFT,
                ),
            ],
        ),
    }
}

/// Draws `screen` for a panel of `size`; `pictures` are the photo and its result for
/// [`Screen::Result`].
pub fn draw(screen: &Screen, size: Size, pictures: Option<(&Frame<Work>, &Frame<Work>)>) -> Codes {
    let Said { ground, symbol, mut title, mut lines, progress } = said(screen);
    let mut sheet = Sheet::new(size, ground);
    let (width, height) = (size.width as f32, size.height as f32);
    // All measures follow the panel's height; 0.06 of it keeps words clear of the edges some panels
    // cut.
    let edge = (0.06 * height).max(2.0);
    let pictures = pictures.filter(|_| matches!(screen, Screen::Result { .. }));
    let (top, title_px, line_px) = match pictures {
        Some(pictures) => {
            let below = 0.27 * height;
            (draw_pair(&mut sheet, pictures, height - below, ground) + 0.2 * edge, 0.1, 0.06)
        }
        None => (edge, 0.17, 0.085),
    };
    let (title_px, line_px) = (title_px * height, line_px * height);
    let room = width - 2.0 * edge;
    let side = title_px * 0.8;
    draw_symbol(&mut sheet, symbol, (edge, top + 0.1 * title_px), side);
    let words_at = edge + side * 1.35;
    // A title is one line, smaller if it must be.
    let shrunk = |title: &str| {
        let needed = lettering::width(title, title_px);
        title_px * ((width - edge - words_at) / needed.max(1.0)).min(1.0)
    };
    // Beside pictures there is little room: a name that is not too long goes into the title.
    let named = format!("{title}: {}", lines.first().map_or("", |(name, _)| name));
    if pictures.is_some() && lines.len() > 1 && shrunk(&named) > 0.5 * title_px {
        (title, lines) = (named, lines.split_off(1));
    }
    let shrunk = shrunk(&title);
    sheet.line(&title, (words_at, top + (title_px - shrunk) / 2.0), shrunk, PAPER);
    let mut y = top + title_px * 1.2;
    let foot = if progress.is_some() { 0.08 * height + edge } else { edge };
    let texts: Vec<&str> = lines.iter().map(|(text, _)| text.as_str()).collect();
    let (px, set) = lettering::fitted(&texts, line_px, (room, height - y - 0.5 * foot));
    for (text, (_, colour)) in set.iter().zip(&lines) {
        for line in text {
            sheet.line(line, (edge, y), px, *colour);
            y += px * lettering::SPACING;
        }
        y += px * lettering::GAP;
    }
    if let Some(share) = progress {
        let (bar_y, thick) = ((height - edge - 0.05 * height) as i32, (0.05 * height) as i32);
        sheet.rectangle((edge as i32, bar_y), (room as i32, thick), [60, 74, 98]);
        sheet.rectangle((edge as i32, bar_y), ((room * share.clamp(0.0, 1.0)) as i32, thick), SKY);
    }
    sheet.finish()
}

/// Both pictures side by side from edge to edge, at most `tall_px` high; returns where they end.
fn draw_pair(
    sheet: &mut Sheet,
    (before, after): (&Frame<Work>, &Frame<Work>),
    tall_px: f32,
    ground: PanelColour,
) -> f32 {
    let size = sheet.size();
    let gap = (size.width / 200).max(1) as i32;
    let half = (size.width as i32 - gap) / 2;
    let shape = before.size();
    let tall = (half as f32 * shape.height as f32 / shape.width as f32).min(tall_px);
    for (n, (picture, word)) in [(before, "before"), (after, "after")].into_iter().enumerate() {
        let left = n as i32 * (size.width as i32 - half);
        let (place, _) = sheet.picture(picture, (left, 0), (half, tall.ceil() as i32));
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
                // The exclamation mark in it.
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

/// One screen of each kind, for looking at them.
pub fn examples() -> Vec<(&'static str, Screen)> {
    let text = str::to_owned;
    vec![
        (
            "starting",
            Screen::Starting { words: text("The camera and the panel are being looked for.") },
        ),
        (
            "ready",
            Screen::Ready { hint: text("Put photos into the inbox, then press the button.") },
        ),
        (
            "waiting",
            Screen::Waiting {
                photos: 12,
                others: text(
                    "2 photos are still arriving. 1 photo waits for the rest of its file.",
                ),
            },
        ),
        ("counting", Screen::Counting { seconds: 2 }),
        ("taking", Screen::Taking),
        (
            "asking",
            Screen::Asking {
                photos: 1,
                words: text("The camera does not see this panel yet."),
                others: text("1 photo is still arriving."),
            },
        ),
        ("measuring", Screen::Measuring { why: text("displaced by 0.41 px, allowed 0.25") }),
        (
            "working",
            Screen::Working { photo: text("Sommer am Attersee, 1987.jpg"), number: 3, of: 12 },
        ),
        (
            "result",
            Screen::Result {
                photo: text("Sommer am Attersee, 1987.jpg"),
                untouched: false,
                words: text("Photographed through the lens again, this picture is your photo."),
                hint: text("The result is in the outbox."),
            },
        ),
        (
            "resting",
            Screen::Resting {
                words: text("The night begins at 22:00 (Europe/Vienna)."),
                photos: 4000,
                others: String::new(),
            },
        ),
        (
            "missed",
            Screen::Missed {
                what: text(
                    "no photo was restored in the night up to 2026-01-11 06:00 (Europe/Vienna), \
                     though photos wait since 2026-01-10 21:50 (Europe/Vienna)",
                ),
                why: text("the time is not known: no network has set the clock yet"),
                photos: 4000,
                others: String::new(),
            },
        ),
        (
            "trouble",
            Screen::Trouble {
                what: text("The camera is gone: no frame came within 500 ms."),
                to_do: text("Look at the camera's cable. The box tries again every minute."),
            },
        ),
        (
            "maintenance",
            Screen::Maintenance { words: text("The box does no work until you say so.") },
        ),
    ]
}

#[cfg(test)]
#[path = "screen_tests.rs"]
mod tests;
