//! Broad light of a lens: veiling glare and haze beyond the support of its functions.
//!
//! K x = d (a P x + Σⱼ sⱼ Gⱼ x): the lens functions P carry a share a of the light, Gaussians Gⱼ
//! carry shares sⱼ, and a + Σ sⱼ = 1. A Gaussian is computed on cells of a quarter of its σ: means
//! over cells, two small matrices, linear interpolation, each with its exact transpose. It is
//! applied to x rather than P x, because the blur P is several times narrower.
//!
//! With a dark surround, flat light would be dimmer at the border. The calibration has already
//! attributed that to vignetting, so the gain d makes K 1 = 1.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::frame::{Plane, STRETCH, Size};

/// A share of the light spread over a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Halo {
    /// Standard deviation in photo pixels.
    pub radius_px: f32,
    /// Share of the light, 0 to 1.
    pub share: f32,
}

impl Halo {
    /// The Gaussian along one axis, at `side` pixels about its centre.
    pub(crate) fn along(&self, side: usize) -> Vec<f32> {
        let place = |n: usize| (n as f32 - (side / 2) as f32) / self.radius_px;
        let peak = 1.0 / (std::f32::consts::TAU.sqrt() * self.radius_px);
        (0..side).map(|n| peak * (-0.5 * place(n).powi(2)).exp()).collect()
    }

    /// Share of all light that falls outside a square of `side` pixels about its centre.
    pub(crate) fn beyond(&self, side: usize) -> f32 {
        self.share * (1.0 - self.along(side).iter().sum::<f32>().powi(2))
    }
}

/// Light around the canvas, within reach of a halo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    /// Black.
    Dark,
    /// The light of the border, continued outwards.
    LikeTheBorder,
}

/// Cells per standard deviation. The halo of a picture of squares is then within 1 % of its peak of
/// the exact Gaussian, and within 5 % at the border (test below).
const CELLS_PER_RADIUS: f32 = 4.0;
/// Truncation of a Gaussian, in standard deviations: 6e-5 of its light lies beyond.
const CUT: f32 = 4.0;

/// One axis of the grid of cells.
#[derive(Debug, Clone)]
struct HaloSide {
    /// Pixels of a cell; the last may have fewer.
    cell: usize,
    /// Weight of a pixel in the mean of each cell.
    weights: Vec<f32>,
    /// Gaussian weights `[to][from]` between cells.
    spread: Vec<f32>,
    /// Band width of `spread`, cells on either side.
    reach: usize,
    /// The cell whose centre precedes each pixel.
    lower: Vec<usize>,
    /// Interpolation weight of the next cell at each pixel.
    along: Vec<f32>,
}

impl HaloSide {
    fn new(length: usize, radius_px: f32, beyond: Beyond) -> HaloSide {
        let cell = ((radius_px / CELLS_PER_RADIUS) as usize).clamp(1, length.max(1));
        let count = length.div_ceil(cell).max(1);
        let pixels = |n: usize| match beyond {
            Beyond::Dark => cell,
            Beyond::LikeTheBorder => cell.min(length - n * cell).max(1),
        };
        // A mean over a cell has a variance of 1/12 cells², linear interpolation one of 1/6.
        let own = if cell == 1 { 0.0 } else { 0.25 };
        let sigma = ((radius_px / cell as f32).powi(2) - own).max(0.01).sqrt();
        let reach = (CUT * sigma).ceil() as isize;
        let weight = |step: isize| (-0.5 * (step as f32 / sigma).powi(2)).exp();
        let whole: f32 = (-reach..=reach).map(weight).sum();
        let mut spread = vec![0.0; count * count];
        for to in 0..count {
            for step in -reach..=reach {
                let from = to as isize + step;
                let inside = from.clamp(0, count as isize - 1);
                if inside == from || beyond == Beyond::LikeTheBorder {
                    spread[to * count + inside as usize] += weight(step) / whole;
                }
            }
        }
        let place = |pixel: usize| {
            let place = ((pixel as f32 + 0.5) / cell as f32 - 0.5).clamp(0.0, (count - 1) as f32);
            let lower = (place as usize).min(count.saturating_sub(2));
            (lower, place - lower as f32)
        };
        let (lower, along): (Vec<usize>, Vec<f32>) = (0..length).map(place).unzip();
        HaloSide {
            cell,
            weights: (0..count).map(|n| 1.0 / pixels(n) as f32).collect(),
            spread,
            reach: reach as usize,
            lower,
            along,
        }
    }

