//! The built program: help, wrong use, exit codes.

use std::path::Path;
use std::process::{Command, Output};

use relens::config::Curve;
use relens::frame::{Frame, Plane, Size};
use relens::picture::{Format, Manner, encode};

use crate::{SCENE, calibrated};

fn relens(words: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    match command.args(words).current_dir(folder).output() {
        Ok(output) => output,
        Err(error) => panic!("the program does not start: {error}"),
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const COMMANDS: [&str; 11] = [
    "demo",
    "run",
    "calibrate",
    "restore",
    "photograph",
    "shoot",
    "chart",
    "align",
    "check",
    "status",
    "press",
];

#[test]
fn help_and_version_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    for words in [&["help"][..], &["--help"], &["-h"], &["--version"], &["-V"], &["run", "-h"]] {
        let output = relens(words, folder.path());
        assert_eq!(output.status.code(), Some(0), "{words:?}");
        assert!(text(&output.stdout).contains("relens") && output.stderr.is_empty(), "{words:?}");
    }
    let overview = text(&relens(&["help"], folder.path()).stdout);
    for command in COMMANDS {
        assert!(overview.contains(&format!("\n  {command} ")), "{command} is in the overview");
        let page = text(&relens(&["help", command], folder.path()).stdout);
        assert_eq!(page, text(&relens(&[command, "--help"], folder.path()).stdout));
        assert!(page.contains(&format!("Usage: relens {command}")), "{page}");
        assert!(page.contains(&format!("\n  relens {command}")), "{page}");
        assert!(page.lines().all(|line| line.chars().count() <= 100), "{page}");
    }
    assert!(overview.lines().all(|line| line.chars().count() <= 100));
    let methods = text(&relens(&["help", "restore"], folder.path()).stdout);
    assert!(methods.contains("hybrid, block-matching"), "{methods}");
}

#[test]
fn without_a_command_it_prints_help_and_fails() {
    let folder = tempfile::tempdir().unwrap();
    let output = relens(&[], folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("Usage: relens") && output.stdout.is_empty());
}

#[test]
fn completions_and_manual_pages_are_made_for_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let output = relens(&["completions", shell], folder.path());
        let script = text(&output.stdout);
        assert!(output.status.success() && output.stderr.is_empty(), "{shell}");
        for word in COMMANDS.iter().chain(&["block-matching", "once"]) {
            assert!(script.contains(word), "{word} is completed in {shell}");
        }
    }
    assert!(text(&relens(&["man"], folder.path()).stdout).contains(".TH relens 1"));
    let output = relens(&["man", "--out", "."], folder.path());
    assert!(output.status.success() && output.stdout.is_empty(), "{}", text(&output.stderr));
    for name in COMMANDS.map(|command| format!("relens-{command}.1")) {
        let page = std::fs::read_to_string(folder.path().join(&name)).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains(".SH DESCRIPTION"), "{name}");
        assert!(page.contains(".SH EXAMPLES"), "{name}");
    }
    assert!(folder.path().join("relens.1").is_file());
}

#[test]
fn pipes_get_plain_text() {
    let folder = tempfile::tempdir().unwrap();
    let output = relens(&["calibrate", "--rig", "small.toml", "-v"], folder.path());
    assert!(output.status.success(), "{}", text(&output.stderr));
    for written in [&output.stdout, &output.stderr] {
        assert!(!written.contains(&0x1b) && !written.contains(&b'\r'), "{}", text(written));
    }
}

#[test]
fn wrong_use_ends_with_2_and_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    for (words, wanted) in [
        (&["runn"][..], "'run'"),
        (&["run"], "--rig <RIG.toml>"),
        (&["run", "--rig", "no-such.toml"], "no-such.toml"),
        (
            &["run", "--rig", "smal.toml"],
            "found no rig file smal.toml, allowed a file or a built-in one: simulated.toml",
        ),
        (&["run", "--rig", "small.toml", "--onec"], "'--once'"),
        (&["calibrate", "--rig", "small.toml", "--focus-offset", "near"], "not a number"),
        (&["calibrate", "--rig", "small.toml", "--focus-offset", "1000"], "allowed 0.001 to 10"),
        (&["shoot", "--rig", "small.toml", "-o", "a.dng", "--frames", "0"], "0 is not in 1..=64"),
        (&["shoot", "--rig", "small.toml", "-o", "a.dng", "--gain", "0"], ", allowed 0.01 to 100"),
        (
            &["restore", "--rig", "small.toml", "a.jpg", "-o", "b.webp"],
            "one ending in .jpg, .png or .tif",
        ),
        (
            &["restore", "--rig", "small.toml", "a.jpg", "-o", "b.jpg", "-m", "magic"],
            "[possible values: paper,",
        ),
        (&["status"], "found no state file"),
    ] {
        let output = relens(words, folder.path());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains(wanted), "{words:?}: {said}");
        assert!(output.stdout.is_empty(), "{words:?}: {}", text(&output.stdout));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "no files are left");
}

