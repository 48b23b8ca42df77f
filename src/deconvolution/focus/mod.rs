//! Estimate of a photo's defocus from the photo alone, before any capture.
//!
//! The lens is measured at a few *focus offsets* δ = 1/z − 1/z₀, in dioptres (1/m), where z₀ is the
//! panel's distance and z the object's; positive δ is nearer. Point spread functions at other
//! offsets are interpolated tap by tap ([`LensFunctions::between`]).
//!
//! The model of a photo's spectrum at δ is the scene's power law (Field 1987, JOSA A 4:2379) times
//! the lens's power transfer function at δ, plus white noise. The estimate maximises the likelihood
//! ([`likelihood`]) of the spectra of tiles all over the photo, summed over the channels:
//! longitudinal chromatic aberration resolves the sign of δ.

mod likelihood;
mod spectra;
mod spectral_check;

pub use spectra::FocusData;
pub use spectral_check::{NOISE_MAX, SpectralFinding, check_spectrum};

use rayon::prelude::*;

use super::lens_model::LensFunctions;
use crate::frame::Channel;
use likelihood::{PowerLaw, likeliest};
use spectra::{TileSpectrum, Tiles, Transfers};

/// Candidates per interval between two measured offsets.
const STEPS: usize = 4;
/// Minimum mean gain in log likelihood per tile over the panel's focus, in standard errors of that
/// mean. On small.toml photographs at the panel's focus reach 0.7 to 2.1, photos from 3.2 to 8 m
/// 2.7 to 17.
const STANDARD_ERRORS: f64 = 2.5;
/// Minimum number of tiles for a standard error.
const TILES_MIN: usize = 8;

/// A lens measured at several focus offsets.
#[derive(Debug, Clone)]
pub struct FocusSeries<'a> {
    /// Offset in dioptres, ascending, and functions.
    members: Vec<(f32, &'a LensFunctions)>,
}

/// An estimated focus, between two members of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundFocus {
    /// The offset, dioptres.
    pub offset: f32,
    /// Indices of the neighbouring members, equal at the series' end.
    pub between: (usize, usize),
    /// Weight of the second member, 0..1.
    pub share: f32,
    /// Whether it is the first or last measured offset: the true one may lie beyond.
    pub at_end: bool,
}

