//! Spectral check of a photo's noise and lens.
//!
//! A photo taken through a sharper lens can be explained as well as one taken through the measured
//! lens: the solution overshoots, and the measured lens hides that. But then the solution's power
//! would rise at frequencies that the measured lens hardly passes, whereas the power of scenes
//! falls with frequency. The check asks which hypothesis makes the tiles' spectra likeliest: lens
//! and sensor as measured, a noisier sensor, or a narrower lens.

use super::likelihood::{PowerLaw, likeliest, noise_alone};
use super::spectra::{FocusData, TileSpectrum, Tiles, Transfers};
use super::{errors_for, least, map_tiles, sums};
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::Channel;

/// Factor of the alternative hypotheses: twice the noise σ, half the width of the lens. Guess: on
/// the laboratory's group of limits, 1.5 times the noise is likeliest for charts.
const ALTERNATIVE: f32 = 2.0;
/// Largest plausible noise σ relative to the sensor's: four stops of gain.
pub const NOISE_MAX: f32 = 16.0;
/// Ratio of the scene's power to the noise power up to which a frequency is taken for noise alone.
const NOISE_ALONE: f32 = 0.1;
/// Minimum number of frequencies of noise alone for a tile to be used.
const ALONE_MIN: usize = 32;
/// Width of a defocused lens relative to the measured one. A lens is found sharper only if the
/// narrower lens is likelier than this one.
const BLURRED: f32 = 1.5;
/// Standard errors of the tiles' mean by which twice the noise must be likelier. On the
/// laboratory's group of limits, ordinary photos reach at most 4.1 (a chart) and noisier ones at
/// least 8.0.
const NOISE_ERRORS: f64 = 5.5;
/// Standard errors of the tiles' mean by which half the width must be likelier. On that group,
/// photos reach at most 0.7, at half the distance at most 2.8, and one of two photos through the
/// lens stopped down reaches 5.5.
const LENS_ERRORS: f64 = 4.0;

/// A property of the rig that the spectrum of a photo contradicts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpectralFinding {
    /// The sensor's noise. Factors on its power without light and on the power that light adds.
    Noisier([f32; 2]),
    /// The lens: a much narrower one than measured is likelier.
    SharperLens,
}

/// The spectral finding on `photo`, taken through a lens of `functions`, if there is one. Noise is
/// checked if `noise_unknown`; a noisier photo's lens is not checked.
pub fn check_spectrum(
    functions: &LensFunctions,
    photo: &FocusData<'_>,
    noise_unknown: bool,
) -> Option<SpectralFinding> {
    let as_measured = TriedSource { width: 1.0, times: 1.0 };
    let narrower = TriedSource { width: 1.0 / ALTERNATIVE, ..as_measured };
    let noisier = TriedSource { times: ALTERNATIVE, ..as_measured };
    let blurred = TriedSource { width: BLURRED, ..as_measured };
    let costs_of = |tried: &[TriedSource]| costs(functions, photo, tried);
    let tried = [as_measured, narrower, noisier];
    let first = costs_of(if noise_unknown { &tried } else { &tried[..2] });
    if noise_unknown && errors_for(&first, 0, 2) > NOISE_ERRORS {
        return noise_factors(functions, photo).map(SpectralFinding::Noisier);
    }
    let errors = errors_for(&first, 0, 1);
    log::debug!("a lens half as wide is likelier by {errors:.1} standard errors");
    if errors <= LENS_ERRORS {
        return None;
    }
    let blurred = sums(&costs_of(&[as_measured, blurred]), 2)[1];
    (sums(&first, 2)[1] < blurred).then_some(SpectralFinding::SharperLens)
}

/// Factors on the sensor's noise power without light and on that of the light, estimated from
/// `photo`.
fn noise_factors(functions: &LensFunctions, photo: &FocusData<'_>) -> Option<[f32; 2]> {
    let half_stops = 2 * NOISE_MAX.log2() as i32;
    let tried: Vec<TriedSource> = (0..=half_stops)
        .map(|n| TriedSource { width: 1.0, times: (n as f32 / 2.0).exp2() })
        .collect();
    let likeliest = tried[least(&sums(&costs(functions, photo, &tried), tried.len()))].times;
    let found = fit_factors(&measure_noise(functions, photo, likeliest));
    log::debug!("noise: {likeliest:.1} times the sensor's is likeliest: {found:?}");
    found
}

/// A hypothesis: factors on the width of the measured lens and on the noise σ of the sensor.
#[derive(Debug, Clone, Copy)]
struct TriedSource {
    width: f32,
    times: f32,
}

