//! Can this rig be calibrated at all? Judged from a few trial captures, each failure told apart.

use super::CalibrateError;
use crate::calibration::checkerboard::CheckerboardError;
use crate::calibration::geometric::{Geometry, Pair};
use crate::frame::{Channel, Counts, Plane, Size};

/// Cells the sensor is divided into, in each direction, to see where light is missing or too much.
const CELLS: usize = 16;
/// Largest share of saturated pixels in the brightest cell of white. White may end at the largest
/// count: then noise alone saturates half of the pixels (and rounding some more).
const SATURATED_MAX: f64 = 0.98;
/// Least white over black, of full scale: an 8-bit camera then still has 38 counts (guess).
const CONTRAST_MIN: f64 = 0.15;
/// Below this share of full scale there is no light of the panel at all (guess).
const LIGHT_MIN: f64 = 0.005;
/// A cell is lit when it has this share of the brightest one's light; dark corners are brighter
/// (guess).
const LIT_SHARE: f64 = 0.2;
/// Farthest that a corner may move between two captures, sensor pixels: registration off by half a
/// pixel does harm (study).
const SHIFT_MAX_PX: f64 = 0.25;
/// Largest deviation of counts from what so many times the exposure should bring, as a share: twice
/// what a sensor's knee near its full well does, a third of a webcam's gamma (guess).
const BENT_MAX: f64 = 0.1;
/// Most of the picture before that a frame may show: a grey level of 255; `relens check` allows
/// half of it.
const LEFT_MAX: f64 = 0.004;
/// Least share of the corners expected in view that must be found.
const CORNERS_MIN: f64 = 0.5;

/// Judges exposure and view by a capture of white and one of black, in the rows that are `seen`:
/// others are never white.
///
/// # Errors
/// Over-exposed, too dark, or not in view.
pub(super) fn exposure(
    white: &Counts,
    black: &Counts,
    count_max: u16,
    seen: &dyn Fn(usize) -> bool,
) -> Result<(), CalibrateError> {
    let rows: Vec<usize> = (0..white.size().height).filter(|&row| seen(row)).collect();
    let full = f64::from(count_max);
    let mut saturated = 0.0f64;
    let mut contrast = vec![0.0f64; CELLS * CELLS];
    for (white, black) in white.planes().iter().zip(black.planes()) {
        let share = cells(white, &rows, |_, c| f64::from(u8::from(c >= count_max)));
        saturated = share.into_iter().fold(saturated, f64::max);
        let over = cells(white, &rows, |n, c| (f64::from(c) - f64::from(black.data()[n])) / full);
        // The brightest channel says whether a cell is lit.
        contrast.iter_mut().zip(over).for_each(|(a, b)| *a = a.max(b));
    }
    let brightest = contrast.iter().copied().fold(0.0, f64::max);
    if saturated > SATURATED_MAX {
        return Err(CalibrateError::OverExposed {
            found_percent: 100.0 * saturated,
            allowed_percent: 100.0 * SATURATED_MAX,
        });
    }
    if brightest < LIGHT_MIN {
        let found =
            format!("white is {:.2} % of full scale above black anywhere", 100.0 * brightest);
        return Err(CalibrateError::NotInView { found });
    }
    if brightest < CONTRAST_MIN {
        return Err(CalibrateError::TooDark {
            found_percent: 100.0 * brightest,
            allowed_percent: 100.0 * CONTRAST_MIN,
        });
    }
    let unlit = contrast.iter().filter(|&&c| c < LIT_SHARE * brightest).count();
    if unlit > 0 {
        let share = 100.0 * unlit as f64 / contrast.len() as f64;
        return Err(CalibrateError::NotInView {
            found: format!(
                "{share:.0} % of the camera's picture stay dark when the panel is white"
            ),
        });
    }
    Ok(())
}

/// Judges whether black shown after white is as dark as black was before, in the rows `seen`.
///
/// # Errors
/// Too soon.
pub(super) fn settled(
    white: &Counts,
    blacks: [&Counts; 2],
    seen: &dyn Fn(usize) -> bool,
) -> Result<(), CalibrateError> {
    let mean = |counts: &Counts, c: Channel| {
        let plane = counts.plane(c);
        let rows = (0..plane.height()).filter(|&row| seen(row)).map(|row| plane.row(row));
        let (sum, count) =
            rows.flatten().fold((0.0, 0.0), |(sum, count), &v| (sum + f64::from(v), count + 1.0));
        sum / f64::max(count, 1.0)
    };
    let left = Channel::ALL.map(|c| {
        let [before, after] = blacks.map(|black| mean(black, c));
        (after - before) / f64::max(mean(white, c) - before, 1.0)
    });
    let left = left.into_iter().fold(0.0, f64::max);
    if left > LEFT_MAX {
        return Err(CalibrateError::TooSoon {
            found_percent: 100.0 * left,
            allowed_percent: 100.0 * LEFT_MAX,
        });
    }
    Ok(())
}

/// Means of `value`(place, count) over [`CELLS`]² cells of the rows `rows`.
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

/// A board that cannot be made out, in words for the operator.
pub(super) fn board(error: CheckerboardError) -> CalibrateError {
    match error {
        CheckerboardError::NoSpot { .. } | CheckerboardError::SpotsInLine => {
            CalibrateError::NotInView { found: error.to_string() }
        }
        CheckerboardError::NoCorners { .. } => CalibrateError::WrongFocus {
            found: error.to_string(),
            allowed: "blur narrower than half a square is".to_owned(),
        },
    }
}

