//! The axis of one place: along which line its colours lie, and how closely.

/// Added to the mean colour, grey levels: the direction of black is grey's.
const DARK: f32 = 8.0;
/// How many variances of noise say that flat places have details along the mean colour.
const FLAT: f32 = 4.0;
/// κ = STRICT/√(ρ + 10⁻⁴), within these.
const STRICT: f32 = 0.3;
const STRICTNESS: (f32, f32) = (2.0, 16.0);
/// ρ at which colours are half a line.
const HALF_A_LINE: f32 = 0.05;
/// Cosines of 2° and 4°: as near as the first to the mean colour's direction the axis is that.
const SNAPPED: (f32, f32) = (0.999_391, 0.997_564);
/// Squarings of the covariance: its first direction to the 128th power over the others.
const SQUARINGS: usize = 7;

/// Of colours at a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalAxis {
    /// u, of length 1.
    pub(super) direction: [f32; 3],
    /// κ: by how much more what is off the axis is shrunk, 2 to 16.
    pub(super) strictness: f32,
    /// How much of a line the colours are, 0 to 1.
    pub(super) line: f32,
}

impl LocalAxis {
    /// The axis of colours of a given mean and covariance (upper half by rows: rr, rg, rb, gg, gb,
    /// bb), with noise of `noise` grey levels.
    ///
    /// ρ is the power off the first direction over that along it. Where it is large there is no
    /// line, and the axis goes to grey's, for brightness is what changes most.
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

/// The eigenvector of the largest eigenvalue of a symmetric matrix without negative ones; some
/// vector of length 1 where there is none.
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

/// `v` at length 1; grey's direction where it has none.
pub(super) fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    if length > 1e-12 { v.map(|v| v / length) } else { [(1.0f32 / 3.0).sqrt(); 3] }
}

/// `share` of `a` and the rest of `b`, at length 1.
fn mixed(share: f32, a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    unit([0, 1, 2].map(|c| share * a[c] + (1.0 - share) * b[c]))
}
