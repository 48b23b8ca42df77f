//! The beat of the panel's columns with the sensor's, taken out of a capture.
//!
//! A panel's pixel is three stripes of light with dark between those of one colour. A lens that
//! passes so fine a grating lets the sensor see it as a beat: light that rises and falls in step
//! with the panel's columns, by a share of the light that is there. A photo has none.
//!
//! So a capture is taken for y = (1 + a·cos φ + b·sin φ)·P, where P is what the lens model predicts
//! and φ is 2π times the panel's column. a and b come from linear least squares: part of the photo
//! by part, for the lens differs over its field, and capture by capture, for a panel wanders by
//! more than a beat bears.

use std::f32::consts::TAU;
use std::ops::Range;

use rayon::prelude::*;

use super::data_term::{MISSING, TRUSTED};
use super::forward_convolution::Seen;
use crate::frame::{Channel, Frame, Mosaic, Plane, Rect, Work};

/// Parts of the photo along its width and height, at most. Across a part the beat is taken for
/// one wave between its neighbours': with half as many, half of a singlet's blue beat stayed,
/// whose phase turns over the field.
const PARTS: [usize; 2] = [12, 8];
/// With fewer columns of parts than this, that would be worse still. Guess.
const COLUMNS_MIN: usize = 6;
/// A beat counts when it explains so many times what it would of noise alone: two numbers a part of
/// all the pixels. Guess: what a prediction misses is not white.
const CERTAIN: f64 = 10.0;
/// A grating that the sensor sees by more than this share of the light is resolved, and no beat.
/// Guess.
const SHARE_MAX: f64 = 0.5;
/// A wave with fewer periods than this in a part, as a channel's sites see it, is not told from a
/// panel that is uneven. Guess.
const PERIODS_MIN: f32 = 3.0;

/// A channel of a capture whose beat is looked for.
pub struct SeenChannel<'a> {
    /// Its light.
    pub light: &'a Plane,
    /// The same as it would be without a beat.
    pub predicted: &'a Plane,
    /// Whether a pixel's light and prediction are known.
    pub known: &'a (dyn Fn(usize, usize) -> bool + Sync),
    /// The photo's place, to which the parts belong.
    pub photo: Rect,
    /// The panel's column, in its pixels, that each pixel sees.
    pub column: &'a Plane,
    /// Whether every other column of pixels only is this channel's, behind colour filters.
    pub at_sites: bool,
}

/// The beat of one channel of one capture.
#[derive(Debug, Clone, PartialEq)]
pub struct PanelBeat {
    /// The wave's cosine and sine, as shares of the light, part by part.
    shares: Vec<[f64; 2]>,
    parts: BeatParts,
}

/// The photo in so many parts along its width and height.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BeatParts {
    photo: Rect,
    columns: usize,
    rows: usize,
}

/// Sums over a part: products of the prediction's two waves with each other and with what the
/// prediction leaves, that squared, and pixels.
type WaveSums = [f64; 7];

impl PanelBeat {
    /// The beat that `look` shows; `None` where there is none to speak of.
    pub fn of(look: &SeenChannel<'_>) -> Option<PanelBeat> {
        let parts = BeatParts::of(look)?;
        let of_part = |n: usize| {
            let [columns, rows] = parts.part(n);
            let mut sums: WaveSums = [0.0; 7];
            for y in rows {
                let light = look.light.row(y);
                let (predicted, column) = (look.predicted.row(y), look.column.row(y));
                for x in columns.clone().filter(|&x| (look.known)(x, y)) {
                    let [cosine, sine] = wave(column[x]).map(|v| f64::from(v * predicted[x]));
                    let left = f64::from(light[x] - predicted[x]);
                    let terms = [
                        cosine * cosine,
                        cosine * sine,
                        sine * sine,
                        left * cosine,
                        left * sine,
                        left * left,
                        1.0,
                    ];
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                }
            }
            sums
        };
        let sums: Vec<WaveSums> =
            (0..parts.columns * parts.rows).into_par_iter().map(of_part).collect();
        let shares: Vec<[f64; 2]> = sums.iter().map(solved).collect();
        let explained: f64 =
            sums.iter().zip(&shares).map(|(sums, [a, b])| a * sums[3] + b * sums[4]).sum();
        let of_all = |n: usize| sums.iter().map(|sums| sums[n]).sum::<f64>();
        let by_chance = (2 * shares.len()) as f64 / of_all(6);
        let share = explained / of_all(5);
        (share > CERTAIN * by_chance).then(|| {
            log::debug!("the panel's beat with the sensor explains {share:.3} of what is left");
            PanelBeat { shares, parts }
        })
    }

