//! The gallery's HTML. Whatever comes from a file's name or an error is escaped.

use std::ffi::OsStr;

use super::charts;
use crate::daemon::store::limits::Removed;
use crate::daemon::store::pilots::PilotEntry;
use crate::daemon::store::report_file::{Failed, Report, ResultKind};

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
    /// All photos with a result.
    pub(super) reports: &'a [Report],
    pub(super) failed: &'a [Failed],
    pub(super) left: &'a [Failed],
    /// What the operator should know, a sentence each.
    pub(super) attention: &'a [String],
    pub(super) removed: Removed,
    pub(super) pilots: &'a [PilotEntry],
    pub(super) now_unix_s: u64,
}

/// The first page: the summary, the charts, what was not restored, and the newest photos.
pub(super) fn first_page(overview: &Overview<'_>) -> String {
    let &Overview { rig, reports, failed, left, attention, removed, pilots, now_unix_s } = overview;
    let restored = reports.iter().filter(|r| r.outcome == ResultKind::Restored).count();
    let mut counts = vec![format!("<b>{restored}</b> restored")];
    for (n, words) in [
        (reports.len() - restored, "left as they were"),
        (failed.len(), "not restored"),
        (left.len(), "waiting"),
    ] {
        if n > 0 {
            counts.push(format!("<b>{n}</b> {words}"));
        }
    }
    let summary = format!(
        "<p>{} · rig {} · <time data-unix=\"{now_unix_s}\"></time> · <a \
         href=\"gallery/report.json\">as data</a></p>\n",
        counts.join(" · "),
        escape(rig),
    );
    let pages = reports.len().div_ceil(PHOTOS);
    let mut html = head(&summary, "", reports.len() > 12);
    for words in attention {
        html.push_str(&format!(
            "<p class=\"attention\">Attention: {}.</p>\n",
            escape(words.trim_end_matches('.'))
        ));
    }
    list(&mut html, "Not restored", "in the folder <code>failed</code>, unchanged", failed);
    list(&mut html, "Waiting", "still in the inbox, to be tried again", left);
    html.push_str(&charts::charts(reports, pilots));
    if reports.is_empty() {
        html.push_str(
            "<p class=\"empty\">No photo has been restored yet. Drop one into the inbox.</p>\n",
        );
    }
    pager(&mut html, pages);
    if removed != Removed::default() {
        html.push_str(&format!(
            "<p class=\"removed\">Removed by the limits of this box so far: {} of the results, {} \
             of the originals, {} MiB; the last \
             <time data-unix=\"{}\"></time>.</p>\n",
            removed.results,
            removed.originals,
            removed.bytes >> 20,
            removed.last_unix_s,
        ));
    }
    photos(&mut html, reports.iter().take(PHOTOS));
    foot(html)
}

/// The `n`-th page, from 1 with the oldest photos, of `pages`, with these `reports`. It names its
/// neighbours only, so that it does not change with every page that is added.
pub(super) fn photo_page(rig: &str, n: usize, pages: usize, reports: &[Report]) -> String {
    let summary = format!("<p>rig {} · page <b>{n}</b></p>\n", escape(rig));
    // Addresses are those of the first page, which lies one folder up.
    let mut html = head(&summary, "<base href=\"../\">\n", reports.len() > 12);
    html.push_str("<nav><a href=\"index.html\">newest</a>");
    let neighbours = [(n < pages, n + 1, "newer"), (n > 1, n.saturating_sub(1), "older")];
    for (_, other, word) in neighbours.into_iter().filter(|(is, ..)| *is) {
        html.push_str(&format!("<a href=\"{}\">{word}</a>", page_address(other)));
    }
    html.push_str("</nav>\n");
    photos(&mut html, reports.iter());
    foot(html)
}

/// Links to all pages, the newest first.
fn pager(html: &mut String, pages: usize) {
    if pages < 2 {
        return;
    }
    html.push_str("<nav><a href=\"index.html\" aria-current=\"page\">newest</a>");
    for n in (1..=pages).rev() {
        html.push_str(&format!("<a href=\"{}\">{n}</a>", page_address(n)));
    }
    html.push_str("</nav>\n");
}

