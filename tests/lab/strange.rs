//! Photos with something that no scene gives through the lens, and the share of the gain that
//! remains around it.

use std::ops::Range;

use relens::chart::table::Table;
use relens::chart::test_rig::{PictureQuality, TestPhoto};
use relens::frame::{Channel, Frame, Plane, RawSites, Size, Work};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{Outcome, Outliers, method};

use crate::Failure;
use crate::change::NOTHING;
use crate::harness::{Harness, calibrated};
use crate::jpeg_coder::{Quality, coded};
use crate::judging::groups::Group;
use crate::made::Made;
use crate::view::{Subject, View};

/// Something strange in a photo.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Strange {
    /// A date in yellow, in a corner.
    Stamp,
    /// Half-transparent text over a fifth of the photo.
    Watermark,
    /// The ghost of a lamp: a disc of light with a rim.
    Flare,
    /// A part of the photo copied onto another.
    Retouched,
    /// Five dark spots.
    Dust,
}

const ALL: [(Strange, &str); 5] = [
    (Strange::Stamp, "stamp"),
    (Strange::Watermark, "watermark"),
    (Strange::Flare, "flare"),
    (Strange::Retouched, "retouched"),
    (Strange::Dust, "dust"),
];

/// Pixels around a strange thing that are not scored: half a window of SSIM, and the soft edge.
const UNSCORED_PX: usize = 12;

impl Strange {
    /// The photo `from` with the thing in it, both in code values, and a mask of its place.
    fn over(self, from: &Frame<Work>) -> (Frame<Work>, Plane<u8>) {
        let size = from.size();
        let mut place = Plane::filled(size, 0u8);
        let mut codes = from.clone();
        for (x, y) in (0..size.area()).map(|i| (i % size.width, i / size.width)) {
            if let Some(value) = self.at(from, x, y) {
                Channel::ALL.iter().for_each(|&c| codes.plane_mut(c).set(x, y, value[c.index()]));
                place.set(x, y, 1);
            }
        }
        (codes, place)
    }

    /// The codes of the pixel (`x`, `y`) if it shows the thing in photo `from`, else `None`.
    fn at(self, from: &Frame<Work>, x: usize, y: usize) -> Option<[f32; 3]> {
        let codes = |x: usize, y: usize| Channel::ALL.map(|c| from.plane(c).at(x, y));
        let old = codes(x, y);
        let (w, h) = (from.size().width as f32, from.size().height as f32);
        let (left, top) = (x as f32, y as f32);
        let inside = |across: Range<f32>, down: Range<f32>| {
            across.contains(&(left / w)) && down.contains(&(top / h))
        };
        match self {
            Strange::Stamp => {
                let cell = (h / 120.0).max(1.0);
                let is_ink = is_ink("26 11 27", (0.95 * w - left) / cell, (0.95 * h - top) / cell);
                is_ink.then_some([255.0, 200.0, 40.0])
            }
            Strange::Watermark => {
                let cell = (h / 80.0).max(1.0);
                let (right, below) = ((0.75 * w - left) / cell, (0.7 * h - top) / cell % 8.0);
                let is_ink =
                    inside(0.25..0.75, 0.3..0.7) && is_ink("2026 11 2026 27 2026 11", right, below);
                is_ink.then(|| old.map(|v| 0.6 * v + 0.4 * 255.0))
            }
            Strange::Flare => {
                let radius = 0.11 * h;
                let far = (left - 0.3 * w).hypot(top - 0.35 * h) / radius;
                let light = 34.0 * ((1.0 - far) * radius / 1.5 + 0.5).clamp(0.0, 1.0)
                    + 60.0 * (-(far / 0.25).powi(2)).exp();
                let lit = |(v, tint): (f32, f32)| (v + tint * light).min(255.0);
                let [r, g, b] = old;
                (light > 0.5).then(|| [(r, 1.0), (g, 0.85), (b, 0.6)].map(lit))
            }
            Strange::Retouched => inside(0.55..0.72, 0.4..0.6)
                .then(|| codes(x - (0.31 * w) as usize, y - (0.23 * h) as usize)),
            Strange::Dust => {
                let spots = [(0.2, 0.2), (0.7, 0.3), (0.45, 0.55), (0.3, 0.8), (0.85, 0.75)];
                let far = |(a, b): (f32, f32)| (left - a * w).hypot(top - b * h) / (0.012 * w);
                let nearest = spots.into_iter().map(far).fold(f32::INFINITY, f32::min);
                let passed = 1.0 - 0.35 * (1.5 - nearest).clamp(0.0, 1.0);
                (passed < 0.99).then(|| old.map(|v| passed * v))
            }
        }
    }
}

