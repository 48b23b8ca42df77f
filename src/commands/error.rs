//! The errors of commands, and their exit codes.

use std::io;
use std::path::{Path, PathBuf};

use relens::calibration::store::StoreError;
use relens::chart::test_rig::TestRigError;
use relens::config::ConfigError;
use relens::daemon::DaemonError;
use relens::disk::FileError;
use relens::picture::PictureError;
use relens::pipeline::PipelineError;
use relens::remedy::{AnyFailure, Remedy, full_message};
use relens::rig::RigError;

#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    #[error(transparent)]
    RigFile(#[from] ConfigError),
    #[error("the rig {0} has real devices, and this needs a simulated one")]
    NotSimulated(String),
    #[error(
        "the sensor of the rig {0} has no colour filters ([sensor] mosaic), so its photos cannot \
         be raw (.dng): name the photo .tif or .png"
    )]
    NoFilters(String),
    #[error("the simulated rig {0} needs a picture to photograph: give --scene PICTURE")]
    NoScene(String),
    #[error("this camera's exposure cannot be set by program: leave --exposure out")]
    FixedExposure,
    #[error(
        "this camera's gain cannot be set: leave --gain out, or name its control in the rig file \
         (hardware.camera.gain-step-db, with `gain` or `analogue_gain` among the controls)"
    )]
    FixedGain,
    #[error("the dark frame has {0:.0} % of full light: cover the lens, and take the photo again")]
    NotDark(f64),
    #[error(
        "found a focus offset of {0} dioptres, allowed less: the focus ring would have to turn \
         past infinity"
    )]
    PastInfinity(f32),
    #[error("{0} exists already: choose another name")]
    Taken(PathBuf),
    #[error("{0}: {1}")]
    OfPhoto(String, Box<CliError>),
    #[error("cannot write {0}: its folder does not exist")]
    NoFolder(PathBuf),
    #[error("found the result's name {0}, allowed one ending in .jpg, .png or .tif")]
    Format(PathBuf),
    #[error("found no folder {0}, allowed a folder for the results of several photos")]
    NoSuchFolder(PathBuf),
    #[error("--report takes one photo, found {0}")]
    OneReport(usize),
    #[error("cannot read standard input")]
    StandardInput(#[source] io::Error),
    #[error("found no state file in {0}, allowed a folder that `relens run` has worked on")]
    NoState(PathBuf),
    #[error("no `relens run` is working on {0}: start one, or give its folder")]
    NobodyThere(PathBuf),
    #[error("{}; nothing was done; {}", full_message(.0), state_remedy(.0.kind()))]
    BrokenState(FileError),
    #[error("cannot write {0}")]
    Writing(PathBuf, #[source] io::Error),
    #[error("{failed} of {all} photos were not restored")]
    SomeFailed { failed: usize, all: usize },
    #[error("cannot handle signals")]
    Signals(#[source] io::Error),
    #[error("no operating point was chosen: no setting restored the scenes shown")]
    NothingScored,
    #[error("{}", .0.join("; "))]
    Faults(Vec<String>),
    #[error("{}", full_message(&**.0))]
    Failed(AnyFailure),
}

/// The remedy if the state cannot be read, by the `cause`.
fn state_remedy(cause: io::ErrorKind) -> &'static str {
    match cause {
        io::ErrorKind::PermissionDenied => {
            "join the folder's group (sudo usermod -aG relens YOU, then log in again)"
        }
        io::ErrorKind::InvalidData => {
            "restart `relens run`, which writes the file again (the service: sudo systemctl \
             restart relens)"
        }
        _ => "check the disk or the network share",
    }
}

impl CliError {
    /// The exit code: 1 where photos failed, 2 for wrong use or rig file, 3 where the operator is
    /// needed.
    pub(super) fn exit_code(&self) -> u8 {
        let of = |remedy| match remedy {
            Remedy::SkipPhoto | Remedy::RetryLater | Remedy::ShootAgain => 1,
            Remedy::Recalibrate | Remedy::ReopenRig | Remedy::CallOperator => 3,
        };
        match self {
            CliError::Writing(..) | CliError::StandardInput(_) | CliError::SomeFailed { .. } => 1,
            CliError::Signals(_) | CliError::NothingScored | CliError::Faults(_) => 3,
            CliError::Failed(error) => of(error.remedy()),
            CliError::OfPhoto(_, error) => error.exit_code(),
            _ => 2,
        }
    }

    /// The remedy to show on the panel.
    pub(super) fn what_to_do(&self) -> &'static str {
        match self {
            CliError::Failed(error) => error.what_to_do(),
            _ => Remedy::CallOperator.what_to_do(),
        }
    }

    pub(super) fn writing(path: &Path, source: io::Error) -> CliError {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::AlreadyExists => CliError::Taken(path),
            io::ErrorKind::NotFound => CliError::NoFolder(path),
            _ => CliError::Writing(path, source),
        }
    }
}

/// Conversions of errors with a remedy.
macro_rules! failures {
    ($($error:ty)*) => {$(
        impl From<$error> for CliError {
            fn from(error: $error) -> CliError {
                CliError::Failed(error.into())
            }
        }
    )*};
}

failures! {
    AnyFailure DaemonError FileError PictureError PipelineError RigError StoreError TestRigError
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unreadable_state_has_the_remedy_of_its_cause() {
        use io::ErrorKind::{InvalidData, PermissionDenied};
        let message = |kind| {
            let error = FileError::at("read the state", Path::new("a"))(io::Error::from(kind));
            CliError::BrokenState(error).to_string()
        };
        let (denied, broken) = (message(PermissionDenied), message(InvalidData));
        assert!(denied.contains("usermod") && !denied.contains("restart"), "{denied}");
        assert!(broken.contains("restart") && !broken.contains("usermod"), "{broken}");
        assert!(message(io::ErrorKind::Other).ends_with("check the disk or the network share"));
    }
}
