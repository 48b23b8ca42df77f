//! The simulated panel: response to codes, and projection onto the sensor's pixels.

use rayon::prelude::*;

use super::pose::PanelMap;
use crate::config::{DisplayTable, Uneven};
use crate::frame::{Plane, Size};

/// Light of each code, 0..255, of one channel (formula at [`DisplayTable`]).
pub(super) fn response(display: &DisplayTable, channel: usize) -> [f32; 256] {
    let (gamma, toe) = (display.gamma[channel], display.toe[channel]);
    let floor = (toe / (1.0 + toe)).powf(gamma);
    std::array::from_fn(|code| {
        let curve = ((code as f64 / 255.0 + toe) / (1.0 + toe)).powf(gamma);
        let share = (curve - floor) / (1.0 - floor);
        (255.0 * (display.leakage_share + (1.0 - display.leakage_share) * share)) as f32
    })
}

/// Shading of an uneven panel.
pub(super) struct Shading {
    /// Factor by which the light of a code is multiplied, per channel.
    pub(super) gain: [Plane; 3],
    /// Light added independently of the code.
    pub(super) veil: Plane,
}

impl Shading {
    /// Shading of a panel of `size` as seen by the lens; `None` for an even panel.
    pub(super) fn new(uneven: &Uneven, map: &PanelMap, size: Size) -> Option<Shading> {
        if *uneven == Uneven::default() {
            return None;
        }
        let aslant: Plane = Plane::from_fn(size, |x, y| {
            (map.angle_deg([x as f64, y as f64]) / 10.0).powi(2) as f32
        });
        let [middle_x, middle_y] = map.panel_centre;
        let gain = [-0.5, 0.0, 0.5].map(|tint| {
            let corner = uneven.corner_loss + tint * uneven.corner_tint;
            Plane::from_fn(size, |x, y| {
                let (x_share, y_share) = (x as f64 / middle_x - 1.0, y as f64 / middle_y - 1.0);
                let out = (x_share.powi(2) + y_share.powi(2)) / 2.0;
                let lost_aslant = uneven.loss_at_10_deg * f64::from(aslant.at(x, y));
                ((1.0 - corner * out).max(0.0) * (1.0 - lost_aslant).max(0.0)) as f32
            })
        });
        let veil = aslant.map(|v| v * (uneven.leakage_at_10_deg * 255.0) as f32);
        Some(Shading { gain, veil })
    }
}

/// Mean progress from the last picture to the new one over an exposure, 0..1. The panel approaches
/// the new picture exponentially from `change_s` on, with time constant `response_s`.
pub(super) fn approach(change_s: f64, response_s: f64, from_s: f64, to_s: f64) -> f64 {
    let begin = from_s.max(change_s);
    if to_s <= begin {
        return 0.0;
    }
    let gap = |t: f64| if response_s > 0.0 { (-(t - change_s) / response_s).exp() } else { 0.0 };
    ((to_s - begin) - response_s * (gap(begin) - gap(to_s))) / (to_s - from_s)
}

/// Footprints of a grid's pixels on the panel, as upright squares.
pub(super) struct Projection {
    size: Size,
    /// Footprint centres on the panel, x and y.
    centres: Vec<[f32; 2]>,
    /// Half the side of a footprint, in panel pixels.
    half: f32,
    /// Exact offset of panel pixels from grid pixels, if both grids coincide.
    identity: Option<[isize; 2]>,
    /// Steps on the panel, in its pixels, for one sensor pixel right and one down, in the middle.
    pub(super) steps: [[f64; 2]; 2],
}

impl Projection {
    /// Offset of the panel, in its own pixels, when it appears `moved_px` sensor pixels to the
    /// right and down. The offset must be small, so that lens and perspective are constant over it.
    pub(super) fn offset_px(&self, moved_px: [f64; 2]) -> [f64; 2] {
        let [right, down] = moved_px;
        [0, 1].map(|n| right * self.steps[0][n] + down * self.steps[1][n])
    }

    /// Footprints of a grid of `size` whose pixel (0, 0) is sensor pixel (−pad, −pad).
    pub(super) fn new(map: &PanelMap, size: Size, pad: usize) -> Projection {
        let sensor_px_per_panel_px = map.scale;
        let pad = pad as f64;
        let centres: Vec<[f32; 2]> = (0..size.area())
            .into_par_iter()
            .map(|n| {
                let at = [(n % size.width) as f64 - pad, (n / size.width) as f64 - pad];
                map.to_panel(at).map(|v| v as f32)
            })
            .collect();
        // Without resampling every footprint is one panel pixel.
        let whole = (sensor_px_per_panel_px - 1.0).abs() < 1e-9
            && centres.iter().enumerate().all(|(n, c)| {
                let origin = centres[0];
                let (x, y) = ((n % size.width) as f32, (n / size.width) as f32);
                let near = |a: f32, b: f32| (a - b).abs() < 1e-3;
                near(c[0], origin[0].round() + x) && near(c[1], origin[1].round() + y)
            });
        let identity = whole.then(|| centres[0].map(|v| v.round() as isize));
        let middle = map.to_panel(map.axis);
        let steps = [[1.0, 0.0], [0.0, 1.0]].map(|step| {
            let [x, y] = map.to_panel([map.axis[0] + step[0], map.axis[1] + step[1]]);
            [x - middle[0], y - middle[1]]
        });
        Projection { steps, size, centres, half: (0.5 / sensor_px_per_panel_px) as f32, identity }
    }

