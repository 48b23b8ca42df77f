//! Checks of a rig by trial captures; each check has its own error.

use super::error::{CONTRAST_MIN, CalibrateError, RESIDUAL_MAX, SATURATED_MAX};
use super::linearity::BENT_MAX;
use crate::calibration::geometric::{Geometry, Pair};
use crate::frame::{Channel, Counts, Plane, Size};

/// Cells along each side of the sensor in which exposure and view are checked.
const CELLS: usize = 16;
/// Least light, as a share of full scale, that is attributed to the panel. Guess.
const LIGHT_MIN: f64 = 0.005;
/// Least light of a lit cell, as a share of the brightest; vignetting is weaker. Guess.
const LIT_SHARE: f64 = 0.2;
/// Least share of the corners in view that must be found.
const CORNERS_MIN: f64 = 0.5;

/// Checks exposure and view by captures of white and black, in the rows where `is_used` holds. The
/// other rows carry frame marks and are never white.
pub(super) fn exposure(
    white: &Counts,
    black: &Counts,
    count_max: u16,
    is_used: &dyn Fn(usize) -> bool,
) -> Result<(), CalibrateError> {
    let rows: Vec<usize> = (0..white.size().height).filter(|&row| is_used(row)).collect();
    let full = f64::from(count_max);
    let mut saturated = 0.0f64;
    let mut contrast = vec![0.0f64; CELLS * CELLS];
    for (white, black) in white.planes().iter().zip(black.planes()) {
        let share = cells(white, &rows, |_, c| f64::from(u8::from(c >= count_max)));
        saturated = share.into_iter().fold(saturated, f64::max);
        let over = cells(white, &rows, |n, c| (f64::from(c) - f64::from(black.data()[n])) / full);
        // A cell is lit if its brightest channel is.
        contrast.iter_mut().zip(over).for_each(|(a, b)| *a = a.max(b));
    }
    let brightest = contrast.iter().copied().fold(0.0, f64::max);
    if saturated > SATURATED_MAX {
        return Err(CalibrateError::OverExposed(saturated));
    }
    if brightest < LIGHT_MIN {
        let found = format!("white is only {:.2} % of full scale above black", 100.0 * brightest);
        return Err(CalibrateError::NotInView(found));
    }
    if brightest < CONTRAST_MIN {
        return Err(CalibrateError::TooDark(brightest));
    }
    let unlit = contrast.iter().filter(|&&c| c < LIT_SHARE * brightest).count();
    if unlit > 0 {
        let share = 100.0 * unlit as f64 / contrast.len() as f64;
        let found =
            format!("{share:.0} % of the camera's picture stays dark when the panel is white");
        return Err(CalibrateError::NotInView(found));
    }
    Ok(())
}

/// Checks that black after white is as dark as black before it, in the rows where `is_used` holds.
pub(super) fn settled(
    white: &Counts,
    blacks: [&Counts; 2],
    is_used: &dyn Fn(usize) -> bool,
) -> Result<(), CalibrateError> {
    let mean = |counts: &Counts, c: Channel| {
        let plane = counts.plane(c);
        let rows = (0..plane.height()).filter(|&row| is_used(row)).map(|row| plane.row(row));
        let (sum, count) =
            rows.flatten().fold((0.0, 0.0), |(sum, count), &v| (sum + f64::from(v), count + 1.0));
        sum / f64::max(count, 1.0)
    };
    let residual = Channel::ALL.map(|c| {
        let [before, after] = blacks.map(|black| mean(black, c));
        (after - before) / f64::max(mean(white, c) - before, 1.0)
    });
    let residual = residual.into_iter().fold(0.0, f64::max);
    if residual > RESIDUAL_MAX {
        return Err(CalibrateError::TooSoon(residual));
    }
    Ok(())
}

/// Means of `value`(index, count) over [`CELLS`]² cells of `rows`.
fn cells(plane: &Plane<u16>, rows: &[usize], value: impl Fn(usize, u16) -> f64) -> Vec<f64> {
    let size = plane.size();
    let mut sums = vec![(0.0, 0.0); CELLS * CELLS];
    for (n, &y) in rows.iter().enumerate() {
        for x in 0..size.width {
            let cell = &mut sums[n * CELLS / rows.len() * CELLS + x * CELLS / size.width];
            *cell = (cell.0 + value(y * size.width + x, plane.at(x, y)), cell.1 + 1.0);
        }
    }
    sums.into_iter().map(|(sum, count)| sum / f64::max(count, 1.0)).collect()
}