#[test]
fn outcomes_are_printed_once_and_available_to_programs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrated(folder);
    std::fs::create_dir(folder.join("inbox")).unwrap();
    std::fs::write(folder.join("inbox/letter.jpg"), b"Dear Sir or Madam").unwrap();
    let output = relens(&["run", "--rig", "small.toml", "--once"], folder);
    let said = text(&output.stdout) + &text(&output.stderr);
    assert_eq!(said.matches("a text").count(), 1, "{said}");
    let counts = "0 restored, 0 unchanged, 1 failed, 0 waiting";
    assert!(said.contains(counts), "{said}");
    assert!(text(&relens(&["status"], folder).stdout).contains(counts));
    let json = relens(&["status", "--json"], folder).stdout;
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!((&json["running"], &json["failed"]), (&false.into(), &1.into()), "{json}");
    assert_eq!(json["waiting"]["unfinished"], 0, "{json}");
    std::fs::remove_dir(folder.join("inbox")).unwrap();
    assert!(text(&relens(&["status"], folder).stdout).contains("its inbox is missing"));
}

#[test]
fn a_photo_that_cannot_be_restored_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.jpg"), b"not a photo").unwrap();
    let output = relens(&["restore", "--rig", "small.toml", "a.jpg", "-o", "b.jpg"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr)
            .contains("this is not a photo: found a text, allowed JPEG, PNG, TIFF, WebP")
    );
    assert!(!folder.path().join("b.jpg").exists());
}

#[test]
fn photograph_never_overwrites_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["photograph", "--rig", "small.toml", SCENE, "-o", "photo.png"];
    let output = relens(&words, folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let photo = std::fs::read(folder.path().join("photo.png")).unwrap();
    let limits = relens::picture::Limits::default();
    let photo = relens::picture::Photo::from_bytes("photo.png", &photo, Curve::Srgb, &limits);
    assert_eq!(photo.unwrap().light.size(), Size::new(256, 192));
    let again = relens(&words, folder.path());
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("photo.png exists already"));
}

/// The folder of a calibrated small rig with a photo taken by it, `photo.png`.
fn folder_with_photo() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    calibrated(folder.path());
    let words = ["photograph", "--rig", "small.toml", SCENE, "-o", "photo.png"];
    assert!(relens(&words, folder.path()).status.success());
    folder
}

#[test]
fn a_bad_photo_stops_no_other_of_several() {
    let folder = folder_with_photo();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("bad.png"), b"not a photo").unwrap();
    std::fs::copy(at("photo.png"), at("again.png")).unwrap();
    let restore = ["restore", "--rig", "small.toml", "--method", "digital"];
    let words = |more: &[&'static str]| [&restore[..], more].concat();
    let all = words(&["bad.png", "photo.png", "again.png", "-o", "results"]);
    let output = relens(&all, folder.path());
    assert_eq!(output.status.code(), Some(2), "the folder does not exist yet");
    assert!(text(&output.stderr).contains("allowed a folder for the results"));
    std::fs::create_dir(at("results")).unwrap();
    let output = relens(&all, folder.path());
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("1 of 3 photos were not restored"));
    assert!(at("results/photo.png").is_file() && at("results/again.png").is_file());
    assert!(!at("results/bad.png").exists());
    // Endings are ignored: a HEIC picture stops no other photo, and a PNG named .heic is restored.
    std::fs::write(at("phone.heic"), b"\0\0\0\x18ftypheic\0\0\0\0").unwrap();
    std::fs::copy(at("photo.png"), at("really.heic")).unwrap();
    let named = words(&["phone.heic", "really.heic", "photo.png", "-o", "results"]);
    let output = relens(&named, folder.path());
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("phone.heic: this kind of photo is not read: found an HEIC"), "{said}");
    assert!(said.contains("photo.png: results/photo.png exists already"), "{said}");
    assert!(at("results/really.heic.png").is_file(), "{said}");
    // A sharp picture is returned as the same file, or converted to the requested format.
    let size = Size::new(512, 384);
    let sharp = Frame::from_fn(|_| {
        Plane::from_fn(size, |x, y| if (x / 24 + y / 16) % 2 == 0 { 30.0 } else { 190.0 })
    });
    let manner = Manner::plain(Format::Png, 8, Curve::Srgb);
    std::fs::write(at("sharp.png"), encode("sharp", &sharp, &manner, false).unwrap()).unwrap();
    let said = text(&relens(&words(&["sharp.png", "-o", "same.png"]), folder.path()).stdout);
    assert!(said.contains("the photo as it is;") && !said.contains("smaller"), "{said}");
    assert_eq!(std::fs::read(at("same.png")).unwrap(), std::fs::read(at("sharp.png")).unwrap());
    let said = text(&relens(&words(&["sharp.png", "-o", "other.tif"]), folder.path()).stdout);
    assert!(said.contains("the photo as it is, written as TIFF;"), "{said}");
    assert!(said.contains("smaller, 256×192 instead of 512×384"), "{said}");
    // A report is a new file, too, which is checked before the photo is restored.
    let taken = words(&["photo.png", "-o", "new.png", "--report", "photo.png"]);
    let output = relens(&taken, folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("photo.png exists already") && !at("new.png").exists());
    // With -q only errors are printed.
    let output = relens(&words(&["-q", "photo.png", "-o", "quiet.png"]), folder.path());
    assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty());
    assert!(at("quiet.png").is_file());
}

#[test]
fn restore_works_with_standard_input_and_output() {
    let folder = folder_with_photo();
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    command.args(["restore", "--rig", "small.toml", "-m", "digital", "-", "-o", "-"]);
    command.stdin(std::fs::File::open(folder.path().join("photo.png")).unwrap());
    let output = command.current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(output.stdout.starts_with(b"\x89PNG"), "nothing before the picture");
    assert!(output.stdout.ends_with(b"IEND\xaeB\x60\x82"), "nothing after the picture");
    assert!(text(&output.stderr).contains("standard output: restored by digital"));
}