/// The photos' small pictures, and a card for each.
fn photos<'a>(html: &mut String, reports: impl Iterator<Item = &'a Report> + Clone) {
    if reports.clone().count() > 6 {
        html.push_str("<div class=\"small\">\n");
        for (n, report) in reports.clone().enumerate() {
            let name = escape(&report.photo);
            let (small, large) =
                (escape(&report.after.replace("-after.", "-small.")), escape(&report.after));
            html.push_str(&format!(
                "<a href=\"#photo-{n}\" title=\"{name}\" \
                 onclick=\"document.getElementById('photo-{n}').scrollIntoView();return \
                 false\"><img src=\"{small}\" data-large=\"{large}\" alt=\"{name}\" \
                 loading=\"lazy\"></a>\n"
            ));
        }
        html.push_str("</div>\n");
    }
    html.push_str("<div class=\"cards\">\n");
    for (n, report) in reports.enumerate() {
        card(html, n, report);
    }
    html.push_str("</div>\n");
}

fn foot(mut html: String) -> String {
    html.push_str("</main>\n<script>\n");
    html.push_str(include_str!("page.js"));
    html.push_str("</script>\n</body>\n</html>\n");
    html
}

fn head(summary: &str, base: &str, find: bool) -> String {
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>relens: restored \
         photos</title>\n{base}\
         <style>\n{}</style>\n</head>\n<body>\n<header>\n<h1>relens</h1>\n{summary}",
        include_str!("page.css"),
    );
    if find {
        html.push_str(
            "<input id=\"find\" type=\"search\" placeholder=\"Find a name on this page\" \
             aria-label=\"Find a name on this page\">\n",
        );
    }
    html.push_str("</header>\n<main>\n");
    html
}

fn list(html: &mut String, title: &str, where_they_are: &str, photos: &[Failed]) {
    if photos.is_empty() {
        return;
    }
    html.push_str(&format!(
        "<details class=\"aside\" open><summary>{title}: {} \
         <span>{where_they_are}</span></summary>\n<ul>\n",
        photos.len()
    ));
    for photo in photos {
        let name = escape(&photo.photo);
        let reason =
            photo.reason.strip_prefix(&format!("{}: ", photo.photo)).unwrap_or(&photo.reason);
        html.push_str(&format!("<li><b>{name}</b> {}</li>\n", escape(reason)));
    }
    html.push_str("</ul></details>\n");
}

fn card(html: &mut String, n: usize, report: &Report) {
    let name = escape(&report.photo);
    let (mut width, mut height) = (report.size.width, report.size.height);
    if report.turned.is_some_and(|tag| tag >= 5) {
        (width, height) = (height, width);
    }
    html.push_str(&format!(
        "<article id=\"photo-{n}\" data-name=\"{}\">\n<div class=\"pair\" \
         style=\"aspect-ratio:{width}/{height}\">\n\
         <img src=\"{}\" alt=\"{name}, restored\" loading=\"lazy\" draggable=\"false\">\n\
         <img class=\"before\" src=\"{}\" alt=\"{name}, as it was\" loading=\"lazy\" \
         draggable=\"false\">\n\
         <span class=\"tag left\">photo</span><span class=\"tag right\">{}</span><i></i>\n\
         <input type=\"range\" min=\"0\" max=\"100\" step=\"0.5\" value=\"50\" aria-label=\"How \
         much of {name} to show as it was\">\n\
         </div>\n",
        escape(&report.photo.to_lowercase()),
        escape(&report.after),
        escape(&report.before),
        if report.outcome == ResultKind::Restored { "restored" } else { "left as it was" },
    ));
    let captures = match report.captures {
        0 => "no capture".to_owned(),
        1 => "1 capture".to_owned(),
        n => format!("{n} captures"),
    };
    html.push_str(&format!(
        "<h2><a href=\"{}\">{name}</a><button type=\"button\" class=\"wide\" title=\"Large or \
         small\" aria-label=\"Show {name} large or small\">⤢</button></h2>\n\
         <p class=\"facts\"><span title=\"{}\">rung {}: {}</span> · {} · {captures} · {}</p>\n",
        escape(&report.result_address),
        escape(&report.rung_reason),
        report.rung,
        rung_words(report.rung),
        escape(&report.method),
        seconds(report.seconds),
    ));
    match &report.certificate {
        Some(certificate) => html.push_str(&format!(
            "<p class=\"certificate {}\">{} <small>residual {:.2} grey levels; noise alone \
             {:.2}</small></p>\n",
            match certificate.ratio() {
                r if r <= 1.25 => "good",
                r if r <= 2.0 => "fair",
                _ => "poor",
            },
            certificate.meaning(),
            certificate.residual_grey_levels,
            certificate.floor_grey_levels,
        )),
        None => html.push_str(
            "<p class=\"certificate none\">Not photographed again, so not \
         certified.</p>\n",
        ),
    }
    if !report.notes.is_empty() {
        html.push_str("<ul class=\"notes\">");
        for note in &report.notes {
            html.push_str(&format!("<li>{}</li>", escape(note)));
        }
        html.push_str("</ul>\n");
    }
    html.push_str(&format!(
        "<p class=\"more\"><time data-unix=\"{}\"></time> · {width}×{height} · <a \
         href=\"{}.json\">report</a></p>\n</article>\n",
        report.finished_unix_s,
        escape(&report.result_address),
    ));
}