/// Checks the focus by the number of corners found: contrast without corners means blur.
pub(super) fn corners(found: usize, expected: usize) -> Result<(), CalibrateError> {
    if (found as f64) < CORNERS_MIN * expected as f64 {
        return Err(CalibrateError::WrongFocus(
            format!("{found} of {expected} corners of the checkerboard were found"),
            format!("{:.0} % or more", 100.0 * CORNERS_MIN),
        ));
    }
    Ok(())
}

/// Median displacement of the corners common to two captures, sensor pixels; infinite if there are
/// none.
pub(super) fn displacement(first: &[Pair], second: &[Pair]) -> (f64, f64) {
    let both = first.iter().filter_map(|a| Some((a, second.iter().find(|b| b.to == a.to)?)));
    let (mut right, mut down): (Vec<f64>, Vec<f64>) =
        both.map(|(a, b)| (b.from.0 - a.from.0, b.from.1 - a.from.1)).unzip();
    let median = |shifts: &mut Vec<f64>| {
        shifts.sort_by(f64::total_cmp);
        shifts.get(shifts.len() / 2).copied().unwrap_or(f64::INFINITY)
    };
    (median(&mut right), median(&mut down))
}

/// Checks that a pattern's capture repeats: its RMS `difference` against the expected `noise` of
/// one capture, both in grey levels.
pub(super) fn repeats(difference: f64, noise: f64) -> Result<(), CalibrateError> {
    // √2 for the noise of both captures, and half as much again for its variation with light.
    let allowed = 1.5 * std::f64::consts::SQRT_2 * noise;
    if difference > allowed {
        let found =
            format!("two captures of the same picture differ by {difference:.2} grey levels RMS");
        return Err(CalibrateError::Moving(found, format!("{allowed:.2}")));
    }
    Ok(())
}

/// Checks that `channel` has no `bend`: a multiple of the exposure and of the counts.
pub(super) fn straight(channel: Channel, bend: Option<(f64, f64)>) -> Result<(), CalibrateError> {
    let Some((times, found)) = bend else { return Ok(()) };
    let [least, most] = [1.0 - BENT_MAX, 1.0 + BENT_MAX].map(|share| share * times);
    let found = format!(
        "{times} times the exposure gives {found:.2} times the counts, allowed {least:.2} to \
         {most:.2}"
    );
    Err(CalibrateError::NotLinear(channel, found))
}

/// The error for counts that no increasing curve explains.
pub(super) fn no_curve() -> CalibrateError {
    let found = "no rising curve fits the counts of longer exposures".to_owned();
    CalibrateError::NotLinear(Channel::Green, found)
}

pub(super) fn on_panel(geometry: &Geometry, panel: Size) -> Result<(), CalibrateError> {
    let d = geometry.work_to_panel.x.domain();
    for (x, y) in [(d.left, d.top), (d.right, d.top), (d.left, d.bottom), (d.right, d.bottom)] {
        let (u, v) = geometry.work_to_panel.at(x, y);
        let off = [-0.5 - u, u - panel.width as f64 + 0.5, -0.5 - v, v - panel.height as f64 + 0.5];
        let off = off.into_iter().fold(0.0, f64::max);
        if off > 0.0 {
            return Err(CalibrateError::NotInView(format!(
                "point ({x:.0}, {y:.0}) of the photo's canvas lies {off:.0} panel pixels outside \
                 the panel"
            )));
        }
    }
    Ok(())
}

/// Checks the focus by the RMS radius of the sharpest lens function, which was fitted on a support
/// of `support_px`. The error names `written_px`, the support in the rig file.
pub(super) fn focus(
    radius_px: f64,
    support_px: f64,
    written_px: usize,
) -> Result<(), CalibrateError> {
    // A Gaussian of this RMS radius has 98 % of its light within half the support.
    let allowed = support_px / 2.0 / 1.98;
    if radius_px > allowed {
        return Err(CalibrateError::WrongFocus(
            format!("the lens blurs to {radius_px:.1} px RMS where it is sharpest"),
            format!("{allowed:.1} px (function-support-px of the rig file is {written_px})"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Frame;

    #[test]
    fn rows_of_frame_marks_need_not_be_white() {
        // A sixteenth of the rows on either side has marks.
        let (size, kept) = (Size::new(64, 48), |row: usize| !(3..45).contains(&row));
        let level = |inside: u16, edge: u16| -> Counts {
            Frame::from_fn(|_| Plane::from_fn(size, |_, y| if kept(y) { edge } else { inside }))
        };
        let (white, black) = (level(180, 16), level(16, 16));
        exposure(&white, &black, 255, &|row| !kept(row)).unwrap();
        let error = exposure(&white, &black, 255, &|_| true).unwrap_err();
        assert!(matches!(error, CalibrateError::NotInView { .. }), "{error}");
    }
}
