//! The simulated sensor: converts light to counts, with channel mixing, colour filters, fixed
//! pattern, black level, noise, response curve, saturation and quantisation.

use std::sync::Arc;

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use rayon::prelude::*;

use crate::config::{CameraTable, SensorCurve, SensorTable};
use crate::frame::{Channel, Counts, FULL_SCALE, Frame, Mosaic, Plane, Rect, Size};
use crate::rig::pixel_format::PixelFormat;

/// The simulated sensor of a rig file.
#[derive(Debug, Clone)]
pub(super) struct SimulatedSensor {
    pub(super) config: SensorTable,
    count_max: f32,
    bits: u8,
    /// Gains and hot pixels; `None` if all pixels are equal.
    pattern: Option<Arc<[FixedPattern; 3]>>,
}

/// Fixed differences between the pixels of one channel.
#[derive(Debug, Clone)]
struct FixedPattern {
    gain: Plane,
    /// Dark signal in grey levels.
    dark_signal: Plane,
}

/// A part of the sensor to read, and the random stream of its noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Readout {
    pub(super) part: Rect,
    pub(super) seed: u64,
    pub(super) stream: Stream,
    pub(super) number: u64,
}

/// Purpose of a random stream; streams of different purposes are independent.
#[derive(Debug, Clone, Copy)]
pub(super) enum Stream {
    Capture = 1,
    Photograph = 2,
    Fault = 3,
    Wear = 4,
    Pattern = 5,
    Unrest = 6,
}

/// Random generator of a stream; its values do not depend on the number of threads.
pub(super) fn random(seed: u64, stream: Stream, number: u64, part: u64) -> Xoshiro256PlusPlus {
    // Mixer of SplitMix64 (Steele, Lea and Flood 2014), applied to each number in turn.
    let mut state = seed;
    for word in [stream as u64, number, part] {
        state = state
            .wrapping_add(0x9e37_79b9_7f4a_7c15)
            .wrapping_add(word.wrapping_mul(0xd134_2543_de82_ef95));
        state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^= state >> 31;
    }
    Xoshiro256PlusPlus::seed_from_u64(state)
}

impl SimulatedSensor {
    pub(super) fn new(config: &SensorTable, camera: &CameraTable) -> SimulatedSensor {
        SimulatedSensor {
            config: config.clone(),
            count_max: f32::from(camera.count_max()),
            bits: camera.bits,
            pattern: fixed_pattern(config, camera.size()).map(Arc::new),
        }
    }

    /// Counts per grey level of a primary's light in its own channel.
    pub(super) fn counts_per_level(&self) -> f32 {
        (self.config.white_share * (f64::from(self.count_max) - self.config.black_level_counts)
            / 255.0) as f32
    }

    /// Shot noise: variance in grey levels² per grey level of light.
    fn variance_per_level(&self) -> f32 {
        let range = f64::from(self.count_max) - self.config.black_level_counts;
        let electrons_per_level =
            f64::from(self.counts_per_level()) * self.config.full_well_electrons / range;
        (1.0 / electrons_per_level) as f32
    }

    /// Standard deviation of the noise at light `level`, before rounding to counts.
    pub(super) fn noise_levels(&self, level: f64) -> f64 {
        (level.max(0.0) * f64::from(self.variance_per_level())
            + self.config.read_noise_levels.powi(2))
        .sqrt()
    }

    /// Adds shot and read noise to a row of light in grey levels.
    pub(super) fn add_noise(&self, row: &mut [f32], mut random: Xoshiro256PlusPlus) {
        let (shot, read) =
            (self.variance_per_level(), (self.config.read_noise_levels as f32).powi(2));
        if shot <= 0.0 && read <= 0.0 {
            return;
        }
        for value in row {
            let normal: f32 = StandardNormal.sample(&mut random);
            // Gaussian approximation of Poisson noise, valid above a few electrons.
            *value += normal * (value.max(0.0) * shot + read).sqrt();
        }
    }

