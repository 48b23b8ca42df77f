//! Photos not taken by the rig's lens: how many are changed, and how many of those are certified.
//!
//! Sharp pictures reduced or enlarged to the rig's size or blurred by other lenses, drawn screens,
//! and scans. For comparison, photos of the same scenes through the rig's lens are included.

use std::path::Path;

use image::imageops::FilterType::{self, CatmullRom, Lanczos3, Nearest, Triangle};
use image::{ImageBuffer, Rgb, imageops};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use relens::chart::table::Table;
use relens::chart::test_rig::TestPhoto;
use relens::config::MethodName;
use relens::frame::{Channels, Frame, Plane, Size, Work};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{Confirmation, Outcome, SensorMatch, Verdict, method};

use super::groups::Group;
use crate::Failure;
use crate::change::{NOTHING, simulation};
use crate::harness::{Harness, calibrated};
use crate::jpeg_coder::{Quality, coded};
use crate::made::Made;
use crate::view::View;

/// A picture in colour, code values 0..1.
type Picture = ImageBuffer<Rgb<f32>, Vec<f32>>;

/// Cause of a photo's softness.
#[derive(Debug, Clone, Copy)]
enum Blur {
    /// The rig's own lens.
    Own,
    /// A reduction by two.
    Reduced(FilterType),
    /// An enlargement by this factor.
    Enlarged(f32, FilterType),
    /// A Gaussian of this σ, pixels.
    Gaussian(f32),
    /// A disc of this radius, pixels, as out of focus.
    Disc(f32),
    /// A movement along a line of this length, pixels, and this slope.
    Motion(f32, f32),
    /// A screen drawn with this seed, shown pixel by pixel.
    Screen(u64),
    /// A screen drawn with this seed and scanned: softened and grainy.
    Scan(u64),
}

/// The blurs of one view and their names in tables.
const BLURS: [(Blur, &str); 14] = [
    (Blur::Own, OWN),
    (Blur::Reduced(Nearest), "reduced"),
    (Blur::Reduced(Triangle), "reduced"),
    (Blur::Reduced(CatmullRom), "reduced"),
    (Blur::Reduced(Lanczos3), "reduced"),
    (Blur::Enlarged(2.0, Nearest), "enlarged"),
    (Blur::Enlarged(1.5, Triangle), "enlarged"),
    (Blur::Enlarged(2.0, CatmullRom), "enlarged"),
    (Blur::Enlarged(2.5, Lanczos3), "enlarged"),
    (Blur::Gaussian(0.8), "Gaussian"),
    (Blur::Gaussian(1.4), "Gaussian"),
    (Blur::Disc(1.5), "disc"),
    (Blur::Disc(2.5), "disc"),
    (Blur::Motion(5.0, 0.4), "motion"),
];

/// File formats of photos: PNG (`None`) or JPEG. The last is used for the rig's own lens only.
const KEPT: [Option<Quality>; 4] = [
    None,
    Some(Quality { quality: 95, pixels: (1, 1) }),
    Some(Quality { quality: 85, pixels: (2, 2) }),
    Some(Quality { quality: 60, pixels: (2, 2) }),
];

/// Name in tables of photos through the rig's lens.
const OWN: &str = "own lens";

/// Number of screens and scans of a group.
const DRAWN: usize = 20;

