//! Photos of a scene: exposures without a picture on the panel, metering, and dark frames.

use super::exposure::Devices;
use super::{Exposed, RigError};
use crate::frame::{Channel, Counts, Mosaic, Plane};

/// Maximum share of clipped sites in a metered exposure.
pub const CLIPPED_SHARE_MAX: f64 = 0.001;

/// Target level of the brightest sites, [`CLIPPED_SHARE_MAX`] excluded, as a share of the count
/// range. Guess: leaves room for a lamp's flicker.
const BRIGHTEST: f64 = 0.9;

/// Maximum factor by which one step of metering changes the exposure.
const STEP_MAX: f64 = 8.0;

/// Maximum mean light behind a covered lens, as a share of the count range. Guess: dark current
/// adds less, a room more.
const DARK_SHARE_MAX: f64 = 0.05;

const METERED_MAX: usize = 6;

/// A photo: the mean of one or more exposures.
#[derive(Debug, Clone, PartialEq)]
pub struct PhotoShot {
    /// Counts of the whole sensor times 2^`finer`.
    pub counts: Counts,
    /// Bits of resolution added by the mean, whose noise may be less than one count.
    pub finer: u32,
    /// Share of sites, 0..1, that reached the largest count in any exposure.
    pub clipped_share: f64,
    /// Noise power relative to one exposure.
    pub noise_share: f64,
    /// Noise power added by a subtracted dark frame, relative to one dark exposure.
    pub dark_share: f64,
}

/// Noise power of one exposure's red, green and blue sites, in squared counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SiteNoise {
    /// Noise power without light.
    pub at_black: [f64; 3],
    /// Noise power added per count above black.
    pub per_count: [f64; 3],
}

impl SiteNoise {
    /// Noise at `times` the gain. Shot noise and noise before the amplifier scale with the gain;
    /// rounding does not. Other noise after the amplifier is overestimated. The black level is
    /// assumed constant, as sensors keep it so.
    #[must_use]
    pub fn amplified(&self, times: f64) -> SiteNoise {
        const ROUNDING: f64 = 1.0 / 12.0;
        let at_black = |power: f64| (power - ROUNDING).max(0.0) * times.powi(2) + ROUNDING;
        SiteNoise {
            at_black: self.at_black.map(at_black),
            per_count: self.per_count.map(|power| power * times),
        }
    }
}

/// Range of a camera's counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CountRange {
    /// Count without light.
    pub black: f64,
    /// Largest count.
    pub max: u16,
}

impl PhotoShot {
    /// Range of the photo's counts, given the camera's `range`.
    pub fn range(&self, range: CountRange) -> CountRange {
        let times = 1 << self.finer;
        CountRange { black: range.black * f64::from(times), max: range.max * times }
    }

    /// Adds `bits` of resolution to the counts.
    fn refine(&mut self, bits: u32) {
        for plane in self.counts.planes_mut() {
            plane.data_mut().iter_mut().for_each(|count| *count <<= bits);
        }
        self.finer += bits;
    }

    /// Noise variance of red, green and blue sites as (slope over the light, value without light),
    /// given the `noise` of one exposure. Light is 1 at the largest count.
    pub fn noise_profile(&self, noise: &SiteNoise, range: CountRange) -> [[f64; 2]; 3] {
        let full = f64::from(range.max) - range.black;
        let dark = (self.noise_share + self.dark_share) / full.powi(2);
        [0, 1, 2].map(|c| [self.noise_share * noise.per_count[c] / full, dark * noise.at_black[c]])
    }

    /// Mean light as a share of the count range.
    pub fn brightness(&self, mosaic: Option<Mosaic>, range: CountRange) -> f64 {
        let range = self.range(range);
        (mean(&self.counts, mosaic) - range.black) / (f64::from(range.max) - range.black)
    }

    /// Whether the photo was taken with a covered lens.
    pub fn is_dark(&self, mosaic: Option<Mosaic>, range: CountRange) -> bool {
        self.brightness(mosaic, range) < DARK_SHARE_MAX
    }

