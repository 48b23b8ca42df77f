//! `relens check`: faults of devices, calibration and timing, and their remedies.

use std::path::Path;

use clap::Args;
use relens::calibration::{Calibration, store};
use relens::config::{self, RigFile};
use relens::diagnosis;
use relens::pipeline::{Pipeline, Setting};
use relens::remedy::full_message;
use relens::restorer::operating_point;
use relens::rig::exposure::Devices;

use super::error::CliError;
use super::opening;
use super::options::{FolderOption, RigOption};
use super::output::say;

/// Check devices, timing and calibration, and advise on faults
///
/// Opens the devices, measures the panel's latency and settle time, and reads the calibration. With
/// a method that convolves backward by light (`paper`) it also tests whether that is the adjoint of
/// the forward convolution.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens check --rig RIG.toml --folder DIR")]
pub(super) struct CheckOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
}

/// Runs `relens check`.
///
/// # Errors
/// When a device cannot be opened, or the faults found.
pub(super) fn run(options: &CheckOptions) -> Result<(), CliError> {
    let rig = &config::load(&options.rig.rig)?;
    let mut devices = opening::devices(&diagnosis::patient(rig))?;
    let sizes = format!("{} panel, {} camera", devices.panel.size(), devices.camera.size());
    row("devices", &sizes);
    row(
        "frame marks",
        match devices.has_marks() {
            true => "found: each frame is identified",
            false => "none: frames are identified by their time",
        },
    );
    let timing = diagnosis::measure(&mut devices, rig).map_err(CliError::of)?;
    say(timing.to_string().trim_end());
    let mut faults = rig.doubts();
    faults.extend(timing.faults());
    let kept = opening::calibration_folder(&options.folder.folder);
    let setting = match operating_point::load(&kept, rig) {
        Ok(None) => None,
        Ok(Some(chosen)) => {
            row("operating point", &chosen.to_string());
            Some(chosen.setting)
        }
        Err(error) => {
            faults.push(format!(
                "no operating point: {}; run `relens calibrate`",
                full_message(&error)
            ));
            None
        }
    };
    let setting = setting.unwrap_or_else(|| Setting::as_filed(rig, rig.restore.method));
    faults.extend(check_calibration(rig, &mut devices, &kept, &setting)?);
    if !faults.is_empty() {
        return Err(CliError::Faults(faults));
    }
    say("no faults found");
    Ok(())
}

/// Checks the calibration in `kept`, and what the method of `setting` does by light; returns the
/// faults.
fn check_calibration(
    rig: &RigFile,
    devices: &mut Devices,
    kept: &Path,
    setting: &Setting,
) -> Result<Vec<String>, CliError> {
    let calibration: Calibration = match store::load(kept, rig.identity) {
        Ok(calibration) => calibration,
        Err(error) => {
            row("calibration", "none that can be used");
            return Ok(vec![full_message(&error)]);
        }
    };
    let (generation, captures) = (calibration.generation, calibration.captures);
    row("calibration", &format!("generation {generation}, {captures} captures"));
    let mut faults: Vec<String> = calibration.warning().into_iter().collect();
    let pipeline = Pipeline::new(rig, &calibration).map_err(CliError::of)?;
    match pipeline.check_backward(devices, setting.method(rig).about()) {
        Ok(None) => {}
        Ok(Some(check)) => {
            row("backward convolution", &check.to_string());
            faults.extend(check.complaint());
        }
        Err(error) => faults.push(full_message(&*error)),
    }
    Ok(faults)
}

fn row(name: &str, value: &str) {
    say(&format!("{name:<28}{value}"));
}
