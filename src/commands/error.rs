//! Why a command did not do what was asked, and the exit code that says so.

use std::io;
use std::path::{Path, PathBuf};

use relens::config::ConfigError;
use relens::daemon::{DaemonError, FolderError};
use relens::disk::FileError;
use relens::remedy::{AnyFailure, Remediable, Remedy, full_message};

/// What stands in the way of a command.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// The rig file was not taken.
    #[error(transparent)]
    RigFile(#[from] ConfigError),
    /// The command is for simulated rigs.
    #[error("found the rig {0}, made of devices, allowed simulated rigs")]
    NotSimulated(String),
    /// A raw photo is asked of a camera that has none.
    #[error(
        "found the rig {0}, whose sensor has no colour filters ([sensor] mosaic), allowed one that \
         has for a raw photo (.dng)"
    )]
    NoFilters(String),
    /// A simulated rig has nothing before its lens.
    #[error("found no picture for the simulated rig {0} to photograph, allowed --scene PICTURE")]
    NoScene(String),
    /// An exposure is asked of a camera that has one only.
    #[error("this camera's exposure cannot be set by program, allowed --exposure 1")]
    FixedExposure,
    /// A gain is asked of a camera that has one only.
    #[error(
        "this camera's gain cannot be set, allowed --gain 1; the rig file lets it be set by \
         hardware.camera.gain-step-db, with `gain` or `analogue_gain` among the controls"
    )]
    FixedGain,
    /// A dark frame that is not dark.
    #[error(
        "found {0:.0} % of full light for the dark frame, allowed next to none: cover the lens"
    )]
    NotDark(f64),
    /// A simulated focus ring is to be turned past its end.
    #[error(
        "found a focus offset of {0} dioptres, allowed one that the rig's focus ring reaches: it \
         ends at infinity"
    )]
    PastInfinity(f32),
    /// A file that is to be written is there already.
    #[error("{0} exists already, allowed a new name")]
    Taken(PathBuf),
    /// The same, or another mistake, of one photo of several.
    #[error("{0}: {1}")]
    OfPhoto(String, Box<CliError>),
    /// The folder of a file that is to be written is not there.
    #[error("cannot write {0}: its folder does not exist")]
    NoFolder(PathBuf),
    /// The result's name does not tell a format.
    #[error("found the result's name {0}, allowed one ending in .jpg, .png or .tif")]
    Format(PathBuf),
    /// Several photos' results go into a folder.
    #[error("found no folder {0}, allowed a folder for the results of several photos")]
    NoSuchFolder(PathBuf),
    /// A report is of one photo.
    #[error("found --report beside {0} photos, allowed one photo")]
    OneReport(usize),
    /// What was piped in cannot be read.
    #[error("cannot read standard input")]
    StandardInput(#[source] io::Error),
    /// No daemon worked on the folder yet.
    #[error("found no state file in {0}, allowed a folder that `relens run` has worked on")]
    NoState(PathBuf),
    /// No daemon works on the folder.
    #[error("found no relens at work on {0}, allowed a folder with a `relens run`")]
    NobodyThere(PathBuf),
    /// What the daemon wrote of itself cannot be read.
    #[error("{}; nothing was done; {}", full_message(.0), to_read_the_state(.0.kind()))]
    BrokenState(FileError),
    /// The disk refused a file.
    #[error("cannot write {0}")]
    Writing(PathBuf, #[source] io::Error),
    /// Some photos were not restored; they were listed.
    #[error("{failed} of {all} photos were not restored")]
    SomeFailed { failed: usize, all: usize },
    /// The drop folder.
    #[error(transparent)]
    Folder(#[from] DaemonError),
    /// The program cannot be told to stop.
    #[error("cannot listen to signals")]
    Signals(#[source] io::Error),
    /// No operating point can be chosen.
    #[error("no setting gave a picture of the scenes shown that could be scored")]
    NothingScored,
    /// What `relens check` found wrong.
    #[error("{}", .0.join("; "))]
    Unwell(Vec<String>),
    /// A photo, a rig, a calibration: the remedy tells which.
    #[error("{}", full_message(&**.0))]
    Failed(AnyFailure),
}

/// What helps where the state cannot be read for a `cause`.
fn to_read_the_state(cause: io::ErrorKind) -> &'static str {
    match cause {
        io::ErrorKind::PermissionDenied => {
            "be of the group that shares the folder (sudo usermod -aG relens YOU, then log in anew)"
        }
        io::ErrorKind::InvalidData => {
            "end `relens run` and start it again, it writes the file anew (the service: sudo \
             systemctl restart relens)"
        }
        _ => "look after the disk or the network share",
    }
}

impl CliError {
    /// 1: some photos failed. 2: wrong use or rig file. 3: the operator is needed.
    pub(super) fn exit_code(&self) -> u8 {
        let of = |remedy| match remedy {
            Remedy::SkipPhoto | Remedy::RetryLater | Remedy::ShootAgain => 1,
            Remedy::Recalibrate | Remedy::ReopenRig | Remedy::CallOperator => 3,
        };
        match self {
            CliError::RigFile(_)
            | CliError::NotSimulated(_)
            | CliError::NoFilters(_)
            | CliError::NoScene(_)
            | CliError::FixedExposure
            | CliError::FixedGain
            | CliError::NotDark(_)
            | CliError::PastInfinity(_)
            | CliError::Taken(_)
            | CliError::NoFolder(_)
            | CliError::Format(_)
            | CliError::NobodyThere(_)
            | CliError::BrokenState(_)
            | CliError::NoSuchFolder(_)
            | CliError::OneReport(_)
            | CliError::NoState(_) => 2,
            CliError::Writing(..) | CliError::StandardInput(_) | CliError::SomeFailed { .. } => 1,
            CliError::Signals(_) | CliError::NothingScored | CliError::Unwell(_) => 3,
            CliError::Folder(error) => of(error.remedy()),
            CliError::Failed(error) => of(error.remedy()),
            CliError::OfPhoto(_, error) => error.exit_code(),
        }
    }

    /// What the one who stands before a box may do about it, for its panel.
    pub(super) fn what_to_do(&self) -> &'static str {
        match self {
            CliError::Folder(error) => error.what_to_do(),
            CliError::Failed(error) => error.what_to_do(),
            _ => Remedy::CallOperator.what_to_do(),
        }
    }

    /// What kept `path` from being written.
    pub(super) fn writing(path: &Path, source: io::Error) -> CliError {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::AlreadyExists => CliError::Taken(path),
            io::ErrorKind::NotFound => CliError::NoFolder(path),
            _ => CliError::Writing(path, source),
        }
    }

    /// Any error that knows its remedy.
    pub(super) fn of(error: impl Remediable + Send + Sync + 'static) -> CliError {
        CliError::Failed(Box::new(error))
    }
}

impl From<FolderError> for CliError {
    fn from(error: FolderError) -> Self {
        CliError::Folder(error.into())
    }
}

impl From<FileError> for CliError {
    fn from(error: FileError) -> Self {
        CliError::Folder(error.into())
    }
}

impl From<AnyFailure> for CliError {
    fn from(error: AnyFailure) -> Self {
        CliError::Failed(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_that_cannot_be_read_has_the_remedy_of_its_cause() {
        use io::ErrorKind::{InvalidData, PermissionDenied};
        let said = |kind| {
            let error = FileError::at("read the state", Path::new("a"))(io::Error::from(kind));
            CliError::BrokenState(error).to_string()
        };
        let (denied, broken) = (said(PermissionDenied), said(InvalidData));
        assert!(denied.contains("usermod") && !denied.contains("restart"), "{denied}");
        assert!(broken.contains("restart") && !broken.contains("usermod"), "{broken}");
        assert!(said(io::ErrorKind::Other).ends_with("look after the disk or the network share"));
    }
}