/// Judges focus by the corners found among those `expected` in view: where there is contrast but no
/// corners, they are blurred away.
///
/// # Errors
/// Wrong focus.
pub(super) fn corners(found: usize, expected: usize) -> Result<(), CalibrateError> {
    if (found as f64) < CORNERS_MIN * expected as f64 {
        return Err(CalibrateError::WrongFocus {
            found: format!("{found} of {expected} corners of the checkerboard can be made out"),
            allowed: format!("{:.0} % or more are", 100.0 * CORNERS_MIN),
        });
    }
    Ok(())
}

/// Judges whether the rig stands still, by the same corners found in two captures.
///
/// # Errors
/// Moving.
pub(super) fn still(first: &[Pair], second: &[Pair]) -> Result<(), CalibrateError> {
    let mut shifts: Vec<f64> = first
        .iter()
        .filter_map(|a| {
            let b = second.iter().find(|b| b.to == a.to)?;
            Some((a.from.0 - b.from.0).hypot(a.from.1 - b.from.1))
        })
        .collect();
    shifts.sort_by(f64::total_cmp);
    let median = shifts.get(shifts.len() / 2).copied().unwrap_or(f64::INFINITY);
    if median > SHIFT_MAX_PX {
        return Err(CalibrateError::Moving {
            found: format!("the picture moved by {median:.2} px"),
            allowed: format!("{SHIFT_MAX_PX} px are"),
        });
    }
    Ok(())
}

/// Judges whether the rig stood still from the first to the last pattern, by the RMS difference of
/// two captures of it, grey levels, and the noise it should have.
///
/// # Errors
/// Moving.
pub(super) fn repeats(difference: f64, noise: f64) -> Result<(), CalibrateError> {
    // √2 for the noise of both, half as much again for what noise varies with light.
    let allowed = 1.5 * std::f64::consts::SQRT_2 * noise;
    if difference > allowed {
        return Err(CalibrateError::Moving {
            found: format!("light changed by {difference:.2} grey levels RMS"),
            allowed: format!("{allowed:.2} are"),
        });
    }
    Ok(())
}

/// Judges whether counts are straight in light, by what one code brings in `channel` over black at
/// `times` the exposure.
///
/// # Errors
/// Not linear.
pub(super) fn straight(
    channel: Channel,
    times: [f64; 3],
    counts: [f64; 3],
) -> Result<(), CalibrateError> {
    for (times, found) in times.into_iter().zip(counts).skip(1) {
        let found = found / counts[0];
        let (least, most) = (times * (1.0 - BENT_MAX), times * (1.0 + BENT_MAX));
        // Written so that a number that is none fails too.
        if !(least..=most).contains(&found) {
            return Err(CalibrateError::NotLinear {
                channel: channel.name(),
                found: format!("{times} times the exposure brings {found:.2} times the counts"),
                allowed: format!("{least:.2} to {most:.2}"),
            });
        }
    }
    Ok(())
}

/// What a camera is told whose counts no rising curve explains.
pub(super) fn no_curve() -> CalibrateError {
    CalibrateError::NotLinear {
        channel: Channel::Green.name(),
        found: "no rising curve explains what longer exposures bring".to_owned(),
        allowed: "counts that rise with light".to_owned(),
    }
}

/// Judges whether the whole canvas can be shown.
///
/// # Errors
/// Not in view.
pub(super) fn on_panel(geometry: &Geometry, panel: Size) -> Result<(), CalibrateError> {
    let d = geometry.work_to_panel.x.domain();
    for (x, y) in [(d.left, d.top), (d.right, d.top), (d.left, d.bottom), (d.right, d.bottom)] {
        let (u, v) = geometry.work_to_panel.at(x, y);
        let off = [-0.5 - u, u - panel.width as f64 + 0.5, -0.5 - v, v - panel.height as f64 + 0.5];
        let off = off.into_iter().fold(0.0, f64::max);
        if off > 0.0 {
            return Err(CalibrateError::NotInView {
                found: format!(
                    "place ({x:.0}, {y:.0}) of the photo's canvas lies {off:.0} panel pixels off \
                     the panel"
                ),
            });
        }
    }
    Ok(())
}

/// Judges focus by the sharpest lens function: its RMS radius must fit the `support_px` it was
/// looked for in. The rig file has functions of `written_px`.
///
/// # Errors
/// Wrong focus.
pub(super) fn focus(
    radius_px: f64,
    support_px: f64,
    written_px: usize,
) -> Result<(), CalibrateError> {
    // A bell of this RMS radius has 98 % of its light within half the support.
    let allowed = support_px / 2.0 / 1.98;
    if radius_px > allowed {
        return Err(CalibrateError::WrongFocus {
            found: format!("the lens blurs to {radius_px:.1} px RMS where it is sharpest"),
            allowed: format!(
                "{allowed:.1} px are (function-support-px of the rig file is {written_px})"
            ),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Frame;

    #[test]
    fn counts_that_follow_the_exposure_are_straight_and_a_gamma_is_not() {
        let counts = |gamma: f64| [1.0, 2.0, 3.0].map(|times: f64| 250.0 * times.powf(gamma));
        let times = [1.0, 2.0, 3.0];
        for gamma in [0.95, 0.98, 1.0, 1.05] {
            straight(Channel::Green, times, counts(gamma)).unwrap();
        }
        for gamma in [0.45, 0.6, 0.8, 1.2, 2.2, f64::NAN] {
            assert!(straight(Channel::Green, times, counts(gamma)).is_err(), "{gamma}");
        }
    }

    #[test]
    fn rows_kept_for_marks_are_not_asked_to_be_white() {
        // A sixteenth of the rows on either side is kept.
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
