//! The likelihood of a tile's spectrum. The expected power at f is
//!
//! M(f) = share · Σ A |f|^−b |H(f)|² + noise,
//!
//! summed over the frequencies that fold onto f. Whittle (1953) has the power exponentially
//! distributed about M. But a tile with an edge in it has nearly all its power along one line, and
//! hundreds of times M there: so M itself is taken as uncertain by a factor, inverse-gamma
//! distributed with shape ν, and the power then as ∝ 1/M · (1 + P/(νM))^−(ν+1), as Student's t
//! comes from Gauss's curve. A and b, the scene's, are what makes the tile likeliest, found by
//! scoring; the noise is the sensor's.

use super::spectra::{Frequencies, TileSpectrum};

/// ν. Guess: with 0.7 offsets found on small.toml differ by 0.01 dioptres, and one of 24 is no
/// longer believed; with infinity, Whittle's own, they differ by 0.06.
const NU: f32 = 1.5;
/// Rounds of Fisher's scoring at most.
const ROUNDS: usize = 8;
/// It ends when neither number changes by more.
const SETTLED: f64 = 0.01;
/// Largest change of a round, of ln A and of b.
const STEP_MAX: [f64; 2] = [3.0, 0.7];
/// Exponents that scenes' power spectra may have: flat noise to more than a step's edge.
const EXPONENTS: (f64, f64) = (0.0, 5.0);
/// ln A stays within this of nothing at all and of more than any photo holds.
const LN_POWERS: (f64, f64) = (-30.0, 30.0);

/// A scene's spectrum, A |f|^−b.
#[derive(Debug, Clone, Copy)]
pub(super) struct PowerLaw {
    ln_power: f64,
    exponent: f64,
}

impl PowerLaw {
    /// A first guess: natural scenes' exponent (Field 1987), and the tile's power.
    pub(super) fn of(spectrum: &TileSpectrum) -> PowerLaw {
        let mean = spectrum.power.iter().sum::<f32>() / spectrum.power.len().max(1) as f32;
        // About the mean of |f|^−2 over a tile's frequencies.
        PowerLaw { ln_power: f64::from(mean.max(1e-6) / 60.0).ln(), exponent: 2.0 }
    }
}

#[cfg(test)]
impl PowerLaw {
    pub(super) fn at(ln_power: f64, exponent: f64) -> PowerLaw {
        PowerLaw { ln_power, exponent }
    }

    pub(super) fn numbers(&self) -> (f64, f64) {
        (self.ln_power, self.exponent)
    }
}

/// −ln likelihood of this very `scene`.
#[cfg(test)]
pub(super) fn cost(at: &Frequencies, of: &TileSpectrum, passed: &[f32], scene: PowerLaw) -> f64 {
    scored(at, of, passed, scene).cost
}

/// −ln likelihood of a `spectrum` behind a lens that lets `passed` through, of the likeliest scene,
/// which `scene` becomes.
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
            // Too far: half the way back.
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

/// The power over that of the noise at the frequencies to which a `scene` behind a lens that lets
/// `passed` through brings less than `share` of the noise.
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

/// −ln likelihood of a scene, and the change of ln A and b that Fisher's scoring calls for.
struct Scored {
    cost: f64,
    step: [f64; 2],
}

fn scored(at: &Frequencies, spectrum: &TileSpectrum, passed: &[f32], scene: PowerLaw) -> Scored {
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
    // A little is added, so that a tile of noise alone has a step, too.
    let (aa, bb) = (aa + 1e-3, bb + 1e-3);
    let determinant = (aa * bb - ab * ab).max(1e-9);
    let step = [
        (bb * slope[0] - ab * slope[1]) / determinant,
        (aa * slope[1] - ab * slope[0]) / determinant,
    ];
    Scored { cost, step }
}
