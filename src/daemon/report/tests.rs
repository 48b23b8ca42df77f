//! The gallery of four thousand photos, as files and in a real browser.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::gallery::{Gallery, SCENES};
use super::now;
use super::page;
use super::state::Doing;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::names::address;
use crate::daemon::store::report_file::{Failed, Report, ResultKind};
use crate::deconvolution::stage::ResultStage;
use crate::frame::Size;
use crate::pipeline::{CertifiedFocus, OpticalResidual};

pub(super) fn report(n: u64) -> Report {
    let name = format!("photo {n:04}.jpg");
    Report {
        photo: name.clone(),
        result: name.clone(),
        result_address: address(name.as_ref()),
        outcome: if n.is_multiple_of(7) { ResultKind::Untouched } else { ResultKind::Restored },
        rig: "small".into(),
        method: "hybrid".into(),
        stage: ResultStage::Captures,
        reason: "the certificate says that the model missed something".into(),
        captures: 2,
        seconds: 6.5,
        certificate: Some(OpticalResidual {
            focus: CertifiedFocus::Photo,
            of_any_sensor: false,
            residual_grey_levels: 1.1,
            floor_grey_levels: 1.0,
        }),
        meaning: None,
        size: Size::new(256, 192),
        stored: Size::new(256, 192),
        curve: "sRGB".into(),
        grey: false,
        turned: None,
        left_as_they_were: vec![],
        notes: vec![],
        iterations: vec![],
        finished_unix_s: 1_700_000_000 + 7 * n,
        number: n,
        before: "gallery/a-before.jpg".into(),
        after: "gallery/a-after.jpg".into(),
        photo_crc32: "0".into(),
        photo_bytes: 1,
    }
}

/// Adds a photo whose result is in the outbox.
fn add(gallery: &mut Gallery, folders: &Folders, report: &Report) {
    std::fs::write(folders.outbox.join(&report.result), "").unwrap();
    gallery.add(report.clone());
}

/// Writes an outbox with `count` photos and two failures; the previews are blue (before) and red
/// (after).
fn write_gallery(root: &Path, count: u64) -> PathBuf {
    let folders = Folders::open(root).unwrap();
    let picture = |rgb: [f32; 3], px: usize| {
        use crate::config::Curve;
        use crate::frame::{Frame, Plane, Work};
        use crate::picture::{Format, Manner, preview};
        let light: Frame<Work> =
            Frame::from_fn(|c| Plane::filled(Size::new(256, 192), rgb[c.index()]));
        preview("a", &light, &Manner::plain(Format::Jpeg, 8, Curve::Srgb), false, px).unwrap()
    };
    let previews = folders.previews.to_owned();
    std::fs::write(previews.join("a-before.jpg"), picture([0.0, 0.0, 255.0], 256)).unwrap();
    std::fs::write(previews.join("a-after.jpg"), picture([255.0, 0.0, 0.0], 256)).unwrap();
    std::fs::write(previews.join("a-small.jpg"), picture([0.0, 255.0, 0.0], 160)).unwrap();
    let mut gallery = Gallery::default();
    (0..count).for_each(|n| add(&mut gallery, &folders, &report(n)));
    for name in ["cut.jpg", "empty.jpg"] {
        gallery.failed.push(Failed { photo: name.into(), reason: format!("{name}: not a photo") });
    }
    let reason = "photos were postponed: press the button";
    now::write(&folders, &Doing::Paused { reason: reason.into() }, 1_700_030_000).unwrap();
    gallery.write(&folders, "small", &[], 1_700_030_000).unwrap();
    folders.outbox.to_owned()
}

#[test]
fn four_thousand_photos_are_split_into_pages() {
    let root = tempfile::tempdir().unwrap();
    let outbox = write_gallery(root.path(), 4000);
    let index = std::fs::read_to_string(outbox.join("index.html")).unwrap();
    assert!(index.len() < 500_000, "the first page has {} bytes", index.len());
    for wanted in ["<b>3428</b> restored", "<b>572</b> unchanged", "<b>2</b> failed", "cut.jpg"] {
        assert!(index.contains(wanted), "{wanted}");
    }
    let mut found = 0;
    for page in 1..=67 {
        let html = std::fs::read_to_string(outbox.join(page::page_address(page))).unwrap();
        found += html.matches("<article").count();
    }
    assert_eq!(found, 4000);
    let data: serde_json::Value =
        serde_json::from_slice(&std::fs::read(outbox.join("gallery/report.json")).unwrap())
            .unwrap();
    assert_eq!(data["photos"].as_array().unwrap().len(), 4000);
    assert_eq!(data["failed"][1]["photo"], "empty.jpg");
}

