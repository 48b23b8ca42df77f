//! `relens photograph`: photos by a simulated rig's camera.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use relens::chart::scenes::cut;
use relens::config::{self, RigFile};
use relens::frame::{Frame, Work};
use relens::picture::{Dng, Format, Limits, Manner, Photo, RawTags, RigSetting, encode};
use relens::rig::simulated;

use super::error::CliError;
use super::new_file::{format_of, must_be_new, write_new};
use super::options::RigOption;
use super::progress;

/// Photograph a picture with a simulated rig's camera
///
/// The picture is cut to the rig's shape, and the photo developed as by a camera. For raw photos
/// see `relens shoot`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens photograph --rig simulated.toml sharp.png -o photo.jpg")]
pub(super) struct PhotographOptions {
    #[command(flatten)]
    rig: RigOption,
    /// Sharp picture to photograph
    #[arg(value_name = "SHARP", value_hint = ValueHint::FilePath)]
    scene: PathBuf,
    /// New file for the photo, in the format of its ending
    #[arg(short, long, value_name = "PHOTO", value_hint = ValueHint::FilePath)]
    out: PathBuf,
}

pub(super) fn run(options: &PhotographOptions) -> Result<(), CliError> {
    let rig = config::load(&options.rig.rig)?.unbinned();
    let format = format_of(&options.out)?;
    must_be_new(&options.out)?;
    let sharp = Photo::read(&options.scene, rig.photo.curve, &Limits::default())?;
    let taken = photos(&rig, &[cut(&sharp.in_colour(), rig.photo.size())])?;
    write_new(&options.out, &file_of(&rig, &taken[0].codes, format, &sharp.name)?)
}

pub(super) struct Taken {
    /// Codes of the developed photo.
    pub(super) codes: Frame<Work, u8>,
    /// The raw file, if the sensor has colour filters; its white is the scene's white.
    pub(super) raw_file: Option<Vec<u8>>,
    /// The scene with the photo's shading, the best possible result.
    pub(super) shaded: Frame<Work>,
}

/// Photos by the simulated `rig` of `scenes` (photo-sized linear light), each with its own noise.
pub(super) fn photos(rig: &RigFile, scenes: &[Frame<Work>]) -> Result<Vec<Taken>, CliError> {
    let Some(simulation) = rig.simulation() else {
        return Err(CliError::NotSimulated(rig.name.clone()));
    };
    let (_, witness) = simulated::open(rig)?;
    let all = scenes.len() as u64;
    let each = |(done, (scene, seed))| {
        progress::show(done, all, "photographing");
        Taken {
            codes: witness.photograph(scene, seed),
            raw_file: witness.photograph_raw(scene, seed).map(|raw| {
                let black = witness.black_level_counts();
                let (camera, sites) = (rig.name.as_str(), &raw.sites);
                let white = witness.white_count().round() as u16;
                let exposure_s = Some(rig.camera.exposure_ms / 1000.0);
                let setting =
                    RigSetting { identity: rig.identity, focus: rig.camera.focus.clone() };
                let tags = RawTags { setting: Some(&setting), ..RawTags::default() };
                let mosaic = raw.mosaic;
                Dng { sites, mosaic, black, white, camera, exposure_s, crop: None, tags }.bytes()
            }),
            shaded: witness.shaded(scene),
        }
    };
    let taken = (0..).zip(scenes.iter().zip(simulation.seed..)).map(each).collect();
    progress::clear();
    Ok(taken)
}

/// Encodes `codes`, which follow the rig's curve, as a file.
pub(super) fn file_of(
    rig: &RigFile,
    codes: &Frame<Work, u8>,
    format: Format,
    name: &str,
) -> Result<Vec<u8>, CliError> {
    let manner = Manner::plain(format, 8, rig.photo.curve);
    let light = Frame::from_fn(|channel| manner.tone.plane(channel, codes.plane(channel)));
    Ok(encode(name, &light, &manner, false)?)
}
