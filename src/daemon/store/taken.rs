//! Photos taken by the box itself, put into its inbox.

use super::folders::Folders;
use crate::disk::FileError;
use crate::disk::files::TakenNames;
use crate::restorer::photo_file::TakenPhoto;

/// Writes `photo` into the inbox, whole and synchronised, under a name with the date `unix_s`;
/// returns the name.
pub(crate) fn keep(
    folders: &Folders,
    photo: &TakenPhoto,
    unix_s: u64,
) -> Result<String, FileError> {
    let name = format!("photo-{}.{}", date(unix_s), photo.ending);
    let (files, inbox) = (&folders.files, &folders.inbox);
    files.with_free_name(inbox, name.as_ref(), &TakenNames::holds, &mut |name| {
        files.write_new(inbox, name, &mut &*photo.bytes)?;
        Ok(name.to_string_lossy().into_owned())
    })
}

/// Date and time by the box's calendar, which may be wrong: duplicate names get a number.
fn date(unix_s: u64) -> String {
    let second = i64::try_from(unix_s).ok().and_then(|s| jiff::Timestamp::from_second(s).ok());
    second.unwrap_or_default().strftime("%Y%m%d-%H%M%S").to_string()
}
