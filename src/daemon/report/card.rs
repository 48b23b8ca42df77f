//! A photo in the gallery: what became of it in a photographer's words, the pictures one over the
//! other, and the numbers one click away.

use std::fmt::Write;

use super::html::{escape, moment, span};
use crate::daemon::store::deliver::is_beyond_preview;
use crate::daemon::store::report_file::{Report, ResultKind, plain};
use crate::deconvolution::stage::ResultStage;
use crate::frame::Size;
use crate::pipeline::Confirmation;

/// A photo with a result, as the pages show it.
pub(super) struct GalleryPhoto<'a> {
    pub(super) report: &'a Report,
    /// Its number among all, the oldest 0: its address on its page.
    pub(super) number: usize,
    /// Address of the original from the outbox, if it is still there.
    pub(super) original: Option<&'a str>,
    /// Address of the scene itself from the outbox, if it is known.
    pub(super) scene: Option<String>,
}

/// The one word of an outcome, by which photos are also told apart in style and search.
pub(super) fn state(kind: ResultKind) -> &'static str {
    match kind {
        ResultKind::Restored => "restored",
        ResultKind::Untouched => "left",
    }
}

/// Width and height of a picture of `size` as a viewer of the photo sees it.
fn seen(report: &Report, size: Size) -> (usize, usize) {
    let (width, height) = (size.width, size.height);
    if report.turned.is_some_and(|tag| tag >= 5) { (height, width) } else { (width, height) }
}

/// The address of the stamp by which one finds a photo.
pub(super) fn stamp_address(report: &Report) -> String {
    report.after.replace("-after.", "-small.")
}

/// What tells the viewer where the picture at the address `preview` is pixel by pixel, if it is
/// elsewhere; `up` leads from the page to the outbox.
fn pixels(report: &Report, preview: &str, up: &str) -> String {
    if !is_beyond_preview(report.size) {
        return String::new();
    }
    format!(" data-pixels=\"{up}{}\"", escape(&preview.replace(".jpg", "-pixels.jpg")))
}

/// The stamp, a link to the card; `up` leads from the page to the outbox.
pub(super) fn stamp(html: &mut String, photo: &GalleryPhoto<'_>, up: &str) {
    let (name, after) = (escape(&photo.report.photo), escape(&photo.report.after));
    let _ = writeln!(
        html,
        "<a href=\"#photo-{}\" title=\"{name}\"><img src=\"{up}{}\" data-large=\"{up}{after}\" \
         alt=\"{name}\" loading=\"lazy\" width=\"160\" height=\"120\"></a>",
        photo.number,
        escape(&stamp_address(photo.report)),
    );
}

/// The card.
pub(super) fn card(html: &mut String, photo: &GalleryPhoto<'_>, up: &str) {
    let &GalleryPhoto { report, number, original, ref scene } = photo;
    let name = escape(&report.photo);
    let (width, height) = seen(report, report.size);
    let (before, after) = (escape(&report.before), escape(&report.after));
    let state = state(report.outcome);
    let result_words = match report.outcome {
        ResultKind::Restored => "restored",
        ResultKind::Untouched => "as it was",
    };
    let result = escape(&report.result_address);
    let _ = write!(
        html,
        "<article id=\"photo-{number}\" data-number=\"{number}\" data-state=\"{state}\" \
         aria-labelledby=\"name-{number}\">\n<div class=\"pair\" \
         style=\"--w:{width};--h:{height}\">\
         <figure class=\"before\"><img src=\"{up}{before}\" alt=\"{name}, the photo\"{} \
         loading=\"lazy\" draggable=\"false\" width=\"{width}\" height=\"{height}\">\
         <figcaption>photo</figcaption></figure>\
         <figure class=\"after\"><img src=\"{up}{after}\" alt=\"{name}, {result_words}\"{} \
         loading=\"lazy\" draggable=\"false\" width=\"{width}\" height=\"{height}\">\
         <figcaption>{result_words}</figcaption></figure>{}<i></i>\
         <input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-valuetext=\"50 % of the \
         photo, 50 % of the result\" aria-label=\"Compare {name} with its result\"></div>\n\
         <h2 id=\"name-{number}\">{name}</h2>\n",
        pixels(report, &report.before, up),
        pixels(report, &report.after, up),
        scene.as_ref().map_or(String::new(), |scene| format!(
            "<figure class=\"scene\"><img src=\"{up}{}\" alt=\"{name}, the scene itself\" \
             loading=\"lazy\" draggable=\"false\" width=\"{width}\" height=\"{height}\">\
             <figcaption>the scene itself</figcaption></figure>",
            escape(scene)
        )),
    );
    if is_smaller(report) {
        let _ = writeln!(
            html,
            "<p class=\"smaller\">Smaller than the photo: {} instead of {} pixels.</p>",
            report.size, report.stored,
        );
    }
    let _ = writeln!(html, "<p class=\"state\">{}</p>", escape(&outcome_words(report)));
    if report.outcome == ResultKind::Untouched && report.size.area() < report.stored.area() {
        let _ = writeln!(
            html,
            "<p class=\"quiet\">Shown here at {}; the file is as it was, {} pixels.</p>",
            report.size, report.stored,
        );
    }
    if let Some((class, words)) = confirmation_words(report) {
        let _ = writeln!(html, "<p class=\"certificate {class}\">{words}</p>");
    }
    html.push_str("<p class=\"links\">");
    if let Some(original) = original {
        let _ = write!(
            html,
            "<a href=\"{up}{}\" download target=\"_blank\">Download original<span> of \
             {name}</span></a>",
            escape(original)
        );
    }
    let _ = writeln!(
        html,
        "<a href=\"{up}{result}\" download target=\"_blank\">Download result<span> of \
         {name}</span></a></p>\n\
         <details><summary>Numbers<span> of {name}</span></summary>\n{}</details>\n</article>",
        numbers(photo, up),
    );
}

