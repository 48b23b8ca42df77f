//! The gallery's pages. They work from a disk, without a server, a network or scripts.

use std::ffi::OsStr;
use std::fmt::Write;

use super::card::{GalleryPhoto, card, stamp};
use super::charts;
use super::html::{escape, moment, photos};
use crate::daemon::store::limits::Removed;
use crate::daemon::store::pilots::PilotEntry;
use crate::daemon::store::report_file::{Failed, ResultKind, address};
use crate::daemon::store::waiting::Waiting;

/// Photos without a result that are listed at once; more are a click away.
const LISTED: usize = 5;

/// Photos on one page.
pub(super) const PHOTOS: usize = 60;

/// Address of the `n`-th page, from 1, of `pages`, from the outbox.
pub(super) fn page_address(n: usize) -> String {
    format!("gallery/photos-{n}.html")
}

/// The number of the photo page whose file is called `name`.
pub(super) fn number(name: &OsStr) -> Option<usize> {
    name.to_str()?.strip_prefix("photos-")?.strip_suffix(".html")?.parse().ok()
}

/// Everything the first page says beside its photos.
pub(super) struct Overview<'a> {
    pub(super) rig: &'a str,
    /// All photos with a result, newest first.
    pub(super) photos: &'a [GalleryPhoto<'a>],
    pub(super) failed: &'a [Failed],
    pub(super) left: &'a [Failed],
    /// Photos that wait, those left among them.
    pub(super) waiting: Waiting,
    /// Where the line is that says what the box is doing, if it is.
    pub(super) now: Option<&'a str>,
    /// What the operator should know, a sentence each.
    pub(super) attention: &'a [String],
    pub(super) removed: Removed,
    pub(super) pilots: &'a [PilotEntry],
    pub(super) now_unix_s: u64,
}

/// The first page: the counts, what failed, the newest photos, and how the night went.
pub(super) fn first_page(overview: &Overview<'_>) -> String {
    let &Overview { rig, photos: all, failed, left, waiting, .. } = overview;
    let &Overview { attention, removed, pilots, now_unix_s, .. } = overview;
    let restored = all.iter().filter(|p| p.report.outcome == ResultKind::Restored).count();
    let as_were = all.len() - restored;
    let mut counts = vec![format!("<b>{restored}</b> restored")];
    let waiting_words = waiting.to_string();
    for (n, words) in [
        (as_were, if as_were == 1 { "left as it was" } else { "left as they were" }),
        (failed.len(), "failed"),
        (waiting.all(), waiting_words.split_once(' ').map_or("waiting", |(_, words)| words)),
    ] {
        if n > 0 {
            counts.push(format!("<b>{n}</b> {words}"));
        }
    }
    let mut html = head(&format!("<p>{}</p>\n", counts.join(" · ")), "", all.len());
    if let Some(now) = overview.now {
        let _ = writeln!(
            html,
            "<iframe class=\"now\" title=\"What the box is doing\" src=\"{now}\"></iframe>"
        );
    }
    for words in attention {
        let _ = writeln!(
            html,
            "<p class=\"attention\">Attention: {}.</p>",
            escape(words.trim_end_matches('.'))
        );
    }
    let failed_are = "They lie unchanged in the folder <code>failed</code>. To try one again, move \
                      it back into <code>inbox</code>.";
    list(&mut html, "Failed", failed_are, failed, Some("../failed/"));
    let left_are = "They are still in the folder <code>inbox</code>, and are tried again.";
    list(&mut html, "Waiting", left_are, left, None);
    if all.is_empty() {
        html.push_str(
            "<p class=\"empty\">No photo has been restored yet. Drop one into the inbox.</p>\n",
        );
    }
    let pages = all.len().div_ceil(PHOTOS);
    pager(&mut html, pages);
    cards(&mut html, &all[..all.len().min(PHOTOS)], "");
    html.push_str(&charts::charts(all, pilots));
    html.push_str(HELP);
    if removed != Removed::default() {
        let _ = writeln!(
            html,
            "<p class=\"quiet\">Removed by the limits of this box so far: {} of the results, {} \
             of the originals, {} MiB; the last {}.</p>",
            removed.results,
            removed.originals,
            removed.bytes >> 20,
            moment(removed.last_unix_s),
        );
    }
    let _ = writeln!(
        html,
        "<p class=\"quiet\">Written {} by the rig {}. The same <a \
         href=\"gallery/report.json\">as data</a>.</p>",
        moment(now_unix_s),
        escape(rig),
    );
    foot(html)
}

/// The `n`-th page, from 1 with the oldest photos, of `pages`, with these photos, newest first. It
/// names its neighbours only, so that it does not change with every page that is added.
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

/// Links to the page where the first photo is that is not on this one, and to all `pages`, the
/// newest first.
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