    /// Counts of one exposure of the panel: `light` of each primary, with dark corners, and ambient
    /// light with the dark corners `falloff`.
    pub(super) fn expose(
        &self,
        light: &[Plane; 3],
        falloff: &[Plane; 3],
        seed: u64,
        number: u64,
    ) -> Counts {
        let fill = |channel: Channel, y: usize, levels: &mut [f32]| {
            let c = channel.index();
            let mix = self.config.cross_channel[c].map(|v| v as f32);
            let ambient = self.config.ambient_levels[c] as f32;
            let rows = [light[0].row(y), light[1].row(y), light[2].row(y)];
            let dark = falloff[c].row(y);
            for (x, level) in levels.iter_mut().enumerate() {
                *level = mix[0] * rows[0][x]
                    + mix[1] * rows[1][x]
                    + mix[2] * rows[2][x]
                    + ambient * dark[x];
            }
        };
        self.read_out(light[0].size(), seed, number, fill)
    }

    /// Counts of one exposure of a scene; `light` is the light behind each filter.
    pub(super) fn photograph(&self, light: &[Plane; 3], seed: u64, number: u64) -> Counts {
        let fill = |channel: Channel, y: usize, levels: &mut [f32]| {
            levels.copy_from_slice(light[channel.index()].row(y));
        };
        self.read_out(light[0].size(), seed, number, fill)
    }

    /// Counts of the whole sensor; `fill` writes the light of a row.
    fn read_out(
        &self,
        size: Size,
        seed: u64,
        number: u64,
        fill: impl Fn(Channel, usize, &mut [f32]) + Sync + Copy,
    ) -> Counts {
        let reading =
            Readout { part: Rect { x: 0, y: 0, size }, seed, stream: Stream::Capture, number };
        match self.config.mosaic {
            Some(mosaic) => self.as_device_frame(&self.sites(mosaic, reading, fill), mosaic),
            None => Frame::from_fn(|channel| {
                self.plane(channel, reading, fill, |level| self.count(level))
            }),
        }
    }

    /// One channel of a sensor without colour filters: `fill` writes the light of a row, `code`
    /// converts a level with its noise.
    pub(super) fn plane<T: Copy + Default + Send>(
        &self,
        channel: Channel,
        reading: Readout,
        fill: impl Fn(Channel, usize, &mut [f32]) + Sync,
        code: impl Fn(f32) -> T + Sync,
    ) -> Plane<T> {
        let fill = |y: usize, levels: &mut [f32]| {
            fill(channel, y, levels);
            self.apply_pattern(channel, reading.part, y, levels);
        };
        self.codes(reading, channel.index(), fill, code)
    }

    /// Raw counts of a sensor with colour filters `mosaic`.
    pub(super) fn sites(
        &self,
        mosaic: Mosaic,
        reading: Readout,
        fill: impl Fn(Channel, usize, &mut [f32]) + Sync,
    ) -> Plane<u16> {
        let mosaic = mosaic.from_place(reading.part.x, reading.part.y);
        let fill = |y: usize, levels: &mut [f32]| {
            let mut own = vec![0.0; levels.len()];
            for start in 0..2 {
                let channel = mosaic.colour_at(start, y);
                fill(channel, y, &mut own);
                self.apply_pattern(channel, reading.part, y, &mut own);
                for x in (start..levels.len()).step_by(2) {
                    levels[x] = own[x];
                }
            }
        };
        self.codes(reading, 0, fill, |level| self.count(level))
    }

    /// Takes rows from `fill`, adds noise from the streams of `plane`, and converts by `code`.
    fn codes<T: Copy + Default + Send>(
        &self,
        Readout { part: Rect { size, .. }, seed, stream, number }: Readout,
        plane: usize,
        fill: impl Fn(usize, &mut [f32]) + Sync,
        code: impl Fn(f32) -> T + Sync,
    ) -> Plane<T> {
        let mut codes: Plane<T> = Plane::zeros(size);
        codes.data_mut().par_chunks_mut(size.width).enumerate().for_each_init(
            || vec![0.0f32; size.width],
            |levels, (y, row)| {
                fill(y, levels);
                let part = (y * Channel::ALL.len() + plane) as u64;
                self.add_noise(levels, random(seed, stream, number, part));
                row.iter_mut().zip(levels).for_each(|(to, level)| *to = code(*level));
            },
        );
        codes
    }

