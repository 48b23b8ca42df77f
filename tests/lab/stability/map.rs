//! The map of faults and methods, as a drawing in SVG: where results gain, where they harm, and
//! what is delivered.

use std::fmt::Write;

use super::contestant::Contestant;
use super::fault::Fault;
use super::report::{Cell, HARM};

/// Left edge of the first column and upper edge of the first row.
const ORIGIN: [f64; 2] = [250.0, 118.0];
/// Width and height of one strength's box.
const BOX: [f64; 2] = [20.0, 24.0];
/// From one method to the next, from one fault to the next.
const PITCH: [f64; 2] = [112.0, 30.0];
/// A gain of this much SSIM has the full colour; a loss of it, too.
const FULL: f64 = 0.1;

/// The map of `cells`, headed `title`.
pub fn svg(cells: &[Cell], title: &str) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = draw(&mut out, cells, title);
    out
}

fn draw(out: &mut String, cells: &[Cell], title: &str) -> std::fmt::Result {
    let contestants: Vec<Contestant> = Contestant::ALL
        .into_iter()
        .filter(|c| cells.iter().any(|cell| cell.contestant == *c))
        .collect();
    let faults: Vec<Fault> =
        Fault::ALL.into_iter().filter(|f| cells.iter().any(|cell| cell.fault == *f)).collect();
    let width = ORIGIN[0] + PITCH[0] * contestants.len() as f64 + 20.0;
    let height = ORIGIN[1] + PITCH[1] * faults.len() as f64 + 20.0;
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" \
         font-size=\"13\"><rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\
         <text x=\"20\" y=\"28\" font-size=\"18\">{title}</text>"
    )?;
    legend(out)?;
    for (n, contestant) in contestants.iter().enumerate() {
        let x = ORIGIN[0] + PITCH[0] * n as f64;
        writeln!(out, "<text x=\"{x}\" y=\"{}\">{}</text>", ORIGIN[1] - 8.0, contestant.name())?;
    }
    for (row, fault) in faults.iter().enumerate() {
        let y = ORIGIN[1] + PITCH[1] * row as f64;
        let (name, unit) = fault.name();
        let strengths: Vec<f64> = strengths(cells, *fault);
        let ends = match (strengths.first(), strengths.last()) {
            (Some(first), Some(last)) => format!("{first} … {last} {unit}"),
            _ => String::new(),
        };
        writeln!(
            out,
            "<text x=\"{0}\" y=\"{1}\" text-anchor=\"end\">{name}</text>\
             <text x=\"{0}\" y=\"{2}\" text-anchor=\"end\" font-size=\"10\" \
             fill=\"#666\">{ends}</text>",
            ORIGIN[0] - 10.0,
            y + 11.0,
            y + 23.0
        )?;
        for (column, contestant) in contestants.iter().enumerate() {
            let x = ORIGIN[0] + PITCH[0] * column as f64;
            for cell in cells.iter().filter(|c| c.fault == *fault && c.contestant == *contestant) {
                place(out, cell, [x + BOX[0] * cell.step as f64, y])?;
            }
        }
    }
    out.push_str("</svg>\n");
    Ok(())
}

fn strengths(cells: &[Cell], fault: Fault) -> Vec<f64> {
    let mut found: Vec<(usize, f64)> =
        cells.iter().filter(|c| c.fault == fault).map(|c| (c.step, c.strength)).collect();
    found.sort_by_key(|f| f.0);
    found.dedup();
    found.into_iter().map(|f| f.1).collect()
}

/// Blue where it gains, orange where it harms, white between: told apart by the colour-blind, too.
fn colour(gain: f64) -> String {
    let share = (gain.abs() / FULL).min(1.0);
    // Okabe & Ito's blue and vermilion.
    let full = if gain > 0.0 { [0.0, 114.0, 178.0] } else { [213.0, 94.0, 0.0] };
    let [r, g, b] = full.map(|v: f64| (255.0 + share * (v - 255.0)).round());
    format!("rgb({r},{g},{b})")
}

fn place(out: &mut String, cell: &Cell, [x, y]: [f64; 2]) -> std::fmt::Result {
    let gain = cell.ssim - cell.photo_ssim;
    let title = format!(
        "{}, {} at {} {}: SSIM {:.4}, the photo {:.4}, delivered {:.4}; {} of {} harmful results \
         noticed",
        cell.contestant.name(),
        cell.fault.name().0,
        cell.strength,
        cell.fault.name().1,
        cell.ssim,
        cell.photo_ssim,
        cell.delivered_ssim,
        cell.caught,
        cell.harmful
    );
    writeln!(
        out,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{}\" stroke=\"#bbb\" \
         stroke-width=\"0.5\">\
         <title>{title}</title></rect>",
        BOX[0] - 1.0,
        BOX[1],
        colour(gain)
    )?;
    let (middle_x, middle_y) = (x + (BOX[0] - 1.0) / 2.0, y + BOX[1] / 2.0);
    if cell.delivered_ssim < cell.photo_ssim - HARM {
        // Harm that reaches the customer.
        writeln!(
            out,
            "<path d=\"M{:.1} {:.1}l8 8m0 -8l-8 8\" stroke=\"black\" stroke-width=\"2\"/>",
            middle_x - 4.0,
            middle_y - 4.0
        )?;
    } else if cell.noticed > 0 {
        // Full when every result was noticed, a ring when some were.
        let fill = if cell.noticed == cell.runs { "black" } else { "white" };
        writeln!(
            out,
            "<circle cx=\"{middle_x:.1}\" cy=\"{middle_y:.1}\" r=\"3.5\" fill=\"{fill}\" \
             stroke=\"black\"/>"
        )?;
    }
    Ok(())
}

fn legend(out: &mut String) -> std::fmt::Result {
    let y = 44.0;
    let mut x = 20.0;
    for gain in [-0.1, -0.05, 0.0, 0.05, 0.1] {
        writeln!(
            out,
            "<rect x=\"{x}\" y=\"{y}\" width=\"34\" height=\"16\" fill=\"{}\" stroke=\"#bbb\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"10\">{gain:+}</text>",
            colour(gain),
            x + 17.0,
            y + 28.0
        )?;
        x += 36.0;
    }
    writeln!(
        out,
        "<text x=\"{0}\" y=\"{1}\">the method's own result, SSIM above or below the untouched \
         photo; faults grow to the \
         right, the first box has none</text>\
         <circle cx=\"{2}\" cy=\"{3}\" r=\"3.5\"/><text x=\"{4}\" y=\"{5}\">noticed and replaced \
         (ring: on some views)</text>\
         <path d=\"M{6} {7}l8 8m0 -8l-8 8\" stroke=\"black\" stroke-width=\"2\"/>\
         <text x=\"{8}\" y=\"{5}\">harm delivered</text>",
        x + 10.0,
        y + 12.0,
        x + 16.0,
        y + 28.0,
        x + 26.0,
        y + 32.0,
        x + 330.0,
        y + 24.0,
        x + 346.0
    )
}
