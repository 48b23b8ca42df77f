//! A lens model refined by the captures of a photo: its own content is the test pattern.
//!
//! A capture y of a candidate L that is known exactly says what the measured model K̂ gets wrong: y
//! − K̂L = (K − K̂)L and the capture's noise. A small change of K̂'s functions is fitted to it
//! ([`bands`] says what a change is made of, [`squares`] what the capture says, [`fit`] how large a
//! change it calls for), and K̂ with its functions so changed takes its place. It is a lens model
//! like any other: its adjoint is exact, and it costs what K̂ costs.

mod banded;
mod bands;
pub mod displacement;
mod fit;
mod squares;
mod steps;

use rayon::prelude::*;

use super::data_term::{MISSING, NOISE_MIN, TRUSTED};
use super::forward_convolution::Seen;
use super::lens_model::{LensFunctions, LensModel};
use super::level_norms::LevelNorms;
use crate::frame::{Channel, Frame, Plane, Rect, Work};
use bands::Bands;
use fit::{Change, Grid};
use squares::Squares;

/// A lens as captures say it is, where it was measured to be: a panel that was knocked moves every
/// capture, and no photo. See [`displacement`]. Functions and not a model, which takes tens of MiB.
#[derive(Debug, Clone)]
pub struct RefinedLens {
    /// Its functions.
    pub functions: LensFunctions,
    /// Its level norms.
    pub level_norms: [LevelNorms; 3],
}

/// What a refinement starts from.
#[derive(Debug, Clone, Copy)]
pub struct Measured<'a> {
    /// Where the photo lies on the canvas.
    pub photo: Rect,
    /// The channels to be refined.
    pub channels: &'a [Channel],
    /// What each pixel of the photo is worth; where nothing is known, captures are not looked at.
    pub trust: &'a Frame<Work, u8>,
    /// The lens as measured.
    pub model: &'a LensModel,
    /// Its level norms.
    pub level_norms: &'a [LevelNorms; 3],
    /// Standard deviation of a capture's noise per channel, grey levels.
    pub capture_noise: [f32; 3],
}

impl Measured<'_> {
    /// The lens by which the photo is judged and the model that explains its captures, where
    /// `unexplained`, the residual of the capture `seen` of `shown` under the measured model, calls
    /// for another than the measured one.
    pub fn refine(
        &self,
        shown: &Frame<Work>,
        seen: &Seen,
        unexplained: &Frame<Work>,
    ) -> Option<(RefinedLens, LensModel)> {
        let looked_at: Frame<Work, u8> = Frame::from_fn(|c| {
            let photo = self.trust.plane(c).data();
            let mut at = seen.trusted.plane(c).map(|t| u8::from(t == TRUSTED));
            at.data_mut().iter_mut().zip(photo).for_each(|(t, &p)| *t &= u8::from(p != MISSING));
            at
        });
        self.fitted(shown, unexplained, &looked_at)
    }

    /// The model of `functions` on the same canvas.
    fn model_of(&self, functions: &LensFunctions) -> Option<LensModel> {
        self.model.with_functions(self.photo.size, self.photo.x, functions).ok()
    }

    fn noise(&self, channel: Channel) -> f64 {
        f64::from(self.capture_noise[channel.index()].max(NOISE_MIN))
    }

    /// The model changed so that it explains what it leaves `unexplained`; `None` when it explains
    /// well enough what was `looked_at`.
    fn fitted(
        &self,
        shown: &Frame<Work>,
        unexplained: &Frame<Work>,
        looked_at: &Frame<Work, u8>,
    ) -> Option<(RefinedLens, LensModel)> {
        let functions = self.model.functions();
        let bands = Bands::within(functions.support_px);
        let find = |&c: &Channel| {
            let (noise, left, at) = (self.noise(c), unexplained.plane(c), looked_at.plane(c));
            if fit::is_explained(mean_power(left, at) / noise.powi(2)) {
                return (c, None);
            }
            let squares = Squares::of(bands, self.photo, shown.plane(c), left, at);
            (c, fit::find(&squares, noise))
        };
        let changes: Vec<(Channel, Option<Change>)> = self.channels.par_iter().map(find).collect();
        let largest = |of: &dyn Fn(&Change) -> usize| {
            changes.iter().filter_map(|(_, change)| change.as_ref()).map(of).max()
        };
        let (columns, rows) = (largest(&|c| c.grid.columns)?, largest(&|c| c.grid.rows)?);
        let mut changed =
            spread(functions, columns.max(functions.columns), rows.max(functions.rows));
        for (c, change) in &changes {
            if let Some(change) = change {
                add(&mut changed, *c, change, bands);
            }
        }
        let moved = displacement::moved(functions, &changed, self.channels);
        let back = displacement::shifted(&changed, (-moved.0, -moved.1));
        let level_norms = Channel::ALL.map(|c| {
            let norms = &self.level_norms[c.index()];
            let is_changed = changes.iter().any(|(of, change)| *of == c && change.is_some());
            if is_changed { steps::safe(norms, c, functions, &changed) } else { norms.clone() }
        });
        log::debug!("captures lie {:.2}, {:.2} px aside", moved.0, moved.1);
        Some((RefinedLens { functions: back, level_norms }, self.model_of(&changed)?))
    }
}

/// Mean square of `plane` where it is `looked_at`.
fn mean_power(plane: &Plane, looked_at: &Plane<u8>) -> f64 {
    let (mut sum, mut count) = (0.0f64, 0u32);
    for (&v, _) in plane.data().iter().zip(looked_at.data()).filter(|(_, at)| **at != 0) {
        sum += f64::from(v * v);
        count += 1;
    }
    sum / f64::from(count.max(1))
}

/// `functions` on a grid of `columns` × `rows`, interpolated as the model does.
fn spread(functions: &LensFunctions, columns: usize, rows: usize) -> LensFunctions {
    if (columns, rows) == (functions.columns, functions.rows) {
        return functions.clone();
    }
    let old = Grid { columns: functions.columns, rows: functions.rows };
    let area = functions.support_px.pow(2);
    let taps = Channel::ALL.map(|c| {
        let mut all = vec![0.0f32; rows * columns * area];
        for (n, taps) in all.chunks_exact_mut(area.max(1)).enumerate() {
            for (place, weight) in old.at(centre(n, columns, rows)) {
                let from = functions.function(c, place % old.rows, place / old.rows);
                taps.iter_mut().zip(from).for_each(|(t, f)| *t += weight as f32 * f);
            }
        }
        all
    });
    LensFunctions { rows, columns, taps, ..functions.clone() }
}

/// The centre of the `n`-th function of a grid, as shares of the photo.
fn centre(n: usize, columns: usize, rows: usize) -> (f64, f64) {
    (((n % columns) as f64 + 0.5) / columns as f64, ((n / columns) as f64 + 0.5) / rows as f64)
}

/// Adds `change` to the functions of one channel.
fn add(functions: &mut LensFunctions, channel: Channel, change: &Change, bands: Bands) {
    let (columns, rows, area) = (functions.columns, functions.rows, functions.support_px.pow(2));
    for (n, taps) in functions.taps[channel.index()].chunks_exact_mut(area.max(1)).enumerate() {
        let more = bands.taps(&change.at(centre(n, columns, rows)));
        taps.iter_mut().zip(more).for_each(|(tap, m)| *tap += m);
    }
}

#[cfg(test)]
mod tests;
