//! Storage of the calibration in two slots; at most one is being written.
//!
//! A slot is: magic (8 bytes), version (u32, little-endian), calibration (postcard), CRC-32 of all
//! preceding bytes (u32, little-endian). The newer valid slot of this rig is used. A new
//! calibration is written to a temporary file in the same folder, synchronised, and renamed over
//! the other slot; then the folder is synchronised. One valid slot survives a power cut at any
//! time.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::Calibration;
use crate::disk::{Disk, LocalDisk, Unsynced};
use crate::remedy::{Remediable, Remedy};

const MAGIC: [u8; 8] = *b"relenscl";
/// Format of slots; incremented with every change of [`Calibration`]'s layout.
pub const VERSION: u32 = 9;
const HEADER_BYTES: usize = 12;
const CRC_BYTES: usize = 4;
const SLOTS: [&str; 2] = ["calibration-a.slot", "calibration-b.slot"];
/// Maximum size of a slot, larger than any calibration: 192 functions of 101×101 taps in three
/// channels are 24 MB, the response of 24 million pixels in three channels 72 MB, twelve focuses of
/// the default rig's 48 functions 18 MB.
const SLOT_BYTES_MAX: u64 = 128 << 20;

/// Why a slot is not valid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SlotFault {
    /// The file does not exist.
    #[error("missing")]
    Missing,
    /// The file is unreadable, too long, of another format, or damaged; the text says which.
    #[error("{0}")]
    Bad(String),
    /// The payload is no calibration although the checksum is right, which is a bug of the writer.
    #[error("the file is intact but holds no valid calibration: {0}")]
    Contents(String),
}

/// Why a calibration was not loaded or stored.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum StoreError {
    #[error("no calibration in {0}; run `relens calibrate`")]
    Empty(PathBuf),
    #[error("no valid calibration in {folder}: slot a: {a}, slot b: {b}; run `relens calibrate`")]
    BothBad { folder: PathBuf, a: SlotFault, b: SlotFault },
    #[error(
        "the calibration in {folder} is of rig {found:016x}; this is rig {allowed:016x}; run \
         `relens calibrate`"
    )]
    OtherRig { folder: PathBuf, found: u64, allowed: u64 },
    #[error("cannot store the calibration in {0}")]
    Write(PathBuf, #[source] std::io::Error),
    #[error("the calibration cannot be encoded: {0}")]
    Encode(String),
}

impl Remediable for StoreError {
    fn remedy(&self) -> Remedy {
        match self {
            StoreError::Empty(_) | StoreError::BothBad { .. } | StoreError::OtherRig { .. } => {
                Remedy::Recalibrate
            }
            StoreError::Write(..) => Remedy::RetryLater,
            StoreError::Encode(_) => Remedy::CallOperator,
        }
    }
}

/// Creates `folder` and its parents.
pub fn make_folder(folder: &Path) -> Result<(), StoreError> {
    std::fs::create_dir_all(folder).map_err(|source| StoreError::Write(folder.to_owned(), source))
}

/// Loads the newer valid calibration of `rig` from `folder`.
///
/// # Errors
/// When there is no valid calibration of this rig.
pub fn load(folder: &Path, rig: u64) -> Result<Calibration, StoreError> {
    load_from(&LocalDisk::new(vec![folder.to_owned()]), folder, rig)
}

/// [`load`] from any `disk`.
pub fn load_from(disk: &dyn Disk, folder: &Path, rig: u64) -> Result<Calibration, StoreError> {
    let slots = SLOTS.map(|name| read_slot(disk, &folder.join(name)));
    for (name, slot) in SLOTS.iter().zip(&slots) {
        match slot {
            Err(SlotFault::Missing) | Ok(_) => {}
            Err(fault) => log::warn!("calibration {name}: {fault}"),
        }
    }
    let folder = folder.to_owned();
    let (mut ours, mut others): (Vec<_>, Vec<_>) =
        slots.iter().flatten().cloned().partition(|c: &Calibration| c.rig == rig);
    ours.sort_by_key(|c| c.generation);
    if let Some(newest) = ours.pop() {
        return Ok(newest);
    }
    others.sort_by_key(|c| c.generation);
    if let Some(newest) = others.pop() {
        return Err(StoreError::OtherRig { folder, found: newest.rig, allowed: rig });
    }
    match slots {
        [Err(SlotFault::Missing), Err(SlotFault::Missing)] => Err(StoreError::Empty(folder)),
        [Err(a), Err(b)] => Err(StoreError::BothBad { folder, a, b }),
        // A valid slot was handled above.
        _ => Err(StoreError::Empty(folder)),
    }
}

