//! `relens shoot`: photos by the rig's own camera.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use clap::builder::TypedValueParser;
use clap::{Args, ValueHint, value_parser};
use relens::calibration::store;
use relens::config::{self, RigFile};
use relens::frame::{Frame, Mosaic, Plane};
use relens::restorer::photo_file::{PROPOSED, SensorFacts, developed, raw_file};
use relens::rig;
use relens::rig::exposure::Devices;
use relens::rig::shoot::{CLIPPED_SHARE_MAX, CountRange, PhotoShot, meter, shoot};
use relens::rig::simulated::{self, Witness};

use super::error::CliError;
use super::new_file::{format_of, must_be_new, write_new};
use super::options::{FolderOption, RigOption};
use super::output::say;
use super::{opening, scene};

/// Take a photo with the rig's own camera
///
/// A sensor with colour filters gives a raw photo (.dng) of all its sites, any other a TIFF or PNG
/// of 16 bits. A simulated rig photographs the picture of --scene.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens shoot --rig RIG.toml --folder DIR -o DIR/inbox/photo.dng
  relens shoot --rig RIG.toml --folder DIR -o photo.dng --exposure auto --frames 4 --dark 4
  relens shoot --rig truthful.toml --scene sharp.png -o photo.dng")]
pub(super) struct ShootOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// New file for the photo, in the format of its ending
    #[arg(short, long, value_name = "PHOTO", value_hint = ValueHint::FilePath)]
    out: PathBuf,
    /// Number of exposures to average
    #[arg(long, value_name = "N", default_value = "1", value_parser = frames())]
    frames: u8,
    /// Number of exposures with the lens covered, whose mean is subtracted; for long exposures and
    /// warm sensors
    #[arg(long, value_name = "N", value_parser = frames())]
    dark: Option<u8>,
    /// Exposure as a multiple of the rig file's, or `auto` for the longest that hardly clips
    #[arg(long, value_name = "TIMES", default_value = "1", value_parser = exposure)]
    exposure: PhotoExposure,
    /// Gain as a multiple of the rig file's, for light too dim for any exposure. The noise stated
    /// in the photo is scaled from the noise at the rig file's gain
    #[arg(long, value_name = "TIMES", default_value = "1", value_parser = gain)]
    gain: f64,
    /// Sharp picture for a simulated rig to photograph
    #[arg(long, value_name = "PICTURE", value_hint = ValueHint::FilePath)]
    scene: Option<PathBuf>,
}

fn frames() -> impl TypedValueParser<Value = u8> {
    value_parser!(u8).range(1..=64)
}

#[derive(Debug, Clone, Copy)]
enum PhotoExposure {
    Auto,
    Times(f64),
}

fn exposure(word: &str) -> Result<PhotoExposure, String> {
    match word.parse() {
        _ if word == "auto" => Ok(PhotoExposure::Auto),
        Ok(times) if (0.001..=1000.0).contains(&times) => Ok(PhotoExposure::Times(times)),
        _ => Err(format!("found {word}, allowed auto, or 0.001 to 1000 times the rig file's")),
    }
}

fn gain(word: &str) -> Result<f64, String> {
    match word.parse() {
        Ok(times) if (0.01..=100.0).contains(&times) => Ok(times),
        _ => Err(format!("found {word}, allowed 0.01 to 100 times the rig file's")),
    }
}

pub(super) fn run(options: &ShootOptions) -> Result<(), CliError> {
    let file = config::load(&options.rig.rig)?;
    let rig = file.unbinned();
    let out = &options.out;
    let raw = out.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("dng"));
    let format = if raw { None } else { Some(format_of(out)?) };
    let mosaic = rig.mosaic();
    if raw && mosaic.is_none() {
        return Err(CliError::NoFilters(rig.name));
    }
    must_be_new(out)?;
    make_inbox(&options.folder.folder, out)?;
    let mut rigged = open_before_scene(&rig, options)?;
    if file.simulation().is_none() && file.camera.binning > 1 {
        // The noise of binned pixels was measured, not that of their sites.
        rigged.sensor.noise = None;
    }
    let range = rigged.sensor.range;
    let gain = set_gain(&mut rigged, options.gain)?;
    let times = set_exposure(&mut rigged.devices, mosaic, range, options.exposure)?;
    let mut shot = shoot(&mut rigged.devices, mosaic, range, options.frames)?;
    if let Some(frames) = options.dark {
        let dark = shoot_dark(&rig, &mut rigged, range, frames)?;
        shot = shot.without_dark(&dark, range);
    }
    let exposure_s = times * rig.camera.exposure_ms / 1000.0;
    let bytes = match (format, mosaic) {
        (Some(format), _) => developed(&rig, &shot, range, format)?,
        (None, Some(mosaic)) => raw_file(&rig, &shot, mosaic, &rigged.sensor, exposure_s),
        (None, None) => return Err(CliError::NoFilters(rig.name)),
    };
    write_new(out, &bytes)?;
    print_shot(options, &shot, exposure_s, gain);
    let photo = rig.photo_grid();
    say(&format!("  the rig restores {} of the sensor's {}", photo.photo.size, photo.sensor));
    Ok(())
}