    fn count(&self) -> usize {
        self.weights.len()
    }

    /// The cell after `lower`; the same where there is only one.
    fn after(&self, lower: usize) -> usize {
        (lower + 1).min(self.count() - 1)
    }
}

/// Convolution with a Gaussian, computed on cells.
#[derive(Debug, Clone)]
pub(crate) struct Veil {
    x: HaloSide,
    y: HaloSide,
}

impl Veil {
    /// A Gaussian of standard deviation `radius_px` on planes of `size`.
    pub(crate) fn new(size: Size, radius_px: f32, beyond: Beyond) -> Veil {
        Veil {
            x: HaloSide::new(size.width, radius_px, beyond),
            y: HaloSide::new(size.height, radius_px, beyond),
        }
    }

    fn cells(&self) -> Size {
        Size::new(self.x.count(), self.y.count())
    }

    /// `light` convolved with the Gaussian, on rows of cells and columns of pixels.
    fn spread(&self, light: &Plane) -> Plane {
        let mut means: Plane = Plane::zeros(self.cells());
        let rows = means.data_mut().par_chunks_mut(self.x.count()).enumerate();
        rows.for_each_init(
            || vec![0.0f32; light.width()],
            |sum, (n, to)| {
                sum.fill(0.0);
                for y in n * self.y.cell..((n + 1) * self.y.cell).min(light.height()) {
                    sum.iter_mut().zip(light.row(y)).for_each(|(s, v)| *s += v);
                }
                for ((to, part), weight) in
                    to.iter_mut().zip(sum.chunks(self.x.cell)).zip(&self.x.weights)
                {
                    *to = part.iter().sum::<f32>() * weight * self.y.weights[n];
                }
            },
        );
        let cells = self.apply(&means, |spread, count, to, from| spread[to * count + from]);
        let x = &self.x;
        self.on_rows(light.width(), |n, row| {
            let cells = cells.row(n);
            for ((v, &lower), along) in row.iter_mut().zip(&x.lower).zip(&x.along) {
                *v = cells[lower] + along * (cells[x.after(lower)] - cells[lower]);
            }
        })
    }

    /// A plane of `width` pixels and one row per row of cells, filled row by row.
    fn on_rows(&self, width: usize, fill: impl Fn(usize, &mut [f32])) -> Plane {
        let mut plane = Plane::zeros(Size::new(width, self.y.count()));
        (0..plane.height()).for_each(|n| fill(n, plane.row_mut(n)));
        plane
    }

    /// Applies the matrices with the elements `at`(spread, count, to, from) along both axes.
    fn apply(&self, cells: &Plane, at: fn(&[f32], usize, usize, usize) -> f32) -> Plane {
        let along_x = transposed(&apply(&transposed(cells), &self.x, at));
        apply(&along_x, &self.y, at)
    }

    /// Adds `share` of the result of [`Veil::spread`] to row `y` of a plane.
    fn add_row(&self, spread: &Plane, share: f32, y: usize, row: &mut [f32]) {
        let (above, ty) = (self.y.lower[y], self.y.along[y]);
        let near = spread.row(above).iter().zip(spread.row(self.y.after(above)));
        row.iter_mut().zip(near).for_each(|(v, (a, b))| *v += share * (a + ty * (b - a)));
    }

