//! A photo taken by the rig as a file: raw sites behind colour filters, or three planes with the
//! rig's curve.

use crate::calibration::Calibration;
use crate::config::RigFile;
use crate::frame::{Channel, Frame, Mosaic, Work};
use crate::picture::{Dng, Format, Manner, PictureError, RawTags, RigSetting, encode};
use crate::pipeline::site_noise_of;
use crate::remedy::AnyFailure;
use crate::rig::RigError;
use crate::rig::exposure::Devices;
use crate::rig::shoot::{CountRange, PhotoShot, SiteNoise, meter, shoot, sites_of};

/// Range of automatic exposures, as multiples of the rig file's exposure.
pub const PROPOSED: (f64, f64) = (1.0 / 32.0, 32.0);

/// Properties of the sensor that takes a photo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFacts {
    /// Range of the sensor's counts.
    pub range: CountRange,
    /// Counts per grey level, by channel of the sensor and then by colour of the light (red, green,
    /// blue); `None` if unknown.
    pub gains: Option<[[f64; 3]; 3]>,
    /// Noise of a site in one exposure; `None` if unknown.
    pub noise: Option<SiteNoise>,
}

impl SensorFacts {
    /// Takes the properties of the sensor of `rig` from its `calibration`.
    pub fn of(rig: &RigFile, calibration: &Calibration) -> SensorFacts {
        let of_unit = calibration.counts_per_level.map(f64::from);
        let mixing = calibration.cross_channel.c;
        let gain = |to: usize, from: usize| f64::from(mixing[from][to]) * of_unit[to];
        let gains = [0, 1, 2].map(|to| [0, 1, 2].map(|from| gain(to, from)));
        let black = calibration.black_level(Channel::Green);
        SensorFacts {
            range: CountRange { black, max: rig.camera.count_max() },
            // Measured with the panel's primaries, which are near sRGB's. They do not hold for the
            // scenes of a simulated rig, whose channels each see a light of their own.
            gains: rig.simulation().is_none().then_some(gains),
            // The noise of a binned pixel is not that of its sites.
            noise: (rig.camera.binning == 1).then(|| site_noise_of(calibration)),
        }
    }
}

/// A photo in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct TakenPhoto {
    /// The file's bytes.
    pub bytes: Vec<u8>,
    /// File extension, without the dot.
    pub ending: &'static str,
    /// Share of saturated sites, 0..1.
    pub clipped_share: f64,
}

/// Takes one photo of the scene before the lens. If the camera's exposure can be set, it is metered
/// so that hardly any site is saturated.
///
/// # Errors
/// When an exposure yields no frame, or the camera rejects a setting.
pub fn take(
    devices: &mut Devices,
    rig: &RigFile,
    sensor: &SensorFacts,
) -> Result<TakenPhoto, AnyFailure> {
    let (mosaic, range) = (rig.mosaic(), sensor.range);
    let mut taken = || -> Result<_, RigError> {
        let times = meter(devices, mosaic, range, PROPOSED)?.unwrap_or(1.0);
        Ok((times, shoot(devices, mosaic, range, 1)?))
    };
    let taken = taken();
    // Even after a failure, return to the rig file's exposure. The first frame after a change may
    // still have the old one, so one is discarded.
    let back = devices.expose_times(1.0).and_then(|_| devices.expose());
    let (times, shot) = taken?;
    back?;
    let clipped_share = shot.clipped_share;
    let exposure_s = times * rig.camera.exposure_ms / 1000.0;
    Ok(match mosaic {
        Some(mosaic) => {
            let bytes = raw_file(rig, &shot, mosaic, sensor, exposure_s);
            TakenPhoto { bytes, ending: "dng", clipped_share }
        }
        None => {
            let failed = |error| Box::new(error) as AnyFailure;
            let bytes = developed(rig, &shot, range, Format::Tiff).map_err(failed)?;
            TakenPhoto { bytes, ending: "tif", clipped_share }
        }
    })
}

/// Encodes a raw photo as a DNG file, with the noise of the mean of its exposures.
pub fn raw_file(
    rig: &RigFile,
    shot: &PhotoShot,
    mosaic: Mosaic,
    sensor: &SensorFacts,
    exposure_s: f64,
) -> Vec<u8> {
    let (range, gains) = (shot.range(sensor.range), sensor.gains);
    let noise = sensor.noise.map(|noise| shot.noise_profile(&noise, sensor.range));
    let setting = RigSetting { identity: rig.identity, focus: rig.camera.focus.clone() };
    Dng {
        sites: &sites_of(shot.counts.planes(), mosaic),
        mosaic,
        black: range.black,
        white: range.max,
        camera: &rig.name,
        exposure_s: Some(exposure_s),
        crop: Some(rig.photo_on_sensor()),
        tags: RawTags { serial: rig.camera_serial(), setting: Some(&setting), gains, noise },
    }
    .bytes()
}

/// Encodes three planes of counts with the rig's transfer curve, in 16 bits, or in 8 for JPEG.
///
/// # Errors
/// When the format cannot hold the photo.
pub fn developed(
    rig: &RigFile,
    shot: &PhotoShot,
    range: CountRange,
    format: Format,
) -> Result<Vec<u8>, PictureError> {
    let range = shot.range(range);
    let bits = if format == Format::Jpeg { 8 } else { 16 };
    let manner = Manner::plain(format, bits, rig.photo.curve);
    let per_level = (f64::from(range.max) - range.black) / 255.0;
    let level = |count: u16| ((f64::from(count) - range.black) / per_level).max(0.0) as f32;
    let light: Frame<Work> = Frame::from_fn(|c| shot.counts.plane(c).map(level));
    encode("photo", &light, &manner, false)
}