fn print_shot(options: &ShootOptions, shot: &PhotoShot, exposure_s: f64, gain: f64) {
    let exposures = match options.frames {
        1 => "1 exposure".to_owned(),
        more => format!("{more} exposures"),
    };
    let gain = match gain {
        1.0 => String::new(),
        times => format!(" at {times:.2} times the gain"),
    };
    say(&format!(
        "{}: {exposures} of {exposure_s:.4} s{gain}, {:.2} % clipped",
        options.out.display(),
        100.0 * shot.clipped_share
    ));
    if shot.clipped_share > CLIPPED_SHARE_MAX {
        say("  clipped pixels are lost to the restoration: try --exposure auto");
    }
}

/// Creates the inbox of `folder` if `out` is in it, because the first photo may precede the first
/// run. Another missing folder may be a typing error.
fn make_inbox(folder: &Path, out: &Path) -> Result<(), CliError> {
    fn plain(path: &Path) -> &Path {
        path.strip_prefix(".").unwrap_or(path)
    }
    let inbox = folder.join("inbox");
    if out.parent().is_none_or(|parent| plain(parent) != plain(&inbox)) {
        return Ok(());
    }
    std::fs::create_dir_all(&inbox).map_err(|e| CliError::writing(out, e))
}

/// The devices, with the scene before the lens.
struct Rigged {
    devices: Devices,
    /// Puts scenes before the lens of a simulated rig.
    witness: Option<Witness>,
    sensor: SensorFacts,
}

fn open_before_scene(file: &RigFile, options: &ShootOptions) -> Result<Rigged, CliError> {
    match (file.simulation(), &options.scene) {
        (Some(_), Some(scene)) => {
            let scene = scene::read(file, scene)?;
            let (devices, witness) = simulated::open(file)?;
            witness.put_before_lens(Some(&scene));
            let (black, max) = (witness.black_level_counts(), file.camera.count_max());
            let (range, noise) = (CountRange { black, max }, Some(witness.site_noise()));
            let sensor = SensorFacts { range, gains: None, noise };
            Ok(Rigged { devices, witness: Some(witness), sensor })
        }
        (Some(_), None) => Err(CliError::NoScene(file.name.clone())),
        (None, Some(_)) => Err(CliError::NotSimulated(file.name.clone())),
        (None, None) => {
            // The camera's black level and noise come from the calibration.
            let kept = opening::calibration_folder(&options.folder.folder);
            let calibration = store::load(&kept, file.identity)?;
            let devices = rig::open_without_marks(file)?;
            let sensor = SensorFacts::of(file, &calibration);
            Ok(Rigged { devices, witness: None, sensor })
        }
    }
}

/// Takes exposures with the lens covered, after asking for it.
fn shoot_dark(
    file: &RigFile,
    rigged: &mut Rigged,
    range: CountRange,
    frames: u8,
) -> Result<PhotoShot, CliError> {
    match &rigged.witness {
        Some(witness) => {
            let nothing = Frame::from_fn(|_| Plane::zeros(file.photo_grid().sensor));
            witness.put_before_lens(Some(&nothing));
        }
        None => {
            say("cover the lens and press Enter");
            // At the end of input the check for darkness decides.
            let _ = std::io::stdin().lock().read_line(&mut String::new());
        }
    }
    let mosaic = file.mosaic();
    let dark = shoot(&mut rigged.devices, mosaic, range, frames)?;
    match dark.is_dark(mosaic, range) {
        true => Ok(dark),
        false => Err(CliError::NotDark(100.0 * dark.brightness(mosaic, range))),
    }
}

/// Sets the gain to `times` the rig file's; returns the factor that was set.
fn set_gain(rigged: &mut Rigged, times: f64) -> Result<f64, CliError> {
    if times == 1.0 {
        return Ok(times);
    }
    let set = rigged.devices.camera.amplify_times(times)?;
    let times = set.ok_or(CliError::FixedGain)?;
    rigged.sensor.noise = rigged.sensor.noise.map(|noise| noise.amplified(times));
    // The first frame after a change may have the old gain.
    rigged.devices.expose()?;
    Ok(times)
}

/// Sets the exposure; returns its multiple of the rig file's.
fn set_exposure(
    devices: &mut Devices,
    mosaic: Option<Mosaic>,
    range: CountRange,
    exposure: PhotoExposure,
) -> Result<f64, CliError> {
    match exposure {
        PhotoExposure::Times(1.0) => Ok(1.0),
        PhotoExposure::Times(times) => match devices.expose_times(times)? {
            true => {
                // The first frame after a change may have the old exposure.
                devices.expose()?;
                Ok(times)
            }
            false => Err(CliError::FixedExposure),
        },
        PhotoExposure::Auto => {
            meter(devices, mosaic, range, PROPOSED)?.ok_or(CliError::FixedExposure)
        }
    }
}
