//! Options shared by several commands.

use std::path::PathBuf;

use clap::{Args, ValueHint};

/// The option `--rig`.
#[derive(Debug, Args)]
pub(super) struct RigOption {
    /// Rig file, or the name of a built-in one
    #[arg(short, long, value_name = "RIG.toml", value_hint = ValueHint::FilePath)]
    pub(super) rig: PathBuf,
}

/// The option `--folder`.
#[derive(Debug, Args)]
pub(super) struct FolderOption {
    /// Folder with the calibration, inbox and outbox
    #[arg(short, long, value_name = "DIR", default_value = ".", value_hint = ValueHint::DirPath)]
    pub(super) folder: PathBuf,
}
