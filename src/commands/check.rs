//! `relens check`: faults of devices, calibration and timing, and their remedies.

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

/// Check devices, timing and calibration, and advise on faults
///
/// Opens the devices, measures the panel's latency and settle time, and reads the calibration and
/// the operating point.
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
    let mut faults = rig.warnings();
    faults.extend(timing.faults());
    let kept = opening::calibration_folder(&options.folder.folder);
    match store::load(&kept, rig.identity) {
        Ok(calibration) => {
            let (generation, captures) = (calibration.generation, calibration.captures);
            row("calibration", &format!("generation {generation}, {captures} captures"));
            faults.extend(calibration.warning());
            Pipeline::new(rig, &calibration).map_err(CliError::of)?;
        }
        Err(error) => {
            row("calibration", "none that can be used");
            faults.push(full_message(&error));
        }
    }
    match operating_point::load(&kept, rig) {
        Ok(None) => {}
        Ok(Some(chosen)) => row("operating point", &chosen.to_string()),
        Err(error) => faults
            .push(format!("no operating point: {}; run `relens calibrate`", full_message(&error))),
    }
    if !faults.is_empty() {
        return Err(CliError::Faults(faults));
    }
    say("no faults found");
    Ok(())
}

fn row(name: &str, value: &str) {
    say(&format!("{name:<28}{value}"));
}
