//! Moiré between panel columns and sensor columns, removed from captures.
//!
//! A panel pixel is three stripes of light, dark between those of one colour. A lens sharp enough
//! to pass this grating aliases it on the sensor to a beat that modulates the light in step with
//! the panel's columns. Photos have no beat.
//!
//! A capture is modelled as y = (1 + a·cos φ + b·sin φ)·P, where P is the lens model's prediction
//! and φ is 2π times the panel column. Linear least squares give a and b for each part of the
//! photo, since the lens varies over its field, and for each capture, since the panel wanders.

use std::f32::consts::TAU;

use rayon::prelude::*;

use super::data_term::{MISSING, TRUSTED};
use super::forward_convolution::Seen;
use crate::frame::{Channel, Frame, Mosaic, Plane, Rect, Work};

/// Maximum number of parts of the photo along its width and height. With half as many, half of a
/// singlet's blue beat remained, because its phase varies over the field.
const PARTS: [usize; 2] = [12, 8];
/// Minimum number of columns of parts that can follow a phase that varies over the field. Guess.
const COLUMNS_MIN: usize = 6;
/// Minimum residual power that a beat must explain, in multiples of what its two parameters per
/// part explain of white noise. Guess: a model's residual is not white.
const CERTAIN: f64 = 10.0;
/// Maximum amplitude of a beat, as a share of the light; above it the grating is resolved. Guess.
const SHARE_MAX: f64 = 0.5;
/// Minimum number of periods per part, as sampled by the channel's sites; with fewer, a beat cannot
/// be distinguished from an uneven panel. Guess.
const PERIODS_MIN: f32 = 3.0;

/// The wave with one period per panel column, at each pixel of the canvas. Stripes of different
/// colours differ in phase, which the fit absorbs.
#[derive(Debug, Clone)]
pub struct ColumnWave {
    cosine: Plane,
    sine: Plane,
}

impl ColumnWave {
    /// The wave of a canvas whose pixels image the panel columns `columns`, in panel pixels.
    pub fn of(columns: &Plane) -> ColumnWave {
        let phase = |column: f32| TAU * (column - column.floor());
        ColumnWave {
            cosine: columns.map(|column| phase(column).cos()),
            sine: columns.map(|column| phase(column).sin()),
        }
    }

    /// Cosine and sine of the wave at a pixel.
    pub fn at(&self, x: usize, y: usize) -> [f32; 2] {
        [self.cosine.at(x, y), self.sine.at(x, y)]
    }
}

/// A channel of a capture in which a beat is estimated.
pub struct SeenChannel<'a> {
    /// Captured light.
    pub light: &'a Plane,
    /// Predicted light, without a beat.
    pub predicted: &'a Plane,
    /// Whether light and prediction are valid at pixel (x, y).
    pub valid: &'a (dyn Fn(usize, usize) -> bool + Sync),
    /// The photo's rectangle, which is divided into parts.
    pub photo: Rect,
    /// The wave of the panel's columns.
    pub wave: &'a ColumnWave,
    /// Whether the channel has sites in every other column only, behind colour filters.
    pub at_sites: bool,
}

/// The beat of one channel of one capture.
#[derive(Debug, Clone, PartialEq)]
pub struct PanelBeat {
    /// Amplitudes [a, b] of each part, as shares of the light.
    shares: Vec<[f64; 2]>,
    parts: BeatParts,
}

/// A grid of parts over the photo.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BeatParts {
    photo: Rect,
    columns: usize,
    rows: usize,
}

/// Sums of the normal equations over a part: cc, cs, ss, rc, rs, rr of the modulated predictions c
/// and s and the residual r, and the number of pixels.
type WaveSums = [f64; 7];