/// A photo to be made: its view (`None` for a drawn one), its blur, and the name of the blur.
type Case = (Option<View>, Blur, &'static str);

/// Rates of changed photos of `group`, on the rig of the file `rig` or on the group's first rig.
/// Every other blur is applied to each scene, whole and in quarters. Photos of other lenses are
/// kept in one format each; `quick` takes every fifth case.
pub(crate) fn run(group: Group, rig: Option<&Path>, quick: bool) -> Result<Made, Failure> {
    let seed = group.seed() + 900;
    let rig = match rig {
        None => group.rigs()[0].load(seed)?,
        Some(path) => {
            let mut rig = relens::config::load(path)?;
            simulation(&mut rig, |simulation| simulation.seed = seed);
            rig
        }
    };
    let (file, calibration) = calibrated(&rig, &NOTHING, 0.0)?;
    let mut harness = Harness::changed(&file, &calibration, &NOTHING, 0.0)?;
    let mut rows =
        String::from("view,blur,kept,verdict,certificate,sensor found,sensor expected,reason\n");
    let mut all = Vec::new();
    let step = if quick { 5 } else { 1 };
    for (n, (view, blur, name)) in cases(group).into_iter().enumerate().step_by(step) {
        let codes = blurred(&harness, view, blur, group.seed() + n as u64);
        let one = KEPT[n / 2 % 3];
        let ways = if name == OWN { &KEPT } else { std::slice::from_ref(&one) };
        for &kept in ways {
            let (sensor, outcome) = restored(&mut harness, &codes, kept)?;
            let of_sensor = |of: fn(&SensorMatch) -> f64| {
                sensor.as_ref().map_or(String::new(), |sensor| format!("{:.1}", of(sensor)))
            };
            let line = [
                view.map_or(String::new(), View::name),
                format!("{blur:?}"),
                kept.map_or("PNG".to_owned(), |Quality { quality, .. }| format!("JPEG {quality}")),
                format!("{:?}", outcome.verdict),
                outcome.certificate.map_or(String::new(), |of| format!("{:.2}", of.ratio())),
                of_sensor(|sensor| sensor.found),
                of_sensor(|sensor| sensor.expected),
                outcome.reason.clone(),
            ];
            let line = line.map(|cell| cell.replace(',', "")).join(",");
            log::info!("{line}");
            rows += &(line + "\n");
            all.push((name, outcome));
        }
    }
    let mut made = Made::table(format!("foreign-{}", group.word()), table(group, &file.name, &all));
    made.files = vec![(format!("foreign-{}-results.csv", group.word()), rows.into_bytes())];
    Ok(made)
}

fn cases(group: Group) -> Vec<Case> {
    let mut cases = Vec::new();
    for (n, subject) in group.subjects().into_iter().enumerate() {
        for part in 0..5 {
            let view = View { subject, quarter: (part > 0).then(|| part - 1) };
            let some = BLURS.iter().skip((n + part) % 2).step_by(2);
            cases.extend(some.map(|&(blur, name)| (Some(view), blur, name)));
        }
    }
    for seed in (group.seed()..).take(DRAWN) {
        let is_scan = seed.is_multiple_of(2);
        let screen = (None, Blur::Screen(seed), "screen");
        cases.push(if is_scan { (None, Blur::Scan(seed), "scan") } else { screen });
    }
    cases
}

/// Counts of `all` outcomes, by blur.
fn table(group: Group, rig: &str, all: &[(&'static str, Outcome)]) -> Table {
    let caption = format!(
        "Photos that the lens of {} did not take, scenes of the group `{}`: how many are changed. \
         `{OWN}` are photos that it took.",
        rig,
        group.word()
    );
    let head = ["blurred by", "photos", "changed", "of these replaced", "certified"];
    let mut table = Table::new(caption, &head);
    let mut row = |name: &str, of: &dyn Fn(&str) -> bool| {
        let count = |is: &dyn Fn(&Outcome) -> bool| {
            all.iter().filter(|(name, outcome)| of(name) && is(outcome)).count().to_string()
        };
        let changed = |outcome: &Outcome| outcome.verdict != Verdict::Untouched;
        let certified = |outcome: &Outcome| {
            let confirmed = outcome.certificate.map(|of| of.confirmation());
            changed(outcome) && matches!(confirmed, Some(Confirmation::Full | Confirmation::Noisy))
        };
        table.row(vec![
            name.to_owned(),
            count(&|_| true),
            count(&changed),
            count(&|outcome| outcome.verdict == Verdict::Replaced),
            count(&certified),
        ]);
    };
    let mut names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    names.dedup();
    names.iter().for_each(|&name| row(name, &|of| of == name));
    row("all of other lenses", &|of| of != OWN);
    table
}

/// Restores the photo of `codes`, `kept` as a PNG or as a JPEG; also returns its sensor match.
fn restored(
    harness: &mut Harness,
    codes: &Frame<Work, u8>,
    kept: Option<Quality>,
) -> Result<(Option<SensorMatch>, Outcome), Failure> {
    let curve = harness.config().photo.curve;
    let solver = harness.method(&|rig| method(rig, MethodName::Hybrid));
    let (photo, plain);
    let prepared = match kept {
        Some(quality) => {
            let file = coded(codes, quality);
            photo = Photo::from_bytes("photo.jpg", &file, curve, &Limits::default())?;
            harness.test_rig.parts().0.prepare(&photo)
        }
        None => {
            let tone = Tone::of_curve(curve, 8);
            plain = TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, codes.plane(c))));
            plain.prepared(harness.test_rig.parts().0, Channels::Colour)
        }
    };
    Ok((prepared.sensor, harness.restore(&prepared, &*solver)?.outcome))
}

