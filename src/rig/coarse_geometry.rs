//! Map from panel to sensor, exact to a pixel or two: enough to place and read frame marks.
//!
//! The map is a homography fitted to a few dots, each shown alone. Dots from wrong frames are
//! outvoted. The calibration measures a finer geometry later.

use nalgebra::{DMatrix, Matrix3, Vector3};

/// A place in pixels: x, y.
pub type Place = [f64; 2];

/// A homography between panel and sensor pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct CoarseGeometry {
    to_sensor: Matrix3<f64>,
    to_panel: Matrix3<f64>,
}

fn through(matrix: &Matrix3<f64>, place: Place) -> Place {
    let mapped = matrix * Vector3::new(place[0], place[1], 1.0);
    [mapped.x / mapped.z, mapped.y / mapped.z]
}

fn distance(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

impl CoarseGeometry {
    /// Fits a homography to `pairs` (panel place, sensor place), robustly.
    ///
    /// Least median of squares (Zhang 1995) over all quadruples selects the pairs within
    /// `tolerance_px`, which are then fitted by least squares. `None` if fewer than five pairs
    /// agree (four always do), fewer than half do, or the final fit misses one of them by more than
    /// the tolerance.
    pub fn fit(pairs: &[(Place, Place)], tolerance_px: f64) -> Option<Self> {
        let error =
            |geometry: &Self, pair: &(Place, Place)| distance(geometry.sensor_at(pair.0), pair.1);
        let mut best: Option<(f64, Self)> = None;
        for a in 0..pairs.len() {
            for b in a + 1..pairs.len() {
                for c in b + 1..pairs.len() {
                    for d in c + 1..pairs.len() {
                        let Some(proposal) =
                            Self::least_squares(&[pairs[a], pairs[b], pairs[c], pairs[d]])
                        else {
                            continue;
                        };
                        let mut errors: Vec<f64> =
                            pairs.iter().map(|pair| error(&proposal, pair)).collect();
                        errors.sort_by(f64::total_cmp);
                        let median = errors[errors.len() / 2];
                        if best.as_ref().is_none_or(|(least, _)| median < *least) {
                            best = Some((median, proposal));
                        }
                    }
                }
            }
        }
        let (_, proposal) = best?;
        let agreeing: Vec<_> =
            pairs.iter().copied().filter(|pair| error(&proposal, pair) <= tolerance_px).collect();
        let fitted = Self::least_squares(&agreeing)?;
        (agreeing.len() >= 5
            && 2 * agreeing.len() >= pairs.len()
            && agreeing.iter().all(|pair| error(&fitted, pair) <= tolerance_px))
        .then_some(fitted)
    }

    /// Fits an affine map to `pairs`, robustly; it extrapolates better than a homography. `None` if
    /// fewer than four pairs agree (three always do), or fewer than half.
    pub fn fit_affine(pairs: &[(Place, Place)], tolerance_px: f64) -> Option<Self> {
        let error =
            |geometry: &Self, pair: &(Place, Place)| distance(geometry.sensor_at(pair.0), pair.1);
        let agreeing_with = |geometry: &Self| -> Vec<(Place, Place)> {
            pairs.iter().copied().filter(|pair| error(geometry, pair) <= tolerance_px).collect()
        };
        let mut best = Vec::new();
        for a in 0..pairs.len() {
            for b in a + 1..pairs.len() {
                for c in b + 1..pairs.len() {
                    if let Some(proposal) = Self::affine(&[pairs[a], pairs[b], pairs[c]]) {
                        let agreeing = agreeing_with(&proposal);
                        if agreeing.len() > best.len() {
                            best = agreeing;
                        }
                    }
                }
            }
        }
        if best.len() < 4 || 2 * best.len() < pairs.len() { None } else { Self::affine(&best) }
    }

    /// Fits an affine map by least squares: normal equations with centred panel places.
    fn affine(pairs: &[(Place, Place)]) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Matrix3::zeros());
        let from = normaliser(pairs.iter().map(|pair| pair.0))?;
        for &(panel, sensor) in pairs {
            let [x, y] = through(&from, panel);
            let row = Vector3::new(x, y, 1.0);
            normal += row * row.transpose();
            right += Vector3::new(sensor[0], sensor[1], 1.0) * row.transpose();
        }
        // Collinear dots do not determine a map.
        (normal.determinant() > 1e-3).then_some(())?;
        let to_sensor = right * normal.try_inverse()? * from;
        Some(CoarseGeometry { to_sensor, to_panel: to_sensor.try_inverse()? })
    }

    /// Normalised direct linear transformation (Hartley & Zisserman, alg. 4.2).
    pub(crate) fn least_squares(pairs: &[(Place, Place)]) -> Option<Self> {
        let from = normaliser(pairs.iter().map(|pair| pair.0))?;
        let to = normaliser(pairs.iter().map(|pair| pair.1))?;
        let mut rows = DMatrix::zeros(2 * pairs.len().max(5), 9);
        for (n, &(panel, sensor)) in pairs.iter().enumerate() {
            let [x, y] = through(&from, panel);
            let [u, v] = through(&to, sensor);
            set_row(&mut rows, 2 * n, [x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u]);
            set_row(&mut rows, 2 * n + 1, [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v]);
        }
        let svd = rows.svd(false, true);
        let null = svd.v_t.as_ref()?.row(8).into_owned();
        let inner = Matrix3::from_row_slice(null.as_slice());
        let to_sensor = to.try_inverse()? * inner * from;
        let to_panel = to_sensor.try_inverse()?;
        let finite = to_sensor.iter().chain(to_panel.iter()).all(|v| v.is_finite());
        finite.then_some(CoarseGeometry { to_sensor, to_panel })
    }

    /// Sensor place that sees panel place `panel`.
    pub fn sensor_at(&self, panel: Place) -> Place {
        through(&self.to_sensor, panel)
    }

    /// Panel place seen at sensor place `sensor`.
    pub fn panel_at(&self, sensor: Place) -> Place {
        through(&self.to_panel, sensor)
    }
}

