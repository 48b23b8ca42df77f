//! A photo in the gallery: outcome, pictures one over the other, details one click away.

use std::fmt::Write;

use super::html::{escape, moment, span};
use crate::daemon::store::deliver::is_beyond_preview;
use crate::daemon::store::names::{full_size_address, thumbnail_address};
use crate::daemon::store::report_file::{RelativeRect, Report, ResultKind, without_numbers};
use crate::deconvolution::stage::ResultStage;
use crate::frame::Size;
use crate::pipeline::Confirmation;

pub(super) struct GalleryPhoto<'a> {
    pub(super) report: &'a Report,
    /// Number of the photo, 0 for the oldest; part of its address.
    pub(super) number: usize,
    /// Address of the original relative to the outbox, if it still exists.
    pub(super) original: Option<String>,
    /// Address of the true scene relative to the outbox, if known.
    pub(super) scene: Option<String>,
}

/// Keyword of an outcome for style and search.
pub(super) fn state(kind: ResultKind) -> &'static str {
    match kind {
        ResultKind::Restored => "restored",
        ResultKind::Untouched => "unchanged",
    }
}

/// Width and height of a picture of `size`, turned by the photo's EXIF orientation.
fn displayed_size(report: &Report, size: Size) -> (usize, usize) {
    let (width, height) = (size.width, size.height);
    if report.turned.is_some_and(|tag| tag >= 5) { (height, width) } else { (width, height) }
}

/// Attribute with the address of the full-size picture of `preview`, if there is one; `up` leads
/// from the page to the outbox.
fn full_size_attribute(report: &Report, preview: &str, up: &str) -> String {
    if !is_beyond_preview(report.size) {
        return String::new();
    }
    format!(" data-pixels=\"{up}{}\"", escape(&full_size_address(preview)))
}

/// Appends the thumbnail, a link to the card; `up` leads from the page to the outbox.
pub(super) fn thumbnail(html: &mut String, photo: &GalleryPhoto<'_>, up: &str) {
    let (name, after) = (escape(&photo.report.photo), escape(&photo.report.after));
    let _ = writeln!(
        html,
        "<a href=\"#photo-{}\" title=\"{name}\"><img src=\"{up}{}\" data-large=\"{up}{after}\" \
         alt=\"{name}\" loading=\"lazy\" width=\"160\" height=\"120\"></a>",
        photo.number,
        escape(&thumbnail_address(&photo.report.after)),
    );
}

/// Appends the card; `up` leads from the page to the outbox.
pub(super) fn card(html: &mut String, photo: &GalleryPhoto<'_>, up: &str) {
    let &GalleryPhoto { report, number, ref original, .. } = photo;
    let name = escape(&report.photo);
    pair(html, photo, up);
    let _ = writeln!(html, "<h2 id=\"name-{number}\">{name}</h2>");
    let is_smaller = report.size.area() < report.stored.area();
    if is_smaller && report.outcome == ResultKind::Restored {
        let _ = writeln!(
            html,
            "<p class=\"smaller\">Smaller than the photo: {} instead of {} pixels.</p>",
            report.size, report.stored,
        );
    }
    let _ = writeln!(html, "<p class=\"state\">{}</p>", escape(&describe_outcome(report)));
    if is_smaller && report.outcome == ResultKind::Untouched {
        let _ = writeln!(
            html,
            "<p class=\"quiet\">Shown here at {}; the file is unchanged, {} pixels.</p>",
            report.size, report.stored,
        );
    }
    if !report.left_as_they_were.is_empty() {
        html.push_str(
            "<p class=\"quiet\">Outlined parts are unchanged: this lens cannot have taken them. \
             They may be a date stamp, a reflection or a retouched place.</p>\n",
        );
    }
    if let Some((class, words)) = describe_confirmation(report) {
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
        "<a href=\"{up}{}\" download target=\"_blank\">Download result<span> of \
         {name}</span></a></p>\n\
         <details><summary>Details<span> of {name}</span></summary>\n{}</details>\n</article>",
        escape(&report.result_address),
        details(photo, up),
    );
}

