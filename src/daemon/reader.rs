//! How a photo's bytes become a photo: here, or in a process of their own.

use std::fs::File;

use crate::config::LargerPhotos;
use crate::picture::worker::Worker;
use crate::picture::{Limits, Photo, PictureError, whole};

use super::setting::DaemonSetting;

/// Where photos are read.
#[derive(Debug, Clone)]
pub enum Reader {
    /// In this process. For files that nobody could have tampered with.
    Here,
    /// In a worker for each.
    Worker(Worker),
}

impl Reader {
    /// Whether `file`, called `name`, is all there.
    pub(super) fn whole(
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

    /// The photo in `file`, called `name`, on the rig's grid.
    pub(super) fn photo(
        &self,
        name: &str,
        file: File,
        setting: &DaemonSetting,
    ) -> Result<Photo, PictureError> {
        let photo = match self {
            Reader::Here => {
                Photo::of_file(name, file, setting.curve, &setting.limits)?.fit(setting.grid)
            }
            Reader::Worker(worker) => {
                worker.photo(name, file, setting.curve, &setting.limits, setting.grid)
            }
        }?
        .with_raw_results(setting.raw_results);
        match setting.larger_photos {
            LargerPhotos::Shrink => Ok(photo),
            LargerPhotos::Refuse => photo.no_larger(),
        }
    }
}