    /// Takes the beat out of `light`, whose channel sees the panel's `column`.
    pub fn undo(&self, light: &mut Plane, column: &Plane) {
        let width = light.width();
        light.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, (value, &column)) in row.iter_mut().zip(column.row(y)).enumerate() {
                let ([a, b], [cosine, sine]) = (self.at(x, y), wave(column));
                *value /= 1.0 + a * cosine + b * sine;
            }
        });
    }

    /// The two shares at a pixel: between the parts' middles, and beyond them as at the next.
    fn at(&self, x: usize, y: usize) -> [f32; 2] {
        let BeatParts { photo, columns, rows } = self.parts;
        let place = |at: usize, first: usize, length: usize, parts: usize| {
            let place = (at as f32 + 0.5 - first as f32) / length as f32 * parts as f32 - 0.5;
            let place = place.clamp(0.0, parts as f32 - 1.0);
            let before = (place as usize).min(parts - 2);
            (before, place - before as f32)
        };
        let (i, across) = place(x, photo.x, photo.size.width, columns);
        let (j, along) = place(y, photo.y, photo.size.height, rows);
        [0, 1].map(|n| {
            let at = |i: usize, j: usize| self.shares[j * columns + i][n] as f32;
            let upper = at(i, j) * (1.0 - across) + at(i + 1, j) * across;
            let lower = at(i, j + 1) * (1.0 - across) + at(i + 1, j + 1) * across;
            upper * (1.0 - along) + lower * along
        })
    }
}

impl BeatParts {
    /// As many as the wave that `look`'s sites see is told in; `None` where that is too few, as it
    /// is of a panel with whole columns from one site to the next.
    fn of(look: &SeenChannel<'_>) -> Option<BeatParts> {
        let photo = look.photo;
        let spacing = if look.at_sites { 2 } else { 1 };
        let [most, rows] = PARTS;
        if photo.size.width < 2 * most * spacing || photo.size.height < rows {
            return None;
        }
        let (x, y) = (photo.x + photo.size.width / 2, photo.y + photo.size.height / 2);
        let a_step = look.column.at(x, y) - look.column.at(x - spacing, y);
        let periods = (a_step - a_step.round()).abs() * (photo.size.width / spacing) as f32;
        let columns = ((periods / PERIODS_MIN) as usize).min(most);
        (columns >= COLUMNS_MIN).then_some(BeatParts { photo, columns, rows })
    }

    /// Columns and rows of the `n`-th part.
    fn part(&self, n: usize) -> [Range<usize>; 2] {
        let Rect { x, y, size } = self.photo;
        let span = |n: usize, parts: usize, length: usize, first: usize| {
            first + n * length / parts..first + (n + 1) * length / parts
        };
        let (columns, rows) = (self.columns, self.rows);
        [span(n % columns, columns, size.width, x), span(n / columns, rows, size.height, y)]
    }
}

