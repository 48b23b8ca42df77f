//! The laboratory: what is measured on simulated rigs alone, as tables, drawings and pictures.
//!
//! `cargo run --release --example lab -- WHAT --rig RIG.toml --out DIR`; see [`Experiment`].

mod change;
mod colour;
mod colour_crops;
mod colour_pairs;
mod conditions;
mod figures;
mod harness;
mod jpeg;
mod jpeg_files;
mod judging;
mod ladder;
mod likeness;
mod lines;
mod made;
mod mjpeg;
mod peers;
mod regimes;
mod sized;
mod sizes;
mod stability;
mod truths;
mod varied;
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

/// Why there is no result.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The laboratory: what is measured on simulated rigs alone.
#[derive(clap::Parser)]
struct Words {
    /// What is measured
    #[arg(value_enum)]
    what: Experiment,
    /// Rig file of a simulated rig
    #[arg(long, required_unless_present = "group")]
    rig: Option<PathBuf>,
    /// Which scenes and rigs, for `judging`
    #[arg(long, value_enum)]
    group: Option<judging::groups::Group>,
    /// Folder of what is made
    #[arg(long)]
    out: PathBuf,
    /// Fewer methods, scenes or strengths
    #[arg(long)]
    quick: bool,
    /// Rows of other programs, for `peers`; the results of an earlier sweep, for `stability`, which
    /// makes its tables of them and measures nothing
    #[arg(long, required_if_eq("what", "peers"))]
    rows: Option<PathBuf>,
    /// Folder of more photographs, for `colour`, `jpeg` and `mjpeg`
    #[arg(long)]
    pictures: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Experiment {
    /// The methods side by side, also without noise, with glare and with a poor lens model
    Conditions,
    /// Whether colours hold together: charts in inks, and photographs
    Colour,
    /// Twelve places by the rig's own method: the scene, the photo, the result
    ColourCrops,
    /// Colours in other sizes, noise, lenses, glare, and with a poor lens model: along the axes
    /// beside brightness and colour differences
    ColourPairs,
    /// What coding photos as JPEGs costs, taken as decoded and as what the files state
    Jpeg,
    /// The same of another coder's files, and of pictures that were coded before
    JpegFiles,
    /// What a camera costs that codes its frames as JPEG
    Mjpeg,
    /// Every method under every fault: where it harms, and whether the box notices
    Stability,
    /// What the box can know of results, good and bad, of a group of rigs and scenes
    Judging,
    /// Where captures gain over the measured lens alone
    Regimes,
    /// Speed against accuracy where the measured lens is wrong
    WrongModels,
    /// What captures are worth to the rig's own method, where the measured lens is right and wrong
    Worth,
    /// What other sizes of the rig's models would gain
    Sizes,
    /// The stages that a varied set of scenes takes
    Ladder,
    /// The paper's figures 7 to 12; for linear photos
    Figures,
    /// Photos and scenes for tests/benches/outside.py to restore; for linear photos
    Captures,
    /// Speed against accuracy with the rows that it prints; for linear photos
    Peers,
}

fn main() -> ExitCode {
    log::set_logger(&Told).map(|()| log::set_max_level(log::LevelFilter::Info)).ok();
    match run(&<Words as clap::Parser>::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            say(&relens::remedy::full_message(&*failure));
            ExitCode::FAILURE
        }
    }
}

fn run(words: &Words) -> Result<(), Failure> {
    use Experiment::{
        Captures, Colour, ColourCrops, ColourPairs, Conditions, Figures, Jpeg, JpegFiles, Judging,
        Ladder, Mjpeg, Peers, Regimes, Sizes, Stability, Worth, WrongModels,
    };
    let Words { what, out, quick, rows, pictures, .. } = words;
    if let Some(group) = words.group {
        std::fs::create_dir_all(out)?;
        return judging::run(group, *quick)?.write(out);
    }
    let rig = relens::config::load(words.rig.as_deref().unwrap_or(Path::new("")))?;
    if rig.simulation().is_none() {
        return Err(format!("found the rig {}, allowed simulated rigs", rig.name).into());
    }
    let linear = matches!(what, Figures | Captures | Peers);
    if linear && rig.photo.curve != Curve::Linear {
        let found = &rig.name;
        return Err(format!("found the rig {found}, allowed rigs with linear photos").into());
    }
    let reading = |path: &PathBuf| {
        let unreadable = |e| format!("cannot read {}: {e}", path.display());
        std::fs::read_to_string(path).map_err(unreadable)
    };
    let rows = rows.as_ref().map(reading).transpose()?.unwrap_or_default();
    std::fs::create_dir_all(out)?;
    let made = match what {
        Conditions => conditions::run(&rig, *quick),
        Colour => colour::run(&rig, *quick, pictures.as_deref()),
        ColourCrops => colour_crops::run(&rig),
        ColourPairs => colour_pairs::run(&rig, *quick),
        Jpeg => jpeg::run(&rig, *quick, pictures.as_deref()),
        JpegFiles => jpeg_files::run(&rig, *quick),
        Mjpeg => mjpeg::run(&rig, *quick, pictures.as_deref()),
        Stability if !rows.is_empty() => Ok(stability::redrawn(&rig, &rows)),
        Stability => stability::run(&rig, *quick, out),
        Regimes => regimes::run(&rig),
        WrongModels => wrong_models::run(&rig, *quick),
        Worth => worth::run(&rig, *quick),
        Sizes => sizes::run(&rig),
        Ladder => ladder::run(&rig),
        Figures => figures::run(&rig, out),
        Judging => Err("judging wants a --group".into()),
        Captures => peers::captures(&rig),
        Peers => peers::trade(&rig, *quick, &rows),
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

/// Tells of a score as it comes.
fn told(score: &Score) {
    let (scene, method, captures) = (score.scene.name(), &score.method, score.restored.captures);
    let (ssim, db) = (score.ssim, score.psnr_db);
    log::info!("{scene} {method}, {captures} captures: SSIM {ssim:.4}, PSNR {db:.2} dB");
}

#[allow(clippy::print_stdout)]
fn say(words: &str) {
    println!("{words}");
}

/// What is told while it works, on standard error.
struct Told;

impl log::Log for Told {
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