    /// Subtracts `dark`, an equal exposure with a covered lens, site by site. Saturated sites stay
    /// saturated.
    #[must_use]
    pub fn without_dark(mut self, dark: &PhotoShot, range: CountRange) -> PhotoShot {
        self.refine(dark.finer.saturating_sub(self.finer));
        self.dark_share += dark.noise_share;
        let (range, coarser) = (self.range(range), self.finer - dark.finer);
        let black = range.black.round() as i32;
        self.counts.update(&dark.counts, |count, dark| {
            if *count < range.max {
                let light = i32::from(*count) - (i32::from(dark) << coarser) + black;
                *count = light.clamp(0, i32::from(range.max) - 1) as u16;
            }
        });
        self
    }
}

/// Takes a photo as the mean of `frames` exposures (at least one).
pub fn shoot(
    devices: &mut Devices,
    mosaic: Option<Mosaic>,
    range: CountRange,
    frames: u8,
) -> Result<PhotoShot, RigError> {
    let frames = frames.max(1);
    let first = devices.expose()?.counts;
    let mut clipped = first.planes().each_ref().map(|plane| plane.map(|c| c >= range.max));
    let mut sums = first.planes().each_ref().map(|plane| plane.map(u32::from));
    devices.camera.give_back(first);
    for _ in 1..frames {
        let Exposed { counts, .. } = devices.expose()?;
        for ((sum, clipped), plane) in sums.iter_mut().zip(&mut clipped).zip(counts.planes()) {
            let each = sum.data_mut().iter_mut().zip(clipped.data_mut()).zip(plane.data());
            each.for_each(|((sum, clipped), &count)| {
                *sum += u32::from(count);
                *clipped |= count >= range.max;
            });
        }
        devices.camera.give_back(counts);
    }
    let n = u32::from(frames);
    let finer = if n > 1 { range.max.leading_zeros() } else { 0 };
    let clipped_share = mean_of(&clipped, mosaic);
    // The light of a site that saturated in any exposure is unknown: it counts as saturated.
    let mean = |c: Channel| {
        let (sum, clipped) = (&sums[c.index()], &clipped[c.index()]);
        Plane::from_fn(sum.size(), |x, y| match clipped.at(x, y) {
            true => range.max << finer,
            false => (((sum.at(x, y) << finer) + n / 2) / n) as u16,
        })
    };
    let (counts, noise_share) = (Counts::from_fn(mean), f64::from(n).recip());
    Ok(PhotoShot { counts, finer, clipped_share, noise_share, dark_share: 0.0 })
}

/// Sets the longest exposure that clips at most [`CLIPPED_SHARE_MAX`] of the scene, and returns it;
/// `None` if the camera's exposure cannot be set. `allowed` and the result are multiples of the rig
/// file's exposure.
pub fn meter(
    devices: &mut Devices,
    mosaic: Option<Mosaic>,
    range: CountRange,
    allowed: (f64, f64),
) -> Result<Option<f64>, RigError> {
    let mut times = 1.0f64.clamp(allowed.0, allowed.1);
    for _ in 0..METERED_MAX {
        if !devices.expose_times(times)? {
            return Ok(None);
        }
        // The first frame after a change may have the previous exposure.
        devices.expose()?;
        let shot = shoot(devices, mosaic, range, 1)?;
        let next = (times * proposal(&shot, mosaic, range)).clamp(allowed.0, allowed.1);
        let is_settled = (0.95..1.05).contains(&(next / times));
        times = next;
        if is_settled {
            break;
        }
    }
    devices.expose_times(times)?;
    devices.expose()?;
    Ok(Some(times))
}

/// Factor by which to change the exposure, judged by `shot`.
fn proposal(shot: &PhotoShot, mosaic: Option<Mosaic>, range: CountRange) -> f64 {
    if shot.clipped_share > CLIPPED_SHARE_MAX {
        return if shot.clipped_share > 0.1 { 1.0 / STEP_MAX } else { 0.5 };
    }
    let mut histogram = vec![0u64; usize::from(u16::MAX) + 1];
    for_each_site(shot.counts.planes(), mosaic, |count| histogram[usize::from(count)] += 1);
    let all: u64 = histogram.iter().sum();
    let mut above = (CLIPPED_SHARE_MAX * all as f64) as u64;
    let brightest = histogram.iter().rposition(|&sites| match above.checked_sub(sites) {
        Some(remaining) => {
            above = remaining;
            false
        }
        None => true,
    });
    let light = (brightest.unwrap_or(0) as f64 - range.black).max(1.0);
    let wanted = BRIGHTEST * (f64::from(range.max) - range.black) / light;
    wanted.clamp(1.0 / STEP_MAX, STEP_MAX)
}

