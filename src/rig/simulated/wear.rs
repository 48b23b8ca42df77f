//! What has become of a bench since it was new: a panel that warms up, fades, loses pixels and
//! gathers dust.

use rand::RngExt;

use super::sensor::{Stream, random};
use crate::frame::{Plane, Size};

/// Changes that a calibration made before them knows nothing of; none at first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wear {
    /// The panel's exponents are multiplied by this: another picture mode, or age.
    pub gamma_factor: f64,
    /// Share of panel pixels that stay dark.
    pub dead_share: f64,
    /// Grains of dust on the panel's glass, scattered over the whole of it.
    pub dust_grains: usize,
    /// Share of its light that a cold panel lacks; it comes with time.
    pub warm_up_share: f64,
    /// Time constant of the warming up, from now on.
    pub warm_up_s: f64,
    /// Amplitude of bands over the captures, as a share of the light: a backlight that flickers,
    /// exposed for something else than whole periods.
    pub band_share: f64,
}

impl Default for Wear {
    fn default() -> Self {
        Wear {
            gamma_factor: 1.0,
            dead_share: 0.0,
            dust_grains: 0,
            warm_up_share: 0.0,
            warm_up_s: 1.0,
            band_share: 0.0,
        }
    }
}

/// Radius of a grain and its rim, sensor pixels: a speck of 0.3 mm seen out of focus. Guess.
const GRAIN_PX: f32 = 2.0;
/// Share of the light that a grain takes in its middle. Guess.
const GRAIN_SHARE: f32 = 0.6;
/// Bands over the height of a picture: a rolling shutter of 30 ms at 100 Hz of flicker.
const BANDS: f64 = 3.0;

impl Wear {
    /// Panel pixels that are dead, as indices into its rows.
    pub(super) fn dead_pixels(&self, panel: Size, seed: u64) -> Vec<usize> {
        let mut random = random(seed, Stream::Wear, 0, 0);
        let count = (self.dead_share * panel.area() as f64).round() as usize;
        (0..count).map(|_| random.random_range(0..panel.area())).collect()
    }

    /// The share of light that passes the dust, over the sensor; `None` without dust.
    pub(super) fn dust(&self, sensor: Size, seed: u64) -> Option<Plane> {
        let mut random = random(seed, Stream::Wear, 1, 0);
        let grains: Vec<(f32, f32)> = (0..self.dust_grains)
            .map(|_| {
                let (x, y): (f32, f32) = (random.random(), random.random());
                (x * sensor.width as f32, y * sensor.height as f32)
            })
            .collect();
        (!grains.is_empty()).then(|| {
            Plane::from_fn(sensor, |x, y| {
                grains.iter().fold(1.0, |passed, grain| {
                    let distance = (x as f32 - grain.0).hypot(y as f32 - grain.1) / GRAIN_PX;
                    passed * (1.0 - GRAIN_SHARE * (-distance * distance / 2.0).exp())
                })
            })
        })
    }

    /// What the light of row `y` of `rows` is multiplied by in exposure `number`, `since_s` after
    /// the wear began.
    pub(super) fn row_share(
        &self,
        y: usize,
        rows: usize,
        since_s: f64,
        seed: u64,
        number: u64,
    ) -> f32 {
        let cold = self.warm_up_share * (-since_s / self.warm_up_s).exp();
        let phase: f64 = random(seed, Stream::Wear, 2, number).random();
        let band = (std::f64::consts::TAU * (phase + BANDS * y as f64 / rows as f64)).sin();
        ((1.0 - cold) * (1.0 + self.band_share * band)) as f32
    }

    /// Whether the light changes from one exposure to the next.
    pub(super) fn is_unsteady(&self) -> bool {
        self.warm_up_share != 0.0 || self.band_share != 0.0
    }
}