    /// Light seen by the grid's pixels through a perfect lens: mean over each footprint, dark
    /// beyond the panel, with the panel displaced by `offset_px` of its own pixels to the right and
    /// down.
    pub(super) fn light(&self, panel: &Plane, offset_px: [f64; 2]) -> Plane {
        let off = offset_px.map(|v| v as f32);
        let identity = self.identity.filter(|_| offset_px == [0.0; 2]);
        let mut out = Plane::zeros(self.size);
        let width = self.size.width;
        out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| match identity {
            Some([x0, y0]) => {
                let Some(from) = row_of(panel, y0 + y as isize) else { return };
                for (x, value) in row.iter_mut().enumerate() {
                    let x = x0 + x as isize;
                    *value =
                        usize::try_from(x).ok().and_then(|x| from.get(x)).copied().unwrap_or(0.0);
                }
            }
            None => {
                for (value, centre) in row.iter_mut().zip(&self.centres[y * width..][..width]) {
                    let centre = [centre[0] - off[0], centre[1] - off[1]];
                    *value = footprint(panel, centre, self.half);
                }
            }
        });
        out
    }
}

fn row_of(panel: &Plane, y: isize) -> Option<&[f32]> {
    usize::try_from(y).ok().filter(|&y| y < panel.height()).map(|y| panel.row(y))
}

/// First pixel under a footprint along one axis, and the shares of it and the next two pixels.
fn shares(centre: f32, half: f32) -> (isize, [f32; 3]) {
    let (low, high) = (centre - half + 0.5, centre + half + 0.5);
    let first = low.floor();
    let over = 0.5 / half;
    let share = |n: f32| (high.min(first + n + 1.0) - low.max(first + n)).max(0.0) * over;
    (first as isize, [share(0.0), share(1.0), share(2.0)])
}

/// Mean of the panel over a footprint at most two panel pixels wide.
fn footprint(panel: &Plane, [x, y]: [f32; 2], half: f32) -> f32 {
    let (x0, across) = shares(x, half);
    let (y0, down) = shares(y, half);
    let mut sum = 0.0;
    let inside = x0 >= 0 && x0 + 3 <= panel.width() as isize;
    for (n, weight) in down.into_iter().enumerate() {
        let Some(row) = row_of(panel, y0 + n as isize) else { continue };
        if inside {
            let taps = &row[x0 as usize..x0 as usize + 3];
            sum += weight * (across[0] * taps[0] + across[1] * taps[1] + across[2] * taps[2]);
        } else {
            for (m, share) in across.into_iter().enumerate() {
                let tap = usize::try_from(x0 + m as isize).ok().and_then(|x| row.get(x));
                sum += weight * share * tap.copied().unwrap_or(0.0);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_footprint_is_a_mean() {
        let panel = Plane::from_fn(Size::new(9, 9), |x, y| (10 * x + y) as f32);
        // A plane of constant slope: the mean over any footprint is the value at its centre.
        for (x, y) in [(4.0, 4.0), (3.3, 5.1), (4.5, 2.5), (3.99, 4.01)] {
            let found = footprint(&panel, [x, y], 0.58);
            let (low, high) = ((x - 0.58f32).round(), (x + 0.58f32).round());
            // Pixels are piecewise constant, so the mean lies between the pixels touched.
            assert!(
                found >= 10.0 * low + (y - 0.58).round()
                    && found <= 10.0 * high + (y + 0.58).round()
            );
        }
        let (_, all) = shares(3.7, 0.58);
        assert!((all.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((footprint(&panel, [4.0, 4.0], 0.5) - 44.0).abs() < 1e-4);
        assert!((footprint(&panel, [4.5, 4.0], 0.5) - 49.0).abs() < 1e-4);
        assert!(footprint(&panel, [-3.0, 4.0], 0.58).abs() < 1e-9);
    }

    #[test]
    fn the_panel_approaches_a_new_picture_exponentially() {
        assert!(approach(1.0, 0.005, 0.5, 0.9).abs() < 1e-12);
        assert!((approach(1.0, 0.0, 0.9, 1.1) - 0.5).abs() < 1e-9);
        let late = approach(1.0, 0.005, 1.005, 1.005 + 1e-6);
        assert!((late - (1.0 - (-1f64).exp())).abs() < 1e-3, "{late}");
    }

    #[test]
    fn response_runs_from_leakage_to_white() {
        let rig = crate::config::load(std::path::Path::new("small.toml")).expect("built in");
        let display = &rig.simulation().expect("simulated").display;
        for channel in 0..3 {
            let light = response(display, channel);
            assert!((light[0] - 0.255).abs() < 1e-4 && (light[255] - 255.0).abs() < 1e-3);
            assert!(light.windows(2).all(|w| w[1] > w[0]));
        }
    }
}
