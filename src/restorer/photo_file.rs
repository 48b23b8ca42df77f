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

/// Range of automatic exposures, as multiples of the rig file's.
pub const PROPOSED: (f64, f64) = (1.0 / 32.0, 32.0);

/// The sensor that takes a photo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFacts {
    /// Its range of counts.
    pub range: CountRange,
    /// Counts of its channels for each grey level of red, green and blue light, where measured.
    pub gains: Option<[[f64; 3]; 3]>,
    /// The noise of one exposure, where measured.
    pub noise: Option<SiteNoise>,
}

impl SensorFacts {
    /// What the `calibration` of `rig` measured of its sensor.
    pub fn of(rig: &RigFile, calibration: &Calibration) -> SensorFacts {
        let of_unit = calibration.counts_per_level.map(f64::from);
        let mixing = calibration.cross_channel.c;
        let gain = |to: usize, from: usize| f64::from(mixing[from][to]) * of_unit[to];
        let gains = [0, 1, 2].map(|to| [0, 1, 2].map(|from| gain(to, from)));
        let black = calibration.black_level(Channel::Green);
        SensorFacts {
            range: CountRange { black, max: rig.camera.count_max() },
            // The panel's primaries are near sRGB's. A simulated rig's scenes give each channel
            // its own light.
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
    /// Its file extension.
    pub ending: &'static str,
    /// Share of saturated data, 0..1.
    pub clipped_share: f64,
}

/// Takes one photo of the scene before the lens; where the camera's exposure can be set, so that
/// hardly anything is saturated.
///
/// # Errors
/// When an exposure brings no frame, or the camera does not take its setting.
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
    // The exposure returns to the rig file's, whatever became of the photo; the first frame after a
    // change may still have the old one.
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

/// The raw photo as a DNG file, with the noise of the mean of its exposures.
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

/// Three planes of counts encoded with the rig's curve; 16 bits, 8 for JPEG.
///
/// # Errors
/// When the format cannot hold it.
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