/// Codes of the blurred photo of `view`, or of a drawn screen if there is no view.
fn blurred(harness: &Harness, view: Option<View>, blur: Blur, seed: u64) -> Frame<Work, u8> {
    let size = harness.config().photo.size();
    let (w, h) = (size.width as u32, size.height as u32);
    let double = Size::new(2 * size.width, 2 * size.height);
    let Some(view) = view else { return to_codes(&drawn(blur, size)) };
    // A quarter is cut from a picture of twice the size, so that it has `size` pixels, too.
    let sharp = |size: Size| picture(&view.codes(size));
    let made = match blur {
        Blur::Own => {
            let tone = Tone::of_curve(harness.config().photo.curve, 8);
            let codes = to_codes(&picture(&view.codes(size)));
            let light = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
            return harness.witness.photograph(&light, seed);
        }
        Blur::Reduced(filter) => imageops::resize(&sharp(double), w, h, filter),
        Blur::Enlarged(times, filter) => {
            let side = |n: usize| (n as f32 / times).round() as usize;
            let small = sharp(Size::new(side(size.width), side(size.height)));
            imageops::resize(&small, w, h, filter)
        }
        Blur::Gaussian(sigma) => imageops::blur(&sharp(size), sigma),
        Blur::Disc(radius) => {
            let near = |x: f32, y: f32| (radius + 0.5 - x.hypot(y)).clamp(0.0, 1.0);
            spread(&sharp(size), near)
        }
        Blur::Motion(length, slope) => {
            let near = |x: f32, y: f32| {
                let off = (y - slope * x).abs() / 1f32.hypot(slope);
                (1.0 - off).max(0.0) * f32::from(u8::from(x.hypot(y) <= length / 2.0))
            };
            spread(&sharp(size), near)
        }
        Blur::Screen(_) | Blur::Scan(_) => drawn(blur, size),
    };
    to_codes(&made)
}

/// `picture` blurred by the kernel `near`, a function of the offset in pixels.
fn spread(picture: &Picture, near: impl Fn(f32, f32) -> f32) -> Picture {
    let reach = -4i64..=4;
    let taps: Vec<(i64, i64, f32)> = reach
        .clone()
        .flat_map(|y| reach.clone().map(move |x| (x, y)))
        .map(|(x, y)| (x, y, near(x as f32, y as f32)))
        .filter(|tap| tap.2 > 0.0)
        .collect();
    let sum: f32 = taps.iter().map(|tap| tap.2).sum();
    let (w, h) = picture.dimensions();
    let inside = |at: u32, by: i64, of: u32| (i64::from(at) + by).clamp(0, i64::from(of) - 1);
    ImageBuffer::from_fn(w, h, |x, y| {
        let mut value = [0.0; 3];
        for &(dx, dy, weight) in &taps {
            let Rgb(from) = *picture.get_pixel(inside(x, dx, w) as u32, inside(y, dy, h) as u32);
            value.iter_mut().zip(from).for_each(|(total, v)| *total += weight * v);
        }
        Rgb(value.map(|v| v / sum))
    })
}

/// A drawn screen with windows, icons and lines of text, or a scan of one.
fn drawn(blur: Blur, size: Size) -> Picture {
    let (Blur::Screen(seed) | Blur::Scan(seed)) = blur else { return Picture::new(0, 0) };
    let (w, h) = (size.width as u32, size.height as u32);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut screen = Picture::from_pixel(w, h, Rgb([0.2, 0.35, 0.5]));
    for _ in 0..random.random_range(3..9) {
        let (x, y) = (random.random_range(0..w - 40), random.random_range(0..h - 30));
        let (across, down) = (random.random_range(30..w / 2), random.random_range(20..h / 2));
        let ground = Rgb([0; 3].map(|_: i32| random.random_range(0.6..1.0)));
        let ink = Rgb([0; 3].map(|_: i32| random.random_range(0.0..0.45)));
        for v in y..(y + down).min(h) {
            for u in x..(x + across).min(w) {
                let is_edge = u == x || v == y;
                let is_line = (v - y) % 9 < 6 && (v - y) > 8 && u > x + 3;
                let is_ink = is_edge || is_line && random.random_bool(0.35);
                screen.put_pixel(u, v, if is_ink { ink } else { ground });
            }
        }
    }
    if let Blur::Screen(_) = blur {
        return screen;
    }
    let mut scan = imageops::blur(&screen, random.random_range(0.6..1.6));
    scan.pixels_mut()
        .for_each(|p| p.0.iter_mut().for_each(|v| *v += random.random_range(-0.012..0.012)));
    scan
}

fn picture(codes: &Frame<Work>) -> Picture {
    let size = codes.size();
    let [red, green, blue] = codes.planes();
    ImageBuffer::from_fn(size.width as u32, size.height as u32, |x, y| {
        Rgb([red, green, blue].map(|plane| plane.at(x as usize, y as usize) / 255.0))
    })
}

fn to_codes(picture: &Picture) -> Frame<Work, u8> {
    let size = Size::new(picture.width() as usize, picture.height() as usize);
    Frame::from_fn(|c| {
        Plane::from_fn(size, |x, y| {
            (255.0 * picture.get_pixel(x as u32, y as u32).0[c.index()]).round().clamp(0.0, 255.0)
                as u8
        })
    })
}