/// Whether `text`, in digits of 3×5 cells, has ink `right` cells left of its right end and `below`
/// cells above its foot.
fn is_ink(text: &str, right: f32, below: f32) -> bool {
    const DIGITS: [u16; 10] = [
        0b111_101_101_101_111,
        0b010_110_010_010_111,
        0b111_001_111_100_111,
        0b111_001_011_001_111,
        0b101_101_111_001_001,
        0b111_100_111_001_111,
        0b111_100_111_101_111,
        0b111_001_010_010_010,
        0b111_101_111_101_111,
        0b111_101_111_001_111,
    ];
    let (width, height) = (4 * text.len(), 5);
    if right < 0.0 || below < 0.0 || below >= height as f32 {
        return false;
    }
    let Some(column) = (width - 1).checked_sub(right as usize) else { return false };
    let row = height - 1 - below as usize;
    let Some(digit) = text.as_bytes().get(column / 4).filter(|c| c.is_ascii_digit()) else {
        return false;
    };
    let across = column % 4;
    across < 3 && DIGITS[usize::from(digit - b'0')] >> (14 - (3 * row + across)) & 1 == 1
}

/// Columns of the table.
const HEAD: [&str; 10] = [
    "rig",
    "photo",
    "data",
    "strange",
    "verdict",
    "share of SSIM",
    "share of dB",
    "SSIM gained",
    "residual over noise",
    "left as it was",
];

/// Shares of the gain that remain on photos of four scenes of `group`, on two rigs (`quick`: one).
pub(crate) fn run(group: Group, quick: bool) -> Result<Made, Failure> {
    let caption = "Gain outside a strange thing's place, as a share of that without the thing.";
    let table = Table::new(caption.to_owned(), &HEAD);
    let mut made = Made::table(format!("strange-{}", group.word()), table);
    let rigs = &group.rigs()[1..];
    for rig in if quick { &rigs[..1] } else { rigs } {
        let file = rig.load(group.seed() + 700)?;
        let (file, calibration) = calibrated(&file, &NOTHING, 0.0)?;
        let mut harness = Harness::changed(&file, &calibration, &NOTHING, 0.0)?;
        for (n, subject) in subjects(group).into_iter().enumerate() {
            let tone = Tone::of_curve(file.photo.curve, 8);
            let codes = to_codes(&View { subject, quarter: None }.codes(file.photo.size()));
            let light = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
            for data in ["raw", "developed", "JPEG 90"] {
                let taken = Taken::of(&harness, &light, data, group.seed() + n as u64)?;
                let words = [rig.name, subject.name(), data].map(|word| word.replace(',', ""));
                let truth = harness.truth(&light);
                taken.score(&mut harness, &truth, &words, &mut made)?;
            }
        }
    }
    Ok(made)
}

fn subjects(group: Group) -> Vec<Subject> {
    match group {
        Group::Limits => group.subjects()[..4].to_vec(),
        Group::Rates => [0, 1, 3, 4].map(Subject::Kept).to_vec(),
    }
}

/// A photo to which strange things are added.
struct Taken {
    light: Frame<Work>,
    raw: Option<RawSites>,
    jpeg: bool,
    tone: Tone,
}

