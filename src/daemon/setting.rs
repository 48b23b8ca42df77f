//! Settings of the daemon.

use std::fs::File;

use crate::config::Curve;
use crate::frame::PhotoGrid;
use crate::picture::worker::Worker;
use crate::picture::{Photo, PictureError, ReadOptions, whole};

/// Settings of the daemon.
#[derive(Debug, Clone)]
pub struct DaemonSetting {
    /// Name of the rig, for reports.
    pub rig: String,
    /// Whether photos wait for a button.
    pub needs_button: bool,
    /// How photos are decoded.
    pub reading: ReadOptions,
    /// Time without a change after which a photo is taken from the inbox.
    pub quiet_s: f64,
    /// Longest time between two scans of the inbox.
    pub poll_s: f64,
    /// Whether events of the inbox make the next scan come sooner.
    pub hints: bool,
    /// Decodes each photo in a process of its own; `None` decodes trusted files in this process.
    pub worker: Option<Worker>,
    /// Time without a change after which an incomplete photo is rejected.
    pub unfinished_s: f64,
    /// Bytes of the disk that always stay free.
    pub floor_bytes: u64,
    /// Time after which a deferred photo, or a rig in need of help, is tried again.
    pub retry_s: f64,
}

impl DaemonSetting {
    /// Default times, which are guesses: 5 s without a change (as paperless-ngx has it), a scan
    /// every 5 s, a retry after a minute, a quarter of an hour to resume an upload that broke off.
    /// The last 256 MiB of the disk stay free, so that an operator can log in.
    pub fn new(rig: &str, grid: impl Into<PhotoGrid>, curve: Curve) -> DaemonSetting {
        DaemonSetting {
            rig: rig.to_owned(),
            needs_button: false,
            reading: ReadOptions::new(grid, curve),
            worker: None,
            unfinished_s: 900.0,
            floor_bytes: 256 << 20,
            quiet_s: 5.0,
            poll_s: 5.0,
            hints: true,
            retry_s: 60.0,
        }
    }

    /// Checks that `file`, called `name`, is complete and of a kind that is read.
    pub(super) fn check_complete(&self, name: &str, file: File) -> Result<(), PictureError> {
        let limits = self.reading.limits.on(self.reading.grid);
        match &self.worker {
            None => whole(name, file, &limits),
            Some(worker) => worker.whole(name, file, &limits),
        }
    }

    /// Decodes `file`, called `name`, onto the rig's grid.
    pub(super) fn photo(&self, name: &str, file: File) -> Result<Photo, PictureError> {
        match &self.worker {
            None => self.reading.photo_of_file(name, file),
            Some(worker) => worker.photo(name, file, &self.reading),
        }
    }
}
