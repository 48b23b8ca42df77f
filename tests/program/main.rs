//! The built program: used rightly and wrongly, on a terminal, killed, hung, among files of others,
//! taking photos by itself.

// The functions below stop a test as the tests themselves do.
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

/// A scene before the lens.
const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/coffee.png");

/// What the program keeps of the small rig once it is calibrated: names in `calibration`, and what
/// they hold.
fn kept() -> &'static [(String, Vec<u8>)] {
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

/// Makes `folder` that of a small rig that is calibrated.
fn calibrated(folder: &Path) {
    std::fs::create_dir_all(folder.join("calibration")).unwrap();
    for (name, holds) in kept() {
        std::fs::write(folder.join("calibration").join(name), holds).unwrap();
    }
}
