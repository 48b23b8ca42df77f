//! Estimate of a photo's defocus from the photo alone, before any capture.
//!
//! The lens is measured at a few *focus offsets* δ = 1/z − 1/z₀, in dioptres (1/m), where z₀ is the
//! panel's distance and z the object's; δ is positive for nearer objects. Point spread functions at
//! other offsets are interpolated tap by tap ([`LensFunctions::between`]).
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
use spectra::{TilePlace, TileSpectrum, Tiles, Transfers};

/// Candidates per interval between two measured offsets.
const STEPS: usize = 4;
/// Minimum mean gain in log likelihood per tile over the panel's focus, in standard errors of that
/// mean. On small.toml, photos taken at the panel's focus reach 0.7 to 2.1, and photos taken from
/// 3.2 to 8 m reach 2.7 to 17.
const STANDARD_ERRORS: f64 = 2.5;
/// Minimum number of tiles for a standard error.
const TILES_MIN: usize = 8;

/// A lens measured at several focus offsets.
#[derive(Debug, Clone)]
pub struct FocusSeries<'a> {
    /// Offset in dioptres and functions of each measurement, by ascending offset.
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
        let functions: Vec<&LensFunctions> = self.members.iter().map(|member| member.1).collect();
        let panel = self.members.iter().position(|member| member.0 == 0.0)?;
        let candidates = self.candidates();
        let costs = map_tiles(photo, &functions, |tiles, spectra, transfers| {
            let (mut costs, mut power) = (vec![0.0; candidates.len()], Vec::new());
            for (channel, spectrum) in spectra {
                // The fitted scene changes little from one candidate to the next.
                let mut scene = PowerLaw::of(spectrum);
                let at = tiles.frequencies(spectrum.folding);
                for (cost, of) in costs.iter_mut().zip(&candidates) {
                    transfers.power(*channel, of.before, of.share, &mut power);
                    *cost += likeliest(at, spectrum, &power, &mut scene);
                }
            }
            costs
        });
        let sums = sums(&costs, candidates.len());
        let best = least(&sums);
        let at_panel = candidates.iter().position(|of| of.before == panel && of.share == 0.0)?;
        let errors = errors_for(&costs, at_panel, best);
        log::debug!(
            "focus: {:.3} dioptres, by {errors:.1} standard errors of {} tiles",
            self.offset(candidates[best]),
            costs.len()
        );
        (best != at_panel && errors > STANDARD_ERRORS).then(|| self.interpolate(&sums, &candidates))
    }

    /// All members, and the steps between neighbours.
    fn candidates(&self) -> Vec<TriedFocus> {
        let last = self.members.len() - 1;
        let step = |before: usize, n: usize| TriedFocus { before, share: n as f32 / STEPS as f32 };
        let between = (0..last).flat_map(|before| (0..STEPS).map(move |n| step(before, n)));
        between.chain([step(last, 0)]).collect()
    }

    fn offset(&self, of: TriedFocus) -> f32 {
        let from = self.members[of.before].0;
        let to = self.members.get(of.before + 1).map_or(from, |next| next.0);
        from + of.share * (to - from)
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

/// A candidate focus, a `share` of the way from the member `before` to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TriedFocus {
    before: usize,
    share: f32,
}

/// Results of `map` for the tiles of `photo`; it is given a tile's spectra and the transfer
/// functions of `members` there. Empty if too few tiles have data.
fn map_tiles<T: Send>(
    photo: &FocusData<'_>,
    members: &[&LensFunctions],
    map: impl Fn(&Tiles, &[(Channel, TileSpectrum)], &Transfers) -> T + Sync,
) -> Vec<T> {
    let Some(tiles) = Tiles::of(photo.field.size, members[0]) else { return Vec::new() };
    let one = |place: &TilePlace| {
        let spectrum = |&c: &Channel| Some((c, tiles.spectrum(photo, place, c)?));
        let spectra: Vec<_> = photo.channels.list().iter().filter_map(spectrum).collect();
        // The transfer functions of a place serve all of its channels.
        let transfers = || Transfers::of(&tiles, place, members);
        (!spectra.is_empty()).then(|| map(&tiles, &spectra, &transfers()))
    };
    let all: Vec<T> = tiles.places().par_iter().filter_map(one).collect();
    if all.len() < TILES_MIN { Vec::new() } else { all }
}

/// The costs of each of `tried` hypotheses, summed over the tiles.
fn sums(costs: &[Vec<f64>], tried: usize) -> Vec<f64> {
    (0..tried).map(|n| costs.iter().map(|tile| tile[n]).sum()).collect()
}

/// Mean gain per tile of an `alternative` over `first`, in standard errors of that mean.
fn errors_for(costs: &[Vec<f64>], first: usize, alternative: usize) -> f64 {
    let gains: Vec<f64> = costs.iter().map(|tile| tile[first] - tile[alternative]).collect();
    if gains.is_empty() { 0.0 } else { standard_errors(&gains) }
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
