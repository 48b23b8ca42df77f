//! `relens restore`: photos in, pictures out.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use relens::config::{self, LargerPhotos, MethodName, RigFile};
use relens::daemon::{Report, Restorer, Watcher};
use relens::picture::{Format, Limits, Photo, bytes_of, result_name};
use relens::pipeline::Verdict;

use super::error::CliError;
use super::new_file::{format_of, must_be_new, write_new};
use super::opening;
use super::options::{FolderOption, RigOption};
use super::output::{note, say};
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

/// Restore photos
///
/// PHOTO is a JPEG, PNG, TIFF, WebP, BMP or GIF, or a raw photo of the rig's sensor (DNG); RESULT a
/// JPEG, PNG or TIFF by its ending. Of several photos one that cannot be restored stops no other.
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
    /// Restored picture, which must not exist yet; its ending tells the format. `-` is standard
    /// output, in the photo's format. For several photos a folder, where each keeps its name
    #[arg(short, long, value_name = "RESULT", value_hint = ValueHint::AnyPath)]
    out: PathBuf,
    /// Method, the rig file's when not given
    #[arg(short, long, value_name = "NAME", value_parser = methods())]
    method: Option<MethodName>,
    /// Report to write, which must not exist yet; for one photo
    #[arg(long, value_name = "REPORT.json", value_hint = ValueHint::FilePath)]
    report: Option<PathBuf>,
}

/// Where results go.
enum ResultPlace {
    StandardOutput,
    File(PathBuf),
    /// Each with its photo's name.
    Folder(PathBuf),
}

impl ResultPlace {
    /// The file of the result of `photo`, which must not exist yet, and its format.
    fn of(&self, photo: &Photo) -> Result<(Option<PathBuf>, Format), CliError> {
        let usual = photo.manner.format;
        let out = match self {
            ResultPlace::StandardOutput => return Ok((None, usual)),
            ResultPlace::File(out) => out.clone(),
            ResultPlace::Folder(folder) => {
                let name = if photo.name == STANDARD_INPUT { "photo" } else { &photo.name };
                folder.join(result_name(name.as_ref(), usual))
            }
        };
        must_be_new(&out)?;
        let format = format_of(&out)?;
        Ok((Some(out), format))
    }
}

/// The name of a photo that was piped in.
const STANDARD_INPUT: &str = "standard input";

/// `-`, in place of a file.
fn is_dash(path: &Path) -> bool {
    path == Path::new("-")
}

