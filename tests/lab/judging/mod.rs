//! Judging: findings on results of a group of scenes and rigs, rates of wrong verdicts, and the
//! effect of each witness and limit.

mod ablation;
mod cases;
mod findings;
pub(crate) mod foreign;
pub(crate) mod groups;
mod record;
mod report;
#[cfg(test)]
mod tests;

use relens::chart::test_rig::TestPhoto;
use relens::config::MethodName;
use relens::frame::{Channels, Frame, Work};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::method;

use crate::Failure;
use crate::change::{NOTHING, Swept};
use crate::harness::{Harness, calibrated};
use crate::jpeg_coder::coded;
use crate::likeness::{HARM, HARM_IN_COLOUR, Truth};
use crate::made::Made;
use crate::stability::sweep::concerned;
use crate::view::View;
use cases::{Kept, NONE, ORDINARY, faults};
use groups::{Group, GroupRig};
use record::Record;

/// Methods judged: those that start from the lens model. Possible replacements are recorded, too.
const METHODS: [MethodName; 3] =
    [MethodName::Hybrid, MethodName::Digital, MethodName::BlockMatching];

/// Tables of `group` and the list of all its results; `quick` takes the first rig and no faults.
pub(crate) fn run(group: Group, quick: bool) -> Result<Made, Failure> {
    let mut records = Vec::new();
    let rigs = if quick { 1 } else { group.rigs().len() };
    for (n, rig) in group.rigs().iter().enumerate().take(rigs) {
        records.extend(run_rig(group, n, rig, quick)?);
    }
    let mut csv = format!("{}\n", Record::head());
    records.iter().for_each(|record| csv += &(record.cells() + "\n"));
    let files = vec![(format!("judging-{}-results.csv", group.word()), csv.into_bytes())];
    Ok(Made { files, ..tables(group, &records) })
}

/// Tables of `group` from `rows`, the stored list of its results, without solving.
pub(crate) fn walked_again(group: Group, rows: &str) -> Result<Made, Failure> {
    let records = rows.lines().skip(1).map(|line| {
        Record::parse(line).ok_or_else(|| format!("found the row {line:?} of another table").into())
    });
    Ok(tables(group, &records.collect::<Result<Vec<_>, Failure>>()?))
}

fn tables(group: Group, records: &[Record]) -> Made {
    let word = group.word();
    let name = |what: &str| format!("judging-{word}{what}");
    let rates = format!(
        "How often harm is noticed, group `{word}`. Harmful: worse than the photo by {HARM} SSIM \
         of luma or {HARM_IN_COLOUR} of mean ΔE. Noticed: something else than the result is \
         delivered."
    );
    let ordinary = format!(
        "Photos without a fault by the default method, group `{word}`: means, and how many are \
         worse than the photo by {HARM} SSIM of luma or {HARM_IN_COLOUR} of mean ΔE."
    );
    let without = format!(
        "The table of witnesses walked over {} results of group `{word}`: as it is ({} verdicts \
         differ from the pipeline's), without each witness, and with each limit moved.",
        records.len(),
        ablation::differing(records)
    );
    Made {
        tables: vec![
            (name(""), report::rates(rates, records)),
            (name("-ordinary"), report::ordinary(ordinary, records)),
            (name("-ablation"), ablation::table(without, records)),
        ],
        ..Made::default()
    }
}

/// A fault at one of its strengths.
struct Fault {
    swept: &'static Swept,
    strength: f64,
    /// Index of the strength.
    step: usize,
}

impl Fault {
    fn is_none(&self) -> bool {
        self.swept.change.unit.is_empty()
    }
}