fn set_row(rows: &mut DMatrix<f64>, row: usize, values: [f64; 9]) {
    for (column, value) in values.into_iter().enumerate() {
        rows[(row, column)] = value;
    }
}

/// Map that moves the mean of `places` to the origin and scales their mean distance from it to √2.
fn normaliser(places: impl Iterator<Item = Place> + Clone) -> Option<Matrix3<f64>> {
    let count = places.clone().count() as f64;
    let sum = places.clone().fold([0.0, 0.0], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
    let mean = [sum[0] / count, sum[1] / count];
    let spread = places.map(|p| distance(p, mean)).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / spread;
    scale.is_finite().then(|| {
        Matrix3::new(scale, 0.0, -scale * mean[0], 0.0, scale, -scale * mean[1], 0.0, 0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sensor position of a panel position, by scale, rotation, shift and some perspective.
    fn true_sensor_at([x, y]: Place) -> Place {
        let w = 1.0 + 1e-5 * x - 2e-5 * y;
        [(0.86 * x + 0.01 * y - 240.0) / w, (-0.012 * x + 0.85 * y - 15.0) / w]
    }

    fn dots() -> Vec<(Place, Place)> {
        let panel =
            (0..12).map(|n| [300.0 + 400.0 * f64::from(n % 4), 150.0 + 380.0 * f64::from(n / 4)]);
        panel.map(|place| (place, true_sensor_at(place))).collect()
    }

    #[test]
    fn a_homography_is_recovered() {
        let geometry = CoarseGeometry::fit(&dots(), 1.0).unwrap();
        for (x, y) in [(0.0, 0.0), (1900.0, 1000.0), (960.0, 540.0)] {
            assert!(distance(geometry.sensor_at([x, y]), true_sensor_at([x, y])) < 1e-6);
            assert!(distance(geometry.panel_at(true_sensor_at([x, y])), [x, y]) < 1e-6);
        }
    }

    #[test]
    fn dots_of_wrong_frames_are_outvoted() {
        let mut pairs = dots();
        for n in [2, 5, 9] {
            pairs[n].1 = pairs[n - 1].1;
        }
        let geometry = CoarseGeometry::fit(&pairs, 3.0).unwrap();
        assert!(
            distance(geometry.sensor_at([700.0, 500.0]), true_sensor_at([700.0, 500.0])) < 1e-6
        );
    }

    #[test]
    fn an_affine_map_extrapolates_a_little_beyond_its_dots() {
        // Six dots in two rows, each off by a quarter pixel; one was seen in the previous frame.
        let mut pairs: Vec<_> = (0..6)
            .map(|n| [600.0 + 300.0 * f64::from(n % 3), 400.0 + 240.0 * f64::from(n / 3)])
            .map(|panel| (panel, true_sensor_at(panel)))
            .collect();
        for (n, pair) in pairs.iter_mut().enumerate() {
            pair.1[n % 2] += if n % 3 == 0 { 0.25 } else { -0.25 };
        }
        pairs[4].1 = pairs[3].1;
        let geometry = CoarseGeometry::fit_affine(&pairs, 6.0).unwrap();
        for place in [[500.0, 200.0], [1300.0, 200.0], [500.0, 900.0], [1300.0, 900.0]] {
            assert!(distance(geometry.sensor_at(place), true_sensor_at(place)) < 25.0);
        }
        let line: Vec<_> = pairs.iter().map(|&([x, _], sensor)| ([x, 2.0 * x], sensor)).collect();
        assert_eq!(CoarseGeometry::fit_affine(&line, 6.0), None);
    }

    #[test]
    fn dots_that_never_move_give_no_geometry() {
        let pairs: Vec<_> = dots().into_iter().map(|(panel, _)| (panel, [400.0, 300.0])).collect();
        assert_eq!(CoarseGeometry::fit(&pairs, 3.0), None);
        assert_eq!(CoarseGeometry::fit(&pairs[..3], 3.0), None);
    }
}