/// Appends the beginning of the card: photo and result, one over the other.
fn pair(html: &mut String, photo: &GalleryPhoto<'_>, up: &str) {
    let &GalleryPhoto { report, number, ref scene, .. } = photo;
    let name = escape(&report.photo);
    let (width, height) = displayed_size(report, report.size);
    let (before, after) = (escape(&report.before), escape(&report.after));
    let state = state(report.outcome);
    let _ = writeln!(
        html,
        "<article id=\"photo-{number}\" data-number=\"{number}\" data-state=\"{state}\" \
         aria-labelledby=\"name-{number}\">\n<div class=\"pair\" \
         style=\"--w:{width};--h:{height}\">\
         <figure class=\"before\"><img src=\"{up}{before}\" alt=\"{name}, the photo\"{} \
         loading=\"lazy\" draggable=\"false\" width=\"{width}\" height=\"{height}\">\
         <figcaption>photo</figcaption></figure>\
         <figure class=\"after\"><img src=\"{up}{after}\" alt=\"{name}, {state}\"{} \
         loading=\"lazy\" draggable=\"false\" width=\"{width}\" height=\"{height}\">\
         {}<figcaption>{state}</figcaption></figure>{}<i></i>\
         <input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-valuetext=\"50 % of the \
         photo, 50 % of the result\" aria-label=\"Compare {name} with its result\"></div>",
        full_size_attribute(report, &report.before, up),
        full_size_attribute(report, &report.after, up),
        outlines(report),
        scene.as_ref().map_or(String::new(), |scene| format!(
            "<figure class=\"scene\"><img src=\"{up}{}\" alt=\"{name}, the true scene\" \
             loading=\"lazy\" draggable=\"false\" width=\"{width}\" height=\"{height}\">\
             <figcaption>the true scene</figcaption></figure>",
            escape(scene)
        )),
    );
}

fn outlines(report: &Report) -> String {
    let outline = |area: &RelativeRect| {
        let RelativeRect { x, y, width, height } = *area;
        let [x, y, width, height] = [x, y, width, height].map(|share| 100.0 * share);
        format!(
            "<b title=\"as it was\" style=\"left:{x:.1}%;top:{y:.1}%;width:{width:.1}%;\
             height:{height:.1}%\"></b>"
        )
    };
    report.left_as_they_were.iter().map(outline).collect()
}

fn describe_outcome(report: &Report) -> String {
    let means = match (report.outcome, report.stage, &report.certificate) {
        (ResultKind::Untouched, ..) => {
            return format!("Returned unchanged, because {}.", without_numbers(&report.reason));
        }
        (_, ResultStage::Photo | ResultStage::LensModel, _) => "with the lens model",
        (_, _, Some(_)) => "with the lens model, and corrected with the camera",
        (_, _, None) => "with the camera alone",
    };
    format!("Sharpened {means}.")
}

/// Style class and sentence of the confirmation.
fn describe_confirmation(report: &Report) -> Option<(&'static str, String)> {
    if report.outcome == ResultKind::Untouched {
        return None;
    }
    let Some(certificate) = &report.certificate else {
        return Some(("none", "Not confirmed: it was not photographed again.".to_owned()));
    };
    let noisy = "matches your photo within its strong noise";
    let unproven = "matches your photo, supposing that this camera took it";
    let (class, again, finding) = match certificate.confirmation() {
        Confirmation::Full => ("good", "Confirmed: photographed", "matches your photo"),
        Confirmation::Noisy => ("fair", "Photographed", noisy),
        Confirmation::Unproven => ("fair", "Photographed", unproven),
        Confirmation::Nearly => {
            ("fair", "Nearly confirmed: photographed", "nearly matches your photo")
        }
        Confirmation::Not => {
            ("poor", "Not confirmed: photographed", "still differs from your photo")
        }
    };
    let proviso = certificate.proviso();
    Some((class, format!("{again} through the lens again, the result {finding}{proviso}.")))
}

