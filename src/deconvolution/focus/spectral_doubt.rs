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
/// Widths of the other lenses that are tried, of the measured one's: sharper, and one that is out
/// of focus, which explains what neither does.
const WIDTHS: [f32; 2] = [0.5, 1.5];
/// Standard errors of the tiles' mean by which twice the noise must be likelier. On the
/// laboratory's group of limits it is by 4.1 at most of ordinary photos (a chart), by 8.0 and more
/// of noisier ones.
const NOISE_ERRORS: f64 = 5.5;
/// The same of a sharper lens: on the same group by 0.7 at most of photos through the lens as
/// measured, 2.8 of one at half the distance, and by 5.5 of the one of two through it stopped down
/// that this tells.
const LENS_ERRORS: f64 = 4.0;

/// How much more noise than its sensor's `photo` has, taken through a lens of `functions`: how many
/// times the power that there is without light, and that which light adds. `None` where nothing
/// says that it is twice the noise.
pub fn noise_powers(functions: &LensFunctions, photo: &FocusData<'_>) -> Option<[f32; 2]> {
    let with = |times: &[f32]| {
        of_tiles(functions, photo, |tiles, spectra, transfers| {
            let mut costs = vec![0.0; times.len()];
            for (channel, spectrum) in spectra {
                let (mut power, mut scene) = (Vec::new(), PowerLaw::of(spectrum));
                transfers.power(*channel, 0, 0.0, &mut power);
                for (cost, times) in costs.iter_mut().zip(times) {
                    let at = tiles.frequencies(spectrum.folding);
                    *cost += likeliest(at, &spectrum.noisier(times * times), &power, &mut scene);
                }
            }
            costs
        })
    };
    // Most photos have their sensor's.
    if for_second(&with(&[1.0, NOISIER]), [0, 1]) <= NOISE_ERRORS {
        return None;
    }
    let stops = NOISE_MOST.log2() as i32;
    let tried: Vec<f32> = (0..=2 * stops).map(|n| (n as f32 / 2.0).exp2()).collect();
    let best = tried[least(&sums(&with(&tried), tried.len()))];
    let found = fitted(&seen_alone(functions, photo, best));
    log::debug!("noise: {best:.1} times the sensor's is likeliest: {found:?}");
    found
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

/// Whether `photo` was taken through a lens much sharper than one of `functions`.
pub fn is_sharper(functions: &LensFunctions, photo: &FocusData<'_>) -> bool {
    let hypotheses = 1 + WIDTHS.len();
    let costs = of_tiles(functions, photo, |tiles, spectra, transfers| {
        let mut costs = vec![0.0; hypotheses];
        for (channel, spectrum) in spectra {
            let (mut power, mut scene) = (Vec::new(), PowerLaw::of(spectrum));
            for (cost, width) in costs.iter_mut().zip([1.0].into_iter().chain(WIDTHS)) {
                transfers.as_wide(*channel, width, &mut power);
                let at = tiles.frequencies(spectrum.folding);
                *cost += likeliest(at, spectrum, &power, &mut scene);
            }
        }
        costs
    });
    let (errors, sums) = (for_second(&costs, [0, 1]), sums(&costs, hypotheses));
    log::debug!("a lens half as wide is likelier by {errors:.1} standard errors: {sums:.0?}");
    errors > LENS_ERRORS && sums[1] < sums[2]
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
