//! `relens chart`: speed against accuracy of every method on known scenes.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use relens::calibration::store;
use relens::chart;
use relens::chart::test_rig::{Score, TestRig};
use relens::config;
use relens::rig::monotonic::processor_seconds;

use super::error::CliError;
use super::options::{FolderOption, RigOption};
use super::output::say;
use super::{opening, progress};

/// Draw speed against accuracy of every method on known scenes
///
/// Restores known scenes with every method and several settings of each. The folder gets the
/// drawing (SVG), the table (Markdown) and its numbers (CSV). On a rig of devices the scenes are
/// shown on its panel, with the calibration in --folder.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens chart --rig study.toml --out DIR
  relens chart --rig RIG.toml --folder BOX --out DIR --quick")]
pub(super) struct ChartOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Folder for drawing and tables, made if missing
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: PathBuf,
    /// Leave out most settings of the methods that lose
    #[arg(long)]
    quick: bool,
}

/// Runs `relens chart`.
///
/// # Errors
/// When the rig cannot be opened, or the tables cannot be written.
pub(super) fn run(options: &ChartOptions) -> Result<(), CliError> {
    let ChartOptions { out, quick, .. } = options;
    let rig = config::load(&options.rig.rig)?;
    std::fs::create_dir_all(out).map_err(|e| CliError::writing(out, e))?;
    let (mut done, all) = (0, chart::restorations(&rig, *quick) as u64);
    let mut each = |score: &Score| {
        done += 1;
        let (scene, method) = (score.scene.name(), &score.method);
        log::info!("{scene} {method}: SSIM {:.4}, PSNR {:.2} dB", score.ssim, score.psnr_db);
        progress::show(done, all, &format!("restoring known scenes: {done} of {all}"));
    };
    let clock = processor_seconds;
    let (trade, remark) = if rig.simulation().is_some() {
        (chart::trade(&rig, *quick, clock, &mut each), "")
    } else {
        let kept = opening::calibration_folder(&options.folder.folder);
        let calibration = store::load(&kept, rig.identity).map_err(CliError::of)?;
        let trade = TestRig::on(rig.clone(), opening::devices(&rig)?, &calibration, clock)
            .and_then(|mut test_rig| chart::trade_on(&mut test_rig, *quick, &mut each));
        (trade, " The scenes were shown on the rig's own panel.")
    };
    progress::clear();
    let trade = trade.map_err(CliError::of)?;
    let made = chart::chart(&rig, &trade, remark, &made_by(options));
    let write = |name: String, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| CliError::writing(&path, e))
    };
    for (stem, table) in &made.tables {
        write(format!("{stem}.md"), table.markdown())?;
        write(format!("{stem}.csv"), table.csv())?;
        say(&table.markdown());
    }
    for (stem, drawing) in &made.drawings {
        write(format!("{stem}.svg"), drawing.svg())?;
    }
    say(&format!("written to {}", out.display()));
    Ok(())
}

/// By what a chart was made: the machine, the day, the command.
fn made_by(ChartOptions { rig, quick, .. }: &ChartOptions) -> String {
    let told = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    // A board says what it is in its last line, any other what its processor is.
    let named = |key: &str| {
        let line = told.lines().find(|line| line.split(':').next().map(str::trim) == Some(key));
        line.and_then(|line| Some(line.split_once(':')?.1.trim().to_owned()))
    };
    let machine = named("Model").or_else(|| named("model name"));
    let machine = machine.unwrap_or_else(|| "an unknown processor".to_owned());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let day = jiff::Timestamp::now().strftime("%Y-%m-%d");
    let quick = if *quick { " --quick" } else { "" };
    let rig = rig.rig.file_name().unwrap_or_default().display();
    format!("`relens chart --rig {rig}{quick} --out DIR`, {machine}, {cores} cores, {day}")
}