    /// `light` convolved with the Gaussian, on pixels.
    pub(crate) fn on_pixels(&self, light: &Plane) -> Plane {
        let (spread, mut out) = (self.spread(light), Plane::zeros(light.size()));
        (0..light.height()).for_each(|y| self.add_row(&spread, 1.0, y, out.row_mut(y)));
        out
    }

    /// The transpose of [`Veil::spread`] and [`Veil::add_row`] over all rows, on rows of cells and
    /// columns of pixels.
    fn gather(&self, seen: &Plane) -> Plane {
        let mut cells: Plane = Plane::zeros(self.cells());
        let rows = cells.data_mut().par_chunks_mut(self.x.count()).enumerate();
        rows.for_each_init(
            || vec![0.0f32; seen.width()],
            |sum, (n, to)| {
                sum.fill(0.0);
                // A pixel interpolates between the cell before it and the next.
                let near = |n: usize| (n * self.y.cell).min(seen.height());
                for y in near(n.saturating_sub(1))..near(n + 2) {
                    let (above, ty) = (self.y.lower[y], self.y.along[y]);
                    let mut weight = if above == n { 1.0 - ty } else { 0.0 };
                    weight += if self.y.after(above) == n { ty } else { 0.0 };
                    if weight > 0.0 {
                        sum.iter_mut().zip(seen.row(y)).for_each(|(s, v)| *s += weight * v);
                    }
                }
                for ((value, tx), &lower) in sum.iter().zip(&self.x.along).zip(&self.x.lower) {
                    to[lower] += (1.0 - tx) * value;
                    to[self.x.after(lower)] += tx * value;
                }
            },
        );
        let cells = self.apply(&cells, |spread, count, to, from| spread[from * count + to]);
        self.on_rows(seen.width(), |n, row| {
            let columns = cells.row(n).iter().zip(&self.x.weights);
            for (part, (cell, weight)) in row.chunks_mut(self.x.cell).zip(columns) {
                part.fill(cell * weight * self.y.weights[n]);
            }
        })
    }

    /// Adds `share` of the result of [`Veil::gather`] to row `y` of a plane.
    fn add_row_adjoint(&self, gathered: &Plane, share: f32, y: usize, row: &mut [f32]) {
        let gathered = gathered.row(y / self.y.cell).iter();
        row.iter_mut().zip(gathered).for_each(|(v, add)| *v += share * add);
    }
}

/// Applies a matrix along the columns of `cells`.
fn apply(
    cells: &Plane,
    side: &HaloSide,
    at: impl Fn(&[f32], usize, usize, usize) -> f32 + Sync,
) -> Plane {
    let count = cells.height();
    let mut out = Plane::zeros(cells.size());
    let lines = out.data_mut().par_chunks_mut(cells.width().max(1)).enumerate();
    lines.for_each(|(to, line)| {
        for from in to.saturating_sub(side.reach)..(to + side.reach + 1).min(count) {
            let weight = at(&side.spread, count, to, from);
            line.iter_mut().zip(cells.row(from)).for_each(|(sum, v)| *sum += weight * v);
        }
    });
    out
}

fn transposed(plane: &Plane) -> Plane {
    Plane::from_fn(Size::new(plane.height(), plane.width()), |x, y| plane.at(y, x))
}

/// The broad light of one channel.
#[derive(Debug, Clone)]
pub(super) struct Broad {
    veils: Vec<(Veil, Halo)>,
    /// Share a of the light that the lens functions carry.
    local_share: f32,
    /// The gain d, unless it is 1.
    gain: Option<Plane>,
    beyond: Beyond,
}

impl Broad {
    /// The broad light of `halos` on a canvas; `None` without halos.
    pub(super) fn new(canvas: Size, halos: &[Halo], beyond: Beyond) -> Option<Broad> {
        let veil = |&halo: &Halo| (Veil::new(canvas, halo.radius_px, beyond), halo);
        let veils: Vec<(Veil, Halo)> = halos.iter().map(veil).collect();
        let local_share = 1.0 - halos.iter().map(|halo| halo.share).sum::<f32>();
        let mut broad = Broad { veils, local_share, gain: None, beyond };
        if broad.veils.is_empty() {
            return None;
        }
        if beyond == Beyond::Dark {
            let white = Plane::filled(canvas, 1.0);
            let mut flat = white.clone();
            broad.add(&white, &mut flat);
            broad.gain = Some(flat.map(|v| 1.0 / v));
        }
        Some(broad)
    }