/// Calls `each` for every measured value: the sites of a `mosaic`, or all pixels of three planes.
fn for_each_site<T: Copy + Default>(
    planes: &[Plane<T>; 3],
    mosaic: Option<Mosaic>,
    mut each: impl FnMut(T),
) {
    match mosaic {
        Some(mosaic) => sites_of(planes, mosaic).data().iter().for_each(|&v| each(v)),
        None => planes.iter().flat_map(|plane| plane.data()).for_each(|&v| each(v)),
    }
}

/// Mean of the measured values of `counts`.
pub fn mean(counts: &Counts, mosaic: Option<Mosaic>) -> f64 {
    mean_of(counts.planes(), mosaic)
}

fn mean_of<T: Copy + Default + Into<u64>>(planes: &[Plane<T>; 3], mosaic: Option<Mosaic>) -> f64 {
    let (mut sum, mut all) = (0u64, 0u64);
    for_each_site(planes, mosaic, |value| (sum, all) = (sum + value.into(), all + 1));
    sum as f64 / all.max(1) as f64
}

/// Share of the measured values of `counts`, 0..1, that are at least `count_max`.
pub fn clipped_share(counts: &Counts, mosaic: Option<Mosaic>, count_max: u16) -> f64 {
    mean_of(&counts.planes().each_ref().map(|plane| plane.map(|c| c >= count_max)), mosaic)
}

