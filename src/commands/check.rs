//! `relens check`: what is wrong with devices, calibration and timing, and what to do.

use clap::Args;
use relens::calibration::store;
use relens::config;
use relens::diagnosis;
use relens::pipeline::Pipeline;
use relens::remedy::full_message;
use relens::restorer::operating_point;

use super::error::CliError;
use super::opening;
use super::options::{FolderOption, RigOption};
use super::output::say;

/// Look at devices, calibration, drift, latency and noise: what is wrong, what to do
///
/// On a calibrated rig it also tries whether the light's backward convolution is the adjoint of its
/// forward one (the dot test).
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

/// Opens every device, measures the rig's timing, looks for its calibration and tries its backward
/// convolution.
///
/// # Errors
/// When the operator is needed: the first device that cannot be had, or else everything else that
/// is wrong.
pub(super) fn run(options: &CheckOptions) -> Result<(), CliError> {
    let rig = &config::load(&options.rig.rig)?;
    let mut devices = opening::devices(&diagnosis::patient(rig))?;
    let row = |name: &str, found: &str| say(&format!("{name:<28}{found}"));
    let sizes = format!("{} panel, {} camera", devices.panel.size(), devices.camera.size());
    row("devices", &sizes);
    let marks = match devices.has_marks() {
        true => "found, every frame is proven",
        false => "none: frames are trusted by their time",
    };
    row("frame marks", marks);
    let timing = diagnosis::measure(&mut devices, rig).map_err(CliError::of)?;
    say(timing.to_string().trim_end());
    let mut complaints = rig.doubts();
    complaints.extend(timing.complaints());
    let kept = opening::calibration_folder(&options.folder.folder);
    match store::load(&kept, rig.identity) {
        Ok(calibration) => {
            let (generation, captures) = (calibration.generation, calibration.captures);
            row("calibration", &format!("generation {generation}, {captures} captures"));
            complaints.extend(calibration.warning());
            let pipeline = Pipeline::new(rig, &calibration).map_err(CliError::of)?;
            match pipeline.check_backward(&mut devices) {
                Ok(check) => {
                    row("backward convolution", &check.to_string());
                    complaints.extend(check.complaint());
                }
                Err(error) => complaints.push(full_message(&*error)),
            }
        }
        Err(error) => {
            complaints.push(full_message(&error));
            row("calibration", "none that can be used");
        }
    }
    match operating_point::load(&kept, rig) {
        Ok(None) => {}
        Ok(Some(chosen)) => row("operating point", &chosen.to_string()),
        Err(reason) => complaints
            .push(format!("no operating point: {}; run `relens calibrate`", full_message(&reason))),
    }
    if !complaints.is_empty() {
        return Err(CliError::Unwell(complaints));
    }
    say("all is well");
    Ok(())
}
