//! `relens calibrate`: measures the rig and chooses its operating point.

use std::path::Path;

use clap::Args;
use relens::calibration::{Calibration, focus_offset, store};
use relens::chart::operating_point::{choose, restorations};
use relens::chart::test_rig::TestRig;
use relens::config::{self, OperatingPoint, RigFile};
use relens::daemon::Folders;
use relens::frame::{FULL_SCALE, Frame};
use relens::remedy::AnyFailure;
use relens::restorer::{diffuser, focus, on_rig, operating_point};
use relens::rig::exposure::Devices;
use relens::rig::monotonic::Monotonic;
use relens::rig::simulated;

use super::error::CliError;
use super::options::{FolderOption, RigOption};
use super::output::{note, say};
use super::service::service_manager;
use super::{opening, progress};

/// Measure the rig and keep the calibration
///
/// Shows patterns, photographs them, fits the model of the rig, judges the fit, and keeps it in
/// DIR/calibration. A calibration that is not good enough is not kept, and the old one stays.
///
/// With --focus-offset D it measures the lens for scenes D dioptres (1/m) nearer than the panel, or
/// farther if D is negative, and adds that to the calibration: move the panel there, or turn the
/// focus ring until the panel is as unsharp as such a scene, measure, and undo the change. The
/// focus of a photo is then estimated among those measured.
///
/// With --diffuser it measures the lens's vignetting, for remove-vignetting = true in [restore]: it
/// asks for a white diffuser before the lens (opal acrylic, or two sheets of tracing paper), evenly
/// lit, and for half a turn of it between two photos.
///
/// With operating-point = "fast", "balanced" or "best" in [restore] of the rig file it then shows
/// known scenes, restores them with several settings, and keeps the chosen one in
/// DIR/calibration/operating-point.toml, by which photos are restored from then on: the fastest
/// with 90 %, 98 % or all of the highest gain.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens calibrate --rig RIG.toml --folder DIR
  relens calibrate --rig RIG.toml --folder DIR --focus-offset -0.05
  relens calibrate --rig RIG.toml --folder DIR --diffuser")]
pub(super) struct CalibrateOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Measure the lens for scenes D dioptres (1/m) nearer than the panel; farther if negative
    #[arg(long, value_name = "D", allow_hyphen_values = true, value_parser = dioptres)]
    focus_offset: Option<f32>,
    /// Remove the measurements at other focuses, and measure nothing
    #[arg(long, conflicts_with = "focus_offset")]
    forget_focuses: bool,
    /// Measure the lens's vignetting behind a diffuser, for remove-vignetting
    #[arg(long, conflicts_with_all = ["focus_offset", "forget_focuses"])]
    diffuser: bool,
}

fn dioptres(word: &str) -> Result<f32, String> {
    let offset = word.parse().map_err(|_| "not a number".to_owned())?;
    focus_offset(offset).map_err(|error| error.to_string())
}

pub(super) fn run(options: &CalibrateOptions) -> Result<(), CliError> {
    let rig = &config::load(&options.rig.rig)?;
    if let Some(warning) = rig.warning() {
        log::warn!("{warning}");
    }
    let _alone = Folders::lock(&options.folder.folder)?;
    let kept = opening::calibration_folder(&options.folder.folder);
    if options.forget_focuses {
        let forgotten = focus::forget(rig, &kept)?;
        say(&format!("removed {} from {}", counted(forgotten), kept.display()));
        return Ok(());
    }
    if options.diffuser {
        return measure_vignetting(rig, &kept);
    }
    if let Some(offset) = options.focus_offset {
        return measure_focus(rig, &kept, offset);
    }
    let mut devices = opening::devices(rig)?;
    let calibration = on_rig::measure(rig, &mut devices, &kept, progress::calibrating, None)?;
    progress::clear();
    let [red, green, blue] = calibration.operator_error;
    say(&format!(
        "kept in {}, generation {}: {} captures; operator error {red:.2}, {green:.2}, {blue:.2} \
         grey levels in red, green, blue",
        kept.display(),
        calibration.generation,
        calibration.captures,
    ));
    if rig.calibration.broad_term {
        let [red, green, blue] = calibration.scattered().map(|share| 100.0 * share);
        say(&format!(
            "the lens scatters {red:.1}, {green:.1}, {blue:.1} % of red, green, blue beyond the \
             reach of its functions"
        ));
    }
    let (by, more) = (rig.camera.binning, calibration.binning_without_loss(rig.camera.binning));
    if more > 1 {
        say(&format!(
            "the lens passes hardly anything finer than {more} of these pixels: binning = {} in \
             [camera] takes less time and memory, and costs little",
            by * more
        ));
    }
    match rig.restore.operating_point {
        Some(wanted) => choose_setting(rig, devices, calibration, &kept, wanted),
        None => Ok(()),
    }
}

