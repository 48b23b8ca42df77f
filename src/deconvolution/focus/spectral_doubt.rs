//! What a photo's spectrum says against the noise and the lens that it is taken for.
//!
//! A result explains a photo of a sharper lens as well as one of the measured lens: it overshoots,
//! and the lens hides that. But its scene would have to be one whose power rises where that lens
//! lets little through, and scenes' spectra fall as a power of frequency. So it is asked which
//! explains the tiles' spectra best: lens and sensor as measured, a sensor so many times as noisy,
//! or a lens half as wide.

use rayon::prelude::*;

use super::likelihood::{PowerLaw, likeliest, noise_alone};
use super::spectra::{FocusData, TilePlace, TileSpectrum, Tiles, Transfers};
use super::{TILES_MIN, least, standard_errors};
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::Channel;

/// Times the sensor's noise at the most: four stops of gain.
const NOISE_MOST: f32 = 16.0;
/// So many times it is told from it. Guess: on the laboratory's group of limits charts are
/// likeliest with 1.5 times.
const NOISIER: f32 = 2.0;
/// Of the noise, what a scene may bring where it is looked at.
const LITTLE: f32 = 0.1;
/// A tile with fewer such frequencies has no say in how much noise there is.
const ALONE_MIN: usize = 32;
/// Width of the sharper lens that is tried, of the measured one's.
const SHARPER: f32 = 0.5;
/// Width of one out of focus, which explains what neither of the two does.
const BLURRED: f32 = 1.5;
/// Standard errors of the tiles' mean by which twice the noise must be likelier. On the
/// laboratory's group of limits it is by 4.1 at most of ordinary photos (a chart), by 8.0 and more
/// of noisier ones.
const NOISE_ERRORS: f64 = 5.5;
/// The same of a sharper lens: on the same group by 0.7 at most of photos through the lens as
/// measured, 2.8 of one at half the distance, and by 5.5 of the one of two through it stopped down
/// that this tells.
const LENS_ERRORS: f64 = 4.0;

/// What the spectrum of a photo says against its sensor and its lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpectralDoubt {
    /// It has more noise than its sensor: so many times the power that there is without light, and
    /// that which light adds.
    Noisier([f32; 2]),
    /// It was taken through a lens much sharper than this one.
    Sharper,
}

/// What is said against `photo`, taken through a lens of `functions`, if anything is. Noise is
/// asked of where that is `noise_unknown`; what is noisier says nothing of its lens.
pub fn doubted(
    functions: &LensFunctions,
    photo: &FocusData<'_>,
    noise_unknown: bool,
) -> Option<SpectralDoubt> {
    let as_measured = TriedSource { width: 1.0, times: 1.0 };
    let sharper = TriedSource { width: SHARPER, ..as_measured };
    let noisier = TriedSource { times: NOISIER, ..as_measured };
    let all = [as_measured, sharper, noisier];
    let blurred = TriedSource { width: BLURRED, ..as_measured };
    let with = |tried: &[TriedSource]| costs(functions, photo, tried);
    let first = with(if noise_unknown { &all } else { &all[..2] });
    if noise_unknown && for_second(&first, [0, 2]) > NOISE_ERRORS {
        let stops = NOISE_MOST.log2() as i32;
        let tried: Vec<TriedSource> = (0..=2 * stops)
            .map(|n| TriedSource { times: (n as f32 / 2.0).exp2(), ..as_measured })
            .collect();
        let best = tried[least(&sums(&with(&tried), tried.len()))].times;
        let found = fitted(&seen_alone(functions, photo, best));
        log::debug!("noise: {best:.1} times the sensor's is likeliest: {found:?}");
        return found.map(SpectralDoubt::Noisier);
    }
    let errors = for_second(&first, [0, 1]);
    log::debug!("a lens half as wide is likelier by {errors:.1} standard errors");
    if errors <= LENS_ERRORS {
        return None;
    }
    let blurred = sums(&with(&[as_measured, blurred]), 2)[1];
    (sums(&first, 2)[1] < blurred).then_some(SpectralDoubt::Sharper)
}

/// What a photo may have come from: a lens so many times as wide as the measured one, and a sensor
/// of so many times the noise.
#[derive(Debug, Clone, Copy)]
struct TriedSource {
    width: f32,
    times: f32,
}

/// −ln likelihood of each of the `tried`, tile by tile. The likeliest scene is sought from the
/// first one's, for those of its width from that before.
fn costs(functions: &LensFunctions, photo: &FocusData<'_>, tried: &[TriedSource]) -> Vec<Vec<f64>> {
    of_tiles(functions, photo, |tiles, spectra, transfers| {
        let mut costs = vec![0.0; tried.len()];
        for (channel, spectrum) in spectra {
            let (mut power, mut scene) = (Vec::new(), PowerLaw::of(spectrum));
            let at = tiles.frequencies(spectrum.folding);
            for (cost, TriedSource { width, times }) in costs.iter_mut().zip(tried) {
                transfers.as_wide(*channel, *width, &mut power);
                let noisier = spectrum.noisier(times * times);
                if *width == 1.0 {
                    *cost += likeliest(at, &noisier, &power, &mut scene);
                } else {
                    *cost += likeliest(at, &noisier, &power, &mut scene.clone());
                }
            }
        }
        costs
    })
}