/// Results of all cases on `rig`, the `n`-th of `group`.
fn run_rig(group: Group, n: usize, rig: &GroupRig, quick: bool) -> Result<Vec<Record>, Failure> {
    let (file, calibration) = calibrated(&rig.load(group.seed() + 100 * n as u64)?, &NOTHING, 0.0)?;
    let subjects = group.subjects();
    let whole = |n: usize| View { subject: subjects[n % 6], quarter: None };
    let quarter = |n: usize| View { subject: subjects[n % 6], quarter: Some(n / 6 % 4) };
    let mut records = Vec::new();
    let mut add = |swept: &'static Swept, step: usize, of: &[(View, Kept)], methods: &[_]| {
        let fault = Fault { swept, strength: (swept.strengths)(&file)[step], step };
        let mut harness = Harness::changed(&file, &calibration, &swept.change, fault.strength)?;
        let seed = group.seed() + 10 * n as u64 + step as u64;
        for mut record in restore(&mut harness, &fault, of, methods, seed)? {
            record.of[0] = rig.name.replace(',', "");
            log::info!("{}", record.cells());
            records.push(record);
        }
        Ok::<(), Failure>(())
    };
    let mosaic = file.simulation().is_some_and(|s| s.sensor.mosaic.is_some());
    let kinds = ORDINARY.into_iter().filter(|&kept| mosaic || kept != Kept::Developed);
    let every = || (0..6).flat_map(|s| kinds.clone().map(move |kept| (whole(s), kept)));
    add(&NONE, 0, &every().collect::<Vec<_>>(), &METHODS[..1])?;
    let own: Vec<(View, Kept)> = every().filter(|of| of.1 == Kept::Own).step_by(2).collect();
    add(&NONE, 0, &own, &METHODS[1..])?;
    if quick {
        return Ok(records);
    }
    // A rig takes one strength of each fault, so that the three rigs cover three strengths.
    for (f, swept) in faults().into_iter().enumerate() {
        let step = 4 - (f + n) % 3;
        let k = f + step + n;
        let view = if (f + n).is_multiple_of(2) { whole(k) } else { quarter(k + 6 * step) };
        // Block matching is the slowest method, and takes a third of the faults.
        let methods = match (f + n) % 3 {
            0 => &[MethodName::Hybrid, MethodName::BlockMatching][..],
            1 => &[MethodName::Hybrid, MethodName::Digital],
            _ => &[MethodName::Hybrid],
        };
        add(swept, step, &[(view, Kept::Own)], methods)?;
    }
    Ok(records)
}

/// Results of each of `methods` on photos of the views `of`; `seed` and the view give the noise.
fn restore(
    harness: &mut Harness,
    fault: &Fault,
    of: &[(View, Kept)],
    methods: &[MethodName],
    seed: u64,
) -> Result<Vec<Record>, Failure> {
    let tone = Tone::of_curve(harness.config().photo.curve, 8);
    let taken = of.iter().map(|&(view, kept)| {
        let codes = view.codes(harness.config().photo.size());
        let light: Frame<Work> = Frame::from_fn(|c| {
            tone.plane(c, &codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
        });
        let seed = seed.wrapping_mul(1000) + view.number();
        let truth = Truth::of(harness.config(), Channels::Colour, &harness.truth(&light));
        Ok((view, kept, taken(harness, &light, kept, seed)?, truth))
    });
    let taken = taken.collect::<Result<Vec<_>, Failure>>()?;
    harness.change_captures();
    let mut records = Vec::new();
    for (view, kept, photo, truth) in &taken {
        let prepared = harness.prepare(photo);
        for &which in methods {
            let solver = harness.method(&|rig| method(rig, which));
            if fault.step > 0 && !fault.is_none() && !concerned(&*solver, fault.swept) {
                continue;
            }
            let mut record = Record::of(harness, &prepared, truth, &*solver)?;
            record.healthy = fault.is_none();
            record.of = [
                String::new(),
                fault.swept.change.name.to_owned(),
                fault.strength.to_string(),
                kept.name(),
                view.name().replace(',', ""),
                which.name().to_owned(),
            ];
            records.push(record);
        }
    }
    Ok(records)
}

/// A photo of `light` in the form `kept`, with noise from `seed`.
fn taken(h: &Harness, light: &Frame<Work>, kept: Kept, seed: u64) -> Result<TestPhoto, Failure> {
    let curve = h.config().photo.curve;
    let codes = || h.witness.photograph(light, seed);
    Ok(match kept {
        Kept::Own => h.photograph(light, seed)?,
        Kept::Developed => {
            let (tone, codes) = (Tone::of_curve(curve, 8), codes());
            TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, codes.plane(c))))
        }
        Kept::Jpeg(quality) => {
            let file = coded(&codes(), quality);
            Photo::from_bytes("photo.jpg", &file, curve, &Limits::default())?.into()
        }
    })
}
