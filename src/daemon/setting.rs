//! What the daemon is told once.

use crate::config::Curve;
use crate::frame::PhotoGrid;
use crate::picture::Reading;

use super::reader::Reader;

/// What the daemon is told once.
#[derive(Debug, Clone)]
pub struct DaemonSetting {
    /// Name of the rig, for reports.
    pub rig: String,
    /// Whether photos wait for a button.
    pub needs_button: bool,
    /// How photos are read.
    pub reading: Reading,
    /// A photo is taken when it has not changed for this long.
    pub quiet_s: f64,
    /// Longest time between two looks at the inbox.
    pub poll_s: f64,
    /// Whether events of the inbox make the next look come sooner.
    pub hints: bool,
    /// Where photos are read.
    pub reader: Reader,
    /// A photo whose end is missing is waited for this long after its last change, then set aside.
    pub unfinished_s: f64,
    /// Bytes of the disk that are left free whatever happens.
    pub floor_bytes: u64,
    /// Time after which a photo that was put back, or a rig that needed help, is tried again.
    pub retry_s: f64,
}

impl DaemonSetting {
    /// The usual waits, which are guesses: 5 s quiet as paperless-ngx has it, a look every 5 s if
    /// nothing happens before, a minute until a retry, a quarter of an hour for an upload that was
    /// broken off to be taken up again; and a disk that is never filled beyond its last 256 MiB, so
    /// that the system can still log in whoever is to help.
    pub fn new(rig: &str, grid: impl Into<PhotoGrid>, curve: Curve) -> DaemonSetting {
        let (quiet_s, poll_s, retry_s) = (5.0, 5.0, 60.0);
        DaemonSetting {
            rig: rig.to_owned(),
            needs_button: false,
            reading: Reading::new(grid, curve),
            reader: Reader::Here,
            unfinished_s: 900.0,
            floor_bytes: 256 << 20,
            quiet_s,
            poll_s,
            hints: true,
            retry_s,
        }
    }
}
