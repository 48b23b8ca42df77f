//! The built program: correct and wrong use, terminals, kills, stalls, files of other users, taking
//! photos.

// Shared test functions may panic as tests do.
#![allow(clippy::unwrap_used)]

mod command_line;
mod foreign;
mod other_user;
mod scene;
mod signals;
mod stalls;
mod terminal;

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

/// Path of the scene that the tests photograph.
const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/coffee.png");

/// Names and contents of the calibration files of the small rig.
fn calibration_files() -> &'static [(String, Vec<u8>)] {
    static KEPT: OnceLock<Vec<(String, Vec<u8>)>> = OnceLock::new();
    KEPT.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
        command.args(["calibrate", "--rig", "small.toml"]).current_dir(folder.path());
        assert!(command.output().unwrap().status.success());
        let files = std::fs::read_dir(folder.path().join("calibration")).unwrap().flatten();
        files
            .map(|file| {
                let name = file.file_name().to_string_lossy().into_owned();
                (name, std::fs::read(file.path()).unwrap())
            })
            .collect()
    })
}

/// Copies the calibration of the small rig into `folder`.
fn calibrated(folder: &Path) {
    std::fs::create_dir_all(folder.join("calibration")).unwrap();
    for (name, holds) in calibration_files() {
        std::fs::write(folder.join("calibration").join(name), holds).unwrap();
    }
}