    /// The same light on a `canvas` of pixels binned by two.
    pub(super) fn binned(&self, canvas: Size) -> Option<Broad> {
        let half = |(_, halo): &(Veil, Halo)| Halo { radius_px: halo.radius_px / 2.0, ..*halo };
        let halos: Vec<Halo> = self.veils.iter().map(half).collect();
        Broad::new(canvas, &halos, self.beyond)
    }

    /// Turns `out` = P x into K x.
    pub(super) fn add(&self, x: &Plane, out: &mut Plane) {
        let spread: Vec<Plane> = self.veils.iter().map(|(veil, _)| veil.spread(x)).collect();
        let width = out.width().max(1);
        out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            row.iter_mut().for_each(|v| *v *= self.local_share);
            for ((veil, halo), cells) in self.veils.iter().zip(&spread) {
                veil.add_row(cells, halo.share, y, row);
            }
            if let Some(gain) = &self.gain {
                row.iter_mut().zip(gain.row(y)).for_each(|(v, d)| *v *= d);
            }
        });
    }

    /// d y, the input of Pᵀ and [`Broad::add_adjoint`]; `None` where d is 1.
    pub(super) fn before_adjoint(&self, y: &Plane) -> Option<Plane> {
        self.gain.as_ref().map(|gain| {
            let mut scaled = y.clone();
            let pixels = (scaled.data_mut(), gain.data()).into_par_iter();
            pixels.with_min_len(STRETCH).for_each(|(value, gain)| *value *= gain);
            scaled
        })
    }

    /// Turns `out` = Pᵀ d y into Kᵀ y, given d y.
    pub(super) fn add_adjoint(&self, y: &Plane, out: &mut Plane) {
        let gathered: Vec<Plane> = self.veils.iter().map(|(veil, _)| veil.gather(y)).collect();
        let width = out.width().max(1);
        out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            row.iter_mut().for_each(|v| *v *= self.local_share);
            for ((veil, halo), cells) in self.veils.iter().zip(&gathered) {
                veil.add_row_adjoint(cells, halo.share, y, row);
            }
        });
    }
}

/// Checks number, radii and shares of `halos`.
///
/// # Errors
/// A sentence with what was found and what is allowed.
pub(crate) fn check_halos(halos: &[Halo]) -> Result<(), String> {
    let sound =
        |halo: &Halo| (1.0..=1e4).contains(&halo.radius_px) && (0.0..=1.0).contains(&halo.share);
    let share: f32 = halos.iter().map(|halo| halo.share).sum();
    if halos.len() > HALOS_MAX || !halos.iter().all(sound) || share > SHARE_MAX {
        return Err(format!(
            "broad light of {halos:?}; allowed are at most {HALOS_MAX} halos with radii of 1 to \
             10000 px and together at most {SHARE_MAX} of the light"
        ));
    }
    Ok(())
}