    /// Raw sites as counts of a device's frame: packed, then unpacked like a real camera's.
    pub(super) fn as_device_frame(&self, sites: &Plane<u16>, mosaic: Mosaic) -> Counts {
        let format = PixelFormat::raw(mosaic, self.bits);
        let wide = if self.bits > 8 { 2 } else { 1 };
        let mut bytes = Vec::with_capacity(sites.size().area() * wide);
        for count in sites.data() {
            bytes.extend_from_slice(&count.to_le_bytes()[..wide]);
        }
        let mut counts = Counts::zeros(sites.size());
        let mut scratch = Plane::default();
        if let Err(short) = format.unpack(&bytes, sites.width() * wide, &mut counts, &mut scratch) {
            log::error!("a frame of the simulated camera: {short}");
        }
        counts
    }

    /// Gains and dark signal of one channel's pixels on a sensor of `size`.
    pub(super) fn fixed_pattern(&self, channel: Channel, size: Size) -> [Plane; 2] {
        match &self.pattern {
            Some(pattern) => {
                let FixedPattern { gain, dark_signal } = &pattern[channel.index()];
                [gain.clone(), dark_signal.clone()]
            }
            None => [Plane::filled(size, 1.0), Plane::zeros(size)],
        }
    }

    /// Applies gains and dark signal to row `y` of `part`.
    fn apply_pattern(&self, channel: Channel, part: Rect, y: usize, levels: &mut [f32]) {
        let Some(pattern) = &self.pattern else { return };
        let FixedPattern { gain, dark_signal } = &pattern[channel.index()];
        let own = &dark_signal.row(part.y + y)[part.x..];
        for ((level, gain), own) in levels.iter_mut().zip(&gain.row(part.y + y)[part.x..]).zip(own)
        {
            *level = *level * gain + own;
        }
    }

    /// Count of a level with its noise.
    fn count(&self, level: f32) -> u16 {
        let (gain, black) = (self.counts_per_level(), self.config.black_level_counts as f32);
        let bent = self.bent(level);
        (bent * gain + black + 0.5).clamp(0.0, self.count_max) as u16
    }

    /// Applies the response curve to a level.
    pub(super) fn bent(&self, level: f32) -> f32 {
        let SensorCurve { gamma, knee_share, knee_slope } = self.config.curve;
        if self.config.curve == SensorCurve::default() {
            return level;
        }
        // Grey levels at the largest count without the curve.
        let range = f64::from(self.count_max) - self.config.black_level_counts;
        let full = range / f64::from(self.counts_per_level());
        let share = f64::from(level) / full;
        let share = share.abs().powf(gamma).copysign(share);
        let above = (share - knee_share).max(0.0);
        ((share - above * (1.0 - knee_slope)) * full) as f32
    }

    /// Level of `count` in a photo developed by the camera, with white at 255.
    pub(super) fn level_of(&self, count: u16) -> f32 {
        let black = self.config.black_level_counts as f32;
        self.white_at_white((f32::from(count) - black) / self.counts_per_level())
    }

    /// Level in a photo developed by the camera, without quantisation.
    pub(super) fn developed(&self, level: f32) -> f32 {
        self.white_at_white(self.bent(level))
    }

    fn white_at_white(&self, bent: f32) -> f32 {
        if self.config.curve == SensorCurve::default() {
            return bent;
        }
        bent * FULL_SCALE / self.bent(FULL_SCALE)
    }
}