/// The photos' stamps, and a card for each.
fn cards(html: &mut String, shown: &[GalleryPhoto<'_>], up: &str) {
    if shown.len() > 6 {
        html.push_str("<div class=\"stamps\">\n");
        shown.iter().for_each(|photo| stamp(html, photo, up));
        html.push_str("</div>\n");
    }
    html.push_str("<div class=\"cards\">\n");
    shown.iter().for_each(|photo| card(html, photo, up));
    html.push_str("</div>\n");
}

/// What a photographer may ask of the page.
const HELP: &str = "<details class=\"aside\"><summary>What the words mean, how to fetch all, how \
    to try again</summary>\n<dl>\
    <dt>Sharpened with the lens model</dt><dd>The box has measured how its lens blurs, and has \
    undone that.</dd>\
    <dt>Corrected by light</dt><dd>It has shown the result on its panel, photographed it through \
    the lens, and mended what differed from your photo.</dd>\
    <dt>Confirmed by light</dt><dd>The photograph of the result is your photo, but for noise. \
    Nearly confirmed: but for a little more. Not confirmed: it differs, or none was taken.</dd>\
    <dt>Left as it was</dt><dd>The box could not have made it better; the result is your file \
    itself.</dd>\
    <dt>Full screen</dt><dd>Left and right lead to the next photo. + and \u{2212} zoom, 1 is its \
    pixels, 0 the whole; up, down, and left and right with Shift move what is seen.</dd>\
    <dt>To fetch all</dt><dd>Every result is a file in the folder <code>outbox</code>, under the \
    name of its photo (a number is added where that is taken, and a raw photo's ends in \
    <code>.tif</code>): copy them from there, or mark them and let the file manager compress them \
    into one archive.</dd>\
    <dt>To try again</dt><dd>Move the original from the folder <code>done</code>, or from \
    <code>failed</code>, back into <code>inbox</code>. The earlier result stays.</dd></dl>\
    </details>\n";

fn head(summary: &str, up: &str, count: usize) -> String {
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>relens: restored \
         photos</title>\n<style>\n{}</style>\n\
         <script>document.documentElement.className = \"js\";</script>\n</head>\n\
         <body data-up=\"{up}\" data-page=\"{PHOTOS}\">\n<header>\n<h1>relens</h1>\n{summary}",
        include_str!("page.css"),
    );
    if count > 6 {
        html.push_str(
            "<form id=\"find\" role=\"search\"><input type=\"search\" placeholder=\"Find a name\" \
             aria-label=\"Find a photo by its name\">\
             <button type=\"button\" data-state=\"\" aria-pressed=\"true\">All</button>\
             <button type=\"button\" data-state=\"restored\" aria-pressed=\"false\">Restored\
             </button><button type=\"button\" data-state=\"left\" aria-pressed=\"false\">Left as \
             they were</button></form>\n",
        );
    }
    html.push_str("</header>\n<main>\n<div id=\"found\" hidden></div>\n");
    html
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
    where_they_are: &str,
    photos: &[Failed],
    folder: Option<&str>,
) {
    if photos.is_empty() {
        return;
    }
    let _ = write!(
        html,
        "<details class=\"aside {}\"{}><summary>{title}: {}</summary>\n<p>{where_they_are}</p>\
         <ul>\n",
        title.to_lowercase(),
        if photos.len() <= LISTED { " open" } else { "" },
        photos.len()
    );
    for photo in photos {
        let name = escape(&photo.photo);
        // A name that is no text has no address here.
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
    use crate::daemon::store::report_file::Report;

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

    fn overview<'a>(
        rig: &'a str,
        photos: &'a [GalleryPhoto<'a>],
        failed: &'a [Failed],
        left: &'a [Failed],
    ) -> Overview<'a> {
        Overview {
            rig,
            photos,
            failed,
            left,
            waiting: Waiting { settling: 2, ..Waiting::default() },
            now: None,
            attention: &[],
            removed: Removed::default(),
            pilots: &[],
            now_unix_s: 0,
        }
    }

    #[test]
    fn the_page_says_all_that_a_customer_asks() {
        let failed = [Failed {
            photo: "b.jpg".into(),
            reason: "b.jpg: the file is empty: found 0 bytes".into(),
        }];
        let report = report_of("a.jpg");
        let photos = [GalleryPhoto {
            report: &report,
            number: 0,
            original: Some("../done/a.jpg"),
            scene: None,
        }];
        let html = first_page(&overview("small", &photos, &failed, &[]));
        for wanted in [
            "gallery/1-before.jpg",
            "gallery/1-after.jpg",
            "type=\"range\"",
            "a.jpg",
            "<b>2</b> waiting (2 settling)",
            "Sharpened with the lens model",
            "hybrid",
            "6.5 s",
            "Confirmed by light: photographed through the lens again, it is your photo",
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
    fn many_that_failed_are_counted_and_leave_the_page_to_the_photos() {
        let failed: Vec<Failed> = (0..400)
            .map(|n| Failed { photo: format!("{n}.jpg"), reason: "it is no photo".into() })
            .collect();
        for (count, open) in [(2, true), (400, false)] {
            let html = first_page(&overview("small", &[], &failed[..count], &[]));
            let list = html.split("<details class=\"aside failed\"").nth(1).unwrap();
            assert_eq!(list.starts_with(" open>"), open);
            assert!(list.contains(&format!("<summary>Failed: {count}</summary>")), "{count}");
        }
    }

    #[test]
    fn hostile_names_stay_words() {
        let name = "\"><script>alert(1)</script>' onload=x \u{202e}gpj.jpg";
        let failed = [Failed { photo: name.into(), reason: format!("{name}: <img src=x>") }];
        let report = report_of(name);
        let photos = [GalleryPhoto { report: &report, number: 0, original: None, scene: None }];
        let html = first_page(&overview("<b>rig", &photos, &failed, &failed));
        assert_eq!(html.matches("<script>").count(), 2, "the page's own");
        let overview = Overview {
            now: Some("gallery/now.html"),
            attention: &["no photo was restored: <img src=x>".to_owned()],
            ..overview("small", &[], &[], &[])
        };
        let html = html + &first_page(&overview);
        assert!(html.contains("Attention: no photo was restored: &lt;img"));
        assert!(
            !html.contains("<img src=x>") && !html.contains("<b>rig") && !html.contains('\u{202e}')
        );
        assert!(!html.contains("\"><script"));
    }
}