impl Taken {
    fn of(harness: &Harness, light: &Frame<Work>, data: &str, seed: u64) -> Result<Taken, Failure> {
        let curve = harness.config().photo.curve;
        let tone = Tone::of_curve(curve, 8);
        let taken = match data {
            "raw" => harness.photograph(light, seed)?,
            _ => {
                let codes = harness.witness.photograph(light, seed);
                TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, codes.plane(c))))
            }
        };
        Ok(Taken { light: taken.light, raw: taken.raw, jpeg: data.starts_with("JPEG"), tone })
    }

    /// Adds a row for each strange thing that may occur in these data, and a sheet of pictures: the
    /// photo, the result and the weight of the photo in it, from left to right.
    fn score(
        &self,
        harness: &mut Harness,
        truth: &Frame<Work>,
        words: &[String; 3],
        made: &mut Made,
    ) -> Result<(), Failure> {
        let (clean_photo, clean) = self.restored(harness, None)?;
        // Nothing is ever drawn on raw sites.
        let drawn = [Strange::Stamp, Strange::Watermark, Strange::Retouched];
        let all = ALL.iter().filter(|(of, _)| self.raw.is_none() || !drawn.contains(of));
        let mut sheet: Vec<[Plane; 3]> = Vec::new();
        for &(strange, name) in all {
            let (with, outcome) = self.restored(harness, Some(strange))?;
            let place = near(&strange.over(&with).1, UNSCORED_PX);
            let score = |picture: &Frame<Work>| {
                let outside = Frame::from_fn(|c| {
                    let (picture, truth) = (picture.plane(c), truth.plane(c));
                    Plane::from_fn(place.size(), |x, y| match place.at(x, y) {
                        0 => picture.at(x, y),
                        _ => truth.at(x, y),
                    })
                });
                harness.test_rig.quality(&outside, truth)
            };
            let [before, best, found] = [&clean_photo, &clean.picture, &outcome.picture].map(score);
            let share = |of: fn(&PictureQuality) -> f64| {
                (of(&found) - of(&before)) / (of(&best) - of(&before))
            };
            let mut row = words.to_vec();
            row.extend([name.to_owned(), format!("{:?}", outcome.verdict)]);
            let shares = [share(|of| of.ssim), share(|of| of.psnr_db)];
            row.extend(shares.map(|share| format!("{share:.2}")));
            row.push(format!("{:.3}", best.ssim - before.ssim));
            let certificate = outcome.certificate.map(|of| format!("{:.2}", of.ratio()));
            row.push(certificate.unwrap_or_default());
            row.push(format!("{:.3}", outcome.outliers.as_ref().map_or(0.0, Outliers::share)));
            log::info!("{}", row.join(" | "));
            made.tables[0].1.row(row);
            let mut weight = Plane::zeros(place.size());
            if let Some(outliers) = &outcome.outliers {
                weight.add_scaled(255.0, &outliers.weight);
            }
            sheet.push([harness.seen(&with), harness.seen(&outcome.picture), weight]);
        }
        let Size { width, height } = self.light.size();
        let sheet = Plane::from_fn(Size::new(3 * width, sheet.len() * height), |x, y| {
            sheet[y / height][x / width].at(x % width, y % height)
        });
        made.pictures.push((words.each_ref().map(|word| word.replace(' ', "-")).join("-"), sheet));
        Ok(())
    }

    /// Light of the photo with the strange thing in it, and the outcome of its restoration.
    fn restored(
        &self,
        harness: &mut Harness,
        strange: Option<Strange>,
    ) -> Result<(Frame<Work>, Outcome), Failure> {
        let codes = |light: &Frame<Work>| -> Frame<Work> {
            Frame::from_fn(|c| self.tone.display(c, light.plane(c)))
        };
        let light = match strange {
            None => self.light.clone(),
            Some(strange) => {
                let (with, place) = strange.over(&codes(&self.light));
                let with = self.light_of(&with);
                Frame::from_fn(|c| {
                    let (with, own) = (with.plane(c), self.light.plane(c));
                    Plane::from_fn(place.size(), |x, y| match place.at(x, y) {
                        0 => own.at(x, y),
                        _ => with.at(x, y),
                    })
                })
            }
        };
        let own = harness.config().restore.method;
        let solver = harness.method(&|rig| method(rig, own));
        if self.jpeg {
            let file = coded(&to_codes(&codes(&light)), Quality { quality: 90, pixels: (2, 2) });
            let curve = harness.config().photo.curve;
            let photo = Photo::from_bytes("photo.jpg", &file, curve, &Limits::default())?;
            let prepared = harness.test_rig.parts().0.prepare(&photo);
            return Ok((photo.light.clone(), harness.restore(&prepared, &*solver)?.outcome));
        }
        let photo = TestPhoto { light: light.clone(), raw: self.raw, coded: None };
        let prepared = harness.prepare(&photo);
        Ok((light, harness.restore(&prepared, &*solver)?.outcome))
    }

    fn light_of(&self, codes: &Frame<Work>) -> Frame<Work> {
        let codes = to_codes(codes);
        Frame::from_fn(|c| self.tone.plane(c, codes.plane(c)))
    }
}

fn to_codes(codes: &Frame<Work>) -> Frame<Work, u8> {
    Frame::from_fn(|c| codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
}

/// Mask of the pixels within `reach`, across and down, of a pixel of the mask `place`.
fn near(place: &Plane<u8>, reach: usize) -> Plane<u8> {
    let Size { width, height } = place.size();
    let around = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let rows = Plane::from_fn(place.size(), |x, y| {
        around(x, width).map(|x| place.at(x, y)).max().unwrap_or(0)
    });
    Plane::from_fn(place.size(), |x, y| around(y, height).map(|y| rows.at(x, y)).max().unwrap_or(0))
}
