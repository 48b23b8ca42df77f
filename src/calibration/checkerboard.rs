//! Detection of a displayed checkerboard's corners to a fraction of a pixel.
//!
//! Three bright spots ([`crate::patterns::locator_spots`]) give a first affine map. The board is
//! then traced outwards from the corners next to the sensor's middle, each corner predicted from
//! its neighbours and refined as the saddle of a fitted quadratic (Lucchese and Mitra, "Using
//! saddle points for subpixel feature detection in camera calibration targets", APCCAS 2002). The
//! window grows with the squares, so blur of a good part of a square is harmless.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::geometric::Pair;
use crate::frame::{Plane, Size};

/// An affine map of the plane, panel → sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    matrix: Matrix2<f64>,
    origin: Vector2<f64>,
}

impl Affine {
    /// The map of the three points `from` to the three points `to`; `None` if either are collinear.
    pub fn through(from: [(f64, f64); 3], to: [(f64, f64); 3]) -> Option<Affine> {
        let f = Matrix3::from_fn(|i, j| [from[i].0, from[i].1, 1.0][j]).try_inverse()?;
        let row = |value: fn((f64, f64)) -> f64| {
            f * Vector3::new(value(to[0]), value(to[1]), value(to[2]))
        };
        let (x, y) = (row(|p| p.0), row(|p| p.1));
        let matrix = Matrix2::new(x[0], x[1], y[0], y[1]);
        // A panel magnified by less than a thousandth is not in view.
        (matrix.determinant().abs() > 1e-6)
            .then_some(Affine { matrix, origin: Vector2::new(x[2], y[2]) })
    }

    /// The image of a point.
    pub fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let p = self.matrix * Vector2::new(x, y) + self.origin;
        (p[0], p[1])
    }

    /// Sensor pixels per panel pixel along the smaller direction.
    pub fn magnification(&self) -> f64 {
        self.matrix.column(0).norm().min(self.matrix.column(1).norm())
    }
}

/// Centroid of the spot in `plane` (counts over black), above half its peak.
///
/// # Errors
/// A sentence about the finding when the peak is below `allowed` counts.
pub fn spot(plane: &Plane, channel: &str, allowed: f64) -> Result<(f64, f64), String> {
    // The peak of 3×3 means, against hot pixels.
    let mut peak = (0.0f32, 0, 0);
    for y in 1..plane.height().saturating_sub(1) {
        for x in 1..plane.width().saturating_sub(1) {
            let mean = (y - 1..=y + 1)
                .map(|v| plane.row(v)[x - 1..=x + 1].iter().sum::<f32>())
                .sum::<f32>()
                / 9.0;
            if mean > peak.0 {
                peak = (mean, x, y);
            }
        }
    }
    let found = f64::from(peak.0);
    if found.is_nan() || found < allowed {
        return Err(format!(
            "the {channel} spot is too dark: it reaches {found:.0} counts over black, at least \
             {allowed:.0} are needed"
        ));
    }
    let (mut sum, mut sx, mut sy) = (0.0, 0.0, 0.0);
    for y in 0..plane.height() {
        for (x, &v) in plane.row(y).iter().enumerate() {
            let over = f64::from(v) - found / 2.0;
            if over > 0.0 {
                sum += over;
                sx += over * x as f64;
                sy += over * y as f64;
            }
        }
    }
    Ok((sx / sum, sy / sum))
}

#[derive(Debug, Clone, Copy)]
struct Saddle {
    x: f64,
    y: f64,
    /// Mixed second derivative along the board's axes: positive where squares of even a + b are
    /// bright.
    twist: f64,
}

