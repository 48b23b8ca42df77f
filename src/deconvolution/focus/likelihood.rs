//! The likelihood of a tile's power spectrum. The expected power at frequency f is
//!
//! M(f) = share · Σ A |f|^−b |H(f)|² + noise,
//!
//! summed over the frequencies that alias onto f. In Whittle's likelihood (1953) the periodogram P
//! is exponentially distributed about M. A tile with an edge concentrates its power along one line
//! and exceeds M there by hundreds of times, so M is given an inverse-gamma scale with shape ν,
//! which marginalises to the heavy-tailed density p(P) ∝ 1/M · (1 + P/(νM))^−(ν+1), as Student's t
//! arises from the normal distribution. The scene's A and b are fitted per tile by Fisher scoring;
//! the noise is the sensor's.

use super::spectra::{Frequencies, TileSpectrum};

/// Shape ν. Guess: with 0.7 the offsets found on small.toml change by 0.01 dioptres and one of 24
/// is no longer significant; with ∞ (Whittle) they change by 0.06.
const NU: f32 = 1.5;
/// Maximum rounds of Fisher scoring.
const ROUNDS: usize = 8;
/// Convergence threshold of ln A and of b.
const SETTLED: f64 = 0.01;
/// Maximum change per round of ln A and of b.
const STEP_MAX: [f64; 2] = [3.0, 0.7];
/// Range of b, from white to steeper than a step edge.
const EXPONENTS: (f64, f64) = (0.0, 5.0);
/// Range of ln A, wider than any photo needs.
const LN_POWERS: (f64, f64) = (-30.0, 30.0);

/// A scene's power spectrum, A |f|^−b.
#[derive(Debug, Clone, Copy)]
pub(super) struct PowerLaw {
    pub(super) ln_power: f64,
    pub(super) exponent: f64,
}

impl PowerLaw {
    /// Initial value: the exponent of natural scenes (Field 1987) and the tile's mean power.
    pub(super) fn of(spectrum: &TileSpectrum) -> PowerLaw {
        let mean = spectrum.power.iter().sum::<f32>() / spectrum.power.len().max(1) as f32;
        // 60 is about the mean of |f|^−2 over a tile's frequencies.
        PowerLaw { ln_power: f64::from(mean.max(1e-6) / 60.0).ln(), exponent: 2.0 }
    }
}

/// Fits `scene` to a `spectrum` behind a lens of power transfer function `passed`; returns −ln
/// likelihood of the fit.
pub(super) fn likeliest(
    at: &Frequencies,
    spectrum: &TileSpectrum,
    passed: &[f32],
    scene: &mut PowerLaw,
) -> f64 {
    let mut best = f64::INFINITY;
    let mut kept = *scene;
    for _ in 0..ROUNDS {
        let Scored { cost, step } = scored(at, spectrum, passed, *scene);
        if cost < best {
            (best, kept) = (cost, *scene);
        } else {
            // Overshoot: go back halfway.
            scene.ln_power = (scene.ln_power + kept.ln_power) / 2.0;
            scene.exponent = (scene.exponent + kept.exponent) / 2.0;
            continue;
        }
        let [da, db] = [0, 1].map(|n| step[n].clamp(-STEP_MAX[n], STEP_MAX[n]));
        scene.ln_power = (scene.ln_power + da).clamp(LN_POWERS.0, LN_POWERS.1);
        scene.exponent = (scene.exponent + db).clamp(EXPONENTS.0, EXPONENTS.1);
        if da.abs() < SETTLED && db.abs() < SETTLED {
            break;
        }
    }
    *scene = kept;
    best
}

/// Ratios of power to noise power at the frequencies where a `scene` behind a lens of power
/// transfer function `passed` contributes less than `share` of the noise.
pub(super) fn noise_alone<'a>(
    at: &'a Frequencies,
    spectrum: &'a TileSpectrum,
    passed: &'a [f32],
    PowerLaw { ln_power, exponent }: PowerLaw,
    share: f32,
) -> impl Iterator<Item = f32> + 'a {
    let brought = move |&n: &u32| {
        let ln = f64::from(at.ln[n as usize]);
        (ln_power - exponent * ln).exp() as f32 * passed[n as usize]
    };
    let each = at.aliases.chunks_exact(at.folds).zip(&spectrum.power);
    each.filter_map(move |(aliases, &power)| {
        let expected = at.share * aliases.iter().map(brought).sum::<f32>();
        (expected < share * spectrum.noise).then_some(power / spectrum.noise)
    })
}

/// −ln likelihood of a scene, and the Fisher scoring step of ln A and b.
pub(super) struct Scored {
    pub(super) cost: f64,
    step: [f64; 2],
}

pub(super) fn scored(
    at: &Frequencies,
    spectrum: &TileSpectrum,
    passed: &[f32],
    scene: PowerLaw,
) -> Scored {
    let PowerLaw { ln_power, exponent } = scene;
    let (ln_power, exponent) = (ln_power as f32, exponent as f32);
    let noise = spectrum.noise;
    let (mut cost, mut slope, mut information) = (0.0f64, [0.0f64; 2], [0.0f64; 3]);
    for (aliases, &power) in at.aliases.chunks_exact(at.folds).zip(&spectrum.power) {
        let (mut expected, mut by_exponent) = (0.0f32, 0.0f32);
        for &n in aliases {
            let ln = at.ln[n as usize];
            let brought = (ln_power - exponent * ln).exp() * passed[n as usize];
            expected += brought;
            by_exponent -= brought * ln;
        }
        let (expected, by_exponent) = (at.share * expected, at.share * by_exponent);
        let all = expected + noise;
        let (ratio, a, b) = (power / all, expected / all, by_exponent / all);
        cost += f64::from((NU + 1.0) * (ratio / NU).ln_1p() + all.ln());
        let off = f64::from((NU + 1.0) * ratio / (NU + ratio) - 1.0);
        let (a, b) = (f64::from(a), f64::from(b));
        slope[0] += off * a;
        slope[1] += off * b;
        information[0] += a * a;
        information[1] += a * b;
        information[2] += b * b;
    }
    let [aa, ab, bb] = information;
    // Regularised, since a tile of noise alone has no information on the scene.
    let (aa, bb) = (aa + 1e-3, bb + 1e-3);
    let determinant = (aa * bb - ab * ab).max(1e-9);
    let step = [
        (bb * slope[0] - ab * slope[1]) / determinant,
        (aa * slope[1] - ab * slope[0]) / determinant,
    ];
    Scored { cost, step }
}