/// Noise power as it is seen in a tile.
struct NoiseSeen {
    /// The sensor's without light, and what the tile's light adds.
    own: [f32; 2],
    found: f32,
}

/// Noise power of tiles of `photo`, of so many `times` its sensor's noise, at the frequencies where
/// a scene brings little beside that. The likeliest noise itself is off: its likelihood has heavy
/// tails.
fn seen_alone(functions: &LensFunctions, photo: &FocusData<'_>, times: f32) -> Vec<NoiseSeen> {
    let at_black = Channel::ALL.map(|c| (photo.noise)(c, 0.0).powi(2));
    let of_tile = |tiles: &Tiles, spectra: &[(Channel, TileSpectrum)], transfers: &Transfers| {
        let one = |(channel, spectrum): &(Channel, TileSpectrum)| {
            let (mut power, mut scene) = (Vec::new(), PowerLaw::of(spectrum));
            transfers.power(*channel, 0, 0.0, &mut power);
            let at = tiles.frequencies(spectrum.folding);
            let noisier = spectrum.noisier(times * times);
            likeliest(at, &noisier, &power, &mut scene);
            let mut alone: Vec<f32> = noise_alone(at, &noisier, &power, scene, LITTLE).collect();
            if alone.len() < ALONE_MIN {
                return None;
            }
            let middle = alone.len() / 2;
            let median = *alone.select_nth_unstable_by(middle, f32::total_cmp).1;
            let (black, own) = (at_black[channel.index()], at.folds as f32 * spectrum.noise);
            // Of power that is exponentially distributed the median is ln 2 of the mean.
            let found = median / std::f32::consts::LN_2 * times * times * own;
            Some(NoiseSeen { own: [black, (own - black).max(0.0)], found })
        };
        spectra.iter().filter_map(one).collect::<Vec<_>>()
    };
    of_tiles(functions, photo, of_tile).into_iter().flatten().collect()
}

/// How many times the sensor's noise power without light, and that which light adds, explain what
/// is `seen`: least squares of shares. A gain does more to the first.
fn fitted(seen: &[NoiseSeen]) -> Option<[f32; 2]> {
    let (mut own, mut found) = ([[0.0f32; 2]; 2], [0.0f32; 2]);
    for NoiseSeen { own: [black, light], found: power } in seen {
        let share = [black / power, light / power];
        for (n, m) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            own[n][m] += share[n] * share[m];
        }
        (found[0], found[1]) = (found[0] + share[0], found[1] + share[1]);
    }
    let determinant = own[0][0] * own[1][1] - own[0][1] * own[1][0];
    let both = [
        (found[0] * own[1][1] - found[1] * own[0][1]) / determinant,
        (found[1] * own[0][0] - found[0] * own[1][0]) / determinant,
    ];
    // All of one kind where no other fits.
    let alone = |n: usize| found[n] / own[n][n];
    let powers = match both {
        [black, light] if black >= 0.0 && light >= 0.0 => both,
        [black, _] if black < 0.0 => [0.0, alone(1)],
        _ => [alone(0), 0.0],
    };
    powers.iter().all(|power| power.is_finite()).then_some(powers)
}

/// What `of` makes of the tiles of `photo`, each with its spectra and what `functions` let through
/// there; nothing where too few tiles say anything.
fn of_tiles<T: Send>(
    functions: &LensFunctions,
    photo: &FocusData<'_>,
    of: impl Fn(&Tiles, &[(Channel, TileSpectrum)], &Transfers) -> T + Sync,
) -> Vec<T> {
    let Some(tiles) = Tiles::of(photo.rect.size, functions) else { return Vec::new() };
    let one = |place: &TilePlace| {
        let spectrum = |&c: &Channel| Some((c, tiles.spectrum(photo, place, c)?));
        let spectra: Vec<_> = photo.channels.list().iter().filter_map(spectrum).collect();
        let transfers = Transfers::of(&tiles, place, std::iter::once(functions));
        (!spectra.is_empty()).then(|| of(&tiles, &spectra, &transfers))
    };
    let all: Vec<T> = tiles.places().par_iter().filter_map(one).collect();
    if all.len() < TILES_MIN { Vec::new() } else { all }
}

/// What each of so many hypotheses costs all tiles.
fn sums(costs: &[Vec<f64>], hypotheses: usize) -> Vec<f64> {
    (0..hypotheses).map(|n| costs.iter().map(|tile| tile[n]).sum()).collect()
}

/// By how many standard errors the tiles are for the second hypothesis against the first.
fn for_second(costs: &[Vec<f64>], [first, second]: [usize; 2]) -> f64 {
    let gains: Vec<f64> = costs.iter().map(|tile| tile[first] - tile[second]).collect();
    if gains.is_empty() { 0.0 } else { standard_errors(&gains) }
}
