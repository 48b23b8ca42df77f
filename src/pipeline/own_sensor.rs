//! Test whether the rig's sensor took a photo, by the gain pattern of its sites.
//!
//! A site of gain g records the light L as g·L in every photo of that sensor, in any file format,
//! and the gains of other sensors differ (Lukáš, Fridrich and Goljan, *Digital camera
//! identification from sensor pattern noise*, IEEE TIFS 1(2), 2006). With h the coefficients of a
//! photo's luma in blocks of 8×8, and s those of the luma that the pattern adds, the measure is
//!
//! ```text
//! z = Σ_b x_b / √(Σ_b x_b²),   x_b = Σ_k h s / v,   v = mean of h² over the nearest blocks
//! ```
//!
//! It has mean 0 and variance 1 over photos of other sensors, and mean Σ s²/v / √(Σ_b x_b²) over
//! those of this one. Coefficients that a JPEG rounds to zero carry no pattern. Therefore the
//! blocks are those of a JPEG, and small coefficients are left out, in any photo.

use rayon::prelude::*;

use super::photo_data::{PhotoData, Recorded};
use super::stages::{SensorMatch, TakenBy};
use super::{Pipeline, SATURATION_SHARE};
use crate::calibration::SiteGains;
use crate::config::Curve;
use crate::deconvolution::smoothing::mean_around;
use crate::frame::block_transform::{cosines, transform};
use crate::frame::{
    BLOCK_AREA, BLOCK_PX, Channel, FULL_SCALE, Frame, Plane, Rect, Size, TO_YCC, Work,
};
use crate::picture::Tone;

/// Size of a coefficient, in codes, up to which it may be the pixels' rounding: four standard
/// deviations of 1/√12. Chosen from 0 to 1.5 on the group of rates, as the value at which JPEGs of
/// quality 60 have the expected z.
const ROUNDING: f32 = 1.2;
/// Number of the nine nearest blocks in which a coefficient must reach [`ROUNDING`] to be used.
/// Chosen from 0 to 8 on the group of rates.
const ALIVE_MIN: usize = 4;
/// Power added to v, codes². Guess: several times the rounding's.
const LEAST_POWER: f32 = 0.5;
/// Reach of the means of the light, pixels to each side. Without them a raw photo of a dark scene
/// with 16 grey levels of noise is attributed to another sensor; with them photos of the group of
/// limits lose 1 % of z.
const MEAN_PX: usize = 2;
/// Places at which a photo of part of the sensor is matched in full. Guess.
const PLACES_TRIED: usize = 4;

/// A block's coefficients.
type LumaBlock = [f32; BLOCK_AREA];

impl SensorMatch {
    /// Match of `photo`, coded by `tone`, with the gains of `sites` at `rect` of the canvas.
    fn of(photo: &Frame<Work>, tone: &Tone, sites: &SiteGains, rect: Rect) -> SensorMatch {
        let mut codes = Plane::zeros(rect.size);
        let mut pattern = Plane::zeros(rect.size);
        for (c, weight) in Channel::ALL.into_iter().zip(TO_YCC[0]) {
            let seen = tone.display(c, photo.plane(c));
            let deviations = sites.deviations(c, rect);
            let added = added_codes(photo.plane(c), tone, c, deviations);
            pattern.add_scaled(weight, &added);
            codes.add_scaled(weight, &seen);
        }
        let size = Size::new(rect.size.width / BLOCK_PX, rect.size.height / BLOCK_PX);
        SensorMatch::of_blocks(size, &blocks_of(&codes, size), &blocks_of(&pattern, size))
    }

