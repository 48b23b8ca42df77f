//! Names derived from a photo's name: its result, the result's report and gallery pictures, the
//! photo's record in `working`, the note beside it in `failed`.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;

pub(super) const RECORD_PREFIX: &str = ".ledger-";

pub(crate) fn report_name(result: &OsStr) -> OsString {
    with_suffix(result, ".json")
}

/// Name of the note beside a photo in `failed`.
pub(crate) fn note_name(photo: &OsStr) -> OsString {
    with_suffix(photo, ".txt")
}

pub(super) fn record_name(photo: &OsStr) -> OsString {
    format!("{RECORD_PREFIX}{}", id(photo)).into()
}

/// Names of the previews of a photo and its `result` in the gallery.
pub(super) fn preview_names(result: &OsStr) -> [String; 2] {
    ["before", "after"].map(|which| format!("{}-{which}.jpg", id(result)))
}

/// Address of the thumbnail beside the preview `after` of a result.
pub(crate) fn thumbnail_address(after: &str) -> String {
    after.replace("-after.", "-small.")
}

/// Address of the full-size picture beside a `preview`.
pub(crate) fn full_size_address(preview: &str) -> String {
    preview.replace(".jpg", "-pixels.jpg")
}

/// `name` as a relative URL: every byte outside the unreserved set of RFC 3986 §2.3 escaped.
pub(crate) fn address(name: &OsStr) -> String {
    let mut text = String::new();
    for &byte in name.as_bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => {
                text.push(char::from(byte));
            }
            _ => text.push_str(&format!("%{byte:02X}")),
        }
    }
    text
}

/// A short stable identifier of `name`: 64-bit FNV-1a in 16 hexadecimal digits.
fn id(name: &OsStr) -> String {
    // Fowler, Noll, Vo: offset basis and prime for 64 bits.
    let step = |hash: u64, &byte: &u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    format!("{:016x}", name.as_bytes().iter().fold(0xcbf2_9ce4_8422_2325, step))
}

fn with_suffix(name: &OsStr, suffix: &str) -> OsString {
    let mut name = name.to_owned();
    name.push(suffix);
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_match_the_published_test_vectors() {
        assert_eq!(id(OsStr::new("")), "cbf29ce484222325");
        assert_eq!(id(OsStr::new("foobar")), "85944171f73967e8");
    }

    #[test]
    fn addresses_cannot_leave_the_folder_or_the_attribute() {
        assert_eq!(address(OsStr::new("a b\"><é.jpg")), "a%20b%22%3E%3C%C3%A9.jpg");
        assert_eq!(address(OsStr::new("javascript:x/../y")), "javascript%3Ax%2F..%2Fy");
    }
}