/// Takes out of `seen`, of which the lens model `predicted` the light, the beats that are found in
/// its `channels`, by what is known of the photo (`trust`, `photo`); the channels see the panel's
/// `columns`.
pub fn take_out(
    seen: &mut Seen,
    predicted: &Frame<Work>,
    (trust, photo): (&Frame<Work, u8>, Rect),
    columns: &Frame<Work>,
    mosaic: Option<Mosaic>,
    channels: &[Channel],
) {
    for &c in channels {
        let (trusted, trust, column) = (seen.trusted.plane(c), trust.plane(c), columns.plane(c));
        let beat = PanelBeat::of(&SeenChannel {
            light: seen.light.plane(c),
            predicted: predicted.plane(c),
            known: &|x, y| trusted.at(x, y) == TRUSTED && trust.at(x, y) != MISSING,
            photo,
            column,
            at_sites: mosaic.is_some(),
        });
        if let Some(beat) = beat {
            beat.undo(seen.light.plane_mut(c), column);
        }
    }
}

/// The wave with one period a panel pixel: cosine and sine.
fn wave(panel_px: f32) -> [f32; 2] {
    let (sine, cosine) = (TAU * (panel_px - panel_px.floor())).sin_cos();
    [cosine, sine]
}

/// What least squares gives of a part's sums; nothing where they do not tell the waves apart, or
/// where so much is no beat.
fn solved(&[cc, cs, ss, lc, ls, ..]: &WaveSums) -> [f64; 2] {
    let determinant = cc * ss - cs * cs;
    // Written so that a number that is none fails too.
    if determinant > 1e-3 * cc * ss {
        let [a, b] = [(lc * ss - ls * cs) / determinant, (ls * cc - lc * cs) / determinant];
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

    /// A capture of uneven light with noise, whose beat is weaker towards the right; what was
    /// predicted; and the panel's columns.
    fn capture(share: f32, columns_a_pixel: f32) -> (Plane, Plane, Plane) {
        let predicted = Plane::from_fn(SIZE, |x, y| 100.0 + 60.0 * (0.05 * (x + y) as f32).sin());
        let column = Plane::from_fn(SIZE, |x, y| columns_a_pixel * x as f32 + 0.01 * y as f32);
        let noise = noise(1);
        let light = Plane::from_fn(SIZE, |x, y| {
            let weaker = share * (1.0 - 0.5 * x as f32 / SIZE.width as f32);
            let beat = weaker * wave(column.at(x, y) + 0.3)[0];
            predicted.at(x, y) * (1.0 + beat) + noise.at(x, y)
        });
        (light, predicted, column)
    }

    fn found(
        (light, predicted, column): &(Plane, Plane, Plane),
        at_sites: bool,
    ) -> Option<PanelBeat> {
        let known = |x: usize, y: usize| !at_sites || (x + y).is_multiple_of(2);
        PanelBeat::of(&SeenChannel {
            light,
            predicted,
            known: &known,
            photo: PHOTO,
            column,
            at_sites,
        })
    }

    #[test]
    fn a_beat_is_found_and_taken_out_and_the_noise_stays() {
        let capture = capture(0.1, 1.163);
        for at_sites in [false, true] {
            let beat = found(&capture, at_sites).expect("a beat of a tenth");
            let (light, predicted, column) = &capture;
            let mut light = light.clone();
            let left = |light: &Plane| {
                let mut left = light.clone();
                left.add_scaled(-1.0, predicted);
                left.rms()
            };
            let before = left(&light);
            beat.undo(&mut light, column);
            let after = left(&light);
            assert!(before > 5.0 && after < 1.15, "{before} before, {after} after");
        }
    }

    #[test]
    fn noise_is_no_beat_and_neither_is_an_uneven_panel() {
        assert_eq!(found(&capture(0.0, 1.163), false), None);
        // Columns and pixels nearly in step: a wave as wide as the photo.
        assert_eq!(found(&capture(0.1, 2.001), false), None);
        // The same as the sites of one colour see it.
        assert_eq!(found(&capture(0.1, 1.501), true), None);
        assert!(found(&capture(0.1, 1.501), false).is_some());
    }
}
