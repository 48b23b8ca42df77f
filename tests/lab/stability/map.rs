//! The map of faults and methods: where results gain or harm, in luma and in colour, and what is
//! delivered.

use relens::chart::drawing::{Anchor, Colour, Drawing, Stroke};

use super::cells::{Cell, Sense, methods_of, swept_of};

/// Left edge of the first column and upper edge of the first row.
const ORIGIN: [f64; 2] = [200.0, 214.0];
/// Width and height of the box of one strength.
const BOX: [f64; 2] = [12.0, 20.0];
/// Height of the strip for colour, below the box of one strength.
const STRIP: f64 = 8.0;
/// Distances from one method, and from one fault, to the next.
const PITCH: [f64; 2] = [74.0, 36.0];
/// Size of all letters except the title: a page shows the map about 830 wide.
const LETTERS: f64 = 14.0;
/// Gain or loss of SSIM from which a box has its full colour.
const FULL: f64 = 0.1;
/// Gain or loss of ΔE from which a strip has its full colour.
const FULL_IN_COLOUR: f64 = 1.0;

const BLACK: Colour = Colour(0, 0, 0);
const WHITE: Colour = Colour(255, 255, 255);
const EDGE: Colour = Colour(0xbb, 0xbb, 0xbb);

/// The map of `cells` under `title`.
pub(super) fn draw(cells: &[Cell], title: &str) -> Drawing {
    let (methods, changes) = (methods_of(cells), swept_of(cells));
    let size = |n: usize, count: usize| ORIGIN[n] + PITCH[n] * count as f64 + 8.0;
    let mut sheet = Drawing::new(size(0, methods.len()), size(1, changes.len()));
    sheet.words(title, [20.0, 30.0], Anchor::Start, 20.0);
    legend(&mut sheet);
    for (column, method) in methods.iter().enumerate() {
        let x = ORIGIN[0] + PITCH[0] * column as f64;
        // A name is wider than its column: each word has a line, the last just above the column.
        let words: Vec<&str> = method.split('-').collect();
        for (line, word) in words.iter().rev().enumerate() {
            let y = ORIGIN[1] - 8.0 - 16.0 * line as f64;
            sheet.words(word, [x, y], Anchor::Start, LETTERS - 2.0);
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

/// Blue for a gain, orange for harm, white between; `gain` is a share of the full colour. The pair
/// is distinct for colour-blind readers.
fn colour(gain: f64) -> Colour {
    let share = gain.abs().min(1.0);
    // Okabe & Ito's blue and vermilion.
    let full = if gain > 0.0 { [0.0, 114.0, 178.0] } else { [213.0, 94.0, 0.0] };
    let [r, g, b] = full.map(|v: f64| (255.0 + share * (v - 255.0)).round() as u8);
    Colour(r, g, b)
}

/// Draws a box with an edge.
fn edged(sheet: &mut Drawing, [x, y]: [f64; 2], [width, height]: [f64; 2], gain: f64, tip: &str) {
    sheet.rectangle([x, y], [x + width, y + height], EDGE, 1.0);
    let (right, bottom) = (x + width - 0.5, y + height - 0.5);
    let corners = [[x + 0.5, y + 0.5], [right, y + 0.5], [right, bottom], [x + 0.5, bottom]];
    sheet.area(&corners, colour(gain), 1.0, tip);
}

fn place(sheet: &mut Drawing, cell: &Cell, at: [f64; 2]) {
    let tip = format!(
        "{}, {}: SSIM/ΔE {}, the photo {}, delivered {}; noticed of harmful results: {} of {} in \
         luma, {} of {} in colour",
        cell.method,
        cell.swept.change.words(cell.strength),
        cell.result,
        cell.photo,
        cell.delivered,
        cell.caught.in_luma,
        cell.harmful.in_luma,
        cell.caught.in_colour,
        cell.harmful.in_colour
    );
    let gain = (cell.result.ssim - cell.photo.ssim) / FULL;
    edged(sheet, at, [BOX[0] - 1.0, BOX[1]], gain, &tip);
    let strip = [at[0], at[1] + BOX[1]];
    if let Some(gain) = cell.gain_in_colour() {
        edged(sheet, strip, [BOX[0] - 1.0, STRIP], gain / FULL_IN_COLOUR, &tip);
    }
    let middle = |[x, y]: [f64; 2], height: f64| [x + (BOX[0] - 1.0) / 2.0, y + height / 2.0];
    let delivers = |sense: Sense| sense.harms(cell.delivered, cell.photo);
    if delivers(Sense::Colour) {
        cross(sheet, middle(strip, STRIP), 2.5);
    }
    let middle = middle(at, BOX[1]);
    if delivers(Sense::Luma) {
        // Harm that is delivered.
        cross(sheet, middle, 4.0);
    } else if cell.noticed > 0 {
        // Filled black if every result was noticed, white if only some were.
        sheet.disc(middle, 3.5, if cell.noticed == cell.runs { BLACK } else { WHITE }, "");
        sheet.ring(middle, 3.5, Stroke::new(BLACK, 1.0));
    }
}

fn cross(sheet: &mut Drawing, [x, y]: [f64; 2], arm: f64) {
    let stroke = Stroke::new(BLACK, arm / 2.0);
    sheet.line(&[[x - arm, y - arm], [x + arm, y + arm]], stroke);
    sheet.line(&[[x + arm, y - arm], [x - arm, y + arm]], stroke);
}

fn legend(sheet: &mut Drawing) {
    let (left, y) = (20.0, 46.0);
    for (n, share) in [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().enumerate() {
        let x = left + 52.0 * n as f64;
        edged(sheet, [x, y], [50.0, 18.0], share, "");
        let middle = x + 25.0;
        let signed = |value: f64| match share {
            0.0 => "0".to_owned(),
            _ => format!("{value:+}"),
        };
        for (line, words) in
            [signed(share * FULL), signed(-share * FULL_IN_COLOUR)].iter().enumerate()
        {
            let y = y + 33.0 + 16.0 * line as f64;
            sheet.words(words, [middle, y], Anchor::Middle, LETTERS - 1.0);
        }
    }
    let x = left + 52.0 * 5.0 + 12.0;
    sheet.words(
        "the method's own result against its photo:",
        [x, y + 14.0],
        Anchor::Start,
        LETTERS,
    );
    sheet.words("SSIM of luma, in the boxes", [x, y + 33.0], Anchor::Start, LETTERS);
    sheet.words("mean ΔE, in the strips below", [x, y + 49.0], Anchor::Start, LETTERS);
    let line = |n: f64| y + 76.0 + 20.0 * n;
    sheet.disc([26.0, line(0.0) - 5.0], 3.5, BLACK, "");
    let noticed = "noticed, and something else delivered (ring: on some views)";
    sheet.words(noticed, [38.0, line(0.0)], Anchor::Start, LETTERS);
    cross(sheet, [26.0, line(1.0) - 5.0], 4.0);
    let harm = "harm delivered: in luma, or, in a strip, in colour";
    sheet.words(harm, [38.0, line(1.0)], Anchor::Start, LETTERS);
    let grows = "Faults grow to the right; the first box of a row has none.";
    sheet.words(grows, [20.0, line(2.0)], Anchor::Start, LETTERS);
}
