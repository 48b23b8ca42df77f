//! The gallery's pages, which work from a disk without server, network or scripts.

use std::ffi::OsStr;
use std::fmt::Write;

use serde::Serialize;

use super::card::{GalleryPhoto, card, thumbnail};
use super::html::{escape, moment};
use super::now;
use super::summary::PhotoCounts;
use crate::daemon::store::names::address;
use crate::daemon::store::report_file::{Failed, Report};
use crate::kiosk::screen::photos;

/// Longest list of photos without a result that is shown open; longer lists are folded.
const LISTED: usize = 5;

/// Photos on one page.
pub(super) const PHOTOS: usize = 60;

const FAILED: &str = "They are in the folder <code>failed</code>, unchanged. To try one again, \
                      move it back into <code>inbox</code>.";

const DEFERRED: &str = "They are still in the folder <code>inbox</code> and will be tried again.";

/// Address of the photo page `n`, from 1, relative to the outbox.
pub(super) fn page_address(n: usize) -> String {
    format!("gallery/{}", page_name(n))
}

pub(super) fn page_name(n: usize) -> String {
    format!("photos-{n}.html")
}

/// Number of the photo page with the file name `name`.
pub(super) fn number(name: &OsStr) -> Option<usize> {
    name.to_str()?.strip_prefix("photos-")?.strip_suffix(".html")?.parse().ok()
}

/// Contents of the first page, also written as JSON for other programs.
#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) struct Overview<'a> {
    pub(super) rig: &'a str,
    pub(super) written_unix_s: u64,
    pub(super) counts: PhotoCounts,
    /// Photos with a result, oldest first.
    pub(super) photos: &'a [Report],
    pub(super) failed: &'a [Failed],
    pub(super) deferred: &'a [Failed],
}

/// The first page: counts, status line, failures, and the newest of `all` photos.
pub(super) fn first_page(overview: &Overview<'_>, all: &[GalleryPhoto<'_>]) -> String {
    let &Overview { rig, counts: numbers, failed, deferred, written_unix_s, .. } = overview;
    let mut html = head(&format!("<p>{}</p>\n", counts(numbers)), "", all.len());
    let _ = writeln!(
        html,
        "<iframe class=\"now\" title=\"Status of the box\" src=\"{}\"></iframe>",
        now::ADDRESS
    );
    list(&mut html, "Failed", FAILED, failed, Some("../failed/"));
    list(&mut html, "Waiting", DEFERRED, deferred, None);
    if all.is_empty() {
        html.push_str(
            "<p class=\"empty\">No photo has been restored yet. Drop one into the inbox.</p>\n",
        );
    }
    let pages = all.len().div_ceil(PHOTOS);
    pager(&mut html, pages);
    cards(&mut html, &all[..all.len().min(PHOTOS)], "");
    html.push_str(include_str!("help.html"));
    let _ = writeln!(
        html,
        "<p class=\"quiet\">Written {} by the rig {}. Also available <a \
         href=\"gallery/report.json\">as data</a>.</p>",
        moment(written_unix_s),
        escape(rig),
    );
    foot(html)
}

fn counts(numbers: PhotoCounts) -> String {
    let PhotoCounts { restored, untouched, failed, waiting } = numbers;
    let waiting_words = waiting.to_string();
    let mut counts = vec![format!("<b>{restored}</b> restored")];
    for (n, words) in [
        (untouched, "unchanged"),
        (failed, "failed"),
        (waiting.all(), waiting_words.split_once(' ').map_or("waiting", |(_, words)| words)),
    ] {
        if n > 0 {
            counts.push(format!("<b>{n}</b> {words}"));
        }
    }
    counts.join(" · ")
}