/// The design's ladder in a customer's words.
fn rung_words(rung: u8) -> &'static str {
    match rung {
        0 => "left as it was",
        1 => "one blur for the whole photo",
        2 => "the lens model",
        _ => "the lens model and the lens itself",
    }
}

fn seconds(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 99.5 => format!("{s:.0} s"),
        s => format!("{:.0} min", s / 60.0),
    }
}

/// Text for HTML, in content as in quoted attributes. Control characters are shown, not obeyed.
fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Bidirectional overrides make a name read as another one.
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => safe.push('\u{fffd}'),
            c if c.is_control() => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;
    use crate::pipeline::OpticalResidual;

    fn report(photo: &str) -> Report {
        Report {
            photo: photo.to_owned(),
            result: photo.to_owned(),
            result_address: crate::daemon::store::report_file::address(photo.as_ref()),
            outcome: ResultKind::Restored,
            rig: "small".into(),
            method: "hybrid".into(),
            rung: 3,
            rung_reason: "glare".into(),
            captures: 1,
            seconds: 4.31,
            certificate: Some(OpticalResidual {
                residual_grey_levels: 1.13,
                floor_grey_levels: 1.0,
            }),
            meaning: None,
            size: Size::new(256, 192),
            stored: Size::new(256, 192),
            curve: "sRGB".into(),
            grey: false,
            turned: Some(6),
            notes: vec!["the photo was resampled from 512×384 to the rig's 256×192".into()],
            iterations: Vec::new(),
            photo_crc32: "0".into(),
            photo_bytes: 1,
            finished_unix_s: 1_700_000_000,
            before: "gallery/1-before.jpg".into(),
            after: "gallery/1-after.jpg".into(),
        }
    }

    fn overview<'a>(
        rig: &'a str,
        reports: &'a [Report],
        failed: &'a [Failed],
        left: &'a [Failed],
    ) -> Overview<'a> {
        Overview {
            rig,
            reports,
            failed,
            left,
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
        let html = first_page(&overview("small", &[report("a.jpg")], &failed, &[]));
        for wanted in [
            "gallery/1-before.jpg",
            "gallery/1-after.jpg",
            "type=\"range\"",
            "a.jpg",
            "rung 3",
            "hybrid",
            "1 capture",
            "4.3 s",
            "this picture is your photo",
            "residual 1.13",
            "resampled from 512×384",
            "<b>b.jpg</b> the file is empty",
            "aspect-ratio:192/256",
            "prefers-color-scheme",
        ] {
            assert!(html.contains(wanted), "{wanted}");
        }
        assert!(!html.contains("http:") && !html.contains("https:"), "nothing from a network");
    }

    #[test]
    fn hostile_names_stay_words() {
        let name = "\"><script>alert(1)</script>' onload=x \u{202e}gpj.jpg";
        let failed = [Failed { photo: name.into(), reason: format!("{name}: <img src=x>") }];
        let html = first_page(&overview("<b>rig", &[report(name)], &failed, &failed));
        assert_eq!(html.matches("<script>").count(), 1, "the page's own");
        let overview = Overview {
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