#[test]
fn originals_and_scenes_are_found() {
    let root = tempfile::tempdir().unwrap();
    let folders = Folders::open(root.path()).unwrap();
    let mut gallery = Gallery::default();
    (0..3).for_each(|n| add(&mut gallery, &folders, &report(n)));
    std::fs::create_dir(root.path().join(SCENES)).unwrap();
    std::fs::write(root.path().join(SCENES).join("photo 0001.jpg"), "a").unwrap();
    // The second photo has its original; the third's has another length, so it is another photo.
    std::fs::write(folders.done.join("photo 0001.jpg"), "a").unwrap();
    std::fs::write(folders.done.join("photo 0002.jpg"), "abc").unwrap();
    gallery.write(&folders, "small", &[], 0).unwrap();
    let index = std::fs::read_to_string(folders.outbox.join("index.html")).unwrap();
    assert_eq!(index.matches("class=\"scene\"").count(), 1);
    assert!(index.contains("src=\"../scenes/photo%200001.jpg\""));
    assert_eq!(index.matches("Download original").count(), 1);
    assert!(index.contains("href=\"../done/photo%200001.jpg\" download"));
    // The name is used again by a photo without an original.
    gallery.remove(&report(1).result);
    gallery.add(Report { photo_bytes: 2, ..report(1) });
    gallery.write(&folders, "small", &[], 0).unwrap();
    let index = std::fs::read_to_string(folders.outbox.join("index.html")).unwrap();
    assert!(!index.contains("Download original"));
}

#[test]
fn full_pages_are_written_once() {
    let root = tempfile::tempdir().unwrap();
    let folders = Folders::open(root.path()).unwrap();
    let mut gallery = Gallery::default();
    (0..130).for_each(|n| add(&mut gallery, &folders, &report(n)));
    gallery.write(&folders, "small", &[], 0).unwrap();
    let first = folders.outbox.join(page::page_address(1));
    std::fs::remove_file(&first).unwrap();
    add(&mut gallery, &folders, &report(130));
    gallery.write(&folders, "small", &[], 0).unwrap();
    assert!(!first.exists() && folders.outbox.join(page::page_address(3)).exists());
}

#[test]
fn superfluous_pages_are_removed_also_by_the_next_daemon() {
    let root = tempfile::tempdir().unwrap();
    let folders = Folders::open(root.path()).unwrap();
    let mut gallery = Gallery::default();
    (0..130).for_each(|n| add(&mut gallery, &folders, &report(n)));
    gallery.write(&folders, "small", &[], 0).unwrap();
    let page = |n| folders.outbox.join(page::page_address(n)).exists();
    assert_eq!([1, 2, 3].map(page), [true; 3]);
    for n in 0..30 {
        std::fs::remove_file(folders.outbox.join(report(n).result)).unwrap();
    }
    gallery.write(&folders, "small", &[], 0).unwrap();
    assert_eq!([1, 2, 3].map(page), [true, true, false]);
    // The reports do not exist, so a new daemon finds none.
    Gallery::load(&folders).unwrap().write(&folders, "small", &[], 0).unwrap();
    assert_eq!([1, 2, 3].map(page), [false; 3]);
}

/// The installed browser; `None`, with a warning, where none is required.
fn browser() -> Option<&'static str> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = names.into_iter().find(|name| Command::new(name).arg("--version").output().is_ok());
    if found.is_none() {
        let skip =
            std::env::var_os("CI").is_none() || std::env::var_os("RELENS_NO_BROWSER").is_some();
        assert!(skip, "no browser (apt-get install chromium), and RELENS_NO_BROWSER is not set");
        log::warn!("*** THE GALLERY WAS NOT TESTED IN A BROWSER: none is installed. ***");
    }
    found
}

