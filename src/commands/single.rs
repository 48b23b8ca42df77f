//! `relens restore` and `relens photograph`: one file in, one file out.

use std::io::{IsTerminal, Write};
use std::path::Path;

use relens::chart::scenes::cut;
use relens::config::{self, Method, Rig};
use relens::daemon::{ProgressLine, Watcher};
use relens::frame::{Channels, Frame, Work};
use relens::picture::{Format, Limits, Manner, Photo, encode};

use super::arguments::RestoreWords;
use super::{CliError, rigged, say};

/// The rig in the file `path`.
pub(super) fn rig(path: &Path) -> Result<Rig, CliError> {
    Ok(config::load(path)?)
}

/// `relens restore`.
pub(super) fn restore(words: &RestoreWords) -> Result<(), CliError> {
    let rig = rig(&words.rig)?;
    let method = words.method.as_deref().map(method).transpose()?;
    let format = format_of(&words.out)?;
    must_be_new(&words.out)?;
    let photo = Photo::read(&words.photo, rig.photo.curve, &Limits::default())
        .and_then(|photo| photo.fit(rig.photo.size()))
        .map_err(|e| CliError::of(&e))?;
    let mut restorer =
        rigged::restorer(&rig, &words.folder, method, None, &mut |words| log::info!("{words}"))?;
    let mut line = std::io::stderr().is_terminal().then(|| ProgressLine::new(std::io::stderr()));
    if let Some(line) = &mut line {
        line.begun(&photo.name, 1, 1);
    }
    let outcome = restorer.restore(&photo, &mut |progress| {
        if let Some(line) = &mut line {
            line.progress(progress);
        }
    });
    if let Some(line) = &mut line {
        line.ended();
    }
    let outcome = outcome?;
    let manner = Manner { format, ..photo.manner.clone() };
    let grey = photo.channels == Channels::Green;
    let result =
        encode(&photo.name, &outcome.picture, &manner, grey).map_err(|e| CliError::of(&e))?;
    write_new(&words.out, &result)?;
    let certificate = outcome.certificate.map_or(String::new(), |c| format!("; {}", c.meaning()));
    say(&format!(
        "{}: {} on rung {}, {} captures, {:.1} s{certificate}",
        words.out.display(),
        outcome.method,
        outcome.rung.number(),
        outcome.captures,
        outcome.seconds
    ))?;
    for note in [&outcome.reason].into_iter().chain(&photo.notes).chain(&outcome.notes) {
        say(&format!("  {note}"))?;
    }
    if let Some(path) = &words.report {
        let report = relens::daemon::Report::single(&rig.name, &photo, &outcome, &words.out);
        let json =
            serde_json::to_vec_pretty(&report).map_err(|e| CliError::writing(path, &e.into()))?;
        write_new(path, &json)?;
    }
    Ok(())
}

/// `relens photograph`.
pub(super) fn photograph(rig_path: &Path, scene: &Path, out: &Path) -> Result<(), CliError> {
    let rig = rig(rig_path)?;
    let format = format_of(out)?;
    must_be_new(out)?;
    let sharp =
        Photo::read(scene, rig.photo.curve, &Limits::default()).map_err(|e| CliError::of(&e))?;
    let taken = rigged::photograph(&rig, &[cut(&sharp.in_colour(), rig.photo.size())])?;
    let bytes = file_of(&rig, &taken[0], format, &sharp.name)?;
    write_new(out, &bytes)
}

/// The file that holds `codes`, which already have the rig's curve.
pub(super) fn file_of(
    rig: &Rig,
    codes: &Frame<Work, u8>,
    format: Format,
    name: &str,
) -> Result<Vec<u8>, CliError> {
    let manner = Manner::plain(format, 8, rig.photo.curve);
    let light = Frame::from_fn(|channel| manner.tone.plane(channel, codes.plane(channel)));
    encode(name, &light, &manner, false).map_err(|e| CliError::of(&e))
}

fn method(name: &str) -> Result<Method, CliError> {
    let value = toml::Value::String(name.to_owned());
    value.try_into().map_err(|_| {
        let allowed = "paper, residual, unmatched, hybrid, block-matching, digital, wiener or \
             richardson-lucy";
        CliError::Usage(format!("found the method `{name}`, allowed {allowed}"))
    })
}

fn format_of(out: &Path) -> Result<Format, CliError> {
    let extension = out.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    Format::of_extension(&extension).ok_or_else(|| {
        CliError::Usage(format!(
            "found the result's name {}, allowed one ending in .jpg, .png or .tif",
            out.display()
        ))
    })
}

/// Said before the long work, not after it.
fn must_be_new(out: &Path) -> Result<(), CliError> {
    match out.symlink_metadata() {
        Ok(_) => Err(CliError::writing(out, &std::io::ErrorKind::AlreadyExists.into())),
        Err(_) => Ok(()),
    }
}

/// Writes a file that must not exist yet.
fn write_new(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let file = std::fs::OpenOptions::new().write(true).create_new(true).open(path);
    file.and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .map_err(|e| CliError::writing(path, &e))
}
