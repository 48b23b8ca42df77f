//! Options that several commands have.

use std::path::PathBuf;

use clap::{Args, ValueHint};

/// The option `--rig`.
#[derive(Debug, Args)]
pub(super) struct RigOption {
    /// Rig file, or the name of one that comes with the program
    #[arg(short, long, value_name = "RIG.toml", value_hint = ValueHint::FilePath)]
    pub(super) rig: PathBuf,
}

/// The option `--folder`.
#[derive(Debug, Args)]
pub(super) struct FolderOption {
    /// Folder that relens works on: its calibration, inbox and outbox are in there
    #[arg(short, long, value_name = "DIR", default_value = ".", value_hint = ValueHint::DirPath)]
    pub(super) folder: PathBuf,
}