    fn of_blocks(size: Size, photo: &[LumaBlock], pattern: &[LumaBlock]) -> SensorMatch {
        let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        let sums: Vec<[f64; 2]> = (0..size.area())
            .into_par_iter()
            .map(|n| {
                let (mut powers, mut alive) = ([0.0; BLOCK_AREA], [0; BLOCK_AREA]);
                let mut count = 0.0;
                for y in near(n / size.width, size.height) {
                    for block in &photo[y * size.width..][near(n % size.width, size.width)] {
                        count += 1.0;
                        for (k, h) in block.iter().enumerate() {
                            powers[k] += h * h;
                            alive[k] += usize::from(h.abs() >= ROUNDING);
                        }
                    }
                }
                let mut sums = [0.0; 2];
                for k in 1..BLOCK_AREA {
                    let (h, s) = (photo[n][k], pattern[n][k]);
                    if h.abs() >= ROUNDING && alive[k] >= ALIVE_MIN {
                        let power = powers[k] / count + LEAST_POWER;
                        sums[0] += f64::from(h * s / power);
                        sums[1] += f64::from(s * s / power);
                    }
                }
                sums
            })
            .collect();
        let (mut found, mut power, mut expected) = (0.0, 0.0, 0.0);
        for [x, mean] in sums {
            found += x;
            power += x * x;
            expected += mean;
        }
        let error = power.sqrt().max(f64::MIN_POSITIVE);
        SensorMatch { found: found / error, expected: expected / error }
    }
}

/// The place of a photo on the canvas.
#[derive(Debug, Clone, Copy)]
pub(super) struct FoundPhoto {
    /// Rectangle on the canvas, pixels.
    pub(super) rect: Rect,
    /// Match with the gain pattern of the rig's sensor there; `None` if that was not measured.
    pub(super) sensor: Option<SensorMatch>,
}

impl Pipeline {
    /// Whether `photo` shows the pattern of the rig's sensor.
    pub fn shows_sensor<'a>(&self, photo: impl Into<PhotoData<'a>>) -> bool {
        let sensor = self.find_on_sensor(&photo.into()).sensor;
        sensor.map(SensorMatch::taken_by) == Some(TakenBy::Own)
    }

    /// Finds the place of `photo` on the canvas. A photo smaller than the rig's lies where it shows
    /// the sensor's pattern most clearly, or in the middle if the pattern was not measured.
    pub(super) fn find_on_sensor(&self, photo: &PhotoData<'_>) -> FoundPhoto {
        let (field, size) = (self.lens.model.field(), photo.light.size());
        let (across, down) = (field.size.width - size.width, field.size.height - size.height);
        let middle = Rect { x: field.x + across / 2, y: field.y + down / 2, size };
        let Some(sites) = self.correction.sites() else {
            return FoundPhoto { rect: middle, sensor: None };
        };
        let usual;
        let tone = match photo.recorded {
            Recorded::Jpeg { tone, .. } => tone,
            _ => {
                usual = Tone::of_curve(Curve::Srgb, 8);
                &usual
            }
        };
        let places = match across + down {
            0 => vec![field],
            _ => likely_places(photo.light, tone, sites, field),
        };
        let matches = places.into_iter().map(|rect| {
            let found = SensorMatch::of(photo.light, tone, sites, rect);
            FoundPhoto { rect, sensor: Some(found) }
        });
        let z = |found: &FoundPhoto| found.sensor.map_or(0.0, |sensor| sensor.found);
        let found = matches.max_by(|a, b| z(a).total_cmp(&z(b)));
        let found = found.unwrap_or(FoundPhoto { rect: middle, sensor: None });
        log::debug!("the sensor's gain pattern in the photo: {found:.1?}");
        found
    }
}

