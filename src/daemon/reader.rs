//! Decoding of photos, in this process or in a separate one.

use std::fs::File;

use crate::picture::worker::Worker;
use crate::picture::{Limits, Photo, PictureError, ReadOptions, whole};

/// Where photos are decoded.
#[derive(Debug, Clone)]
pub enum Reader {
    /// In this process, for trusted files.
    Here,
    /// In a worker process for each photo.
    Worker(Worker),
}

impl Reader {
    /// Checks that `file`, called `name`, is complete and of a kind that is read.
    pub(super) fn check_complete(
        &self,
        name: &str,
        file: File,
        limits: &Limits,
    ) -> Result<(), PictureError> {
        match self {
            Reader::Here => whole(name, file, limits),
            Reader::Worker(worker) => worker.whole(name, file, limits),
        }
    }

    /// Decodes `file`, called `name`, onto the rig's grid.
    pub(super) fn photo(
        &self,
        name: &str,
        file: File,
        reading: &ReadOptions,
    ) -> Result<Photo, PictureError> {
        match self {
            Reader::Here => reading.photo_of_file(name, file),
            Reader::Worker(worker) => {
                let ReadOptions { curve, limits, grid, .. } = reading;
                reading.finish(worker.photo(name, file, *curve, limits, *grid)?)
            }
        }
    }
}
