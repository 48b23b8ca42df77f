//! Golden arrays: `f32` or `f64` in NumPy's format.

use std::path::Path;

/// Shape and values of the array in `path` (C order), as `f32`.
pub(crate) fn read_npy_f32(path: &Path) -> Result<(Vec<usize>, Vec<f32>), String> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let npy = npyz::NpyFile::new(&bytes[..]).map_err(|e| e.to_string())?;
    let shape = npy.shape().iter().map(|&n| n as usize).collect();
    let kind = npy.dtype().descr();
    if npy.order() != npyz::Order::C {
        return Err(format!("{} is in Fortran order", path.display()));
    }
    let values = match kind.trim_matches('\'') {
        "<f4" => npy.into_vec::<f32>(),
        "<f8" => npy.into_vec::<f64>().map(|all| all.into_iter().map(|v| v as f32).collect()),
        other => return Err(format!("{} has elements of type {other}", path.display())),
    };
    values.map(|values| (shape, values)).map_err(|e| e.to_string())
}