/// Finds the corners of a checkerboard of `square_px` panel pixels in `plane`, as pairs (sensor,
/// panel). `near` is a first guess of panel → sensor.
///
/// # Errors
/// A sentence about the finding when there is no corner near the middle.
pub fn corners(
    plane: &Plane,
    panel: Size,
    square_px: usize,
    near: &Affine,
) -> Result<Vec<Pair>, String> {
    let side = square_px as f64 * near.magnification();
    let finder = Finder {
        plane,
        axes: near.matrix * square_px as f64,
        // Under half a square, so that the window excludes the neighbouring corners.
        radius: (0.38 * side).max(2.0),
        reach: 0.3 * side,
    };
    let board = CornerGrid::new(panel, square_px);
    let starts = board.middle(plane.size(), near);
    let mut found: BTreeMap<(i64, i64), Saddle> = BTreeMap::new();
    for &(a, b) in &starts {
        let (x, y) = board.on_sensor((a, b), near);
        found.extend(finder.refine(x, y, parity(a, b)).map(|saddle| ((a, b), saddle)));
    }
    if found.is_empty() {
        let tried = starts.len();
        return Err(format!(
            "none of the {tried} corners near the middle of the picture was found"
        ));
    }
    board.trace(&finder, &mut found, starts);
    let mut twists: Vec<f64> = found.values().map(|s| s.twist.abs()).collect();
    twists.sort_by(f64::total_cmp);
    // Much weaker corners are at the panel's rim or in a reflection.
    let least = 0.2 * twists[twists.len() / 2];
    Ok(found
        .into_iter()
        .filter(|(_, s)| s.twist.abs() >= least)
        .map(|((a, b), s)| Pair { from: (s.x, s.y), to: board.on_panel(a, b) })
        .collect())
}

/// A checkerboard, whose corner (a, b) is a squares right of the panel's origin and b below it.
struct CornerGrid {
    /// Side of a square, panel pixels.
    square: f64,
    /// Largest indices of corners.
    last: (i64, i64),
}

impl CornerGrid {
    /// The board of squares of `square_px` on a `panel`.
    fn new(panel: Size, square_px: usize) -> CornerGrid {
        let last = ((panel.width / square_px) as i64, (panel.height / square_px) as i64);
        CornerGrid { square: square_px as f64, last }
    }

    fn inner(&self) -> impl Iterator<Item = (i64, i64)> {
        let (columns, rows) = self.last;
        (1..columns).flat_map(move |a| (1..rows).map(move |b| (a, b)))
    }

    /// Sensor position of a corner by the map `near`.
    fn on_sensor(&self, (a, b): (i64, i64), near: &Affine) -> (f64, f64) {
        let (x, y) = self.on_panel(a, b);
        near.at(x, y)
    }

    fn on_panel(&self, a: i64, b: i64) -> (f64, f64) {
        (a as f64 * self.square - 0.5, b as f64 * self.square - 0.5)
    }

    /// The nine corners nearest to the middle of a `sensor`, by the first guess `near`.
    fn middle(&self, sensor: Size, near: &Affine) -> Vec<(i64, i64)> {
        let (middle_x, middle_y) = (sensor.width as f64 / 2.0, sensor.height as f64 / 2.0);
        let distance = |&corner: &(i64, i64)| {
            let (x, y) = self.on_sensor(corner, near);
            (x - middle_x).hypot(y - middle_y)
        };
        let mut all: Vec<(i64, i64)> = self.inner().collect();
        all.sort_by(|p, q| distance(p).total_cmp(&distance(q)));
        all.truncate(9);
        all
    }

    /// Extends `found` to neighbouring corners, from `starts` outwards.
    fn trace(
        &self,
        finder: &Finder<'_>,
        found: &mut BTreeMap<(i64, i64), Saddle>,
        starts: Vec<(i64, i64)>,
    ) {
        let mut missed: BTreeSet<(i64, i64)> = BTreeSet::new();
        let mut queue: VecDeque<(i64, i64)> =
            starts.into_iter().filter(|start| found.contains_key(start)).collect();
        while let Some((a, b)) = queue.pop_front() {
            for (da, db) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let next = (a + da, b + db);
                let on_board =
                    (1..=self.last.0).contains(&next.0) && (1..=self.last.1).contains(&next.1);
                if !on_board || found.contains_key(&next) || missed.contains(&next) {
                    continue;
                }
                let here = found[&(a, b)];
                let (x, y) = match found.get(&(a - da, b - db)) {
                    Some(before) => (2.0 * here.x - before.x, 2.0 * here.y - before.y),
                    None => {
                        let step = finder.axes * Vector2::new(da as f64, db as f64);
                        (here.x + step[0], here.y + step[1])
                    }
                };
                match finder.refine(x, y, parity(next.0, next.1)) {
                    Some(saddle) => {
                        found.insert(next, saddle);
                        queue.push_back(next);
                    }
                    None => {
                        missed.insert(next);
                    }
                }
            }
        }
    }
}

