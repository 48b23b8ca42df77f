//! Recognition of files that are not photos, by name and content: files of systems and shares,
//! uploads under way, and what cameras and programs write beside photos.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use crate::disk::{FileKind, Files};
use crate::picture::{HEAD_BYTES, is_companion};

pub(crate) fn is_hidden(name: &OsStr) -> bool {
    name.as_bytes().starts_with(b".")
}

/// The kinds of companions, for the log.
pub(super) const KINDS: &str =
    "sidecars, movies, sounds, thumbnails, catalogues, files still being sent";

/// Names of files and folders that systems, shares and photo programs make.
const NAMES: &str = "$recycle.bin/#recycle/@eadir/@recycle/@tmp/__macosx/desktop.ini/ehthumbs.db/\
    icon\r/ipod photo cache/lost+found/network trash folder/picasa.ini/system volume information/\
    temporary items/thumbnails/thumbs.db/zbthumbnail.info";

/// Endings of files that are never photos, whatever their content: uploads under way, thumbnails.
const UNFINISHED: &str = "!sync !ut aria2 bc! crdownload download filepart lock opdownload part \
    partial swp tacitpart temp thm tmp";

/// Endings of files found beside photos: sidecars and catalogues of photo programs; what cameras
/// write beside photos; movies and sounds.
const ENDINGS: &str = "\
    aae acr arp cof comask cop cos cot db db-journal db-shm db-wal dop exv ini json lnk lrcat \
    lrprev nksc on1 pp3 rpp spd url vrd xmp \
    bdm bin cpi ctg dat gis gpx idx lrf lrv log mrk nav obs srt xml \
    3gp aac avi insv m2ts m4a m4v mov mp3 mp4 mpg mts wav webm wmv";

/// Whether the `name` of a file or folder alone shows that it is junk: of a system or share, an
/// upload under way, a thumbnail.
pub(super) fn is_junk(name: &OsStr, kind: FileKind) -> bool {
    let lower = name.to_string_lossy().to_lowercase();
    let is_file_junk = || {
        lower.starts_with("~$")
            || lower.ends_with('~')
            // An alternate stream keeps its colon, `a.jpg:Zone.Identifier`.
            || lower.ends_with("zone.identifier")
            || has_ending(&lower, UNFINISHED)
    };
    is_hidden(name)
        || NAMES.split('/').any(|junk| junk == lower)
        || kind != FileKind::Folder && is_file_junk()
}

/// Whether the file `path` is a companion of photos, by its name and its content.
pub(super) fn is_companion_at(files: &Files, path: &Path, kind: FileKind) -> bool {
    let Some(name) = path.file_name().filter(|_| kind == FileKind::File) else { return false };
    let usual = has_ending(&name.to_string_lossy().to_lowercase(), ENDINGS);
    is_companion(name, usual, || files.read(path, HEAD_BYTES).ok().flatten())
}

fn has_ending(lower: &str, endings: &str) -> bool {
    let ending = lower.rsplit('.').next().filter(|ending| ending.len() < lower.len());
    ending.is_some_and(|ending| endings.split(' ').any(|known| known == ending))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn junk_and_half_uploads_are_not_photos() {
        for junk in
            [".DS_Store", "._a.jpg", "Thumbs.db", "a.jpg.part", "a.jpg~", ".a.jpg.Xy12", "~$a.docx"]
        {
            assert!(is_junk(OsStr::new(junk), FileKind::File), "{junk}");
        }
        for junk in ["MVI_2.THM", "a.jpg:Zone.Identifier", "Picasa.ini", "a.jpg.!sync", "Icon\r"] {
            assert!(is_junk(OsStr::new(junk), FileKind::File), "{junk}");
        }
        for photo in ["partial eclipse.jpg", "mov", "a.mov.jpg", "json", "part", "thumbnails.jpg"] {
            assert!(!is_junk(OsStr::new(photo), FileKind::File), "{photo}");
        }
        let is_folder_junk = |name: &str| is_junk(OsStr::new(name), FileKind::Folder);
        assert!(is_folder_junk("Thumbnails") && is_folder_junk("Network Trash Folder"));
        assert!(!is_folder_junk("the trip.tmp") && !is_folder_junk("films.mov"));
    }
}
