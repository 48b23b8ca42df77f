//! The line of the gallery that says what the box is doing: a page of its own within the page,
//! written whole at each change, which fetches itself anew, also without scripts.

use super::html::{escape, moment};
use super::state::Doing;
use crate::daemon::store::folders::Folders;
use crate::disk::FileError;

/// Its name beside the gallery's pictures.
const NAME: &str = "now.html";

/// Address of the line from the outbox, once it was written.
pub(super) fn address(folders: &Folders) -> Option<String> {
    let is_there = folders.files().look(&folders.previews().join(NAME)).is_ok();
    is_there.then(|| format!("gallery/{NAME}"))
}

/// Writes the line.
pub(super) fn write(folders: &Folders, doing: &Doing, now_unix_s: u64) -> Result<(), FileError> {
    let bytes = line(doing, now_unix_s);
    folders.files().replace_for_now(folders.previews(), NAME.as_ref(), bytes.as_bytes())
}

fn line(doing: &Doing, now_unix_s: u64) -> String {
    let words = doing.to_string();
    let words = escape(words.trim_end_matches('.'));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <noscript><meta http-equiv=\"refresh\" content=\"3\"></noscript>\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>What the box is doing</title>\n<style>body, h1 {{ margin: 0; font: 1rem/1.4 \
         system-ui, sans-serif; overflow-wrap: anywhere; }}</style>\n</head>\n\
         <body><main><h1>{words}. <small>({})</small></h1></main>\n\
         <script>\n{}</script></body>\n</html>\n",
        moment(now_unix_s),
        include_str!("now.js"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_says_each_state_and_obeys_no_name() {
        let restoring = |photo: &str| Doing::Restoring {
            photo: photo.to_owned(),
            done: 0.4,
            left_s: Some(21.0),
        };
        let reason = "photos wait for the panel: put it before the lens.".to_owned();
        for (doing, words) in [
            (Doing::Waiting, "Ready. "),
            (restoring("a.dng"), "Restoring a.dng: 40 % done, about 21 s left. "),
            (restoring("<b>"), "Restoring &lt;b&gt;: "),
            (Doing::Paused { reason: reason.clone() }, "Not now: photos wait for the panel: put"),
            (Doing::Held { reason }, "Somebody is needed: "),
            (Doing::Ended, "Switched off. "),
        ] {
            let page = line(&doing, 1_700_000_000);
            assert!(page.contains(words) && page.contains("2023-11-14"), "{page}");
            // A page that reloads by itself while somebody reads it aloud: only without scripts.
            assert!(page.contains("<noscript><meta http-equiv=\"refresh\""), "{page}");
        }
    }
}