/// The [`PLACES_TRIED`] places in `field`, on the canvas, where the details of `photo` have the
/// largest products with the gain pattern of `sites`, the likeliest first.
fn likely_places(photo: &Frame<Work>, tone: &Tone, sites: &SiteGains, field: Rect) -> Vec<Rect> {
    let size = photo.size();
    let mut codes = Plane::zeros(size);
    for (c, weight) in Channel::ALL.into_iter().zip(TO_YCC[0]) {
        codes.add_scaled(weight, &tone.display(c, photo.plane(c)));
    }
    let means = mean_around(&codes, 1);
    codes.update(&means, |code, mean| *code -= mean);
    let powers = mean_around(&codes.map(|v: f32| v * v), BLOCK_PX / 2);
    codes.update(&powers, |code, power| *code /= power + LEAST_POWER);
    // What a gain of 2 adds to the codes, times these details.
    let weighted = Channel::ALL.map(|c| {
        let weight = TO_YCC[0][c.index()];
        let mut added = added_codes(photo.plane(c), tone, c, Plane::filled(size, weight));
        added.update(&codes, |added, code| *added *= code);
        (added, sites.deviations(c, field))
    });
    let rows = 0..=field.size.height - size.height;
    let places = rows.flat_map(|y| (0..=field.size.width - size.width).map(move |x| (x, y)));
    let places: Vec<(usize, usize)> = places.collect();
    let product = |&(x, y): &(usize, usize)| -> f32 {
        let row = |n: usize| {
            let of = |(added, pattern): &(Plane, Plane)| {
                let pattern = &pattern.row(y + n)[x..];
                added.row(n).iter().zip(pattern).map(|(a, b)| a * b).sum::<f32>()
            };
            weighted.iter().map(of).sum::<f32>()
        };
        (0..size.height).map(row).sum()
    };
    let products: Vec<f32> = places.par_iter().map(product).collect();
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&a, &b| products[b].total_cmp(&products[a]));
    let rect = |&n: &usize| Rect { x: field.x + places[n].0, y: field.y + places[n].1, size };
    order.iter().take(PLACES_TRIED).map(rect).collect()
}

/// Codes, by `tone`, that gains of 1 + `deviations` add to one channel of `photo`; 0 where it is
/// saturated. Computed from means of the light, because noise does not show the pattern.
fn added_codes(photo: &Plane, tone: &Tone, channel: Channel, mut deviations: Plane) -> Plane {
    let lights = tone.lights(channel);
    let top = lights.len() - 1;
    let slope = |code: usize| {
        let (below, above) = (code.saturating_sub(1), (code + 1).min(top));
        (above - below) as f32 / (lights[above] - lights[below]).max(f32::MIN_POSITIVE)
    };
    let slopes: Vec<f32> = (0..=top).map(slope).collect();
    let full = SATURATION_SHARE * FULL_SCALE;
    let means = mean_around(photo, MEAN_PX);
    let codes = tone.display(channel, &means);
    let pixels = deviations.data_mut().iter_mut().zip(photo.data());
    for ((added, light), (mean, code)) in pixels.zip(means.data().iter().zip(codes.data())) {
        let slope = slopes[(*code as usize).min(top)];
        *added *= if *light < full { mean * slope } else { 0.0 };
    }
    deviations
}