/// Sites of a sensor, extracted from the three interpolated planes.
pub fn sites_of<T: Copy + Default>(planes: &[Plane<T>; 3], mosaic: Mosaic) -> Plane<T> {
    Plane::from_fn(planes[0].size(), |x, y| planes[mosaic.colour_at(x, y).index()].at(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use crate::frame::{Frame, Work};
    use crate::rig::simulated;
    use std::path::Path;

    const RANGE: CountRange = CountRange { black: 64.0, max: 1023 };

    /// The rig with colour filters, before a grey wall of `level`.
    fn before_a_wall(level: f32) -> Devices {
        let rig = config::load(Path::new("truthful.toml")).unwrap();
        let (devices, witness) = simulated::open(&rig).unwrap();
        let wall: Frame<Work> = Frame::from_fn(|_| Plane::filled(rig.photo_grid().sensor, level));
        witness.put_before_lens(Some(&wall));
        devices
    }

    #[test]
    fn averaging_reduces_noise() {
        let mut devices = before_a_wall(128.0);
        let mosaic = Some(Mosaic::Rggb);
        let mut shots = |frames| shoot(&mut devices, mosaic, RANGE, frames).unwrap();
        let noise = |a: &PhotoShot, b: &PhotoShot| {
            let step = f64::from(1 << a.finer);
            let (a, b) = (sites_of(a.counts.planes(), Mosaic::Rggb), &b.counts);
            let b = sites_of(b.planes(), Mosaic::Rggb);
            let squares =
                a.data().iter().zip(b.data()).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
            (squares.sum::<f64>() / a.data().len() as f64).sqrt() / step
        };
        let (one, other) = (shots(1), shots(1));
        let (four, more) = (shots(8), shots(8));
        let ratio = noise(&four, &more) / noise(&one, &other);
        // The noise falls by a factor of √8, since the mean is not rounded to whole counts.
        assert!((0.345..0.365).contains(&ratio), "{ratio}");
        assert_eq!((one.finer, four.finer, four.noise_share), (0, 6, 0.125));
        assert!(one.clipped_share < 0.01, "{}", one.clipped_share);
    }

    #[test]
    fn noise_is_known_at_another_gain() {
        let rig = config::load(Path::new("truthful.toml")).unwrap();
        let (mut devices, witness) = simulated::open(&rig).unwrap();
        let wall: Frame<Work> = Frame::from_fn(|_| Plane::filled(rig.photo_grid().sensor, 40.0));
        witness.put_before_lens(Some(&wall));
        let mosaic = Some(Mosaic::Rggb);
        let mut seen = |times: f64| {
            assert_eq!(devices.camera.amplify_times(times).unwrap(), Some(times));
            let mut shot = || shoot(&mut devices, mosaic, RANGE, 1).unwrap();
            let (one, other) = (shot(), shot());
            let sites = |shot: &PhotoShot| sites_of(shot.counts.planes(), Mosaic::Rggb);
            let (a, b) = (sites(&one), sites(&other));
            let all = a.data().len() as f64;
            let off = a.data().iter().zip(b.data()).map(|(&a, &b)| f64::from(a) - f64::from(b));
            let light = a.data().iter().map(|&a| f64::from(a) - RANGE.black).sum::<f64>() / all;
            (light, off.map(|off| off * off).sum::<f64>() / all / 2.0)
        };
        let own = witness.site_noise();
        let (light, _) = seen(1.0);
        for times in [4.0, 0.5] {
            let (lighter, noise) = seen(times);
            let there = own.amplified(times);
            let stated = there.at_black[1] + there.per_count[1] * lighter;
            // The rig's camera is nonlinear by some per cent.
            assert!((lighter / light / times - 1.0).abs() < 0.05, "{light}, then {lighter}");
            assert!((stated / noise - 1.0).abs() < 0.05, "{times}: {stated}, not {noise}");
        }
    }

    #[test]
    fn a_dark_frame_removes_hot_sites() {
        let rig = config::load(Path::new("truthful.toml")).unwrap();
        let (mut devices, witness) = simulated::open(&rig).unwrap();
        let mosaic = Some(Mosaic::Rggb);
        let mut before = |level: f32| {
            let wall: Frame<Work> =
                Frame::from_fn(|_| Plane::filled(rig.photo_grid().sensor, level));
            witness.put_before_lens(Some(&wall));
            shoot(&mut devices, mosaic, RANGE, 16).unwrap()
        };
        let (dark, wall) = (before(0.0), before(60.0));
        assert!(dark.is_dark(mosaic, RANGE) && !wall.is_dark(mosaic, RANGE));
        // The rig's hot sites: some twenty grey levels over their neighbours.
        let sites = |shot: &PhotoShot| sites_of(shot.counts.planes(), Mosaic::Rggb);
        let hot: Vec<usize> =
            (0..).zip(sites(&dark).data()).filter(|(_, c)| **c > 90 << 6).map(|(n, _)| n).collect();
        assert!(hot.len() > 3, "{hot:?}");
        let excess = |shot: &PhotoShot| {
            let all = sites(shot);
            // The site two columns to the left has the same colour.
            let over = |&n: &usize| f64::from(all.data()[n]) - f64::from(all.data()[n - 2]);
            let step = f64::from(1 << shot.finer);
            hot.iter().filter(|&&n| n > 1).map(over).sum::<f64>() / hot.len() as f64 / step
        };
        let with = excess(&wall);
        let without = excess(&wall.without_dark(&dark, RANGE));
        assert!(with > 30.0 && without.abs() < 0.2 * with, "{with:.1} counts, then {without:.1}");
    }

    #[test]
    fn a_metered_exposure_is_bright_and_clips_almost_nothing() {
        let mosaic = Some(Mosaic::Rggb);
        for level in [20.0, 128.0, 255.0] {
            let mut devices = before_a_wall(level);
            let times = meter(&mut devices, mosaic, RANGE, (0.05, 20.0)).unwrap().unwrap();
            let shot = shoot(&mut devices, mosaic, RANGE, 1).unwrap();
            assert!(shot.clipped_share <= CLIPPED_SHARE_MAX, "{level}: {}", shot.clipped_share);
            let more = proposal(&shot, mosaic, RANGE);
            assert!((0.9..1.15).contains(&more), "{level}, {times:.2} times: {more}");
        }
        // A scene that is far too bright.
        let mut devices = before_a_wall(255.0);
        let times = meter(&mut devices, mosaic, RANGE, (0.05, 20.0)).unwrap().unwrap();
        devices.expose_times(16.0).unwrap();
        let bright = shoot(&mut devices, mosaic, RANGE, 1).unwrap();
        assert!(bright.clipped_share > 0.1 && proposal(&bright, mosaic, RANGE) < 0.2);
        assert!(times < 2.0, "{times}");
    }
}
