//! Why a command did not do what was asked, and the exit code that says so.

use std::path::Path;

use relens::config::ConfigError;
use relens::daemon::DaemonError;
use relens::remedy::{AnyFailure, Remediable, Remedy, full_message};

/// What stands in the way of a command.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// Wrong use, with the right one.
    #[error("{0}")]
    Usage(String),
    /// The rig file was not taken.
    #[error(transparent)]
    RigFile(#[from] ConfigError),
    /// Some photos were not restored; they were listed.
    #[error("{failed} of {all} photos were not restored")]
    SomeFailed {
        /// Set aside or left.
        failed: usize,
        /// All that were tried.
        all: usize,
    },
    /// The drop folder.
    #[error(transparent)]
    Folder(#[from] DaemonError),
    /// A photo, a rig, a calibration: the remedy tells which.
    #[error("{words}")]
    Failure {
        /// The whole message.
        words: String,
        /// What to do.
        remedy: Remedy,
    },
}

impl CliError {
    /// 1: some photos failed. 2: wrong use or rig file. 3: the operator is needed.
    pub(super) fn exit_code(&self) -> u8 {
        let of = |remedy| match remedy {
            Remedy::SkipPhoto | Remedy::RetryLater | Remedy::ShootAgain => 1,
            Remedy::Recalibrate | Remedy::ReopenRig | Remedy::CallOperator => 3,
        };
        match self {
            CliError::Usage(_) | CliError::RigFile(_) => 2,
            CliError::SomeFailed { .. } => 1,
            CliError::Folder(error) => of(error.remedy()),
            CliError::Failure { remedy, .. } => of(*remedy),
        }
    }

    /// CliError writing to `path`.
    pub(super) fn writing(path: &Path, error: &std::io::Error) -> CliError {
        use std::io::ErrorKind::{AlreadyExists, NotFound};
        let path = path.display();
        match error.kind() {
            AlreadyExists => CliError::Usage(format!("{path} exists already, allowed a new name")),
            NotFound => CliError::Usage(format!("cannot write {path}: its folder does not exist")),
            _ => CliError::Failure {
                words: format!("cannot write {path}: {error}"),
                remedy: Remedy::RetryLater,
            },
        }
    }

    /// CliError made of any error that knows its remedy.
    pub(super) fn of(error: &dyn Remediable) -> CliError {
        // An error of ours as a plain error: the words of all its causes.
        let mut words = error.to_string();
        let mut cause = error.source();
        while let Some(inner) = cause {
            if !words.contains(&inner.to_string()) {
                words = format!("{words}: {inner}");
            }
            cause = inner.source();
        }
        CliError::Failure { words, remedy: error.remedy() }
    }
}

impl From<AnyFailure> for CliError {
    fn from(error: AnyFailure) -> Self {
        CliError::Failure { words: full_message(&*error), remedy: error.remedy() }
    }
}
