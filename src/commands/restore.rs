//! `relens restore`: photos in, pictures out.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use relens::config::{self, MethodName, RigFile};
use relens::daemon::{Report, Restorer, Watcher};
use relens::picture::{Format, Photo, ReadOptions, bytes_of, result_name};
use relens::pipeline::{Outcome, Verdict};

use super::error::CliError;
use super::new_file::{format_of, must_be_new, write_new};
use super::opening;
use super::options::{FolderOption, RigOption};
use super::output::{note, say};
use super::progress::PhotoProgress;

fn methods() -> impl TypedValueParser<Value = MethodName> {
    let named = |word: String| MethodName::ALL.into_iter().find(|method| method.name() == word);
    PossibleValuesParser::new(MethodName::ALL.map(MethodName::name))
        .try_map(move |word| named(word).ok_or("found a method that relens does not have"))
}

/// Restore photos
///
/// PHOTO is a JPEG, PNG, TIFF, WebP, BMP or GIF, or a raw photo of the rig's sensor (DNG). RESULT
/// is a JPEG, PNG or TIFF, by its ending. A photo that cannot be restored does not stop the others.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens restore --rig RIG.toml photo.jpg -o restored.jpg
  relens restore --rig RIG.toml *.jpg -o DIR
  relens restore --rig RIG.toml - -o - < photo.jpg > restored.jpg
  relens restore --rig RIG.toml photo.jpg -o restored.tif --method digital --report report.json")]
pub(super) struct RestoreOptions {
    #[command(flatten)]
    rig: RigOption,
    #[command(flatten)]
    folder: FolderOption,
    /// Photos taken through the rig's lens; `-` is standard input
    #[arg(value_name = "PHOTO", value_hint = ValueHint::FilePath, required = true)]
    photos: Vec<PathBuf>,
    /// New file for the restored picture, in the format of its ending; `-` is standard output, in
    /// the photo's format. For several photos a folder, where each result has its photo's name
    #[arg(short, long, value_name = "RESULT", value_hint = ValueHint::AnyPath)]
    out: PathBuf,
    /// Method, by default the rig file's
    #[arg(short, long, value_name = "NAME", value_parser = methods())]
    method: Option<MethodName>,
    /// New file for a report on the one photo
    #[arg(long, value_name = "REPORT.json", value_hint = ValueHint::FilePath)]
    report: Option<PathBuf>,
}

/// Checks the destination first: several photos need a folder, one a new file of a known format.
fn check_place(RestoreOptions { photos, out, .. }: &RestoreOptions) -> Result<(), CliError> {
    if out.is_dir() {
        return Ok(());
    }
    if photos.len() > 1 {
        return Err(CliError::NoSuchFolder(out.clone()));
    }
    if is_dash(out) {
        return Ok(());
    }
    must_be_new(out)?;
    format_of(out).map(|_| ())
}

struct Destination {
    /// The new file; `None` for standard output.
    file: Option<PathBuf>,
    format: Format,
}

impl Destination {
    /// The destination in `out`, a file, folder or dash, of the result of `photo`.
    fn of(out: &Path, photo: &Photo) -> Result<Destination, CliError> {
        let usual = photo.manner.format;
        let file = if out.is_dir() {
            let name = if photo.name == STANDARD_INPUT { "photo" } else { &photo.name };
            out.join(result_name(name.as_ref(), usual))
        } else if is_dash(out) {
            return Ok(Destination { file: None, format: usual });
        } else {
            out.to_owned()
        };
        must_be_new(&file)?;
        Ok(Destination { format: format_of(&file)?, file: Some(file) })
    }

    fn name(&self) -> &Path {
        self.file.as_deref().unwrap_or(Path::new("standard output"))
    }

    fn write(&self, bytes: &[u8]) -> Result<(), CliError> {
        let Some(file) = &self.file else {
            let mut stdout = std::io::stdout().lock();
            let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
            return written.map_err(|e| CliError::writing(self.name(), e));
        };
        write_new(file, bytes)
    }
}

const STANDARD_INPUT: &str = "standard input";

/// Whether `path` is `-`, in place of a file.
fn is_dash(path: &Path) -> bool {
    path == Path::new("-")
}

