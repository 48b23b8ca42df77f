//! Ablation of the table of witnesses. It is applied to stored results as it is, without each row,
//! and with each limit moved.

use relens::chart::table::Table;
use relens::pipeline::{FOREIGN, NO_GAIN, Verdict, WITNESSES, WitnessRow, harm, is_suspect};

use super::record::Record;
use crate::likeness::Likeness;

/// Factors by which a limit is moved.
const NEIGHBOURS: [f64; 2] = [0.8, 1.25];

/// Limits by which results are judged.
#[derive(Clone)]
struct Limits {
    witnesses: Vec<WitnessRow>,
    /// Unexplained product of the reference solution above which no scene gives the photo.
    foreign_above: f64,
    /// Luma's residual over the untouched photo's above which nothing is gained.
    no_gain_above: f64,
}

/// The effect of each witness and each limit on `records`.
pub(crate) fn table(caption: String, records: &[Record]) -> Table {
    let head = [
        "table",
        "noticed",
        "in luma",
        "false alarms",
        "delivered worse in luma",
        "in colour only",
        "mean SSIM delivered",
    ];
    let mut table = Table::new(caption, &head);
    for (name, limits) in variants() {
        let mut cells = vec![name];
        cells.extend(counts(records, &limits));
        table.row(cells);
    }
    table
}

/// Number of results for which the table as it is gives another verdict than the pipeline.
pub(crate) fn differing(records: &[Record]) -> usize {
    let differs = |record: &&Record| walk(record, &as_it_is()).0 != record.verdict;
    records.iter().filter(differs).count()
}

fn as_it_is() -> Limits {
    Limits { witnesses: WITNESSES.to_vec(), foreign_above: FOREIGN, no_gain_above: NO_GAIN }
}

/// Variants of the table, with their names: as it is, without each witness, each limit moved.
fn variants() -> Vec<(String, Limits)> {
    let mut all = vec![("as it is".to_owned(), as_it_is())];
    for (n, witness) in WITNESSES.iter().enumerate() {
        let mut add = |name: String, change: &dyn Fn(&mut WitnessRow), no_gain: f64| {
            let mut limits = as_it_is();
            change(&mut limits.witnesses[n]);
            if witness.name == "no gain" {
                limits.no_gain_above *= no_gain;
            }
            all.push((name, limits));
        };
        let none = |of: &mut WitnessRow| (of.suspect_above, of.harm_above) = (None, None);
        add(format!("without {}", witness.name), &none, f64::INFINITY);
        for times in NEIGHBOURS {
            let moved = |limit: &mut Option<f64>| *limit = limit.map(|limit| times * limit);
            if witness.suspect_above == witness.harm_above {
                let both = |of: &mut WitnessRow| {
                    moved(&mut of.suspect_above);
                    moved(&mut of.harm_above);
                };
                add(format!("{} × {times}", witness.name), &both, times);
                continue;
            }
            if witness.suspect_above.is_some() {
                let suspect = |of: &mut WitnessRow| moved(&mut of.suspect_above);
                add(format!("{} suspect × {times}", witness.name), &suspect, 1.0);
            }
            if witness.harm_above.is_some() {
                let harm = |of: &mut WitnessRow| moved(&mut of.harm_above);
                add(format!("{} harm × {times}", witness.name), &harm, 1.0);
            }
        }
    }
    for (name, times) in [("without", f64::INFINITY), ("× 0.8", 0.8), ("× 1.25", 1.25)] {
        let mut limits = as_it_is();
        limits.foreign_above *= times;
        all.push((format!("foreign {name}"), limits));
    }
    all
}

/// The verdict on `record` under `limits`, and the likeness of the delivered picture.
fn walk(record: &Record, limits: &Limits) -> (Verdict, Likeness) {
    let judged = &record.judged;
    let Limits { witnesses, foreign_above, no_gain_above } = limits;
    let [alone, beside, digital] = &judged.measures;
    let untouched = (Verdict::Untouched, record.photo);
    if judged.before_solving {
        return untouched;
    }
    if !is_suspect(witnesses, alone, true) {
        return (Verdict::Sound, record.result);
    }
    let no_gain = |found: Option<f64>| found.is_some_and(|found| found > *no_gain_above);
    let own = WITNESSES.iter().position(|of| of.name == "no gain").and_then(|n| alone[n]);
    if judged.foreign > *foreign_above || no_gain(own) && no_gain(judged.reference_gain) {
        return untouched;
    }
    if harm(witnesses, beside).is_none() {
        return (Verdict::Sound, record.result);
    }
    let by_digital = judged.by_captures && harm(witnesses, digital).is_none();
    (Verdict::Replaced, if by_digital { judged.digital } else { judged.reference })
}

/// The table cells of one variant.
fn counts(records: &[Record], limits: &Limits) -> [String; 6] {
    let walked: Vec<(&Record, bool, Likeness)> = records
        .iter()
        .map(|record| {
            let (verdict, delivered) = walk(record, limits);
            (record, verdict.noticed(), delivered)
        })
        .collect();
    let count = |is: &dyn Fn(&Record, bool, Likeness) -> bool| {
        walked
            .iter()
            .filter(|(record, noticed, delivered)| is(record, *noticed, *delivered))
            .count()
    };
    let of = |part: usize, whole: usize| format!("{part} of {whole}");
    let luma = |record: &Record| record.result.harms_luma(record.photo);
    let fine = |record: &Record| record.healthy && !record.harms();
    let mean = walked.iter().map(|of| of.2.ssim).sum::<f64>() / walked.len().max(1) as f64;
    [
        of(count(&|r, noticed, _| r.harms() && noticed), count(&|r, _, _| r.harms())),
        of(count(&|r, noticed, _| luma(r) && noticed), count(&|r, _, _| luma(r))),
        of(count(&|r, noticed, _| fine(r) && noticed), count(&|r, _, _| fine(r))),
        count(&|r, _, delivered| delivered.harms_luma(r.photo)).to_string(),
        count(&|r, _, delivered| delivered.harms_colour(r.photo) && !delivered.harms_luma(r.photo))
            .to_string(),
        format!("{mean:.4}"),
    ]
}
