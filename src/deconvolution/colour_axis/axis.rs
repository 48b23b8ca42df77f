//! The local colour axis: principal direction and linearity of the colours around a place.

/// Added to the mean colour, grey levels, so that black has the direction of grey.
const DARK: f32 = 8.0;
/// Prior variance along the mean colour, in noise variances, for flat places.
const FLAT: f32 = 4.0;
/// κ = STRICT/√(ρ + 10⁻⁴), clamped to the range [`STRICTNESS`].
const STRICT: f32 = 0.3;
const STRICTNESS: (f32, f32) = (2.0, 16.0);
/// ρ at which the linearity is one half.
const HALF_A_LINE: f32 = 0.05;
/// Cosines of 2° and 4°: an axis within 2° of the mean colour's direction snaps to it, one beyond
/// 4° stays, one between is mixed.
const SNAPPED: (f32, f32) = (0.999_391, 0.997_564);
/// Number of squarings of the covariance, which raise ratios of eigenvalues to the 128th power.
const SQUARINGS: usize = 7;

/// The colour axis of a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalAxis {
    /// Unit vector u.
    pub(super) direction: [f32; 3],
    /// κ, the factor on thresholds off the axis, 2 to 16.
    pub(super) strictness: f32,
    /// Linearity of the colours, 0 to 1.
    pub(super) line: f32,
}

impl LocalAxis {
    /// The axis of colours of the given mean and covariance (rr, rg, rb, gg, gb, bb), with a noise
    /// σ of `noise` grey levels.
    ///
    /// ρ is the ratio of the power off the principal direction to that along it. Where ρ is large
    /// the axis tends to grey, the direction of most changes in a scene.
    pub(super) fn of(mean: [f32; 3], covariance: [f32; 6], noise: f32) -> LocalAxis {
        let of_mean = unit(mean.map(|v| v.max(0.0) + DARK));
        let [rr, rg, rb, gg, gb, bb] = covariance;
        let mut power = [[rr, rg, rb], [rg, gg, gb], [rb, gb, bb]];
        let flat = FLAT * noise * noise + f32::EPSILON;
        for (row, v) in power.iter_mut().zip(of_mean) {
            row.iter_mut().zip(of_mean).for_each(|(c, w)| *c += flat * v * w);
        }
        let first = first_direction(power);
        let first = if dot(first, of_mean) < 0.0 { first.map(|v| -v) } else { first };
        let along = dot(first, power.map(|row| dot(row, first))).max(f32::MIN_POSITIVE);
        let total = power[0][0] + power[1][1] + power[2][2];
        let off = ((total - along) / along).max(0.0);
        let line = 1.0 / (1.0 + off / HALF_A_LINE);
        let near = (dot(first, of_mean) - SNAPPED.1) / (SNAPPED.0 - SNAPPED.1);
        let snapped = mixed(near.clamp(0.0, 1.0), of_mean, first);
        let side = (1.0f32 / 3.0).sqrt().copysign(snapped.iter().sum());
        LocalAxis {
            direction: mixed(line, snapped, [side; 3]),
            strictness: (STRICT / (off + 1e-4).sqrt()).clamp(STRICTNESS.0, STRICTNESS.1),
            line,
        }
    }
}

/// The principal eigenvector of a positive semidefinite matrix; grey for the zero matrix.
fn first_direction(mut power: [[f32; 3]; 3]) -> [f32; 3] {
    for _ in 0..SQUARINGS {
        let total = (power[0][0] + power[1][1] + power[2][2]).max(f32::MIN_POSITIVE);
        let scaled = power.map(|row| row.map(|v| v / total));
        power = scaled.map(|row| scaled.map(|column| dot(row, column)));
    }
    let longest = |a: &[f32; 3], b: &[f32; 3]| dot(*a, *a).total_cmp(&dot(*b, *b));
    unit(power.into_iter().max_by(longest).unwrap_or([1.0; 3]))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `v` normalised; the direction of grey for zero.
pub(super) fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    if length > 1e-12 { v.map(|v| v / length) } else { [(1.0f32 / 3.0).sqrt(); 3] }
}

/// `share` · `a` + (1 − `share`) · `b`, normalised.
fn mixed(share: f32, a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    unit([0, 1, 2].map(|c| share * a[c] + (1.0 - share) * b[c]))
}