/// `relens restore`.
pub(super) fn run(options: &RestoreOptions) -> Result<(), CliError> {
    let RestoreOptions { photos, out, report, .. } = options;
    let rig = config::load(&options.rig.rig)?;
    if report.is_some() && photos.len() > 1 {
        return Err(CliError::OneReport(photos.len()));
    }
    let into_folder = photos.len() > 1 || out.is_dir();
    if into_folder && !out.is_dir() {
        return Err(CliError::NoSuchFolder(out.clone()));
    }
    let place = match () {
        () if into_folder => ResultPlace::Folder(out.clone()),
        () if is_dash(out) => ResultPlace::StandardOutput,
        () => ResultPlace::File(out.clone()),
    };
    let restorer = || {
        let (folder, method) = (&options.folder.folder, options.method);
        opening::restorer(&rig, folder, method, None, opening::devices)
    };
    // A single photo, and the name of its result, are looked at before the rig.
    if let [photo] = &photos[..] {
        if let ResultPlace::File(out) = &place {
            must_be_new(out)?;
            format_of(out)?;
        }
        let (photo, bytes) = read(photo, &rig)?;
        let to = place.of(&photo)?;
        return one(options, &rig.name, (&photo, bytes), to, &mut *restorer()?);
    }
    let mut restorer = restorer()?;
    let mut failed = 0;
    for path in photos {
        let done = read(path, &rig).and_then(|(photo, bytes)| {
            let named = |error| CliError::OfPhoto(photo.name.clone(), Box::new(error));
            let to = place.of(&photo).map_err(named)?;
            one(options, &rig.name, (&photo, bytes), to, &mut *restorer)
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

/// The photo in a file or from standard input, on the rig's grid, and the bytes of the file.
fn read(path: &Path, rig: &RigFile) -> Result<(Photo, Vec<u8>), CliError> {
    let limits = Limits::default();
    let (name, bytes) = if is_dash(path) {
        let mut bytes = Vec::new();
        // A byte more than is allowed tells that there are too many.
        std::io::stdin()
            .take(limits.bytes_max + 1)
            .read_to_end(&mut bytes)
            .map_err(CliError::StandardInput)?;
        (STANDARD_INPUT.into(), bytes)
    } else {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        (name, bytes_of(path, &limits).map_err(CliError::of)?)
    };
    let photo = Photo::from_bytes(&name, &bytes, rig.photo.curve, &limits);
    let photo = photo.and_then(|photo| photo.fit(rig.photo_grid()));
    let photo = photo.and_then(|photo| match rig.run.larger_photos {
        LargerPhotos::Shrink => Ok(photo),
        LargerPhotos::Refuse => photo.no_larger(),
    });
    let photo = photo.map_err(CliError::of)?;
    Ok((photo.with_raw_results(rig.photo.raw_results), bytes))
}

/// One photo restored, its result written, and what was done said.
fn one(
    options: &RestoreOptions,
    rig: &str,
    (photo, bytes): (&Photo, Vec<u8>),
    (out, format): (Option<PathBuf>, Format),
    restorer: &mut dyn Restorer,
) -> Result<(), CliError> {
    let mut line = PhotoProgress::default();
    line.begun(&photo.name, 1, 1);
    let outcome = restorer.restore(photo, &mut |progress| line.progress(progress));
    line.ended();
    let outcome = outcome?;
    // The file itself is returned where its result would be of the same format.
    let untouched = outcome.verdict == Verdict::Untouched;
    let is_returned = untouched && photo.file.format == Some(format);
    let bytes = match is_returned {
        true => bytes,
        false => photo.with_picture(&outcome.picture, format).map_err(CliError::of)?,
    };
    let place = out.as_deref().unwrap_or(Path::new("standard output"));
    match &out {
        Some(out) => write_new(out, &bytes)?,
        None => {
            let mut stdout = std::io::stdout().lock();
            stdout
                .write_all(&bytes)
                .and_then(|()| stdout.flush())
                .map_err(|e| CliError::writing(place, e))?;
        }
    }
    let by = match outcome.verdict {
        Verdict::Untouched if is_returned => "the photo as it is".to_owned(),
        Verdict::Untouched => format!("the photo as it is, written as {}", format.name()),
        Verdict::Sound | Verdict::Replaced => format!("restored by {}", outcome.method),
    };
    let (captures, seconds) = (outcome.captures, outcome.seconds);
    let (size, stored) = (photo.light.size(), photo.stored);
    let smaller = match !is_returned && stored.area() > size.area() {
        true => format!("comes back smaller, {size} for {stored}; "),
        false => String::new(),
    };
    let mut said =
        format!("{}: {smaller}{by}; captures: {captures}, {seconds:.1} s", place.display());
    let certificate = outcome.certificate.map(|certificate| certificate.meaning());
    let result = (!is_returned).then_some(format);
    let of_file = photo.told(result);
    let notes = certificate.iter().chain(&of_file).chain(&outcome.notes);
    for note in [&outcome.reason].into_iter().chain(notes) {
        said.push_str(&format!("\n  {note}"));
    }
    match out {
        Some(_) => say(&said),
        // Standard output is the picture's.
        None => note(&said),
    }
    if let Some(path) = &options.report {
        let report = Report::single(rig, photo, &outcome, (place, result));
        let json =
            serde_json::to_vec_pretty(&report).map_err(|e| CliError::writing(path, e.into()))?;
        write_new(path, &json)?;
    }
    Ok(())
}
