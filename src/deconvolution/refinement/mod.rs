//! A lens model refined by the captures of a photo: its own content is the test pattern.
//!
//! A capture y of a candidate L that is known exactly says what the measured model K̂ gets wrong: y
//! − K̂L = (K − K̂)L and the capture's noise. A small change of K̂'s functions is fitted to it
//! ([`bands`] says what a change is made of, [`squares`] what the capture says, [`fit`] how large a
//! change it calls for), and K̂ with its functions so changed takes its place. It is a lens model
//! like any other: its adjoint is exact, and it costs what K̂ costs.
//!
//! What one photo's capture says of the lens is held against the captures of the next photos
//! ([`CaptureFinding::learnt_holds`]); what has proved itself there is good enough for the rig
//! ([`crate::pipeline`]).

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
pub struct Learnt {
    /// Its functions.
    pub functions: LensFunctions,
    /// Its level norms.
    pub level_norms: [LevelNorms; 3],
}

/// What a look at a capture says of the lens.
#[derive(Debug, Clone, Default)]
pub struct CaptureFinding {
    /// The lens that this photo was taken through, where the measured one fails.
    pub refined: Option<Learnt>,
    /// Whether what captures of other photos say of the lens holds for this one, too. `None` when
    /// nothing was learnt, or when this capture cannot tell.
    pub learnt_holds: Option<bool>,
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
    /// The lens as captures of other photos say it is.
    pub learnt: Option<&'a Learnt>,
    /// Standard deviation of a capture's noise per channel, grey levels.
    pub capture_noise: [f32; 3],
}

impl Measured<'_> {
    /// What a capture, `seen` when `shown` was shown, says of the lens, and the model by which this
    /// photo's captures are explained from now on, where that is another; `unexplained` is what the
    /// measured one leaves of it.
    pub fn look(
        &self,
        shown: &Frame<Work>,
        seen: &Seen,
        unexplained: &Frame<Work>,
    ) -> (CaptureFinding, Option<LensModel>) {
        let looked_at: Frame<Work, u8> = Frame::from_fn(|c| {
            let photo = self.trust.plane(c).data();
            let mut at = seen.trusted.plane(c).map(|t| u8::from(t == TRUSTED));
            at.data_mut().iter_mut().zip(photo).for_each(|(t, &p)| *t &= u8::from(p != MISSING));
            at
        });
        let learnt = self.learnt.and_then(|learnt| {
            let model = self.model_of(&learnt.functions)?;
            let left = seen.unexplained(&model.seen(self.channels, shown), self.channels);
            let holds =
                fit::holds(&self.powers(unexplained, &looked_at), &self.powers(&left, &looked_at));
            Some((learnt, model, left, holds))
        });
        let learnt_holds = learnt.as_ref().and_then(|of| of.3);
        let refined = match learnt {
            Some((learnt, model, left, Some(true))) => {
                let from = Measured { model: &model, level_norms: &learnt.level_norms, ..*self };
                let further = from.fitted(self.model, shown, &left, &looked_at);
                Some(further.unwrap_or_else(|| (learnt.clone(), model)))
            }
            _ => self.fitted(self.model, shown, unexplained, &looked_at),
        };
        let (refined, model) = refined.unzip();
        (CaptureFinding { refined, learnt_holds }, model)
    }

    /// The model of `functions` on the same canvas.
    fn model_of(&self, functions: &LensFunctions) -> Option<LensModel> {
        self.model.with_functions(self.photo.size, self.photo.x, functions).ok()
    }

    /// Mean power of what is `unexplained`, channel by channel, in units of the captures' noise.
    fn powers(&self, unexplained: &Frame<Work>, looked_at: &Frame<Work, u8>) -> Vec<f64> {
        let of = |&c: &Channel| {
            mean_power(unexplained.plane(c), looked_at.plane(c)) / self.noise(c).powi(2)
        };
        self.channels.iter().map(of).collect()
    }

    fn noise(&self, channel: Channel) -> f64 {
        f64::from(self.capture_noise[channel.index()].max(NOISE_MIN))
    }

    /// The model changed so that it explains what it leaves `unexplained`; `None` when it explains
    /// well enough what was `looked_at`. `registered` says where the lens was measured to be.
    fn fitted(
        &self,
        registered: &LensModel,
        shown: &Frame<Work>,
        unexplained: &Frame<Work>,
        looked_at: &Frame<Work, u8>,
    ) -> Option<(Learnt, LensModel)> {
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
        let moved = displacement::moved(registered.functions(), &changed, self.channels);
        let back = displacement::shifted(&changed, (-moved.0, -moved.1));
        let level_norms = Channel::ALL.map(|c| {
            let norms = &self.level_norms[c.index()];
            let is_changed = changes.iter().any(|(of, change)| *of == c && change.is_some());
            if is_changed { steps::safe(norms, c, functions, &changed) } else { norms.clone() }
        });
        log::debug!("captures lie {:.2}, {:.2} px aside", moved.0, moved.1);
        Some((Learnt { functions: back, level_norms }, self.model_of(&changed)?))
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