/// Measures the lens at a focus `offset` from the panel's, and keeps it in `kept`.
fn measure_focus(rig: &RigFile, kept: &Path, offset: f32) -> Result<(), CliError> {
    // Before the devices are opened: is the offset valid, and is there a calibration to add it to?
    store::load(kept, rig.identity)?.check_offset(offset).map_err(AnyFailure::from)?;
    let turned = rig.refocused(offset).ok_or(CliError::PastInfinity(offset))?;
    let mut devices = opening::devices(&turned)?;
    let calibration = focus::measure(rig, &mut devices, kept, offset, progress::calibrating);
    progress::clear();
    let calibration = calibration?;
    let offsets: Vec<String> =
        calibration.focuses.iter().map(|focus| format!("{:+.3}", focus.offset)).collect();
    say(&format!(
        "kept in {}, generation {}: the lens at the panel's focus and {} dioptres from it",
        kept.display(),
        calibration.generation,
        offsets.join(", "),
    ));
    Ok(())
}

/// Measures the lens's vignetting, and keeps it in `kept`.
fn measure_vignetting(rig: &RigFile, kept: &Path) -> Result<(), CliError> {
    // Checked before asking for the diffuser.
    store::load(kept, rig.identity)?;
    let flat = if rig.simulation().is_some() {
        let (mut devices, witness) = simulated::open(rig)?;
        let even = Frame::filled(rig.photo_grid().sensor, FULL_SCALE / 2.0);
        witness.put_before_lens(Some(&even));
        diffuser::measure(rig, &mut devices, kept, &mut || {})?
    } else {
        let mut devices = opening::devices_without_panel(rig)?;
        ask("Cover the whole lens with the diffuser, and light it evenly from afar.");
        diffuser::measure(rig, &mut devices, kept, &mut || {
            ask("Turn the diffuser by half a turn; do not move light and camera.");
        })?
    };
    say(&format!(
        "kept in {}: the darkest corner has {:.0} % of the light at the brightest place",
        kept.display(),
        100.0 * flat.darkest()
    ));
    if !rig.restore.remove_vignetting {
        say("  to remove dark corners from results, set remove-vignetting = true in [restore]");
    }
    Ok(())
}

/// Asks the operator for an action, and waits for Enter or the end of input.
fn ask(what: &str) {
    note(&format!("{what} Then press Enter."));
    let _ = std::io::stdin().read_line(&mut String::new());
}

fn counted(focuses: usize) -> String {
    format!("{focuses} {}", if focuses == 1 { "focus" } else { "focuses" })
}

/// Chooses the operating point `wanted` by known scenes on the rig, and keeps it with the
/// calibration.
fn choose_setting(
    rig: &RigFile,
    devices: Devices,
    calibration: Calibration,
    kept: &Path,
    wanted: OperatingPoint,
) -> Result<(), CliError> {
    let mut test_rig = TestRig::on(rig.clone(), devices, &calibration, Monotonic::seconds)?;
    let (mut done, all) = (0, restorations(rig, wanted) as u64);
    let words = "choosing the operating point";
    progress::show(done, all, words);
    let chosen = choose(&mut test_rig, wanted, &mut |setting, score| {
        done += 1;
        log::debug!("{} {setting}: SSIM {:.4}", score.scene.name(), score.result.ssim);
        service_manager().worked();
        progress::show(done, all, &format!("{words}: {done} of {all}"));
    });
    progress::clear();
    let chosen = chosen?.ok_or(CliError::NothingScored)?;
    operating_point::save(kept, rig, &chosen)?;
    say(&format!("operating point {chosen}"));
    Ok(())
}