/// −ln likelihood of each of `tried`, tile by tile. The search for the likeliest scene starts at
/// the last one found for the measured width.
fn costs(functions: &LensFunctions, photo: &FocusData<'_>, tried: &[TriedSource]) -> Vec<Vec<f64>> {
    map_tiles(photo, &[functions], |tiles, spectra, transfers| {
        let mut costs = vec![0.0; tried.len()];
        for (channel, spectrum) in spectra {
            let [mut measured, mut scaled] = [(); 2].map(|()| Vec::new());
            let mut scene = PowerLaw::of(spectrum);
            let at = tiles.frequencies(spectrum.folding);
            transfers.power(*channel, 0, 0.0, &mut measured);
            for (cost, TriedSource { width, times }) in costs.iter_mut().zip(tried) {
                let noisier = spectrum.noisier(times * times);
                if *width == 1.0 {
                    *cost += likeliest(at, &noisier, &measured, &mut scene);
                } else {
                    transfers.as_wide(*channel, *width, &mut scaled);
                    *cost += likeliest(at, &noisier, &scaled, &mut scene.clone());
                }
            }
        }
        costs
    })
}

/// Noise power of a tile.
struct TileNoise {
    /// The sensor's noise power without light, and that of the tile's light.
    own: [f32; 2],
    /// The measured noise power.
    found: f32,
}

/// Noise power of the tiles of `photo`, about `times` the sensor's σ, at frequencies where the
/// scene has little. The likeliest `times` itself is biased: the likelihood has heavy tails.
fn measure_noise(functions: &LensFunctions, photo: &FocusData<'_>, times: f32) -> Vec<TileNoise> {
    let at_black = Channel::ALL.map(|c| (photo.noise)(c, 0.0).powi(2));
    let measure = |tiles: &Tiles, spectra: &[(Channel, TileSpectrum)], transfers: &Transfers| {
        let one = |(channel, spectrum): &(Channel, TileSpectrum)| {
            let (mut power, mut scene) = (Vec::new(), PowerLaw::of(spectrum));
            transfers.power(*channel, 0, 0.0, &mut power);
            let at = tiles.frequencies(spectrum.folding);
            let noisier = spectrum.noisier(times * times);
            likeliest(at, &noisier, &power, &mut scene);
            let mut alone: Vec<f32> =
                noise_alone(at, &noisier, &power, scene, NOISE_ALONE).collect();
            if alone.len() < ALONE_MIN {
                return None;
            }
            let middle = alone.len() / 2;
            let median = *alone.select_nth_unstable_by(middle, f32::total_cmp).1;
            let (black, own) = (at_black[channel.index()], at.folds as f32 * spectrum.noise);
            // The median of exponentially distributed power is ln 2 of its mean.
            let found = median / std::f32::consts::LN_2 * times * times * own;
            Some(TileNoise { own: [black, (own - black).max(0.0)], found })
        };
        spectra.iter().filter_map(one).collect::<Vec<_>>()
    };
    map_tiles(photo, &[functions], measure).into_iter().flatten().collect()
}

/// Factors on the sensor's noise power without light and on that of the light which explain the
/// `tiles`: least squares, each tile weighted by 1/(sensor's power)². Weights from the measured
/// power would favour tiles in which it happens to be low. A higher gain raises the first factor
/// more.
fn fit_factors(tiles: &[TileNoise]) -> Option<[f32; 2]> {
    let (mut own, mut found) = ([[0.0f32; 2]; 2], [0.0f32; 2]);
    for TileNoise { own: [black, light], found: power } in tiles {
        let sum = black + light;
        let (share, power) = ([black / sum, light / sum], power / sum);
        for (n, m) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            own[n][m] += share[n] * share[m];
        }
        (found[0], found[1]) = (found[0] + share[0] * power, found[1] + share[1] * power);
    }
    let determinant = own[0][0] * own[1][1] - own[0][1] * own[1][0];
    let both = [
        (found[0] * own[1][1] - found[1] * own[0][1]) / determinant,
        (found[1] * own[0][0] - found[0] * own[1][0]) / determinant,
    ];
    // A negative factor is set to 0 and the other one fitted alone.
    let alone = |n: usize| found[n] / own[n][n];
    let powers = match both {
        [black, light] if black >= 0.0 && light >= 0.0 => both,
        [black, _] if black < 0.0 => [0.0, alone(1)],
        _ => [alone(0), 0.0],
    };
    powers.iter().all(|power| power.is_finite()).then_some(powers)
}
