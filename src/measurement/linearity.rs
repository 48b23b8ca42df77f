//! Whether a camera's counts are straight in light: one code at one, two and three times the
//! exposure, which bring one, two and three times the counts over black. A gamma passes every flat
//! and bends what a lens blurs.

use super::session::Session;
use super::{CalibrateError, judge};
use crate::frame::{Channel, Counts, Plane};
use crate::patterns;

/// Multiples of the exposure.
const TIMES: [f64; 3] = [1.0, 2.0, 3.0];
/// Share of full scale above black that the code is to bring at the longest exposure: white
/// differs over the field, and must not be saturated anywhere.
const BRIGHTEST: f64 = 0.75;
/// A panel's usual exponent, to guess at a code.
const GAMMA: f64 = 2.2;
/// The code that is tried first.
const FIRST_CODE: u8 = 128;

/// Captures it takes: the code found, two of black and one of the code at each exposure, and one
/// once the exposure is again what it was. The first capture after a change may still be of the
/// exposure before.
pub(super) const CAPTURES: usize = 1 + 3 * TIMES.len() + 1;

/// Proves the camera straight, where its exposure can be set.
///
/// # Errors
/// Not linear, or no captures.
pub(super) fn prove(session: &mut Session<'_>) -> Result<(), CalibrateError> {
    session.step("linearity");
    if !session.expose_times(1.0)? {
        log::debug!("the exposure cannot be set: counts are taken to be straight in light");
        return Ok(());
    }
    let readings = readings(session);
    session.expose_times(1.0)?;
    session.raw(&patterns::flat(session.layout.panel, [0; 3]))?;
    for (c, readings) in Channel::ALL.into_iter().zip(readings?) {
        log::debug!("{}: {readings:.1?} counts over black", c.name());
        judge::straight(c, TIMES, readings)?;
    }
    Ok(())
}

/// Counts over black at each exposure, per channel.
fn readings(session: &mut Session<'_>) -> Result<[[f64; 3]; 3], CalibrateError> {
    let panel = session.layout.panel;
    let black = patterns::flat(panel, [0; 3]);
    let full = f64::from(session.layout.saturated);
    let first = means(&session.raw(&patterns::flat(panel, [FIRST_CODE; 3]))?);
    let share = first.into_iter().fold(0.0, f64::max) / full;
    let factor = BRIGHTEST / TIMES[2] / share.max(1.0 / full);
    let code = (f64::from(FIRST_CODE) * factor.powf(1.0 / GAMMA)).clamp(16.0, 255.0);
    let flat = patterns::flat(panel, [code as u8; 3]);
    let mut all = [[0.0; 3]; 3];
    for (n, times) in TIMES.into_iter().enumerate() {
        session.expose_times(times)?;
        session.raw(&black)?;
        let dark = means(&session.raw(&black)?);
        let light = means(&session.raw(&flat)?);
        for c in 0..3 {
            all[c][n] = light[c] - dark[c];
        }
    }
    Ok(all)
}

/// Mean counts of the middle quarter of the sensor, where the panel is seen for certain.
fn means(counts: &Counts) -> [f64; 3] {
    counts.planes().each_ref().map(|plane: &Plane<u16>| {
        let (width, height) = (plane.width(), plane.height());
        let columns = width / 4..width - width / 4;
        let rows = height / 4..height - height / 4;
        let count = (columns.len() * rows.len()).max(1) as f64;
        let of_row = |y| plane.row(y)[columns.clone()].iter().map(|&c| f64::from(c)).sum::<f64>();
        rows.map(of_row).sum::<f64>() / count
    })
}