impl PanelBeat {
    /// Estimates the beat of `seen`; `None` where it is not significant.
    pub fn estimate(seen: &SeenChannel<'_>) -> Option<PanelBeat> {
        let parts = BeatParts::of(seen)?;
        let of_part = |part: &Rect| {
            let mut sums: WaveSums = [0.0; 7];
            for y in part.rows() {
                let light = seen.light.row(y);
                let predicted = seen.predicted.row(y);
                for x in part.columns().filter(|&x| (seen.valid)(x, y)) {
                    let [c, s] = seen.wave.at(x, y).map(|v| f64::from(v * predicted[x]));
                    let r = f64::from(light[x] - predicted[x]);
                    let terms = [c * c, c * s, s * s, r * c, r * s, r * r, 1.0];
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                }
            }
            sums
        };
        let all: Vec<Rect> = parts.photo.parts(parts.columns, parts.rows).collect();
        let sums: Vec<WaveSums> = all.par_iter().map(of_part).collect();
        let shares: Vec<[f64; 2]> = sums.iter().map(solve).collect();
        let explained: f64 =
            sums.iter().zip(&shares).map(|(sums, [a, b])| a * sums[3] + b * sums[4]).sum();
        let total = |n: usize| sums.iter().map(|sums| sums[n]).sum::<f64>();
        let by_chance = (2 * shares.len()) as f64 / total(6);
        let share = explained / total(5);
        (share > CERTAIN * by_chance).then(|| {
            log::debug!("panel beat explains {share:.3} of the residual's power");
            PanelBeat { shares, parts }
        })
    }

    /// Removes the beat from `light`, the captured channel, given the `wave` of the panel's
    /// columns.
    pub fn remove(&self, light: &mut Plane, wave: &ColumnWave) {
        let BeatParts { photo, columns, rows } = self.parts;
        let across = |x: usize| place(x, photo.x, photo.size.width, columns);
        let across: Vec<(usize, f32)> = (0..light.width()).map(across).collect();
        let width = light.width();
        light.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let (j, along) = place(y, photo.y, photo.size.height, rows);
            let (mut rest, mut x) = (row, 0);
            // Runs of columns between the same parts.
            for run in across.chunk_by(|a, b| a.0 == b.0) {
                let (here, more) = std::mem::take(&mut rest).split_at_mut(run.len());
                let corners = [j, j + 1].map(|j| [0, 1].map(|i| self.share(run[0].0 + i, j)));
                let waves = wave.cosine.row(y)[x..].iter().zip(&wave.sine.row(y)[x..]);
                for ((value, (_, across)), (cosine, sine)) in here.iter_mut().zip(run).zip(waves) {
                    let [a, b] = interpolated(&corners, *across, along);
                    *value /= 1.0 + a * cosine + b * sine;
                }
                (rest, x) = (more, x + run.len());
            }
        });
    }

    /// Amplitudes [a, b] of a part.
    fn share(&self, column: usize, row: usize) -> [f32; 2] {
        self.shares[row * self.parts.columns + column].map(|share| share as f32)
    }
}

/// Index of the part whose centre precedes pixel `at`, for `parts` parts over `length` pixels from
/// `first`, and the fraction of the way from there to the next centre, 0 to 1.
fn place(at: usize, first: usize, length: usize, parts: usize) -> (usize, f32) {
    let place = (at as f32 + 0.5 - first as f32) / length as f32 * parts as f32 - 0.5;
    let place = place.clamp(0.0, parts as f32 - 1.0);
    let before = (place as usize).min(parts - 2);
    (before, place - before as f32)
}

/// Amplitudes [a, b] interpolated between four parts, `[row][column]`.
#[inline(always)]
fn interpolated(corners: &[[[f32; 2]; 2]; 2], across: f32, along: f32) -> [f32; 2] {
    let [upper, lower] = corners;
    [0, 1].map(|n| {
        let upper = upper[0][n] * (1.0 - across) + upper[1][n] * across;
        let lower = lower[0][n] * (1.0 - across) + lower[1][n] * across;
        upper * (1.0 - along) + lower * along
    })
}

impl BeatParts {
    /// Grid of parts of at least [`PERIODS_MIN`] periods each; `None` if it would have too few
    /// columns, for example if sites are a whole number of panel columns apart.
    fn of(seen: &SeenChannel<'_>) -> Option<BeatParts> {
        let photo = seen.photo;
        let spacing = if seen.at_sites { 2 } else { 1 };
        let [most, rows] = PARTS;
        if photo.size.width < 2 * most * spacing || photo.size.height < rows {
            return None;
        }
        let (x, y) = (photo.x + photo.size.width / 2, photo.y + photo.size.height / 2);
        let ([c, s], [before_c, before_s]) = (seen.wave.at(x, y), seen.wave.at(x - spacing, y));
        let a_step = (s * before_c - c * before_s).atan2(c * before_c + s * before_s) / TAU;
        let periods = a_step.abs() * (photo.size.width / spacing) as f32;
        let columns = ((periods / PERIODS_MIN) as usize).min(most);
        (columns >= COLUMNS_MIN).then_some(BeatParts { photo, columns, rows })
    }
}

