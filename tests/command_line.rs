//! The built program: help, wrong use, exit codes.

use std::path::Path;
use std::process::{Command, Output};

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

#[test]
fn help_and_version_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    for words in [
        &["help"][..],
        &["--help"],
        &["run", "--help"],
        &["help", "restore"],
        &["version"],
        &["-V"],
    ] {
        let output = relens(words, folder.path());
        assert_eq!(output.status.code(), Some(0), "{words:?}");
        assert!(text(&output.stdout).contains("relens") && output.stderr.is_empty(), "{words:?}");
    }
    let overview = text(&relens(&["help"], folder.path()).stdout);
    for command in [
        "demo",
        "run",
        "calibrate",
        "restore",
        "photograph",
        "chart",
        "check",
        "status",
        "help",
        "version",
    ] {
        assert!(overview.contains(&format!("relens {command}")), "{command} is in the overview");
    }
    assert!(overview.lines().all(|line| line.chars().count() <= 100));
}

#[test]
fn wrong_use_ends_with_2_and_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for (words, wanted) in [
        (&[][..], "no command"),
        (&["runn"], "did you mean run?"),
        (&["run"], "needs --rig"),
        (&["run", "--rig", "no-such.toml"], "no-such.toml"),
        (
            &["restore", "--rig", "small.toml", "a.jpg", "-o", "b.webp"],
            "one ending in .jpg, .png or .tif",
        ),
        (
            &["restore", "--rig", "small.toml", "a.jpg", "-o", "b.jpg", "-m", "magic"],
            "found the method `magic`",
        ),
        (&["status"], "found no state file"),
    ] {
        let output = relens(words, folder.path());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains(wanted), "{words:?}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{words:?}: {said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "and leaves nothing behind");
}

#[test]
fn a_photo_that_cannot_be_restored_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.jpg"), b"not a photo").unwrap();
    let output = relens(&["restore", "--rig", "small.toml", "a.jpg", "-o", "b.jpg"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr)
            .contains("this is not a photo: found a text, allowed JPEG, PNG or TIFF")
    );
    assert!(!folder.path().join("b.jpg").exists());
}

#[test]
fn a_simulated_rig_photographs_a_picture_and_never_over_another_file() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/coffee.png");
    let words = ["photograph", "--rig", "small.toml", scene, "-o", "photo.png"];
    let output = relens(&words, folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let photo = std::fs::read(folder.path().join("photo.png")).unwrap();
    let limits = relens::picture::Limits::default();
    let photo = relens::picture::Photo::from_bytes(
        "photo.png",
        &photo,
        relens::config::Curve::Srgb,
        &limits,
    );
    assert_eq!(photo.unwrap().light.size(), relens::frame::Size::new(256, 192));
    let again = relens(&words, folder.path());
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("photo.png exists already"));
}
