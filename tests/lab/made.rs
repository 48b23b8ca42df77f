//! Results of an experiment, and their files.

use std::path::Path;

use relens::chart::drawing::Drawing;
use relens::chart::table::Table;
use relens::frame::Plane;

use crate::Failure;

/// Results of an experiment, each with the stem of its file's name.
#[derive(Debug, Default)]
pub(crate) struct Made {
    /// Tables, written as Markdown and CSV.
    pub(crate) tables: Vec<(String, Table)>,
    /// Drawings, written as SVG.
    pub(crate) drawings: Vec<(String, Drawing)>,
    /// Grey pictures, 0..255, written as PNG.
    pub(crate) pictures: Vec<(String, Plane)>,
    /// Names and contents of other files.
    pub(crate) files: Vec<(String, Vec<u8>)>,
}

impl Made {
    /// The results of a single table.
    pub(crate) fn table(stem: String, table: Table) -> Made {
        Made { tables: vec![(stem, table)], ..Made::default() }
    }

    /// Writes all results into `folder`.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), Failure> {
        for (stem, table) in &self.tables {
            write(folder, &format!("{stem}.md"), table.markdown().as_bytes())?;
            write(folder, &format!("{stem}.csv"), table.csv().as_bytes())?;
        }
        for (stem, drawing) in &self.drawings {
            write(folder, &format!("{stem}.svg"), drawing.svg().as_bytes())?;
        }
        for (stem, picture) in &self.pictures {
            let codes: Vec<u8> =
                picture.data().iter().map(|v| v.round().clamp(0.0, 255.0) as u8).collect();
            let (width, height) = (picture.width() as u32, picture.height() as u32);
            let path = folder.join(format!("{stem}.png"));
            image::save_buffer(path, &codes, width, height, image::ColorType::L8)?;
        }
        self.files.iter().try_for_each(|(name, bytes)| write(folder, name, bytes))
    }
}

/// Writes `bytes` to the file `name` in `folder`.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    let path = folder.join(name);
    Ok(std::fs::write(&path, bytes).map_err(|e| format!("cannot write {}: {e}", path.display()))?)
}
