//! The gallery's status line: a page inside the page, which is rewritten at each change and reloads
//! itself, even without scripts.

use super::html::{escape, moment};
use super::state::Doing;
use crate::daemon::store::folders::Folders;
use crate::disk::FileError;

/// Address of the status line, relative to the outbox.
pub(super) const ADDRESS: &str = "gallery/now.html";

pub(super) fn write(folders: &Folders, doing: &Doing, now_unix_s: u64) -> Result<(), FileError> {
    let bytes = line(doing, now_unix_s);
    folders.files.replace_for_now(&folders.outbox.join(ADDRESS), bytes.as_bytes())
}

fn line(doing: &Doing, now_unix_s: u64) -> String {
    let words = doing.to_string();
    let words = escape(words.trim_end_matches('.'));
    format!(
        include_str!("now.html"),
        words = words,
        written = moment(now_unix_s),
        script = include_str!("now.js"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_status_line_names_each_state_and_escapes_names() {
        let restoring = |photo: &str| Doing::Restoring {
            photo: photo.to_owned(),
            done: 0.4,
            remaining_s: Some(21.0),
        };
        let reason = "the panel: put it before the lens.".to_owned();
        for (doing, words) in [
            (Doing::Waiting, "Ready. "),
            (restoring("a.dng"), "Restoring a.dng: 40 % done, about 21 s to go. "),
            (restoring("<b>"), "Restoring &lt;b&gt;: "),
            (Doing::Paused { reason: reason.clone() }, "Waiting: the panel: put"),
            (Doing::Held { reason }, "Help needed: "),
            (Doing::Ended, "Switched off. "),
        ] {
            let page = line(&doing, 1_700_000_000);
            assert!(page.contains(words) && page.contains("2023-11-14"), "{page}");
            // The page reloads only without scripts, since reloads disturb screen readers.
            assert!(page.contains("<noscript><meta http-equiv=\"refresh\""), "{page}");
        }
    }
}
