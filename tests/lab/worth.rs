//! Gain of captures over the lens model alone, by the rig's own method, where the measured lens is
//! right and where it is wrong. No limit was set on these photographs.

use relens::chart::table::Table;
use relens::config::{MethodName, RigFile};
use relens::deconvolution::quality::psnr;
use relens::frame::{Frame, Plane, Work};
use relens::picture::Tone;
use relens::pipeline::Setting;

use crate::Failure;
use crate::change::Change;
use crate::harness::{Harness, calibrated};
use crate::likeness::{Likeness, Truth};
use crate::made::Made;
use crate::view::{KEPT, Subject, View};
use crate::wrong_models::WRONG;

/// Limits on the number of captures.
const CAPTURES: [u32; 4] = [0, 1, 2, 3];
/// Seed of the photos.
const SEED: u64 = 7100;

/// Quality and cost of a result, or of the untouched photo.
#[derive(Debug, Clone, Copy)]
struct Restored {
    likeness: Likeness,
    psnr_db: f64,
    captures: f64,
    seconds: f64,
}

/// A photo and its results with each limit of [`CAPTURES`].
struct Photo {
    subject: Subject,
    untouched: Restored,
    with: [Restored; CAPTURES.len()],
}

/// The rig file's setting with at most that many `captures`.
fn setting(rig: &RigFile, captures: u32) -> Setting {
    let filed = Setting::as_filed(rig, rig.restore.method);
    match (filed.method, captures) {
        // The hybrid method takes at least one capture.
        (MethodName::Hybrid, 0) => Setting { method: MethodName::Digital, ..filed },
        _ => Setting { captures_max: captures, ..filed },
    }
}

/// Tables of the means and of every photo; `quick` takes a third of the photos.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let count = if quick { 2 } else { KEPT.len() };
    let mut cases = Vec::new();
    for (change, strength) in WRONG {
        cases.push((change.words(strength), photos(rig, (change, strength), count)?));
    }
    let stem = format!("{}-worth", rig.name);
    let [means, each] = [means(rig, &cases), each(rig, &cases)];
    Ok(Made {
        // The published page has the bare name.
        tables: vec![(format!("{stem}-means"), means), (format!("{stem}-photos"), each)],
        ..Made::default()
    })
}

fn photos(
    rig: &RigFile,
    (change, strength): (&'static Change, f64),
    count: usize,
) -> Result<Vec<Photo>, Failure> {
    let (rig, measured) = &calibrated(rig, change, strength)?;
    let mut harness = Harness::changed(rig, measured, change, strength)?;
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let channels = harness.test_rig.channels();
    let mut photos = Vec::new();
    for n in 0..count {
        let view = View { subject: Subject::Kept(n), quarter: None };
        let codes = view.codes(rig.photo.size());
        let light: Frame<Work> = Frame::from_fn(|c| {
            tone.plane(c, &codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
        });
        let photo = harness.photograph(&light, SEED + view.number())?;
        let scene = harness.truth(&light);
        let truth = Truth::of(rig, channels, &scene);
        let luma: Plane = harness.seen(&scene);
        let result = |harness: &Harness, picture: &Frame<Work>, captures, seconds| Restored {
            likeness: truth.likeness(picture),
            psnr_db: psnr(&harness.seen(picture), &luma),
            captures,
            seconds,
        };
        let untouched = result(&harness, &photo.light, 0.0, 0.0);
        let mut with = [untouched; CAPTURES.len()];
        for (with, captures) in with.iter_mut().zip(CAPTURES) {
            let method = setting(rig, captures).method(rig);
            let solved = harness.test_rig.solve(&photo, channels, &*method, &mut |_, _| {});
            let (solved, seconds) = solved?;
            *with = result(&harness, &solved.picture, solved.captures as f64, seconds);
            log::info!(
                "{}: {}, {captures} captures at most: {} {:.2} dB, {seconds:.2} s",
                change.words(strength),
                view.name(),
                with.likeness,
                with.psnr_db
            );
        }
        photos.push(Photo { subject: view.subject, untouched, with });
    }
    Ok(photos)
}

/// Mean of `all`.
fn mean(all: impl Iterator<Item = Restored>) -> Option<Restored> {
    let all: Vec<Restored> = all.collect();
    let of = |part: fn(&Restored) -> f64| all.iter().map(part).sum::<f64>() / all.len() as f64;
    Some(Restored {
        likeness: Likeness::mean(&all.iter().map(|one| one.likeness).collect::<Vec<_>>())?,
        psnr_db: of(|one| one.psnr_db),
        captures: of(|one| one.captures),
        seconds: of(|one| one.seconds),
    })
}

/// SSIM, dB and ΔE as words.
fn plain(of: Restored) -> String {
    let difference = of.likeness.difference.map_or(String::new(), |v| format!("/{v:.2}"));
    format!("{:.4}/{:.2}{difference}", of.likeness.ssim, of.psnr_db)
}

/// SSIM, dB and ΔE less those of `none`, as words; a smaller ΔE is better.
fn gain(of: Restored, none: Restored) -> String {
    let both = of.likeness.difference.zip(none.likeness.difference);
    let difference = both.map_or(String::new(), |(of, none)| format!("/{:+.2}", of - none));
    let (ssim, db) = (of.likeness.ssim - none.likeness.ssim, of.psnr_db - none.psnr_db);
    format!("{ssim:+.4}/{db:+.2}{difference}")
}

fn means(rig: &RigFile, cases: &[(String, Vec<Photo>)]) -> Table {
    let names: Vec<&str> = KEPT.iter().map(|kept| kept.0).collect();
    let count = cases.first().map_or(0, |(_, photos)| photos.len());
    let caption = format!(
        "Worth of captures, rig {}, {}: SSIM and dB of luma and mean ΔE of the photo and of the \
         lens model alone; gain of up to one, two and three captures, and the mean number taken; \
         processor seconds a photo with none and one to three captures. Means of {}; the methods' \
         own results.",
        rig.name,
        rig.restore.method.name(),
        names[..count.min(names.len())].join(", ")
    );
    let head = ["fault", "photo", "no capture", "1", "2", "3", "taken", "seconds"];
    let mut table = Table::new(caption, &head);
    for (words, photos) in cases {
        let Some(untouched) = mean(photos.iter().map(|photo| photo.untouched)) else { continue };
        let with: Vec<Restored> = (0..CAPTURES.len())
            .filter_map(|n| mean(photos.iter().map(|photo| photo.with[n])))
            .collect();
        let Some((&none, some)) = with.split_first() else { continue };
        let mut cells = vec![words.clone(), plain(untouched), plain(none)];
        cells.extend(some.iter().map(|&of| gain(of, none)));
        let list = |of: &dyn Fn(&Restored) -> String| some.iter().map(of).collect::<Vec<_>>();
        cells.push(list(&|of| format!("{:.1}", of.captures)).join(", "));
        let seconds = list(&|of| format!("{:.2}", of.seconds)).join(", ");
        cells.push(format!("{:.2}; {seconds}", none.seconds));
        table.row(cells);
    }
    table
}

fn each(rig: &RigFile, cases: &[(String, Vec<Photo>)]) -> Table {
    let caption = format!("Worth of captures, photo by photo, rig {}.", rig.name);
    let head = ["fault", "scene", "photo", "no capture", "1", "2", "3"];
    let mut table = Table::new(caption, &head);
    for (words, photos) in cases {
        for photo in photos {
            let mut cells = vec![words.clone(), photo.subject.name().to_owned()];
            cells.push(plain(photo.untouched));
            cells.extend(photo.with.map(plain));
            table.row(cells);
        }
    }
    table
}
