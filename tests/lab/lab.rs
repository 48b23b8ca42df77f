//! The laboratory: measurements on simulated rigs, as tables, drawings and pictures.
//!
//! `cargo run --release --example lab -- WHAT --rig RIG.toml --out DIR`; see [`Experiment`].

mod appearance;
mod binned;
mod capture_sharpening;
mod change;
mod colour;
mod colour_crops;
mod conditions;
mod csv;
mod figures;
mod focus;
mod harness;
mod jpeg;
mod jpeg_coder;
mod jpeg_files;
mod judging;
mod learned;
mod likeness;
mod lines;
mod made;
mod pace;
mod regimes;
mod sized;
mod speed_accuracy;
mod stability;
mod strange;
mod truths;
mod view;
mod worth;
mod wrong_models;

#[cfg(test)]
mod stability_tests;
#[cfg(test)]
mod study_tests;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use relens::chart::test_rig::Score;
use relens::config::Curve;
use relens::rig::monotonic::processor_seconds as seconds;

/// Error that ends an experiment.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The laboratory: measurements on simulated rigs.
#[derive(clap::Parser)]
struct Options {
    /// Experiment to run
    #[arg(value_enum)]
    what: Experiment,
    /// Rig file of a simulated rig
    #[arg(long, required_unless_present = "group")]
    rig: Option<PathBuf>,
    /// Group of scenes and rigs, for `judging`, `foreign` and `strange`
    #[arg(long, value_enum)]
    group: Option<judging::groups::Group>,
    /// Folder of the results
    #[arg(long)]
    out: PathBuf,
    /// Fewer methods, scenes or strengths
    #[arg(long)]
    quick: bool,
    /// Stored rows to draw from instead of measuring, for `speed-accuracy`, `stability`,
    /// `wrong-models` and `judging`
    #[arg(long)]
    rows: Option<PathBuf>,
    /// Camera pixels per pixel of the rig, along each side, for `binned`
    #[arg(long, default_value = "2")]
    times: usize,
    /// Binning factors, for `binned`
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    binnings: Vec<usize>,
    /// Folder of more photographs, for `colour` and `jpeg`
    #[arg(long)]
    pictures: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Experiment {
    /// The methods side by side, also without noise, with glare and with a poor lens model
    Conditions,
    /// Colours of charts in inks and of photographs
    Colour,
    /// Twelve places at full size: scene, photo, and result of the rig's own method
    ColourCrops,
    /// Cost of JPEG coding, solved from decoded pixels and from coefficients
    Jpeg,
    /// Cost of JPEG coding by another coder, and of pictures coded before
    JpegFiles,
    /// Every method under every fault: harm, and whether it is noticed
    Stability,
    /// The judge's verdicts on good and bad results of a group of rigs and scenes
    Judging,
    /// Photos of other lenses: how many are changed
    Foreign,
    /// Photos with something strange in them: the gain that remains
    Strange,
    /// Scenes nearer and farther than the panel, with the lens measured at one focus and at three
    Focus,
    /// Gain of captures over the measured lens alone
    Regimes,
    /// A camera finer than its lens: photos solved on its own pixels and on binned ones
    Binned,
    /// Time and quality of the rig's own method
    Pace,
    /// A learned prior beside shrinkage and block matching, without captures
    Learned,
    /// Speed against accuracy of the program's methods and a raw developer's sharpening
    SpeedAccuracy,
    /// Gain of captures where the measured lens is wrong
    WrongModels,
    /// Gain of captures by the rig's own method, with the lens model right and wrong
    Worth,
    /// The paper's figures 7 to 12, on a rig with linear photos
    Figures,
}

fn main() -> ExitCode {
    log::set_logger(&Progress).map(|()| log::set_max_level(log::LevelFilter::Info)).ok();
    match run(&<Options as clap::Parser>::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            say(&relens::remedy::full_message(&*failure));
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<(), Failure> {
    use Experiment::{
        Binned, Colour, ColourCrops, Conditions, Figures, Focus, Foreign, Jpeg, JpegFiles, Judging,
        Learned, Pace, Regimes, SpeedAccuracy, Stability, Strange, Worth, WrongModels,
    };
    let Options { what, out, quick, rows, pictures, .. } = options;
    if let Some(group) = options.group {
        std::fs::create_dir_all(out)?;
        let made = match rows {
            _ if *what == Foreign => judging::foreign::run(group, options.rig.as_deref(), *quick)?,
            _ if *what == Strange => strange::run(group, *quick)?,
            Some(rows) => judging::walked_again(group, &std::fs::read_to_string(rows)?)?,
            None => judging::run(group, *quick)?,
        };
        made.tables.iter().for_each(|(_, table)| say(&table.markdown()));
        return made.write(out);
    }
    let rig = relens::config::load(options.rig.as_deref().unwrap_or(Path::new("")))?;
    if rig.simulation().is_none() {
        return Err(format!("found the rig {}, allowed simulated rigs", rig.name).into());
    }
    if *what == Figures && rig.photo.curve != Curve::Linear {
        let found = &rig.name;
        return Err(format!("found the rig {found}, allowed rigs with linear photos").into());
    }
    let reading = |path: &PathBuf| {
        let unreadable = |e| format!("cannot read {}: {e}", path.display());
        std::fs::read_to_string(path).map_err(unreadable)
    };
    let rows = rows.as_ref().map(reading).transpose()?;
    std::fs::create_dir_all(out)?;
    let made = match (what, rows) {
        (SpeedAccuracy, Some(rows)) => speed_accuracy::redrawn(&rig, &rows),
        (Stability, Some(rows)) => Ok(stability::redrawn(&rig, &rows)),
        (WrongModels, Some(rows)) => wrong_models::redrawn(&rig, &rows),
        (SpeedAccuracy, None) => speed_accuracy::run(&rig, out),
        (Stability, None) => stability::run(&rig, *quick, out),
        (WrongModels, None) => wrong_models::run(&rig, *quick),
        (Conditions, _) => conditions::run(&rig, *quick),
        (Colour, _) => colour::run(&rig, *quick, pictures.as_deref()),
        (ColourCrops, _) => colour_crops::run(&rig),
        (Jpeg, _) => jpeg::run(&rig, *quick, pictures.as_deref()),
        (JpegFiles, _) => jpeg_files::run(&rig, *quick),
        (Binned, _) => binned::run(&rig, *quick, options.times, &options.binnings),
        (Focus, _) => focus::run(&rig, *quick),
        (Pace, _) => pace::run(&rig, *quick),
        (Learned, _) => learned::rows::run(&rig, *quick),
        (Regimes, _) => regimes::run(&rig),
        (Worth, _) => worth::run(&rig, *quick),
        (Figures, _) => figures::run(&rig, out),
        (Judging | Foreign | Strange, _) => Err("this needs a --group".into()),
    }?;
    made.write(out)?;
    made.tables.iter().for_each(|(_, table)| say(&table.markdown()));
    say(&format!("written to {}", out.display()));
    Ok(())
}

/// A rig file that comes with the program.
#[cfg(test)]
fn rig(name: &str) -> Result<relens::config::RigFile, Failure> {
    Ok(relens::config::load(Path::new(name))?)
}

/// Logs the score of a method.
fn report(method: &str, score: &Score) {
    let (scene, captures) = (score.scene.name(), score.captures);
    let (ssim, db) = (score.result.ssim, score.result.psnr_db);
    let seconds = score.computing_seconds;
    log::info!("{scene} {method}, {captures} captures, {seconds:.2} s: SSIM {ssim:.4}, {db:.2} dB");
}

#[allow(clippy::print_stdout)]
fn say(words: &str) {
    println!("{words}");
}

/// Writes progress to standard error.
struct Progress;

impl log::Log for Progress {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.target().starts_with("lab")
    }

    #[allow(clippy::print_stderr)]
    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            eprintln!("{}", record.args());
        }
    }

    fn flush(&self) {}
}
