//! `relens chart`: speed against accuracy of the methods on known scenes.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use relens::calibration::store;
use relens::chart::test_rig::{Score, TestRig};
use relens::chart::{Chart, ChartPlan};
use relens::config;
use relens::rig::monotonic::processor_seconds;

use super::error::CliError;
use super::options::{FolderOption, RigOption};
use super::output::say;
use super::{opening, progress};

/// Draw speed against accuracy of the methods on known scenes
///
/// Restores known scenes with the methods in several settings. The folder gets the drawing (SVG),
/// the tables (Markdown) and their numbers (CSV). On a rig of devices the scenes are shown on its
/// panel, with the calibration in --folder.
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
    /// Take one photo of each scene instead of three
    #[arg(long)]
    quick: bool,
}

pub(super) fn run(options: &ChartOptions) -> Result<(), CliError> {
    let ChartOptions { out, quick, .. } = options;
    let rig = config::load(&options.rig.rig)?;
    std::fs::create_dir_all(out).map_err(|e| CliError::writing(out, e))?;
    let clock = processor_seconds;
    let (mut test_rig, shown) = if rig.simulation().is_some() {
        (TestRig::open(rig.clone(), clock)?, None)
    } else {
        let kept = opening::calibration_folder(&options.folder.folder);
        let calibration = store::load(&kept, rig.identity)?;
        let devices = opening::devices(&rig)?;
        let test_rig = TestRig::on(rig.clone(), devices, &calibration, clock);
        let remark = "The scenes were shown on the rig's own panel.".to_owned();
        (test_rig?, Some(remark))
    };
    let plan = ChartPlan::new(&rig, *quick);
    let (mut done, all) = (0, plan.restorations() as u64);
    let trade = plan.run(&mut test_rig, &mut |method, score: &Score| {
        done += 1;
        let (scene, quality) = (score.scene.name(), score.result);
        log::info!("{scene} {method}: SSIM {:.4}, PSNR {:.2} dB", quality.ssim, quality.psnr_db);
        progress::show(done, all, &format!("restoring known scenes: {done} of {all}"));
    });
    progress::clear();
    let mut notes = vec![made_by(options)];
    notes.extend(shown);
    let chart = Chart::new(&rig, &trade?, &notes);
    let write = |name: String, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| CliError::writing(&path, e))
    };
    let (stem, by_scene) = (&chart.stem, format!("{}-by-scene", rig.name));
    for (stem, table) in [(stem, &chart.summary), (&by_scene, &chart.scores)] {
        write(format!("{stem}.md"), table.markdown())?;
        write(format!("{stem}.csv"), table.csv())?;
        say(&table.markdown());
    }
    write(format!("{stem}.svg"), chart.drawing.svg())?;
    say(&format!("written to {}", out.display()));
    Ok(())
}

/// Command, machine and day of a chart.
fn made_by(ChartOptions { rig, quick, .. }: &ChartOptions) -> String {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    // A board names its model, a PC its processor.
    let named = |key: &str| {
        let line = cpuinfo.lines().find(|line| line.split(':').next().map(str::trim) == Some(key));
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
