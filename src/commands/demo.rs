//! `relens demo`: photos through a bad lens, restored by the drop folder, and compared with their
//! scenes.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use relens::chart::appearance::display_luminance;
use relens::chart::scenes::Scene;
use relens::config::{self, RigFile};
use relens::daemon::{Folders, SCENES};
use relens::deconvolution::quality::{psnr, ssim};
use relens::disk::files::numbered;
use relens::picture::{Format, Limits, Manner, Photo, Tone, encode};

use super::error::CliError;
use super::opening;
use super::output::say;
use super::photograph::{self, Taken};
use super::run::empty_inbox;

const RIG: &str = "simulated.toml";

/// The scenes, in order. Photographs come first and last: the gallery begins with the newest.
const SCENES_TAKEN: [Scene; 4] = [Scene::Coffee, Scene::Chart, Scene::Rocket, Scene::Astronaut];

/// Restore photos on a simulated rig: start here
///
/// Takes photos of four scenes through the simulated rig's bad lens, drops them into an inbox,
/// restores them, and prints their likeness to the scenes before and after.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens demo
  relens demo --out /tmp/demo    then open /tmp/demo/outbox/index.html in a browser")]
pub(super) struct DemoOptions {
    /// Folder of the demo; if it exists, a number is added to its name
    #[arg(
        short,
        long,
        value_name = "DIR",
        default_value = "relens-demo",
        value_hint = ValueHint::DirPath
    )]
    out: PathBuf,
}

pub(super) fn run(options: &DemoOptions) -> Result<(), CliError> {
    let rig = config::load(Path::new(RIG))?;
    let folders = Folders::open(&free(&options.out))?;
    let root = folders.root.to_owned();
    let (inbox, outbox) = (folders.inbox.to_owned(), folders.outbox.to_owned());
    let size = rig.photo.size();
    say(&format!("1. photographing four scenes through the bad lens of {RIG} ({size})"));
    let sharp = SCENES_TAKEN.map(|scene| scene.light(size));
    let mut taken = photograph::photos(&rig, &sharp)?;
    let names = SCENES_TAKEN.each_ref().map(|&scene| photo_name(scene, rig.mosaic().is_some()));
    let scenes = root.join(SCENES);
    std::fs::create_dir_all(&scenes).map_err(|e| CliError::writing(&scenes, e))?;
    for (name, taken) in names.iter().zip(&mut taken) {
        write_photo_and_scene(&rig, name, taken, [&inbox, &scenes])?;
    }
    say("2. calibrating the rig, from captures alone");
    let mut restorer = opening::restorer(&rig, &root, None, None, opening::devices)?;
    say(&format!("3. restoring what was dropped into {}", inbox.display()));
    let summary = empty_inbox(&rig, folders, &mut *restorer, &|| false)?;
    say("\n              SSIM            PSNR in dB      captures  seconds\n              photo  \
         restored photo  restored");
    for (name, taken) in names.iter().zip(&taken) {
        let Some(report) = summary.restored.iter().find(|report| report.photo == *name) else {
            continue;
        };
        let (ssim_before, db_before) = quality(&root.join("done").join(name), &rig, taken)?;
        let (ssim, db) = quality(&outbox.join(&report.result), &rig, taken)?;
        say(&format!(
            "{name:13} {ssim_before:.3}  {ssim:.3}    {db_before:5.2}  {db:5.2}    {:5}     {:5.1}",
            report.captures, report.seconds
        ));
    }
    for photo in summary.failed.iter().chain(&summary.deferred) {
        say(&format!("not restored: {}", photo.reason));
    }
    say(&format!("\nbefore and after: open {} in a browser", outbox.join("index.html").display()));
    match summary.failed.len() + summary.deferred.len() {
        0 => Ok(()),
        failed => Err(CliError::SomeFailed { failed, all: names.len() }),
    }
}

/// Writes the photo called `name` into the first of the `folders`, and its scene into the second.
fn write_photo_and_scene(
    rig: &RigFile,
    name: &str,
    taken: &mut Taken,
    [inbox, scenes]: [&Path; 2],
) -> Result<(), CliError> {
    let format = if name.ends_with(".jpg") { Format::Jpeg } else { Format::Png };
    let is_raw = name.ends_with(".dng");
    let photo = match taken.raw_file.take().filter(|_| is_raw) {
        Some(raw) => raw,
        None => photograph::file_of(rig, &taken.codes, format, name)?,
    };
    let manner = Manner::plain(format, 8, rig.photo.curve);
    let scene = encode(name, &taken.shaded, &manner, false)?;
    let scene_name = match is_raw {
        true => Path::new(name).with_extension("png"),
        false => PathBuf::from(name),
    };
    for (path, bytes) in [(inbox.join(name), photo), (scenes.join(scene_name), scene)] {
        std::fs::write(&path, bytes).map_err(|e| CliError::writing(&path, e))?;
    }
    Ok(())
}

/// SSIM and PSNR, dB, of the picture at `path` against the scene of `taken`.
fn quality(path: &Path, rig: &RigFile, taken: &Taken) -> Result<(f64, f64), CliError> {
    let picture = Photo::read(path, rig.photo.curve, &Limits::default())?;
    let tone = Tone::of_curve(config::Curve::Srgb, 8);
    let [picture, scene] =
        [&picture.in_colour(), &taken.shaded].map(|light| display_luminance(&tone, light));
    Ok((ssim(&picture, &scene), psnr(&picture, &scene)))
}

/// The file name of a scene's photo: a DNG if the camera is `raw`, unless the scene's is a JPEG.
fn photo_name(scene: Scene, raw: bool) -> String {
    let developed = scene.file_name();
    match developed.strip_suffix(".png") {
        Some(stem) if raw => format!("{stem}.dng"),
        _ => developed.to_owned(),
    }
}

/// `wanted`, with the first free number added if it exists.
fn free(wanted: &Path) -> PathBuf {
    let names = numbered(wanted.file_name().unwrap_or(wanted.as_os_str()));
    let mut paths = names.map(|name| wanted.with_file_name(name));
    paths.find(|path| !path.exists()).unwrap_or_else(|| wanted.to_owned())
}
