//! `relens demo`: photos through a bad lens, dropped, restored, and compared with what was
//! photographed.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use relens::chart::looks::display_luminance;
use relens::chart::scenes::Scene;
use relens::config;
use relens::daemon::{Folders, SCENES};
use relens::deconvolution::quality::{psnr, ssim};
use relens::picture::{Format, Limits, Manner, Photo, Tone, encode};

use super::error::CliError;
use super::output::say;
use super::run::empty_inbox;
use super::{opening, photograph};

/// The rig of the demo.
const RIG: &str = "simulated.toml";

/// What is photographed, in this order. A photograph comes first, and one last: the gallery begins
/// with the newest.
const SCENES_TAKEN: [Scene; 4] = [Scene::Coffee, Scene::Chart, Scene::Rocket, Scene::Astronaut];

/// Tell the whole story on a simulated rig: start here
///
/// Takes photos of four scenes through the simulated rig's bad lens, drops them into an inbox,
/// restores them, and prints how much nearer to the scenes they came.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens demo
  relens demo --out /tmp/demo    then open /tmp/demo/outbox/index.html in a browser")]
pub(super) struct DemoOptions {
    /// Folder of the demo, made with a number behind its name if that name is taken
    #[arg(
        short,
        long,
        value_name = "DIR",
        default_value = "relens-demo",
        value_hint = ValueHint::DirPath
    )]
    out: PathBuf,
}

/// Runs the demo.
pub(super) fn run(options: &DemoOptions) -> Result<(), CliError> {
    let rig = config::load(Path::new(RIG))?;
    let folders = Folders::open(&free(&options.out))?;
    let root = folders.root().to_owned();
    let (inbox, outbox) = (folders.inbox().to_owned(), folders.outbox().to_owned());
    say(&format!(
        "1. photographing four scenes through the bad lens of {RIG} ({})",
        rig.photo.size()
    ));
    let sharp = SCENES_TAKEN.map(|scene| scene.light(rig.photo.size()));
    let mut taken = photograph::photos(&rig, &sharp)?;
    let names = SCENES_TAKEN.each_ref().map(|&scene| photo_name(scene, rig.mosaic().is_some()));
    let scenes = root.join(SCENES);
    std::fs::create_dir_all(&scenes).map_err(|e| CliError::writing(&scenes, e))?;
    for (name, taken) in names.iter().zip(&mut taken) {
        let format = if name.ends_with(".jpg") { Format::Jpeg } else { Format::Png };
        let raw = if name.ends_with(".dng") { taken.raw_file.take() } else { None };
        let photo = match raw {
            Some(raw) => raw,
            None => photograph::file_of(&rig, &taken.codes, format, name)?,
        };
        let manner = Manner::plain(format, 8, rig.photo.curve);
        let scene = encode(name, &taken.shaded, &manner, false).map_err(CliError::of)?;
        let scene_name = if name.ends_with(".dng") {
            Path::new(name).with_extension("png")
        } else {
            PathBuf::from(name)
        };
        for (path, bytes) in [(inbox.join(name), photo), (scenes.join(scene_name), scene)] {
            std::fs::write(&path, bytes).map_err(|e| CliError::writing(&path, e))?;
        }
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
        let of = |path: PathBuf| -> Result<[f64; 2], CliError> {
            let photo =
                Photo::read(&path, rig.photo.curve, &Limits::default()).map_err(CliError::of)?;
            let tone = Tone::of_curve(config::Curve::Srgb, 8);
            let [is, ought] =
                [&photo.in_colour(), &taken.shaded].map(|light| display_luminance(&tone, light));
            Ok([ssim(&is, &ought), psnr(&is, &ought)])
        };
        let (before, after) = (of(root.join("done").join(name))?, of(outbox.join(&report.result))?);
        say(&format!(
            "{name:13} {:.3}  {:.3}    {:5.2}  {:5.2}    {:5}     {:5.1}",
            before[0], after[0], before[1], after[1], report.captures, report.seconds
        ));
    }
    for photo in summary.failed.iter().chain(&summary.left) {
        say(&format!("not restored: {}", photo.reason));
    }
    say(&format!("\nbefore and after: open {} in a browser", outbox.join("index.html").display()));
    match summary.failed.len() + summary.left.len() {
        0 => Ok(()),
        failed => Err(CliError::SomeFailed { failed, all: names.len() }),
    }
}

/// The file that a scene's photo is dropped as: raw where the camera gives sites, but for one that
/// the camera itself developed.
fn photo_name(scene: Scene, raw: bool) -> String {
    let developed = scene.file_name();
    match developed.strip_suffix(".png") {
        Some(stem) if raw => format!("{stem}.dng"),
        _ => developed.to_owned(),
    }
}

/// `wanted`, or with the first number that is free if there is something already.
fn free(wanted: &Path) -> PathBuf {
    let mut path = wanted.to_owned();
    let mut number = 2;
    while path.exists() {
        let mut name = wanted.file_name().unwrap_or(wanted.as_os_str()).to_owned();
        name.push(format!("-{number}"));
        path = wanted.with_file_name(name);
        number += 1;
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_story_and_its_gallery_begin_with_photographs() {
        let [first, .., last] = SCENES_TAKEN;
        assert!(first != Scene::Chart && last != Scene::Chart);
        assert!(Scene::ALL.iter().all(|scene| SCENES_TAKEN.contains(scene)));
    }
}
