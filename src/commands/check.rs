//! `relens check`: faults of devices, calibration and timing, and their remedies.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use relens::calibration::store;
use relens::config::{self, Kind, RigFile};
use relens::diagnosis;
use relens::pipeline::Pipeline;
use relens::remedy::full_message;
use relens::restorer::operating_point;

use super::board;
use super::error::CliError;
use super::new_file;
use super::opening;
use super::options::{FolderOption, RigOption};
use super::output::say;

/// Check devices, timing and calibration, and advise on faults
///
/// Opens the devices, measures the panel's latency, settle time and range, and reads the
/// calibration and the operating point.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens check --rig RIG.toml --folder DIR
  relens check --rig RIG.toml --report board.txt")]
pub(super) struct CheckOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Describe board and findings in a new file, without serial numbers
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    report: Option<PathBuf>,
}

pub(super) fn run(options: &CheckOptions) -> Result<(), CliError> {
    let rig = &config::load(&options.rig.rig)?;
    let Some(out) = &options.report else {
        return examine(options, rig, &mut CheckLines::default());
    };
    new_file::must_be_new(out)?;
    let mut findings = CheckLines(board::describe(Path::new("/")));
    let outcome = examine(options, rig, &mut findings);
    if let Err(error) = &outcome {
        findings.0.push_str(&format!("{error}\n"));
    }
    new_file::write_new(out, findings.0.as_bytes())?;
    outcome
}

/// Lines for the terminal, kept for a report.
#[derive(Default)]
struct CheckLines(String);

impl CheckLines {
    fn say(&mut self, lines: &str) {
        say(lines);
        self.0.push_str(lines);
        self.0.push('\n');
    }

    fn row(&mut self, name: &str, value: &str) {
        self.say(&format!("{name:<28}{value}"));
    }
}

/// Checks the devices and the calibration of `rig`.
fn examine(options: &CheckOptions, rig: &RigFile, found: &mut CheckLines) -> Result<(), CliError> {
    let mut faults = Vec::from_iter(rig.warning());
    if let Kind::Hardware(hardware) = &rig.kind {
        faults.extend(board::edid_fault(Path::new("/"), &hardware.panel.connector));
    }
    let mut devices = opening::devices(&diagnosis::patient(rig))?;
    let sizes = format!("{} panel, {} camera", devices.panel.size(), devices.camera.size());
    found.row("devices", &sizes);
    let marks = match devices.has_marks() {
        true => "found: each frame is identified",
        false => "none: frames are identified by their time",
    };
    found.row("frame marks", marks);
    let timing = diagnosis::measure(&mut devices, rig)?;
    found.say(timing.to_string().trim_end());
    faults.extend(timing.faults());
    let range = diagnosis::measure_range(&mut devices, rig)?;
    found.row("range", &range.to_string());
    faults.extend(range.fault());
    let rejected = devices.rejected();
    if rejected.mistimed > 0 {
        found.row("pulses of wrong length", &rejected.mistimed.to_string());
    }
    let kept = opening::calibration_folder(&options.folder.folder);
    match store::load(&kept, rig.identity) {
        Ok(calibration) => {
            let (generation, captures) = (calibration.generation, calibration.captures);
            found.row("calibration", &format!("generation {generation}, {captures} captures"));
            faults.extend(calibration.warning());
            Pipeline::new(rig, &calibration)?;
        }
        Err(error) => {
            found.row("calibration", "none that can be used");
            faults.push(full_message(&error));
        }
    }
    match operating_point::load(&kept, rig) {
        Ok(None) => {}
        Ok(Some(chosen)) => found.row("operating point", &chosen.to_string()),
        Err(reason) => {
            faults.push(format!("no operating point: {reason}; run `relens calibrate`"));
        }
    }
    if !faults.is_empty() {
        return Err(CliError::Faults(faults));
    }
    found.say("no faults found");
    Ok(())
}
