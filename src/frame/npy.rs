//! `f32` arrays in NumPy's format, for measured blur grids, golden arrays of tests, and photos for
//! other programs.

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
    /// The array has an unsupported element type or order.
    #[error("{path} contains {found}; allowed are little-endian f32 or f64 in C order")]
    Kind {
        /// The file.
        path: PathBuf,
        /// Its contents.
        found: String,
    },
}

/// Reads shape and values of the array in `path` (`f32` or `f64`, C order), as `f32`.
///
/// # Errors
/// When the file cannot be read or is no such array.
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
        "<f8" => Ok((
            shape,
            npy.into_vec::<f64>().map_err(read)?.into_iter().map(|v| v as f32).collect(),
        )),
        other => Err(wrong(format!("elements of type {other}"))),
    }
}

/// Encodes `values` with `shape` as an array file (`f32`, C order).
pub fn npy_f32(shape: &[usize], values: &[f32]) -> Vec<u8> {
    use npyz::WriterBuilder;
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    let mut bytes = Vec::new();
    let written =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd();
    // Writing to memory cannot fail; `values` must fill the shape.
    let written = written.and_then(|mut array| {
        array.extend(values)?;
        array.finish()
    });
    debug_assert!(written.is_ok(), "{} values fill {shape:?}", values.len());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_array_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let values = [0.0, 1.5, -2.0, 1e9, 5.0, 6.0];
        std::fs::write(&path, npy_f32(&[2, 3], &values)).unwrap();
        assert_eq!(read_npy_f32(&path).unwrap(), (vec![2, 3], values.to_vec()));
    }
}