/// Stores `calibration` in `folder`, replacing the slot that is invalid, another rig's, or older.
///
/// # Errors
/// When it cannot be written; the other slot then stays as it was.
pub fn save(folder: &Path, calibration: &Calibration) -> Result<(), StoreError> {
    save_to(&LocalDisk::new(vec![folder.to_owned()]), folder, calibration)
}

/// [`save`] to any `disk`.
pub fn save_to(
    disk: &dyn Disk,
    folder: &Path,
    calibration: &Calibration,
) -> Result<(), StoreError> {
    let bytes = encode(calibration)?;
    // Rank of a slot's contents: invalid, another rig's, then by generation.
    let rank = |name: &str| match read_slot(disk, &folder.join(name)) {
        Ok(c) if c.rig == calibration.rig => (2, c.generation),
        Ok(_) => (1, 0),
        Err(_) => (0, 0),
    };
    let slot = if rank(SLOTS[0]) <= rank(SLOTS[1]) { SLOTS[0] } else { SLOTS[1] };
    let (path, fresh) = (folder.join(slot), folder.join(format!("{slot}.new")));
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| StoreError::Write(path, source)
    };
    disk.write(&fresh, &mut &bytes[..]).and_then(Unsynced::sync).map_err(failed(&fresh))?;
    disk.rename(&fresh, &path).map_err(failed(&path))?;
    disk.sync_folder(folder).map_err(failed(folder))
}

fn encode(calibration: &Calibration) -> Result<Vec<u8>, StoreError> {
    let payload =
        postcard::to_allocvec(calibration).map_err(|e| StoreError::Encode(e.to_string()))?;
    let mut bytes = [&MAGIC[..], &VERSION.to_le_bytes(), &payload].concat();
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    match bytes.len() as u64 {
        0..=SLOT_BYTES_MAX => Ok(bytes),
        length => Err(StoreError::Encode(too_long(length))),
    }
}

fn too_long(length: u64) -> String {
    format!("{length} bytes long; {SLOT_BYTES_MAX} are allowed")
}

fn read_slot(disk: &dyn Disk, path: &Path) -> Result<Calibration, SlotFault> {
    let unreadable = |e: std::io::Error| match e.kind() {
        ErrorKind::NotFound => SlotFault::Missing,
        _ => SlotFault::Bad(format!("cannot be read: {e}")),
    };
    let file = disk.open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    if length > SLOT_BYTES_MAX {
        return Err(SlotFault::Bad(too_long(length)));
    }
    let mut bytes = Vec::with_capacity(length as usize);
    file.take(SLOT_BYTES_MAX).read_to_end(&mut bytes).map_err(unreadable)?;
    decode(&bytes)
}

fn decode(bytes: &[u8]) -> Result<Calibration, SlotFault> {
    let bad = |how: &str| SlotFault::Bad(how.to_owned());
    let damaged = || bad("damaged");
    let (body, crc) = bytes.split_last_chunk::<CRC_BYTES>().ok_or_else(damaged)?;
    let (header, payload) = body.split_first_chunk::<HEADER_BYTES>().ok_or_else(damaged)?;
    let [magic @ .., a, b, c, d] = header;
    let version = u32::from_le_bytes([*a, *b, *c, *d]);
    if *magic != MAGIC {
        return Err(bad("not a calibration of relens"));
    }
    if version != VERSION {
        let how = format!("written in format {version}; this program reads {VERSION}");
        return Err(SlotFault::Bad(how));
    }
    if u32::from_le_bytes(*crc) != crc32fast::hash(body) {
        return Err(damaged());
    }
    let calibration: Calibration =
        postcard::from_bytes(payload).map_err(|e| SlotFault::Contents(e.to_string()))?;
    calibration.check().map_err(SlotFault::Contents)?;
    Ok(calibration)
}

#[cfg(test)]
mod tests;