/// The coefficients of `size` blocks of `plane`, row by row.
fn blocks_of(plane: &Plane, size: Size) -> Vec<LumaBlock> {
    let rows = cosines();
    let block = |n: usize| {
        let (left, top) = (n % size.width * BLOCK_PX, n / size.width * BLOCK_PX);
        let mut block = [0.0; BLOCK_AREA];
        for (y, row) in block.chunks_exact_mut(BLOCK_PX).enumerate() {
            row.copy_from_slice(&plane.row(top + y)[left..][..BLOCK_PX]);
        }
        transform(&mut block, &rows);
        block
    };
    (0..size.area()).into_par_iter().map(block).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config;
    use crate::deconvolution::method::digital::Digital;
    use crate::frame::Channels;
    use crate::measurement::{calibrate, to_the_end};
    use crate::picture::{Format, Limits, Manner, Photo, encode};
    use crate::pipeline::{CertifiedFocus, Confirmation, OpticalResidual, Outcome, Verdict};
    use crate::rig::simulated::open;

    const SIZE: Size = Size::new(256, 192);

    /// Squares that fade from light to dark.
    fn scene(channel: Channel) -> Plane {
        let tint = 1.0 - 0.2 * channel.index() as f32;
        Plane::from_fn(SIZE, |x, y| {
            let square = 60.0 * ((x / 16 + y / 16) % 2) as f32;
            tint * (40.0 + 0.5 * x as f32 + square)
        })
    }

    #[test]
    fn photos_show_their_own_sensor_whatever_their_file() {
        let config = config::load(Path::new("truthful.toml")).unwrap();
        let (mut devices, witness) = open(&config).unwrap();
        let calibration = calibrate(&mut devices, &config, None, &mut to_the_end).unwrap();
        let pipeline = Pipeline::new(&config, &calibration).unwrap();
        let taken_by = |photo: &PhotoData<'_>| {
            pipeline.find_on_sensor(photo).sensor.map(SensorMatch::taken_by)
        };
        let tone = Tone::of_curve(Curve::Srgb, 8);
        let codes = witness.photograph(&Frame::from_fn(scene), 3);
        // A turned photo has the sensor's sites at other places.
        for (is_turned, expected) in [(false, TakenBy::Own), (true, TakenBy::Another)] {
            let light: Frame<Work> = Frame::from_fn(|c| {
                let light = tone.plane(c, codes.plane(c));
                let turned = |x, y| light.at(SIZE.width - 1 - x, SIZE.height - 1 - y);
                if is_turned { Plane::from_fn(SIZE, turned) } else { light }
            });
            let developed = PhotoData::developed(&light, Channels::Colour);
            assert_eq!(taken_by(&developed), Some(expected));
            let manner = Manner::plain(Format::Jpeg, 8, Curve::Srgb);
            let file = encode("a.jpg", &light, &manner, false).unwrap();
            let photo = Photo::from_bytes("a.jpg", &file, Curve::Srgb, &Limits::default()).unwrap();
            assert_eq!(taken_by(&(&photo).into()), Some(expected));
            let prepared = pipeline.prepare(developed);
            let digital = Digital::default();
            let restored = pipeline.restore(&mut devices, &prepared, &digital, &mut |_, _| {});
            let outcome = restored.unwrap().outcome;
            assert_eq!(outcome.reason.contains("pattern of this camera's pixels"), is_turned);
            assert_eq!(outcome.verdict == Verdict::Untouched, is_turned);
        }
        // A photo that any sensor may have taken gets a conditional certificate, and is returned
        // unchanged if its result is not confirmed.
        let light: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
        let mut doubtful = pipeline.prepare(PhotoData::developed(&light, Channels::Colour));
        let certificate = |residual_grey_levels| OpticalResidual {
            residual_grey_levels,
            floor_grey_levels: 1.0,
            focus: CertifiedFocus::Photo,
            of_any_sensor: false,
        };
        for (found, expected) in [(0.0, TakenBy::Either), (20.0, TakenBy::Own)] {
            doubtful.sensor = Some(SensorMatch { found, expected: 1.0 });
            assert_eq!(doubtful.taken_by(), Some(expected));
            for (residual, confirmation) in [(1.0, Confirmation::Full), (4.0, Confirmation::Not)] {
                let mut outcome = Outcome::untouched(light.clone(), "");
                outcome.verdict = Verdict::Sound;
                outcome.certificate = Some(certificate(residual));
                let judged = pipeline.unless_rejected(&doubtful, outcome);
                let is_rejected = expected == TakenBy::Either && confirmation == Confirmation::Not;
                assert_eq!(judged.verdict == Verdict::Untouched, is_rejected);
                let conditional = expected == TakenBy::Either && !is_rejected;
                let wanted = if conditional { Confirmation::Unproven } else { confirmation };
                assert_eq!(judged.confirmation(), (!is_rejected).then_some(wanted));
            }
        }
        // A saturated photo cannot show the pattern.
        let white = Frame::from_fn(|_| Plane::filled(SIZE, 255.0));
        let blank = PhotoData::developed(&white, Channels::Colour);
        assert_eq!(taken_by(&blank), Some(TakenBy::Either));
    }
}
