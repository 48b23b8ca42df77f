//! Reads `f32` arrays in NumPy's format: a measured blur grid, and the golden arrays of the tests.

use std::path::{Path, PathBuf};

/// Why an array file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum NpyError {
    /// The file cannot be opened or read.
    #[error("cannot read the array {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The array has another element type or order than wanted.
    #[error("{path} holds {found}; little-endian f32 or f64 in C order is allowed")]
    Kind {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
    },
}

/// The shape and the values of the array in `path` (`f32` or `f64`, C order), as `f32`.
///
/// # Errors
/// When the file cannot be read, or is not such an array.
pub fn read_npy_f32(path: &Path) -> Result<(Vec<usize>, Vec<f32>), NpyError> {
    let read = |source| NpyError::Read { path: path.to_owned(), source };
    let bytes = std::fs::read(path).map_err(read)?;
    let npy = npyz::NpyFile::new(&bytes[..]).map_err(read)?;
    let shape = npy.shape().iter().map(|&n| n as usize).collect();
    let kind = npy.dtype().descr();
    let wrong = |found| NpyError::Kind { path: path.to_owned(), found };
    if npy.order() != npyz::Order::C {
        return Err(wrong("an array in Fortran order".to_owned()));
    }
    match kind.trim_matches('\'') {
        "<f4" => Ok((shape, npy.into_vec::<f32>().map_err(read)?)),
        "<f8" => Ok((shape, npy.into_vec::<f64>().map_err(read)?.into_iter().map(|v| v as f32).collect())),
        other => Err(wrong(format!("elements of type {other}"))),
    }
}