fn run(browser: &str, profile: &Path, arguments: &[&str], page: &Path) -> Vec<u8> {
    let out = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--window-size=1280,1400",
        ])
        .args(["--virtual-time-budget=8000", "--run-all-compositor-stages-before-draw"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(arguments)
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

#[test]
fn a_browser_shows_the_gallery_of_four_thousand_photos() {
    let Some(browser) = browser() else { return };
    let (root, profile) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let outbox = write_gallery(root.path(), 4000);
    let shot = root.path().join("shot.png");
    for (page, photos) in [("index.html".to_owned(), 60), (page::page_address(67), 40)] {
        let argument = format!("--screenshot={}", shot.display());
        run(browser, profile.path(), &[&argument], &outbox.join(&page));
        let read =
            crate::picture::Photo::read(&shot, crate::config::Curve::Linear, &Default::default())
                .unwrap();
        let count = |rgb: [bool; 3]| {
            let [red, green, blue] = read.light.planes();
            let pixels = red.data().iter().zip(green.data()).zip(blue.data());
            let is = |value: &f32, on: bool| if on { *value > 200.0 } else { *value < 60.0 };
            pixels.filter(|((r, g), b)| is(r, rgb[0]) && is(g, rgb[1]) && is(b, rgb[2])).count()
        };
        // Counts pixels in the style sheet's colour for failures.
        let [red, green, blue] = read.light.planes();
        let pixels = red.data().iter().zip(green.data()).zip(blue.data());
        let near = |value: &f32, code: f32| (value - code).abs() < 6.0;
        let alarm =
            pixels.filter(|((r, g), b)| near(r, 177.0) && near(g, 68.0) && near(b, 47.0)).count();
        if page == "index.html" {
            assert!(alarm > 100, "the two failures stand out: {alarm} pixels");
        } else {
            assert_eq!(alarm, 0, "{page}: no failures");
        }
        let small = count([false, true, false]);
        // Each of sixty thumbnails covers about 83×62 pixels.
        assert!(small > photos * 83 * 62 / 2, "{page}: {small} pixels of small pictures");
        let dom =
            String::from_utf8(run(browser, profile.path(), &["--dump-dom"], &outbox.join(&page)))
                .unwrap();
        assert_eq!(dom.matches("<article").count(), photos, "{page}");
        if page != "index.html" {
            assert!(
                count([true, false, false]) > 5000 && count([false, false, true]) > 5000,
                "before and after"
            );
        }
    }
    // A thumbnail damaged by a power cut.
    std::fs::write(outbox.join("gallery/a-small.jpg"), [0; 100]).unwrap();
    let dom = String::from_utf8(run(
        browser,
        profile.path(),
        &["--dump-dom"],
        &outbox.join("index.html"),
    ));
    assert!(
        dom.unwrap().contains("<img src=\"gallery/a-after.jpg\" alt"),
        "the preview in its place"
    );
    // User actions, simulated by a script.
    let after = |action: &str| {
        let html = std::fs::read_to_string(outbox.join("index.html")).unwrap();
        let script =
            format!("<script>addEventListener('load', () => {{ {action} }})</script></body>");
        std::fs::write(outbox.join("probe.html"), html.replace("</body>", &script)).unwrap();
        let dom = run(browser, profile.path(), &["--dump-dom"], &outbox.join("probe.html"));
        String::from_utf8(dom).unwrap()
    };
    let dom = after(
        "let box = document.querySelector('#find input'); box.value = 'photo 00';
                    box.dispatchEvent(new Event('input'));",
    );
    assert!(
        dom.contains(">100 of 4000 photos with a result</p>"),
        "the search finds photos of all pages"
    );
    assert!(dom.contains("href=\"gallery/photos-2.html#photo-99\""), "and leads to them");
    let dom = after("document.querySelector('#find [data-state=unchanged]').click();");
    let count = ">572 of 4000 photos with a result, the newest 300 are shown</p>";
    assert!(dom.contains(count), "also by outcome");
    let dom = after(
        "document.querySelector('#find [data-state=unchanged]').click();
         setTimeout(() => document.querySelector('#found button').click(), 500);",
    );
    assert!(dom.contains(">572 of 4000 photos with a result</p>"), "all on demand");
    let dom = after(
        "let box = document.querySelector('#find input'); box.value = 'cut';
                    box.dispatchEvent(new Event('input'));",
    );
    assert!(dom.contains("<li hidden=\"\"><a href=\"../failed/empty.jpg\""), "not of this name");
    assert!(dom.contains("<li><a href=\"../failed/cut.jpg\""), "failures are found");
    let dom = after(
        "document.querySelector('#photo-3998 .links button').click();
         for (const key of ['ArrowLeft', 'ArrowRight', 'ArrowRight', '1', '+', '+'])
           document.querySelector('.stage').dispatchEvent(
             new KeyboardEvent('keydown', { key, bubbles: true }));",
    );
    let viewer = dom.split("<dialog").nth(1).unwrap();
    assert!(viewer.contains("aria-label=\"photo 3997.jpg\"") && viewer.contains("open"));
    assert!(viewer.contains(">1600 %</button>") && viewer.contains("stage pixels"), "{viewer}");
    assert_eq!(viewer.matches("scale(16)").count(), 2, "photo and result in step: {viewer}");
    if let Some(keep) = std::env::var_os("RELENS_KEEP_GALLERIES").map(PathBuf::from) {
        for count in [0, 1, 4, 60, 4000] {
            let root = keep.join(count.to_string());
            std::fs::create_dir_all(&root).unwrap();
            write_gallery(&root, count);
        }
    }
}