/// Removes the beats found in the `channels` of `seen`, given its prediction, the photo's validity
/// mask and rectangle, and the `wave` of the panel's columns.
pub fn remove_beats(
    seen: &mut Seen,
    predicted: &Frame<Work>,
    (trust, photo): (&Frame<Work, u8>, Rect),
    wave: &ColumnWave,
    mosaic: Option<Mosaic>,
    channels: &[Channel],
) {
    for &c in channels {
        let (trusted, trust) = (seen.trusted.plane(c), trust.plane(c));
        let beat = PanelBeat::estimate(&SeenChannel {
            light: seen.light.plane(c),
            predicted: predicted.plane(c),
            valid: &|x, y| trusted.at(x, y) == TRUSTED && trust.at(x, y) != MISSING,
            photo,
            wave,
            at_sites: mosaic.is_some(),
        });
        if let Some(beat) = beat {
            beat.remove(seen.light.plane_mut(c), wave);
        }
    }
}

/// The least-squares [a, b] of a part; zeros where the equations are ill-conditioned or the
/// amplitude exceeds [`SHARE_MAX`].
fn solve(&[cc, cs, ss, rc, rs, ..]: &WaveSums) -> [f64; 2] {
    let determinant = cc * ss - cs * cs;
    // False for NaN too.
    if determinant > 1e-3 * cc * ss {
        let [a, b] = [(rc * ss - rs * cs) / determinant, (rs * cc - rc * cs) / determinant];
        if a.hypot(b) <= SHARE_MAX { [a, b] } else { [0.0; 2] }
    } else {
        [0.0; 2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const SIZE: Size = Size::new(260, 180);
    const PHOTO: Rect = Rect { x: 10, y: 10, size: Size::new(240, 160) };

    fn noise(seed: u64) -> Plane {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        Plane::from_fn(SIZE, |_, _| StandardNormal.sample(&mut random))
    }

    struct Capture {
        light: Plane,
        predicted: Plane,
        wave: ColumnWave,
    }

    /// A noisy capture of uneven light with a beat that weakens towards the right.
    fn capture(share: f32, columns_a_pixel: f32) -> Capture {
        let predicted = Plane::from_fn(SIZE, |x, y| 100.0 + 60.0 * (0.05 * (x + y) as f32).sin());
        let column = |x: usize, y: usize| columns_a_pixel * x as f32 + 0.01 * y as f32;
        let wave = ColumnWave::of(&Plane::from_fn(SIZE, column));
        let noise = noise(1);
        let light = Plane::from_fn(SIZE, |x, y| {
            let weaker = share * (1.0 - 0.5 * x as f32 / SIZE.width as f32);
            let beat = weaker * (TAU * (column(x, y) + 0.3)).cos();
            predicted.at(x, y) * (1.0 + beat) + noise.at(x, y)
        });
        Capture { light, predicted, wave }
    }

    fn estimate(capture: &Capture, at_sites: bool) -> Option<PanelBeat> {
        let Capture { light, predicted, wave } = capture;
        let valid = |x: usize, y: usize| !at_sites || (x + y).is_multiple_of(2);
        let (photo, valid) = (PHOTO, &valid);
        PanelBeat::estimate(&SeenChannel { light, predicted, valid, photo, wave, at_sites })
    }

    #[test]
    fn a_beat_is_removed_and_noise_remains() {
        let capture = capture(0.1, 1.163);
        for at_sites in [false, true] {
            let beat = estimate(&capture, at_sites).expect("a beat of a tenth");
            let mut light = capture.light.clone();
            let residual = |light: &Plane| {
                let mut residual = light.clone();
                residual.add_scaled(-1.0, &capture.predicted);
                residual.rms()
            };
            let before = residual(&light);
            beat.remove(&mut light, &capture.wave);
            let after = residual(&light);
            assert!(before > 5.0 && after < 1.15, "{before} before, {after} after");
        }
    }

    #[test]
    fn noise_and_an_uneven_panel_are_not_taken_for_a_beat() {
        assert_eq!(estimate(&capture(0.0, 1.163), false), None);
        // Columns and pixels are nearly in step: the beat is as wide as the photo.
        assert_eq!(estimate(&capture(0.1, 2.001), false), None);
        // The same holds for the sites of one colour.
        assert_eq!(estimate(&capture(0.1, 1.501), true), None);
        assert!(estimate(&capture(0.1, 1.501), false).is_some());
    }
}