fn is_smaller(report: &Report) -> bool {
    report.outcome == ResultKind::Restored && report.size.area() < report.stored.area()
}

/// What was done, or why nothing was.
fn outcome_words(report: &Report) -> String {
    let by = match (report.outcome, report.stage, &report.certificate) {
        (ResultKind::Untouched, ..) => {
            return format!("Left as it was, because {}.", plain(&report.reason));
        }
        (_, ResultStage::Photo | ResultStage::LensModel, _) => "with the lens model",
        (_, _, Some(_)) => "with the lens model, and corrected by light",
        (_, _, None) => "by light alone",
    };
    format!("Sharpened {by}.")
}

/// What the photograph of the result says, and the mark beside it.
fn confirmation_words(report: &Report) -> Option<(&'static str, String)> {
    if report.outcome == ResultKind::Untouched {
        return None;
    }
    let Some(certificate) = &report.certificate else {
        return Some(("none", "Not confirmed: it was not photographed again.".to_owned()));
    };
    let (mark, said) = match certificate.confirmation() {
        Confirmation::Full => {
            ("good", "Confirmed by light: photographed through the lens again, it is your photo")
        }
        Confirmation::Noisy => (
            "fair",
            "Photographed through the lens again, it is your photo as far as its strong noise lets \
             one see",
        ),
        Confirmation::Nearly => (
            "fair",
            "Nearly confirmed by light: photographed through the lens again, it is nearly your \
             photo",
        ),
        Confirmation::Not => (
            "poor",
            "Not confirmed by light: photographed through the lens again, it still differs from \
             your photo",
        ),
    };
    Some((mark, format!("{said}{}.", certificate.proviso())))
}