pub(super) fn run(options: &RestoreOptions) -> Result<(), CliError> {
    let photos = &options.photos;
    let rig = config::load(&options.rig.rig)?;
    if options.report.is_some() && photos.len() > 1 {
        return Err(CliError::OneReport(photos.len()));
    }
    check_place(options)?;
    if let Some(report) = &options.report {
        must_be_new(report)?;
    }
    let restorer = || {
        let (folder, method) = (&options.folder.folder, options.method);
        opening::restorer(&rig, folder, method, None, opening::devices)
    };
    // A single photo and the name of its result are checked before the rig is opened.
    if let [path] = &photos[..] {
        let read = read(path, &rig)?;
        let destination = Destination::of(&options.out, &read.photo)?;
        return restore(options, &rig.name, read, &destination, &mut *restorer()?);
    }
    let mut restorer = restorer()?;
    let mut failed = 0;
    for path in photos {
        let done = read(path, &rig).and_then(|read| {
            let named = |error| CliError::OfPhoto(read.photo.name.clone(), Box::new(error));
            let destination = Destination::of(&options.out, &read.photo).map_err(named)?;
            restore(options, &rig.name, read, &destination, &mut *restorer)
        });
        match done {
            Err(error) if error.exit_code() == 3 => return Err(error),
            Err(error) => {
                failed += 1;
                log::warn!("{}", relens::remedy::full_message(&error));
            }
            Ok(()) => {}
        }
    }
    match failed {
        0 => Ok(()),
        failed => Err(CliError::SomeFailed { failed, all: photos.len() }),
    }
}

/// A photo and the bytes of its file.
struct ReadPhoto {
    photo: Photo,
    bytes: Vec<u8>,
}

/// Reads a photo from a file or standard input, and fits it to the rig's grid.
fn read(path: &Path, rig: &RigFile) -> Result<ReadPhoto, CliError> {
    let reading = ReadOptions::of(rig);
    let limits = reading.limits;
    let (name, bytes) = if is_dash(path) {
        let mut bytes = Vec::new();
        // One byte over the limit shows that there are too many.
        std::io::stdin()
            .take(limits.bytes_max + 1)
            .read_to_end(&mut bytes)
            .map_err(CliError::StandardInput)?;
        (STANDARD_INPUT.into(), bytes)
    } else {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        (name, bytes_of(path, &limits)?)
    };
    Ok(ReadPhoto { photo: reading.photo_of_bytes(&name, &bytes)?, bytes })
}

/// Restores one photo, and writes the result, the summary and the report.
fn restore(
    options: &RestoreOptions,
    rig: &str,
    ReadPhoto { photo, bytes }: ReadPhoto,
    destination: &Destination,
    restorer: &mut dyn Restorer,
) -> Result<(), CliError> {
    let mut line = PhotoProgress::default();
    line.begun(&photo.name, 1, 1);
    let outcome = restorer.restore(&photo, &mut |progress| line.progress(progress));
    line.ended();
    let outcome = outcome?;
    let format = destination.format;
    // An untouched photo is returned byte by byte where the format allows.
    let is_returned = outcome.verdict == Verdict::Untouched && photo.file.format == Some(format);
    let written = (!is_returned).then_some(format);
    match written {
        None => destination.write(&bytes)?,
        Some(format) => {
            let bytes = photo.with_picture(outcome.delivered(&photo), format)?;
            destination.write(&bytes)?;
        }
    }
    let summary = summary(&photo, &outcome, destination, written);
    match &destination.file {
        Some(_) => say(&summary),
        // Standard output carries the picture.
        None => note(&summary),
    }
    if let Some(path) = &options.report {
        let report = Report::single(rig, &photo, &outcome, destination.name(), written);
        let json =
            serde_json::to_vec_pretty(&report).map_err(|e| CliError::writing(path, e.into()))?;
        write_new(path, &json)?;
    }
    Ok(())
}

/// The summary of a restored photo: a line on the result, then one for each note. `written` is the
/// result's format, `None` where the photo's own file was returned.
fn summary(
    photo: &Photo,
    outcome: &Outcome,
    destination: &Destination,
    written: Option<Format>,
) -> String {
    let by = match (outcome.verdict, written) {
        (Verdict::Untouched, None) => "the photo as it is".to_owned(),
        (Verdict::Untouched, Some(format)) => {
            format!("the photo as it is, written as {}", format.name())
        }
        (Verdict::Sound | Verdict::Replaced, _) => format!("restored by {}", outcome.method),
    };
    let (size, stored) = (photo.light.size(), photo.stored);
    let smaller = match written.is_some() && stored.area() > size.area() {
        true => format!("smaller, {size} instead of {stored}; "),
        false => String::new(),
    };
    let mut lines = format!(
        "{}: {smaller}{by}; captures: {}, {:.1} s",
        destination.name().display(),
        outcome.captures,
        outcome.seconds
    );
    let certificate = outcome.certificate.map(|certificate| certificate.meaning());
    let of_file = photo.report_notes(written);
    let notes = certificate.iter().chain(&of_file).chain(&outcome.notes);
    for note in [&outcome.reason].into_iter().chain(notes) {
        lines.push_str(&format!("\n  {note}"));
    }
    lines
}
