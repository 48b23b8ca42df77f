//! A lens model refined by the captures of a photo: its own content is the test pattern.
//!
//! A capture y of a candidate L that is known exactly says what the measured model K̂ gets wrong: y − K̂L = (K − K̂)L and the
//! capture's noise. A small change of K̂'s functions is fitted to it ([`bands`] says what a change is made of, [`squares`]
//! what the capture says, [`fit`] how large a change it calls for), and K̂ with its functions so changed takes its place. It
//! is a lens model like any other: its adjoint is exact, and it costs what K̂ costs.

mod banded;
mod bands;
mod fit;
mod squares;
mod steps;

use rayon::prelude::*;

use super::data_term::{MISSING, TRUSTED};
use super::forward_convolution::Seen;
use super::lens_model::{LensFunctions, LensModel};
use super::level_norms::LevelNorms;
use crate::frame::{Channel, Frame, Plane, Rect, Work};
use bands::Bands;
use fit::{Change, Grid};
use squares::Squares;

/// A refined model.
#[derive(Debug, Clone)]
pub struct Refined {
    /// The lens as the captures say it is.
    pub model: LensModel,
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

/// Noise of a capture at least, grey levels: rounding.
const NOISE_MIN: f32 = 0.289;

impl Refined {
    /// The model and its norms.
    pub fn parts(&self) -> (&LensModel, &[LevelNorms; 3]) {
        (&self.model, &self.level_norms)
    }
}

impl Measured<'_> {
    /// The model refined by what was `seen` of `shown`; `None` when it explains what was seen well enough.
    pub fn refined(&self, shown: &Frame<Work>, seen: &Seen) -> Option<Refined> {
        let functions = self.model.functions();
        let bands = Bands::within(functions.support_px);
        let find = |&c: &Channel| {
            let mut unexplained = Plane::zeros(self.model.canvas());
            self.model.forward(c, shown.plane(c), &mut unexplained);
            let light = seen.light.plane(c).data();
            unexplained.data_mut().iter_mut().zip(light).for_each(|(p, y)| *p = y - *p);
            let mut trusted = seen.trusted.plane(c).map(|t| u8::from(t == TRUSTED));
            let photo = self.trust.plane(c).data();
            trusted.data_mut().iter_mut().zip(photo).for_each(|(t, &p)| *t &= u8::from(p != MISSING));
            let squares = Squares::of(bands, self.photo, shown.plane(c), &unexplained, &trusted);
            let noise = self.capture_noise[c.index()].max(NOISE_MIN);
            (c, fit::find(&squares, f64::from(noise)))
        };
        let changes: Vec<(Channel, Option<Change>)> = self.channels.par_iter().map(find).collect();
        let largest = |of: &dyn Fn(&Change) -> usize| {
            changes.iter().filter_map(|(_, change)| change.as_ref()).map(of).max()
        };
        let (columns, rows) = (largest(&|c| c.grid.columns)?, largest(&|c| c.grid.rows)?);
        let mut changed = spread(functions, columns.max(functions.columns), rows.max(functions.rows));
        for (c, change) in &changes {
            if let Some(change) = change {
                add(&mut changed, *c, change, bands);
            }
        }
        let model = self.model.with_functions(self.photo.size, self.photo.x, &changed).ok()?;
        let level_norms = Channel::ALL.map(|c| {
            let norms = &self.level_norms[c.index()];
            let is_changed = changes.iter().any(|(of, change)| *of == c && change.is_some());
            if is_changed { steps::safe(norms, c, functions, &changed) } else { norms.clone() }
        });
        Some(Refined { model, level_norms })
    }
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