fn details(photo: &GalleryPhoto<'_>, up: &str) -> String {
    let report = photo.report;
    let size = match report.outcome {
        ResultKind::Restored => report.size,
        ResultKind::Untouched => report.stored,
    };
    let (width, height) = displayed_size(report, size);
    let mut rows = vec![
        ("finished", moment(report.finished_unix_s)),
        ("duration", span(report.seconds)),
        ("size", format!("{width}×{height} pixels")),
        ("method", escape(&report.method)),
        ("photographs taken", report.captures.to_string()),
        ("file", escape(&report.result)),
        ("reason", escape(&report.reason)),
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
    let again = match &photo.original {
        Some(original) => format!(
            "To restore it again, move <a href=\"{up}{}\">its original</a> from <code>done</code> \
             into <code>inbox</code>.",
            escape(original)
        ),
        None => "Its original is no longer in <code>done</code>.".to_owned(),
    };
    let _ = writeln!(
        html,
        "<p>{again} The full record: <a href=\"{up}{}.json\">report</a>.</p>",
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
                original: Some("../done/a.jpg".into()),
                scene: Some("../scenes/a.jpg".into()),
            },
            "../",
        );
        html
    }

    /// The part visible without a click.
    fn visible(html: &str) -> &str {
        html.split("<details>").next().unwrap()
    }

    #[test]
    fn the_outcome_is_described_without_jargon() {
        for (stage, kind, certificate, wanted) in [
            (
                ResultStage::Captures,
                ResultKind::Restored,
                Some(1.13),
                "Sharpened with the lens model, and corrected with",
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
            (
                ResultStage::LensModel,
                ResultKind::Restored,
                Some(1.6),
                "Nearly confirmed: photographed",
            ),
            (ResultStage::Captures, ResultKind::Restored, Some(4.0), "Not confirmed: photographed"),
            (
                ResultStage::Photo,
                ResultKind::Untouched,
                None,
                "Returned unchanged, because it is sharp.</p>",
            ),
        ] {
            let mut report = report(1);
            (report.stage, report.outcome) = (stage, kind);
            report.reason = "it is sharp (3.1 times its noise remains)".into();
            report.notes = vec!["noise of the photo: 1.20 grey levels".into()];
            report.certificate = certificate.map(|residual_grey_levels| OpticalResidual {
                focus: CertifiedFocus::Photo,
                of_any_sensor: false,
                residual_grey_levels,
                floor_grey_levels: 1.0,
            });
            let html = card_of(&report);
            let seen = visible(&html);
            assert!(seen.contains(wanted), "{seen}");
            for jargon in ["stage", "grey level", "residual", "3.1", "capture", "hybrid"] {
                assert!(!seen.contains(jargon), "{jargon}: {seen}");
            }
            assert!(html.contains("3.1 times its noise") && html.contains("hybrid"), "{html}");
        }
    }

    #[test]
    fn agreement_within_strong_noise_is_not_a_confirmation() {
        let mut report = report(1);
        report.certificate = Some(OpticalResidual {
            focus: CertifiedFocus::Photo,
            of_any_sensor: false,
            residual_grey_levels: 75.24,
            floor_grey_levels: 75.42,
        });
        let html = card_of(&report);
        assert!(!html.contains("certificate good") && html.contains("strong noise"), "{html}");
        // The page shows no pair of numbers that the user has to compare.
        assert!(!html.contains("75."), "{html}");
    }

    #[test]
    fn agreement_is_no_confirmation_of_a_photo_of_any_sensor() {
        let mut report = report(1);
        let of = report.certificate.as_mut().unwrap();
        of.of_any_sensor = true;
        assert!(of.meaning().contains("supposing that this camera took it"));
        let html = card_of(&report);
        assert!(!html.contains("certificate good"), "{html}");
        assert!(visible(&html).contains("supposing that this camera took it"), "{html}");
    }

    #[test]
    fn a_confirmation_at_the_panel_s_focus_has_a_proviso() {
        let proviso = "if the scene was as far away as the panel";
        let mut report = report(1);
        for (residual_grey_levels, focus, expected) in [
            (1.0, CertifiedFocus::Photo, false),
            (1.0, CertifiedFocus::Panel, true),
            (1.6, CertifiedFocus::Panel, true),
            (4.0, CertifiedFocus::Panel, false),
        ] {
            let of = OpticalResidual {
                residual_grey_levels,
                floor_grey_levels: 1.0,
                focus,
                of_any_sensor: false,
            };
            report.certificate = Some(of);
            let html = card_of(&report);
            assert_eq!(visible(&html).contains(proviso), expected, "{of:?}");
            assert_eq!(of.meaning().contains(proviso), expected, "{of:?}");
        }
    }

    #[test]
    fn a_smaller_result_is_announced_first() {
        let mut report = report(1);
        assert!(!card_of(&report).contains("Smaller"));
        report.stored = Size::new(4000, 3000);
        let html = card_of(&report);
        assert!(html.contains("Smaller than the photo: 256×192 instead of 4000×3000 pixels"));
        assert!(html.find("Smaller") < html.find("Sharpened"));
        assert!(html.contains("<dd>256×192 pixels</dd>"), "{html}");
        // A photo returned unchanged has its own size.
        report.outcome = ResultKind::Untouched;
        let html = card_of(&report);
        assert!(html.contains("<dd>4000×3000 pixels</dd>") && !html.contains("Smaller"), "{html}");
        assert!(html.contains("at 256×192; the file is unchanged, 4000×3000"), "{html}");
    }

    #[test]
    fn areas_left_as_they_were_are_outlined() {
        let mut report = report(1);
        assert!(!card_of(&report).contains("<b ") && !card_of(&report).contains("Outlined"));
        report.left_as_they_were =
            vec![RelativeRect { x: 0.5, y: 0.75, width: 0.25, height: 0.125 }];
        let wanted = "style=\"left:50.0%;top:75.0%;width:25.0%;height:12.5%\"></b>";
        let html = card_of(&report);
        assert!(html.contains(wanted) && visible(&html).contains("Outlined parts"), "{html}");
    }

    #[test]
    fn large_pictures_have_a_full_size_address() {
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
    fn original_and_result_are_linked_and_the_slider_has_a_text() {
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