/// Fixed pattern of a sensor of `size`; `None` if all pixels are equal. It depends on no seed,
/// since a calibration measures it.
fn fixed_pattern(config: &SensorTable, size: Size) -> Option<[FixedPattern; 3]> {
    let SensorTable { gain_deviation, hot_pixel_share, hot_pixel_levels, .. } = *config;
    let own = hot_pixel_share * hot_pixel_levels;
    (gain_deviation > 0.0 || own > 0.0).then(|| {
        Channel::ALL.map(|channel| {
            let mut lots = random(0, Stream::Pattern, channel.index() as u64, 0);
            let gain = Plane::from_fn(size, |_, _| {
                let normal: f64 = StandardNormal.sample(&mut lots);
                (1.0 + gain_deviation * normal) as f32
            });
            let mut lots = random(0, Stream::Pattern, channel.index() as u64, 1);
            let dark_signal = Plane::from_fn(size, |_, _| {
                let (lot, depth): (f64, f64) = (lots.random(), lots.random());
                let hot = lot < hot_pixel_share;
                if hot { (-hot_pixel_levels * (1.0 - depth).ln()) as f32 } else { 0.0 }
            });
            FixedPattern { gain, dark_signal }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(name: &str) -> SimulatedSensor {
        let rig = crate::config::load(std::path::Path::new(name)).expect("built in");
        SimulatedSensor::new(&rig.simulation().expect("simulated").sensor, &rig.camera)
    }

    fn flat(level: f32) -> [Plane; 3] {
        [0.0, level, 0.0].map(|v| Plane::filled(Size::new(200, 100), v))
    }

    fn mean_and_sigma(counts: &Counts, channel: Channel) -> (f64, f64) {
        let values: Vec<f64> = counts.plane(channel).data().iter().map(|&v| f64::from(v)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean, square.sqrt())
    }

    #[test]
    fn noise_at_mid_grey_is_one_grey_level() {
        for name in ["ideal.toml", "small.toml"] {
            let sensor = sensor(name);
            let ones = flat(128.0).map(|p| p.map(|_| 1.0));
            let (mean, sigma) =
                mean_and_sigma(&sensor.expose(&flat(128.0), &ones, 7, 0), Channel::Green);
            let gain = f64::from(sensor.counts_per_level());
            // Rounding to counts adds a variance of 1/12 squared counts.
            let expected = (sensor.noise_levels(128.5).powi(2) + 1.0 / 12.0 / gain / gain).sqrt();
            assert!(
                (sigma / gain / expected - 1.0).abs() < 0.03,
                "{name}: {} {expected}",
                sigma / gain
            );
            assert!((sigma / gain - 1.0).abs() < 0.1, "{name}: {}", sigma / gain);
            assert!((mean - 64.0 - gain * 128.5).abs() < 0.1, "{name}: {mean}");
        }
    }

    #[test]
    fn mixing_black_level_and_saturation_are_simulated() {
        let sensor = sensor("ideal.toml");
        let zeros = flat(0.0);
        let (red, _) = mean_and_sigma(&sensor.expose(&flat(200.0), &zeros, 7, 0), Channel::Red);
        let gain = f64::from(sensor.counts_per_level());
        assert!((red - 64.0 - 0.08 * 200.0 * gain).abs() < 0.2, "{red}");
        let (black, _) = mean_and_sigma(&sensor.expose(&zeros, &zeros, 7, 0), Channel::Blue);
        assert!((black - 64.0).abs() < 0.1, "{black}");
        let over = sensor.expose(&flat(900.0), &zeros, 7, 0);
        assert!(over.plane(Channel::Green).data().iter().all(|&count| count == 1023));
    }

    #[test]
    fn the_study_s_sensor_counts_grey_levels() {
        let sensor = sensor("study.toml");
        let ones = flat(100.0).map(|p| p.map(|_| 1.0));
        let (mean, sigma) =
            mean_and_sigma(&sensor.expose(&flat(100.0), &ones, 7, 0), Channel::Green);
        // The rig's white leaves room below the largest count, so a level is a little less than one
        // count.
        let gain = f64::from(sensor.counts_per_level());
        let noise = (gain * gain + 1.0 / 12.0).sqrt();
        assert!(
            (mean - 100.0 * gain).abs() < 0.05 && (sigma - noise).abs() < 0.03,
            "{mean} {sigma}"
        );
    }

    #[test]
    fn noise_depends_on_seed_and_number_only() {
        let sensor = sensor("study.toml");
        let (light, ones) = (flat(100.0), flat(1.0));
        let one = sensor.expose(&light, &ones, 7, 3);
        assert_eq!(one, sensor.expose(&light, &ones, 7, 3));
        assert_ne!(one, sensor.expose(&light, &ones, 7, 4));
        assert_ne!(one, sensor.expose(&light, &ones, 8, 3));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        assert_eq!(one, pool.install(|| sensor.expose(&light, &ones, 7, 3)));
    }
}