/// Number of the board's corners in the sensor's view and at least a square from its border, by the
/// first guess `near` of the map.
pub fn in_view(sensor: Size, panel: Size, square_px: usize, near: &Affine) -> usize {
    let board = CornerGrid::new(panel, square_px.max(1));
    let rim = board.square * near.magnification();
    let inside = |v: f64, side: usize| v >= rim && v + rim < side as f64;
    let is_in_view = |&corner: &(i64, i64)| {
        let (x, y) = board.on_sensor(corner, near);
        inside(x, sensor.width) && inside(y, sensor.height)
    };
    board.inner().filter(is_in_view).count()
}

/// Sign of the twist at corner (a, b).
fn parity(a: i64, b: i64) -> f64 {
    if (a + b).rem_euclid(2) == 0 { 1.0 } else { -1.0 }
}

struct Finder<'a> {
    plane: &'a Plane,
    /// The board's axes, one square long, on the sensor.
    axes: Matrix2<f64>,
    radius: f64,
    reach: f64,
}

impl Finder<'_> {
    /// Finds the saddle near (`x`, `y`) whose twist has the sign of `parity`.
    fn refine(&self, x: f64, y: f64, parity: f64) -> Option<Saddle> {
        let (start_x, start_y) = (x, y);
        let (mut x, mut y) = (x, y);
        // Converges in three or four rounds, if at all.
        for _ in 0..20 {
            let fit = self.quadratic(x, y)?;
            let hessian = Matrix2::new(2.0 * fit[3], fit[4], fit[4], 2.0 * fit[5]);
            if hessian.determinant() >= 0.0 {
                return None;
            }
            let step = -(hessian.try_inverse()? * Vector2::new(fit[1], fit[2]));
            // The fit is valid only within the window.
            let step = step * (0.5 * self.radius / step.norm().max(1e-12)).min(1.0);
            x += step[0];
            y += step[1];
            if (x - start_x).hypot(y - start_y) > self.reach {
                return None;
            }
            if step.norm() < 1e-3 {
                let twist = (self.axes.column(0).transpose() * hessian * self.axes.column(1))[0];
                return (twist * parity > 0.0).then_some(Saddle { x, y, twist });
            }
        }
        None
    }

    /// Fits c₀ + c₁u + c₂v + c₃u² + c₄uv + c₅v² around (`x`, `y`) with Gaussian weights; `None` if
    /// the window leaves the picture.
    fn quadratic(&self, x: f64, y: f64) -> Option<SVector<f64, 6>> {
        let (left, right) = ((x - self.radius).ceil(), (x + self.radius).floor());
        let (top, bottom) = ((y - self.radius).ceil(), (y + self.radius).floor());
        let inside = left >= 0.0
            && top >= 0.0
            && right < self.plane.width() as f64
            && bottom < self.plane.height() as f64;
        if !inside {
            return None;
        }
        let sharp = 2.0 / (self.radius * self.radius);
        let mut matrix = SMatrix::<f64, 6, 6>::zeros();
        let mut side = SVector::<f64, 6>::zeros();
        for py in top as usize..=bottom as usize {
            let v = py as f64 - y;
            for px in left as usize..=right as usize {
                let u = px as f64 - x;
                let weight = (-sharp * (u * u + v * v)).exp();
                let terms = SVector::<f64, 6>::from([1.0, u, v, u * u, u * v, v * v]);
                matrix += weight * terms * terms.transpose();
                side += weight * f64::from(self.plane.at(px, py)) * terms;
            }
        }
        Some(matrix.cholesky()?.solve(&side))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const PANEL: Size = Size::new(640, 480);
    const SQUARE: usize = 40;

    /// Panel position seen at a sensor position, with rotation, tilt and distortion.
    fn truth(x: f64, y: f64) -> (f64, f64) {
        let (u, v) = (x - 200.0, y - 150.0);
        let (sin, cos) = 0.03f64.sin_cos();
        let far = 1.0 + 2e-5 * u - 3e-5 * v;
        let bend = 1.0 + 2e-7 * (u * u + v * v);
        let scale = 1.25 * bend / far;
        (scale * (cos * u - sin * v) + 322.0, scale * (sin * u + cos * v) + 236.0)
    }

    /// A capture of the board blurred by a Gaussian of `blur` sensor pixels, with dark corner and
    /// noise.
    fn photograph(blur: f64, noise: f64) -> Plane {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let bell = Normal::new(0.0, noise).unwrap();
        let wave = |p: f64| {
            // Fourier series of a square wave, attenuated by the blur.
            let phase = (p + 0.5) * std::f64::consts::PI / SQUARE as f64;
            let damp = std::f64::consts::PI / SQUARE as f64 * 1.25 * blur;
            (0..12)
                .map(|n| f64::from(2 * n + 1))
                .map(|k| {
                    (k * phase).sin() * (-0.5 * (k * damp).powi(2)).exp() * 4.0
                        / (std::f64::consts::PI * k)
                })
                .sum::<f64>()
        };
        Plane::from_fn(Size::new(400, 300), |x, y| {
            let (px, py) = truth(x as f64, y as f64);
            let dark = 1.0 - 2e-6 * ((x as f64 - 200.0).powi(2) + (y as f64 - 150.0).powi(2));
            let light = 127.5 + 127.5 * wave(px) * wave(py);
            (dark * light + bell.sample(&mut random)) as f32
        })
    }

    fn first_guess() -> Affine {
        // Map from panel to sensor through three points of `truth`, as three spots give it.
        let seen = [(120.0, 100.0), (280.0, 100.0), (200.0, 220.0)];
        Affine::through(seen.map(|(x, y)| truth(x, y)), seen).unwrap()
    }

    #[test]
    fn corners_are_found_to_a_fraction_of_a_pixel_in_blur_and_noise() {
        // RMS blur of 0.5 to 8 px, the range of the cheapest lens (3.9 px in the centre, 8.1 px in
        // the corner).
        for (blur, bound) in [(0.5, 0.05), (4.0, 0.05), (8.0, 0.12)] {
            let photo = photograph(blur, 1.0);
            let pairs = corners(&photo, PANEL, SQUARE, &first_guess()).unwrap();
            let squared: f64 = pairs
                .iter()
                .map(|p| {
                    let (x, y) = truth(p.from.0, p.from.1);
                    ((x - p.to.0).powi(2) + (y - p.to.1).powi(2)) / (1.25 * 1.25)
                })
                .sum();
            let rms = (squared / pairs.len() as f64).sqrt();
            println!("blur {blur}: {} corners, {rms:.4} px RMS", pairs.len());
            assert!(pairs.len() >= 80, "{} corners at blur {blur}", pairs.len());
            assert!(rms < bound, "{rms} px at blur {blur}");
        }
    }

    #[test]
    fn a_grey_picture_has_no_corners() {
        let grey = Plane::filled(Size::new(400, 300), 90.0);
        let error = corners(&grey, PANEL, SQUARE, &first_guess()).unwrap_err();
        assert!(error.contains("none of the 9 corners"), "{error}");
    }

    #[test]
    fn a_spot_is_found_and_darkness_is_not() {
        let lit = Plane::from_fn(Size::new(60, 50), |x, y| {
            let d = (x as f32 - 31.3).hypot(y as f32 - 20.6);
            3.0 + 90.0 / (1.0 + (d - 5.0).exp())
        });
        let (x, y) = spot(&lit, "green", 20.0).unwrap();
        assert!((x - 31.3).abs() < 0.05 && (y - 20.6).abs() < 0.05, "{x} {y}");
        let dark = Plane::filled(Size::new(60, 50), 3.0);
        assert!(spot(&dark, "green", 20.0).unwrap_err().contains("too dark"));
    }

    #[test]
    fn points_in_a_line_make_no_map() {
        let line = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)];
        let corner = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
        assert!(Affine::through(line, corner).is_none());
        assert!(Affine::through(corner, line).is_none());
        assert_eq!(Affine::through(corner, corner).unwrap().at(3.0, 4.0), (3.0, 4.0));
    }
}