/// Maximum number of halos, more than any fit tries.
const HALOS_MAX: usize = 16;
/// Maximum share of broad light. Guess.
pub(crate) const SHARE_MAX: f32 = 0.9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Rect;

    const SIZE: Size = Size::new(150, 110);

    fn random(seed: u64) -> Plane {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        Plane::from_fn(SIZE, |_, _| random.random::<f32>() - 0.3)
    }

    fn halos() -> Vec<Halo> {
        vec![
            Halo { radius_px: 3.0, share: 0.1 },
            Halo { radius_px: 20.0, share: 0.2 },
            Halo { radius_px: 900.0, share: 0.1 },
        ]
    }

    #[test]
    fn the_adjoint_is_exact() {
        for beyond in [Beyond::Dark, Beyond::LikeTheBorder] {
            let broad = Broad::new(SIZE, &halos(), beyond).unwrap();
            let (x, y) = (random(1), random(2));
            // P is the identity here.
            let mut forward = x.clone();
            broad.add(&x, &mut forward);
            let scaled = broad.before_adjoint(&y).unwrap_or_else(|| y.clone());
            let mut adjoint = scaled.clone();
            broad.add_adjoint(&scaled, &mut adjoint);
            let (a, b) = (forward.dot(&y), x.dot(&adjoint));
            assert!(
                (a - b).abs() < 1e-5 * forward.dot(&forward).sqrt() * y.dot(&y).sqrt(),
                "{a} {b}"
            );
        }
    }

    #[test]
    fn flat_light_stays_flat_with_either_surround() {
        for beyond in [Beyond::Dark, Beyond::LikeTheBorder] {
            let broad = Broad::new(SIZE, &halos(), beyond).unwrap();
            let flat = Plane::filled(SIZE, 100.0);
            let mut seen = flat.clone();
            broad.add(&flat, &mut seen);
            let off = seen.data().iter().map(|v| (v - 100.0).abs()).fold(0.0, f32::max);
            assert!(off < 1e-2, "{off}");
        }
    }

    /// `light` blurred by the exact Gaussian.
    fn plain(light: &Plane, radius_px: f32) -> Plane {
        let bell = |d: usize| {
            (-0.5 * (d as f32 / radius_px).powi(2)).exp()
                / (std::f32::consts::TAU.sqrt() * radius_px)
        };
        let along_x: Plane = Plane::from_fn(light.size(), |x, y| {
            light.row(y).iter().enumerate().map(|(n, v)| v * bell(n.abs_diff(x))).sum::<f32>()
        });
        Plane::from_fn(light.size(), |x, y| {
            (0..light.height()).map(|n| along_x.at(x, n) * bell(n.abs_diff(y))).sum()
        })
    }

    #[test]
    fn cells_agree_with_the_exact_gaussian() {
        let mut spot = Plane::zeros(SIZE);
        spot.set(75, 55, 1.0);
        let squares =
            Plane::from_fn(SIZE, |x, y| if (x / 19 + y / 13) % 2 == 0 { 1.0 } else { 0.0 });
        // A single pixel's halo is displaced by up to half a cell; at the border there is no next
        // cell to interpolate with.
        for (light, inside, at_border) in [(spot, 0.1, 0.1), (squares, 0.01, 0.05)] {
            for radius_px in [8.0, 12.0, 21.0, 2.0] {
                let right = plain(&light, radius_px);
                let peak = right.data().iter().copied().fold(0.0, f32::max);
                let mut off = Veil::new(SIZE, radius_px, Beyond::Dark).on_pixels(&light);
                off.add_scaled(-1.0, &right);
                let worst = |from: usize| {
                    let inner = Rect {
                        x: from,
                        y: from,
                        size: Size::new(SIZE.width - 2 * from, SIZE.height - 2 * from),
                    };
                    off.crop(inner).data().iter().fold(0.0f32, |a, v| a.max(v.abs())) / peak
                };
                let found = (worst(radius_px as usize / 2), worst(0));
                println!("radius {radius_px}: {found:.4?} of the peak");
                assert!(found.0 < inside && found.1 < at_border, "radius {radius_px}: {found:?}");
            }
        }
    }

    #[test]
    fn invalid_halos_are_refused() {
        assert!(check_halos(&halos()).is_ok() && check_halos(&[]).is_ok());
        let one = |radius_px, share| check_halos(&[Halo { radius_px, share }]);
        for (radius_px, share) in
            [(0.5, 0.1), (f32::NAN, 0.1), (10.0, 0.95), (10.0, -0.1), (10.0, f32::NAN), (1e9, 0.1)]
        {
            assert!(one(radius_px, share).is_err(), "{radius_px} {share}");
        }
    }
}
