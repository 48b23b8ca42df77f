//! Opening and reading of photo files with a rig's options.

use std::fs::File;
use std::io::{Read, Seek};
use std::ops::Range;
use std::path::Path;

use rustix::fs::{Mode, OFlags, SeekFrom, seek};

use super::decode::{Limits, check_head, walk};
use super::kind::HEAD_BYTES;
use super::{Flaw, Format, Photo, PictureError};
use crate::config::{Curve, LargerPhotos, RawResults, RigFile};
use crate::frame::PhotoGrid;

/// Longest file, in bytes, that is read as a whole before its kind and shape are checked: a
/// sixteenth of the memory of a 1 GiB board.
const WHOLE_BYTES_MAX: u64 = 64 << 20;

/// How the photos of a rig are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOptions {
    /// Curve of photos without a usable ICC profile.
    pub curve: Curve,
    /// The resources that one photo may take.
    pub limits: Limits,
    /// The rig's photo on its sensor.
    pub grid: PhotoGrid,
    /// What is done with photos that have more pixels than the grid.
    pub larger_photos: LargerPhotos,
    /// Format of raw photos' results.
    pub raw_results: RawResults,
    /// Whether photos are solved on binned pixels, for which a JPEG's coefficients are no data.
    pub is_binned: bool,
}

impl ReadOptions {
    /// Default options: the usual limits, larger photos resampled, and TIFF results of raw photos.
    pub fn new(grid: impl Into<PhotoGrid>, curve: Curve) -> ReadOptions {
        ReadOptions {
            curve,
            limits: Limits::default(),
            grid: grid.into(),
            larger_photos: LargerPhotos::Shrink,
            raw_results: RawResults::Tiff,
            is_binned: false,
        }
    }

    /// The options that the rig file sets.
    pub fn of(rig: &RigFile) -> ReadOptions {
        ReadOptions {
            larger_photos: rig.run.larger_photos,
            raw_results: rig.photo.raw_results,
            is_binned: rig.camera.binning > 1,
            ..ReadOptions::new(rig.photo_grid(), rig.photo.curve)
        }
    }

    /// The photo in the plain file `file`, called `name`, on the rig's grid.
    pub fn photo_of_file(&self, name: &str, file: File) -> Result<Photo, PictureError> {
        self.photo_of_bytes(name, &read_bytes(file, name, &self.limits)?)
    }

    /// The photo in `bytes`, called `name`, on the rig's grid.
    pub fn photo_of_bytes(&self, name: &str, bytes: &[u8]) -> Result<Photo, PictureError> {
        let limits = self.limits.on(self.grid);
        self.finish(Photo::from_bytes(name, bytes, self.curve, &limits)?.fit(self.grid)?)
    }

    /// Applies the options to `photo`, which is on the rig's grid: sets the format of a raw photo's
    /// result, drops coefficients if photos are binned, and checks the size.
    pub fn finish(&self, mut photo: Photo) -> Result<Photo, PictureError> {
        if photo.raw.is_some() {
            photo.manner.format = match self.raw_results {
                RawResults::Tiff => Format::Tiff,
                RawResults::Jpeg => Format::Jpeg,
            };
        }
        if self.is_binned {
            photo.coding = None;
        }
        let (found, allowed) = (photo.stored, photo.light.size());
        if self.larger_photos == LargerPhotos::Refuse && found.area() > allowed.area() {
            return Err(Flaw::Larger { found, allowed }.of(&photo.name));
        }
        Ok(photo)
    }
}

/// Checks without decoding that `file`, called `name`, is of a kind that is read, and complete: a
/// JPEG to its end marker, a PNG to its end chunk, a TIFF to its last strip, none with a hole in
/// it.
///
/// # Errors
/// [`PictureError::Refused`], with [`Growth::Likely`](super::Growth) if a part is missing;
/// [`PictureError::Read`] if the file cannot be read.
pub fn whole(name: &str, file: File, limits: &Limits) -> Result<(), PictureError> {
    let hole = hole_of(&file);
    let bytes = read_bytes(file, name, limits)?;
    let flaw = match (walk(&bytes, limits), hole) {
        (Err(flaw), _) => flaw,
        (Ok(_), Some(Range { start: from, end: to })) => {
            Flaw::ZeroFilled { from, to, length: bytes.len() }
        }
        (Ok(_), None) => return Ok(()),
    };
    Err(flaw.of(name))
}

/// The first range of `file` that is not stored on its disk, as in a copy whose space was reserved
/// but not yet filled. Uncompressed pixels in such a hole look black.
fn hole_of(file: &File) -> Option<Range<usize>> {
    let length = file.metadata().ok()?.len();
    let from = seek(file, SeekFrom::Hole(0)).ok().filter(|&from| from < length);
    let to = from.map(|from| seek(file, SeekFrom::Data(from)).unwrap_or(length));
    let _ = seek(file, SeekFrom::Start(0));
    Some(from? as usize..to? as usize)
}

/// The bytes of the photo in `path`, which is no link, pipe or device.
pub fn bytes_of(path: &Path, limits: &Limits) -> Result<Vec<u8>, PictureError> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    // A pipe would block the open, and a link may lead anywhere.
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    match rustix::fs::open(path, flags, Mode::empty()) {
        Ok(fd) => read_bytes(fd.into(), &name, limits),
        Err(rustix::io::Errno::LOOP) => Err(PictureError::not_a_file(&name, "a link")),
        Err(errno) => Err(PictureError::Read { path: path.to_owned(), source: errno.into() }),
    }
}

/// The bytes of `file`, a plain file no longer than the limit. Above [`WHOLE_BYTES_MAX`], its head
/// is checked before the rest is read.
pub(super) fn read_bytes(file: File, name: &str, limits: &Limits) -> Result<Vec<u8>, PictureError> {
    let read = |source: std::io::Error| PictureError::Read { path: name.into(), source };
    let about = file.metadata().map_err(read)?;
    if !about.is_file() {
        let found = if about.is_dir() { "a folder" } else { "a pipe or device" };
        return Err(PictureError::not_a_file(name, found));
    }
    if about.len() > limits.bytes_max {
        return Err(Flaw::TooLong { found: about.len(), allowed: limits.bytes_max }.of(name));
    }
    if about.len() > WHOLE_BYTES_MAX {
        let mut head = Vec::new();
        (&file).take(HEAD_BYTES).read_to_end(&mut head).map_err(read)?;
        check_head(&file, &head, limits).map_err(|flaw| flaw.of(name))?;
        (&file).rewind().map_err(read)?;
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    // The walk over the file refuses one that has meanwhile grown beyond the limit.
    file.take(limits.bytes_max + 1).read_to_end(&mut bytes).map_err(read)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    #[test]
    fn long_files_are_refused_by_their_head() {
        let mut file = tempfile::tempfile().unwrap();
        let limits = Limits::default().on(Size::new(256, 192).into());
        let mut refusal = |head: &[u8]| {
            use std::io::Write;
            file.rewind().unwrap();
            file.write_all(head).unwrap();
            // Shorter than the pictures, but too long to be read before a look at its head.
            file.set_len(WHOLE_BYTES_MAX + 1).unwrap();
            file.rewind().unwrap();
            whole("a", file.try_clone().unwrap(), &limits).unwrap_err().to_string()
        };
        assert!(refusal(b"PK\x03\x04").contains("this is not a photo"));
        assert!(refusal(b"P6\n6000 4001\n255\n").contains("6000×4001"));
        assert!(refusal(b"P6\n6000 4500\n255\n").contains("never filled"));
    }
}