/// What is one click away.
fn numbers(photo: &GalleryPhoto<'_>, up: &str) -> String {
    let report = photo.report;
    let size = match report.outcome {
        ResultKind::Restored => report.size,
        ResultKind::Untouched => report.stored,
    };
    let (width, height) = seen(report, size);
    let mut rows = vec![
        ("finished", moment(report.finished_unix_s)),
        ("took", span(report.seconds)),
        ("size", format!("{width}×{height} pixels")),
        ("method", escape(&report.method)),
        ("photographs taken", report.captures.to_string()),
        ("file", escape(&report.result)),
        ("why so", escape(&report.reason)),
    ];
    if let Some(certificate) = &report.certificate {
        rows.push(("difference between its photograph and the photo", certificate.words()));
    }
    let mut html = String::from("<dl>");
    for (what, value) in rows {
        let _ = write!(html, "<dt>{what}</dt><dd>{value}</dd>");
    }
    html.push_str("</dl>\n");
    for note in &report.notes {
        let _ = writeln!(html, "<p>{}</p>", escape(note));
    }
    let again = match photo.original {
        Some(original) => format!(
            "To restore it again, move <a href=\"{up}{}\">its original</a> from the folder \
             <code>done</code> into <code>inbox</code>.",
            escape(original)
        ),
        None => "Its original is no longer in the folder <code>done</code>.".to_owned(),
    };
    let _ = writeln!(
        html,
        "<p>{again} The whole record: <a href=\"{up}{}.json\">report</a>.</p>",
        escape(&report.result_address)
    );
    html
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::daemon::report::tests::report;
    use crate::pipeline::{CertifiedFocus, OpticalResidual};

    fn card_of(report: &Report) -> String {
        let mut html = String::new();
        card(
            &mut html,
            &GalleryPhoto {
                report,
                number: 3,
                original: Some("../done/a.jpg"),
                scene: Some("../scenes/a.jpg".into()),
            },
            "../",
        );
        html
    }

    /// What is read without a click.
    fn in_plain_sight(html: &str) -> &str {
        html.split("<details>").next().unwrap()
    }

    #[test]
    fn a_photographer_understands_what_became_of_a_photo() {
        for (stage, kind, certificate, wanted) in [
            (
                ResultStage::Captures,
                ResultKind::Restored,
                Some(1.13),
                "Sharpened with the lens model, and corrected by",
            ),
            (
                ResultStage::LensModel,
                ResultKind::Restored,
                Some(1.13),
                "Sharpened with the lens model.</p>",
            ),
            (
                ResultStage::LensModel,
                ResultKind::Restored,
                None,
                "Not confirmed: it was not photographed again",
            ),
            (ResultStage::LensModel, ResultKind::Restored, Some(1.6), "Nearly confirmed by light"),
            (ResultStage::Captures, ResultKind::Restored, Some(4.0), "Not confirmed by light"),
            (
                ResultStage::Photo,
                ResultKind::Untouched,
                None,
                "Left as it was, because it is sharp.</p>",
            ),
        ] {
            let mut report = report(1);
            (report.stage, report.outcome) = (stage, kind);
            report.reason = "it is sharp (3.1 times its noise is left)".into();
            report.notes = vec!["noise of the photo: 1.20 grey levels".into()];
            report.certificate = certificate.map(|residual_grey_levels| OpticalResidual {
                focus: CertifiedFocus::Photo,
                residual_grey_levels,
                floor_grey_levels: 1.0,
            });
            let html = card_of(&report);
            let seen = in_plain_sight(&html);
            assert!(seen.contains(wanted), "{seen}");
            for jargon in ["stage", "grey level", "residual", "3.1", "capture", "hybrid"] {
                assert!(!seen.contains(jargon), "{jargon}: {seen}");
            }
            assert!(html.contains("3.1 times its noise") && html.contains("hybrid"), "{html}");
        }
    }

    #[test]
    fn agreement_within_strong_noise_is_no_confirmation() {
        let mut report = report(1);
        report.certificate = Some(OpticalResidual {
            focus: CertifiedFocus::Photo,
            residual_grey_levels: 75.24,
            floor_grey_levels: 75.42,
        });
        let html = card_of(&report);
        assert!(!html.contains("certificate good") && html.contains("strong noise"), "{html}");
        // Two numbers of which the larger is the good one would be read the wrong way round.
        assert!(!html.contains("75."), "{html}");
    }

    #[test]
    fn a_confirmation_at_the_panel_s_focus_says_on_what_it_holds() {
        let proviso = "if the scene was as far away as the panel";
        let mut report = report(1);
        for (residual_grey_levels, focus, told) in [
            (1.0, CertifiedFocus::Photo, false),
            (1.0, CertifiedFocus::Panel, true),
            (1.6, CertifiedFocus::Panel, true),
            (4.0, CertifiedFocus::Panel, false),
        ] {
            let of = OpticalResidual { residual_grey_levels, floor_grey_levels: 1.0, focus };
            report.certificate = Some(of);
            let html = card_of(&report);
            assert_eq!(in_plain_sight(&html).contains(proviso), told, "{of:?}");
            assert_eq!(of.meaning().contains(proviso), told, "{of:?}");
        }
    }

    #[test]
    fn a_result_that_is_smaller_says_so_first() {
        let mut report = report(1);
        assert!(!card_of(&report).contains("Smaller"));
        report.stored = Size::new(4000, 3000);
        let html = card_of(&report);
        assert!(html.contains("Smaller than the photo: 256×192 instead of 4000×3000 pixels"));
        assert!(html.find("Smaller") < html.find("Sharpened"));
        assert!(html.contains("<dd>256×192 pixels</dd>"), "{html}");
        // What was left as it was is as large as it was.
        report.outcome = ResultKind::Untouched;
        let html = card_of(&report);
        assert!(html.contains("<dd>4000×3000 pixels</dd>") && !html.contains("Smaller"), "{html}");
        assert!(html.contains("at 256×192; the file is as it was, 4000×3000"), "{html}");
    }

    #[test]
    fn the_pixels_of_large_pictures_are_told_to_the_viewer() {
        let mut report = report(1);
        assert!(!card_of(&report).contains("data-pixels"));
        report.size = Size::new(1440, 1080);
        let html = card_of(&report);
        for what in ["before", "after"] {
            let wanted = format!("data-pixels=\"../gallery/a-{what}-pixels.jpg\"");
            assert!(html.contains(&wanted), "{html}");
        }
    }

    #[test]
    fn original_and_result_are_a_click_away_and_the_slider_speaks() {
        let html = card_of(&report(1));
        for wanted in [
            "<a href=\"../../done/a.jpg\" download target=\"_blank\">Download original",
            "<a href=\"../photo%200001.jpg\" download target=\"_blank\">Download result",
            "<figure class=\"scene\"><img src=\"../../scenes/a.jpg\"",
            "move <a href=\"../../done/a.jpg\">its original</a>",
            "aria-valuetext=\"50 %",
            "<time datetime=\"2023-11-14T22:13:27Z\" data-unix=\"1700000007\">2023-11-14 22:13 UTC",
        ] {
            assert!(html.contains(wanted), "{wanted}: {html}");
        }
    }
}