/// HTML of photo page `n` of `pages`; page 1 has the oldest photos. The page links only to its
/// neighbours, so that it does not change with every page added.
pub(super) fn photo_page(n: usize, pages: usize, shown: &[GalleryPhoto<'_>]) -> String {
    let summary = format!("<p>page <b>{n}</b>: {}</p>\n", photos(shown.len()));
    let up = "../";
    let mut html = head(&summary, up, PHOTOS + 1);
    html.push_str("<nav aria-label=\"Pages\"><a href=\"../index.html\">newest</a>");
    let neighbours =
        [(n < pages, n + 1, "newer", "prev"), (n > 1, n.saturating_sub(1), "older", "next")];
    for (_, other, word, rel) in neighbours.into_iter().filter(|(is, ..)| *is) {
        let _ = write!(html, "<a rel=\"{rel}\" href=\"{up}{}\">{word}</a>", page_address(other));
    }
    html.push_str("</nav>\n");
    cards(&mut html, shown, up);
    foot(html)
}

/// Appends links to the next older page and to all `pages`, newest first.
fn pager(html: &mut String, pages: usize) {
    if pages < 2 {
        return;
    }
    let _ = write!(
        html,
        "<nav aria-label=\"Pages\"><a rel=\"next\" href=\"{}\">older</a>\
         <details><summary>all {pages} pages</summary><div>",
        page_address(pages - 1)
    );
    for n in (1..=pages).rev() {
        let _ = write!(html, "<a href=\"{}\">{n}</a>", page_address(n));
    }
    html.push_str("</div></details></nav>\n");
}

fn cards(html: &mut String, shown: &[GalleryPhoto<'_>], up: &str) {
    if shown.len() > 6 {
        html.push_str("<div class=\"stamps\">\n");
        shown.iter().for_each(|photo| thumbnail(html, photo, up));
        html.push_str("</div>\n");
    }
    html.push_str("<div class=\"cards\">\n");
    shown.iter().for_each(|photo| card(html, photo, up));
    html.push_str("</div>\n");
}

fn head(summary: &str, up: &str, count: usize) -> String {
    format!(
        include_str!("head.html"),
        style = include_str!("page.css"),
        up = up,
        photos = PHOTOS,
        summary = summary,
        search = if count > 6 { include_str!("search.html") } else { "" },
    )
}

fn foot(mut html: String) -> String {
    let _ = write!(
        html,
        "</main>\n<script>\n{}{}</script>\n</body>\n</html>\n",
        include_str!("page.js"),
        include_str!("viewer.js"),
    );
    html
}

fn list(
    html: &mut String,
    title: &str,
    explanation: &str,
    photos: &[Failed],
    folder: Option<&str>,
) {
    if photos.is_empty() {
        return;
    }
    let _ = write!(
        html,
        "<details class=\"aside {}\"{}><summary>{title}: {}</summary>\n<p>{explanation}</p>\
         <ul>\n",
        title.to_lowercase(),
        if photos.len() <= LISTED { " open" } else { "" },
        photos.len()
    );
    for photo in photos {
        let name = escape(&photo.photo);
        // A name that is not UTF-8 has no address.
        let named = match folder.filter(|_| !photo.photo.contains('\u{fffd}')) {
            Some(folder) => {
                format!("<a href=\"{folder}{}\">{name}</a>", address(photo.photo.as_ref()))
            }
            None => format!("<b>{name}</b>"),
        };
        let reason =
            photo.reason.strip_prefix(&format!("{}: ", photo.photo)).unwrap_or(&photo.reason);
        let _ = writeln!(html, "<li>{named} <span>{}</span></li>", escape(reason));
    }
    html.push_str("</ul></details>\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::daemon::report::tests::report;
    use crate::daemon::store::waiting::Waiting;

    fn report_of(photo: &str) -> Report {
        Report {
            photo: photo.to_owned(),
            result: photo.to_owned(),
            result_address: address(photo.as_ref()),
            turned: Some(6),
            notes: vec!["the photo was resampled from 512×384 to the rig's 256×192".into()],
            before: "gallery/1-before.jpg".into(),
            after: "gallery/1-after.jpg".into(),
            ..report(1)
        }
    }

    fn page(
        rig: &str,
        photos: &[GalleryPhoto<'_>],
        failed: &[Failed],
        deferred: &[Failed],
    ) -> String {
        let waiting = Waiting { settling: 2, ..Waiting::default() };
        let mut counts = PhotoCounts { failed: failed.len(), waiting, ..PhotoCounts::default() };
        photos.iter().for_each(|photo| counts.add(photo.report.outcome));
        let (written_unix_s, all) = (0, &[]);
        let overview = Overview { rig, written_unix_s, counts, photos: all, failed, deferred };
        first_page(&overview, photos)
    }

    #[test]
    fn the_page_has_pictures_outcomes_and_failures() {
        let failed = [Failed {
            photo: "b.jpg".into(),
            reason: "b.jpg: the file is empty: found 0 bytes".into(),
        }];
        let report = report_of("a.jpg");
        let photos = [GalleryPhoto {
            report: &report,
            number: 0,
            original: Some("../done/a.jpg".into()),
            scene: None,
        }];
        let html = page("small", &photos, &failed, &[]);
        for wanted in [
            "gallery/1-before.jpg",
            "gallery/1-after.jpg",
            "type=\"range\"",
            "a.jpg",
            "<b>2</b> waiting (2 arriving)",
            "Sharpened with the lens model",
            "hybrid",
            "6.5 s",
            "Confirmed: photographed through the lens again, the result matches your photo",
            "resampled from 512×384",
            "<a href=\"../failed/b.jpg\">b.jpg</a> <span>the file is empty",
            "move it back into <code>inbox</code>",
            "--w:192;--h:256",
            "prefers-color-scheme",
        ] {
            assert!(html.contains(wanted), "{wanted}");
        }
        assert!(!html.contains("http:") && !html.contains("https:"), "nothing from a network");
    }

    #[test]
    fn a_long_list_of_failures_is_folded() {
        let failed: Vec<Failed> = (0..400)
            .map(|n| Failed { photo: format!("{n}.jpg"), reason: "not a photo".into() })
            .collect();
        for (count, open) in [(2, true), (400, false)] {
            let html = page("small", &[], &failed[..count], &[]);
            let list = html.split("<details class=\"aside failed\"").nth(1).unwrap();
            assert_eq!(list.starts_with(" open>"), open);
            assert!(list.contains(&format!("<summary>Failed: {count}</summary>")), "{count}");
        }
    }

    #[test]
    fn hostile_names_are_escaped() {
        let name = "\"><script>alert(1)</script>' onload=x \u{202e}gpj.jpg";
        let failed = [Failed { photo: name.into(), reason: format!("{name}: <img src=x>") }];
        let report = report_of(name);
        let photos = [GalleryPhoto { report: &report, number: 0, original: None, scene: None }];
        let html = page("<b>rig", &photos, &failed, &failed);
        assert_eq!(html.matches("<script>").count(), 2, "the page's own");
        let html = html + &page("small", &[], &[], &[]);
        assert!(
            !html.contains("<img src=x>") && !html.contains("<b>rig") && !html.contains('\u{202e}')
        );
        assert!(!html.contains("\"><script"));
    }
}