impl<'a> FocusSeries<'a> {
    /// The series of `members`, pairs of offset and functions. `None` unless there are at least
    /// two on one grid, with distinct finite offsets, one of them 0 (the panel's).
    pub fn new(mut members: Vec<(f32, &'a LensFunctions)>) -> Option<FocusSeries<'a>> {
        members.sort_by(|a, b| a.0.total_cmp(&b.0));
        let grid = |f: &LensFunctions| (f.rows, f.columns, f.support_px);
        let first = grid(members.first()?.1);
        let fits = members.len() > 1
            && members.iter().any(|member| member.0 == 0.0)
            && members.iter().all(|(offset, f)| offset.is_finite() && grid(f) == first)
            && members.windows(2).all(|two| two[0].0 < two[1].0);
        fits.then_some(FocusSeries { members })
    }

    /// Estimates the focus of `photo`; `None` unless it differs significantly from the panel's.
    pub fn find(&self, photo: &FocusData<'_>) -> Option<FoundFocus> {
        let functions = self.members[0].1;
        let tiles = Tiles::of(photo.rect.size, functions)?;
        let panel = self.members.iter().position(|member| member.0 == 0.0)?;
        // The transfer functions of a place serve all of its channels.
        let costs: Vec<TileCosts> = tiles
            .places()
            .par_iter()
            .filter_map(|place| {
                let transfers = Transfers::of(&tiles, place, self.members.iter().map(|m| m.1));
                let of = |&c: &Channel| Some((c, tiles.spectrum(photo, place, c)?));
                let spectra: Vec<(Channel, TileSpectrum)> =
                    photo.channels.list().iter().filter_map(of).collect();
                (!spectra.is_empty()).then(|| TileCosts::of(&tiles, &spectra, &transfers))
            })
            .collect();
        if costs.len() < TILES_MIN {
            return None;
        }
        let candidates = self.candidates();
        let sums = sums(&costs);
        let best = least(&sums);
        let at_panel = candidates.iter().position(|of| of.before == panel && of.step == 0)?;
        let gains: Vec<f64> = costs.iter().map(|tile| tile.0[at_panel] - tile.0[best]).collect();
        let errors = standard_errors(&gains);
        log::debug!(
            "focus: {:.3} dioptres, by {errors:.1} standard errors of {} tiles",
            self.offset(candidates[best]),
            gains.len()
        );
        (best != at_panel && errors > STANDARD_ERRORS).then(|| self.interpolate(&sums, &candidates))
    }

    /// All members, and the steps between neighbours.
    fn candidates(&self) -> Vec<TriedFocus> {
        let last = self.members.len() - 1;
        let between = (0..last).flat_map(|before| (0..STEPS).map(move |step| (before, step)));
        between.chain([(last, 0)]).map(|(before, step)| TriedFocus { before, step }).collect()
    }

    fn offset(&self, of: TriedFocus) -> f32 {
        let from = self.members[of.before].0;
        let to = self.members.get(of.before + 1).map_or(from, |next| next.0);
        from + of.share() * (to - from)
    }

    /// The minimum of a parabola through the best candidate's cost and its neighbours'.
    fn interpolate(&self, sums: &[f64], candidates: &[TriedFocus]) -> FoundFocus {
        let best = least(sums);
        let at_end = best == 0 || best + 1 == candidates.len();
        let mut offset = self.offset(candidates[best]);
        if !at_end {
            let x = [best - 1, best, best + 1].map(|n| f64::from(self.offset(candidates[n])));
            let [y0, y1, y2] = [best - 1, best, best + 1].map(|n| sums[n]);
            let (left, right) = ((x[1] - x[0]) * (y1 - y2), (x[1] - x[2]) * (y1 - y0));
            let least =
                x[1] - 0.5 * ((x[1] - x[0]) * left - (x[1] - x[2]) * right) / (left - right);
            if least.is_finite() {
                offset = least.clamp(x[0], x[2]) as f32;
            }
        }
        let before = self.members.iter().rposition(|m| m.0 <= offset).unwrap_or(0);
        let after = (before + 1).min(self.members.len() - 1);
        let (from, to) = (self.members[before].0, self.members[after].0);
        let share = if after > before { (offset - from) / (to - from) } else { 0.0 };
        FoundFocus { offset, between: (before, after), share, at_end }
    }
}

/// A candidate focus, `step` of [`STEPS`] beyond a member.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TriedFocus {
    before: usize,
    step: usize,
}

impl TriedFocus {
    fn share(self) -> f32 {
        self.step as f32 / STEPS as f32
    }
}

/// −ln likelihood of one tile for each candidate, summed over the channels.
struct TileCosts(Vec<f64>);

impl TileCosts {
    fn of(tiles: &Tiles, spectra: &[(Channel, TileSpectrum)], transfers: &Transfers) -> TileCosts {
        let members = transfers.members();
        let mut costs = vec![0.0; (members - 1) * STEPS + 1];
        let mut power = Vec::new();
        for (channel, spectrum) in spectra {
            // The fitted scene changes little from one candidate to the next.
            let mut scene = PowerLaw::of(spectrum);
            for (n, cost) in costs.iter_mut().enumerate() {
                let of = TriedFocus { before: n / STEPS, step: n % STEPS };
                transfers.power(*channel, of.before, of.share(), &mut power);
                *cost +=
                    likeliest(tiles.frequencies(spectrum.folding), spectrum, &power, &mut scene);
            }
        }
        TileCosts(costs)
    }
}

/// The cost of each candidate, summed over `tiles`.
fn sums(tiles: &[TileCosts]) -> Vec<f64> {
    let tried = tiles.first().map_or(0, |tile| tile.0.len());
    (0..tried).map(|n| tiles.iter().map(|tile| tile.0[n]).sum()).collect()
}

/// Index of the minimum.
fn least(sums: &[f64]) -> usize {
    (0..sums.len()).min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0)
}

/// The mean of `values` in units of its standard error.
fn standard_errors(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    mean / (variance / n).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests;
