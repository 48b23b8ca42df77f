//! The map of changes and methods, drawn: where results gain, where they harm, and what is
//! delivered.

use relens::chart::drawing::{Anchor, Colour, Drawing, Stroke};

use super::report::{Cell, HARM, methods_of, swept_of};

/// Left edge of the first column and upper edge of the first row.
const ORIGIN: [f64; 2] = [196.0, 172.0];
/// Width and height of one strength's box.
const BOX: [f64; 2] = [16.0, 26.0];
/// From one method to the next, from one change to the next.
const PITCH: [f64; 2] = [90.0, 36.0];
/// Of all letters but the title's: a page shows the map some 830 wide.
const LETTERS: f64 = 14.0;
/// A gain of this much SSIM has the full colour; a loss of it, too.
const FULL: f64 = 0.1;

const BLACK: Colour = Colour(0, 0, 0);
const WHITE: Colour = Colour(255, 255, 255);
const EDGE: Colour = Colour(0xbb, 0xbb, 0xbb);

/// The map of `cells`, headed `title`.
pub(super) fn draw(cells: &[Cell], title: &str) -> Drawing {
    let (methods, changes) = (methods_of(cells), swept_of(cells));
    let size = |n: usize, count: usize| ORIGIN[n] + PITCH[n] * count as f64 + 20.0;
    let mut sheet = Drawing::new(size(0, methods.len()), size(1, changes.len()));
    sheet.words(title, [20.0, 30.0], Anchor::Start, 20.0);
    legend(&mut sheet);
    for (column, method) in methods.iter().enumerate() {
        let x = ORIGIN[0] + PITCH[0] * column as f64;
        // A line for each of its words, the last on top of the column.
        let words: Vec<&str> = method.split_inclusive('-').collect();
        for (line, word) in words.iter().rev().enumerate() {
            let y = ORIGIN[1] - 8.0 - 16.0 * line as f64;
            sheet.words(word, [x, y], Anchor::Start, LETTERS);
        }
    }
    for (row, swept) in changes.iter().enumerate() {
        let (x, y) = (ORIGIN[0] - 10.0, ORIGIN[1] + PITCH[1] * row as f64);
        let (name, unit) = (swept.change.name, swept.change.unit);
        sheet.words(name, [x, y + 11.0], Anchor::End, LETTERS);
        let of: Vec<&Cell> = cells.iter().filter(|c| c.swept.change.name == name).collect();
        if let (Some(first), Some(last)) =
            (of.iter().min_by_key(|c| c.step), of.iter().max_by_key(|c| c.step))
        {
            let ends = format!("{} … {} {unit}", first.strength, last.strength);
            sheet.words(&ends, [x, y + 26.0], Anchor::End, LETTERS - 1.0);
        }
        for (column, method) in methods.iter().enumerate() {
            let left = ORIGIN[0] + PITCH[0] * column as f64;
            for cell in of.iter().filter(|c| c.method == *method) {
                place(&mut sheet, cell, [left + BOX[0] * cell.step as f64, y]);
            }
        }
    }
    sheet
}

/// Blue where it gains, orange where it harms, white between: told apart by the colour-blind, too.
fn colour(gain: f64) -> Colour {
    let share = (gain.abs() / FULL).min(1.0);
    // Okabe & Ito's blue and vermilion.
    let full = if gain > 0.0 { [0.0, 114.0, 178.0] } else { [213.0, 94.0, 0.0] };
    let [r, g, b] = full.map(|v: f64| (255.0 + share * (v - 255.0)).round() as u8);
    Colour(r, g, b)
}

/// A box with an edge.
fn edged(sheet: &mut Drawing, [x, y]: [f64; 2], [width, height]: [f64; 2], gain: f64, tip: &str) {
    sheet.rectangle([x, y], [x + width, y + height], EDGE, 1.0);
    let (right, bottom) = (x + width - 0.5, y + height - 0.5);
    let corners = [[x + 0.5, y + 0.5], [right, y + 0.5], [right, bottom], [x + 0.5, bottom]];
    sheet.area(&corners, colour(gain), 1.0, tip);
}

fn place(sheet: &mut Drawing, cell: &Cell, at: [f64; 2]) {
    let tip = format!(
        "{}, {}: SSIM {:.4}, the photo {:.4}, delivered {:.4}; {} of {} harmful results noticed",
        cell.method,
        cell.swept.change.words(cell.strength),
        cell.ssim,
        cell.photo_ssim,
        cell.delivered_ssim,
        cell.caught,
        cell.harmful
    );
    edged(sheet, at, [BOX[0] - 1.0, BOX[1]], cell.ssim - cell.photo_ssim, &tip);
    let middle = [at[0] + (BOX[0] - 1.0) / 2.0, at[1] + BOX[1] / 2.0];
    if cell.delivered_ssim < cell.photo_ssim - HARM {
        // Harm that reaches the customer.
        cross(sheet, middle);
    } else if cell.noticed > 0 {
        // Full when every result was noticed, a ring when some were.
        sheet.disc(middle, 3.5, if cell.noticed == cell.runs { BLACK } else { WHITE }, "");
        sheet.ring(middle, 3.5, Stroke::new(BLACK, 1.0));
    }
}

fn cross(sheet: &mut Drawing, [x, y]: [f64; 2]) {
    let stroke = Stroke::new(BLACK, 2.0);
    sheet.line(&[[x - 4.0, y - 4.0], [x + 4.0, y + 4.0]], stroke);
    sheet.line(&[[x + 4.0, y - 4.0], [x - 4.0, y + 4.0]], stroke);
}

fn legend(sheet: &mut Drawing) {
    let (mut x, y) = (20.0, 46.0);
    for gain in [-0.1, -0.05, 0.0, 0.05, 0.1] {
        edged(sheet, [x, y], [46.0, 18.0], gain, "");
        let words = match gain {
            0.0 => "0".to_owned(),
            gain => format!("{gain:+}"),
        };
        sheet.words(&words, [x + 23.0, y + 33.0], Anchor::Middle, LETTERS - 1.0);
        x += 48.0;
    }
    let mut line = |n: usize, words: &str| {
        sheet.words(words, [x + 12.0, y + 14.0 + 20.0 * n as f64], Anchor::Start, LETTERS);
    };
    line(0, "SSIM of the method's own result, above or below the untouched photo's;");
    line(1, "faults grow to the right, the first box has none");
    let y = y + 58.0;
    sheet.disc([26.0, y - 4.0], 3.5, BLACK, "");
    sheet.words("noticed and replaced (ring: on some views)", [38.0, y], Anchor::Start, LETTERS);
    cross(sheet, [374.0, y - 5.0]);
    sheet.words("harm delivered", [386.0, y], Anchor::Start, LETTERS);
}
