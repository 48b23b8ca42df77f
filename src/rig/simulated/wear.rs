//! Wear of a bench: a panel that warms up, fades, loses pixels and gathers dust.

use rand::RngExt;

use super::sensor::{Stream, random};
use crate::frame::{Plane, Size};

/// Changes of a rig since its calibration; none by default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wear {
    /// Factor on the panel's exponents, for another picture mode or age.
    pub gamma_factor: f64,
    /// Share of dead panel pixels.
    pub dead_share: f64,
    /// Number of grains of dust on the panel.
    pub dust_grains: usize,
    /// Share of the light that is missing on a cold panel.
    pub warm_up_share: f64,
    /// Time constant of the warm-up, seconds.
    pub warm_up_s: f64,
    /// Amplitude of bands as a share of the light: a flickering backlight exposed for fractions of
    /// its period.
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

/// Radius of a grain in sensor pixels: a speck of 0.3 mm out of focus. Guess.
const GRAIN_PX: f32 = 2.0;
/// Share of the light blocked in a grain's middle. Guess.
const GRAIN_SHARE: f32 = 0.6;
/// Bands per frame height: a rolling shutter of 30 ms at 100 Hz of flicker.
const BANDS: f64 = 3.0;

impl Wear {
    /// Indices of dead panel pixels.
    pub(super) fn dead_pixels(&self, panel: Size, seed: u64) -> Vec<usize> {
        let mut random = random(seed, Stream::Wear, 0, 0);
        let count = (self.dead_share * panel.area() as f64).round() as usize;
        (0..count).map(|_| random.random_range(0..panel.area())).collect()
    }

    /// Transmission of the dust over the sensor; `None` without dust.
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

    /// Factor of the light of row `y` of `rows` in exposure `number`, `since_s` after the start of
    /// the wear.
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

    /// Whether the light varies between exposures.
    pub(super) fn is_unsteady(&self) -> bool {
        self.warm_up_share != 0.0 || self.band_share != 0.0
    }
}
