//! `relens restore`: one photo in, one picture out.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use relens::config::{self, MethodName};
use relens::daemon::{Report, Watcher};
use relens::picture::{Limits, Photo};
use relens::pipeline::Verdict;

use super::error::CliError;
use super::new_file::{format_of, must_be_new, write_new};
use super::opening;
use super::options::{FolderOption, RigOption};
use super::output::say;
use super::progress::PhotoProgress;

/// The methods that `--method` takes.
fn methods() -> impl TypedValueParser<Value = MethodName> {
    PossibleValuesParser::new(MethodName::ALL.map(MethodName::name)).try_map(|name| {
        MethodName::ALL
            .into_iter()
            .find(|method| method.name() == name)
            .ok_or("no method of relens")
    })
}

/// Restore one photo
///
/// PHOTO and RESULT are JPEG, PNG or TIFF, each by its own ending.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens restore --rig RIG.toml photo.jpg -o restored.jpg
  relens restore --rig RIG.toml photo.jpg -o restored.tif --method digital --report report.json")]
pub(super) struct RestoreOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Photo taken through the rig's lens
    #[arg(value_name = "PHOTO", value_hint = ValueHint::FilePath)]
    photo: PathBuf,
    /// Restored picture, which must not exist yet; its ending tells the format
    #[arg(short, long, value_name = "RESULT", value_hint = ValueHint::FilePath)]
    out: PathBuf,
    /// Method, the rig file's when not given
    #[arg(short, long, value_name = "NAME", value_parser = methods())]
    method: Option<MethodName>,
    /// Report to write, which must not exist yet
    #[arg(long, value_name = "REPORT.json", value_hint = ValueHint::FilePath)]
    report: Option<PathBuf>,
}

/// `relens restore`.
pub(super) fn run(options: &RestoreOptions) -> Result<(), CliError> {
    let rig = config::load(&options.rig.rig)?;
    let out = &options.out;
    let format = format_of(out)?;
    must_be_new(out)?;
    let photo = Photo::read(&options.photo, rig.photo.curve, &Limits::default())
        .and_then(|photo| photo.fit(rig.photo.size()))
        .map_err(CliError::of)?;
    let mut restorer = opening::restorer(&rig, &options.folder.folder, options.method, None)?;
    let mut line = PhotoProgress::default();
    line.begun(&photo.name, 1, 1);
    let outcome = restorer.restore(&photo, &mut |progress| line.progress(progress));
    line.ended();
    let outcome = outcome?;
    write_new(out, &photo.with_picture(&outcome.picture, format).map_err(CliError::of)?)?;
    let by = match outcome.verdict {
        Verdict::Untouched => "the photo as it is".to_owned(),
        Verdict::Sound | Verdict::Replaced => format!("restored by {}", outcome.method),
    };
    let (captures, seconds) = (outcome.captures, outcome.seconds);
    say(&format!("{}: {by}; captures: {captures}, {seconds:.1} s", out.display()));
    let certificate = outcome.certificate.map(|certificate| certificate.meaning().to_owned());
    let notes = certificate.iter().chain(&photo.notes).chain(&outcome.notes);
    for note in [&outcome.reason].into_iter().chain(notes) {
        say(&format!("  {note}"));
    }
    if let Some(path) = &options.report {
        let report = Report::single(&rig.name, &photo, &outcome, out);
        let json =
            serde_json::to_vec_pretty(&report).map_err(|e| CliError::writing(path, e.into()))?;
        write_new(path, &json)?;
    }
    Ok(())
}
