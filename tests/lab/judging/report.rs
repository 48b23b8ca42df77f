//! Tables of a group's results: rates, and ordinary photos.

use relens::chart::table::Table;

use super::record::Record;

/// A count and its share of a whole, in words.
fn share(part: usize, whole: usize) -> String {
    match whole {
        0 => "–".to_owned(),
        _ => format!("{part} ({:.1} %)", 100.0 * part as f64 / whole as f64),
    }
}

fn count(of: &[&Record], is: impl Fn(&Record) -> bool) -> usize {
    of.iter().filter(|record| is(record)).count()
}

/// `records` grouped by the word at `place` of [`Record::of`], in their order.
fn kinds(records: &[Record], place: usize) -> Vec<(String, Vec<&Record>)> {
    let mut kinds: Vec<(String, Vec<&Record>)> = Vec::new();
    for record in records {
        match kinds.iter_mut().find(|(name, _)| *name == record.of[place]) {
            Some((_, of)) => of.push(record),
            None => kinds.push((record.of[place].clone(), vec![record])),
        }
    }
    kinds
}

/// Rates of noticed harm and of false alarms, by rig, by method and for all results.
pub(crate) fn rates(caption: String, records: &[Record]) -> Table {
    let head = [
        "of",
        "results",
        "harmless, no fault",
        "false alarms: replaced or untouched",
        "those worse for it",
        "harmful",
        "in luma",
        "in colour",
        "noticed",
        "harm delivered in luma",
        "in colour only",
    ];
    let mut table = Table::new(caption, &head);
    let all = std::iter::once(("all".to_owned(), records.iter().collect()));
    for (name, of) in kinds(records, 0).into_iter().chain(kinds(records, 5)).chain(all) {
        let fine = count(&of, |r| r.healthy && !r.harms());
        let harmful = count(&of, Record::harms);
        table.row(vec![
            name,
            of.len().to_string(),
            fine.to_string(),
            share(count(&of, Record::is_alarm), fine),
            share(count(&of, |r| r.is_alarm() && r.costs()), fine),
            harmful.to_string(),
            count(&of, |r| r.result.harms_luma(r.photo)).to_string(),
            count(&of, |r| r.result.harms_colour(r.photo)).to_string(),
            share(count(&of, |r| r.harms() && r.verdict.noticed()), harmful),
            count(&of, |r| r.delivered.harms_luma(r.photo)).to_string(),
            count(&of, |r| r.delivered.harms_colour(r.photo) && !r.delivered.harms_luma(r.photo))
                .to_string(),
        ]);
    }
    table
}

/// Results of the default method on photos without a fault, by the form in which they are kept.
pub(crate) fn ordinary(caption: String, records: &[Record]) -> Table {
    let head = [
        "kept",
        "photos",
        "photo SSIM/ΔE",
        "result",
        "delivered",
        "results worse in luma",
        "in colour",
        "delivered worse in luma",
        "in colour",
        "replaced",
        "untouched",
    ];
    let mut table = Table::new(caption, &head);
    let default = |r: &&Record| r.healthy && r.of[5] == "hybrid";
    let ordinary: Vec<Record> = records.iter().filter(default).cloned().collect();
    for (name, of) in kinds(&ordinary, 3) {
        let mean = |what: fn(&Record) -> crate::likeness::Likeness| {
            let sum = of.iter().map(|r| what(r)).fold((0.0, 0.0), |sum, of| {
                (sum.0 + of.ssim, sum.1 + of.difference.unwrap_or_default())
            });
            let number = of.len().max(1) as f64;
            format!("{:.4}/{:.2}", sum.0 / number, sum.1 / number)
        };
        let verdict = |word: &str| {
            count(&of, |r| format!("{:?}", r.verdict).eq_ignore_ascii_case(word)).to_string()
        };
        table.row(vec![
            name,
            of.len().to_string(),
            mean(|r| r.photo),
            mean(|r| r.result),
            mean(|r| r.delivered),
            count(&of, |r| r.result.harms_luma(r.photo)).to_string(),
            count(&of, |r| r.result.harms_colour(r.photo)).to_string(),
            count(&of, |r| r.delivered.harms_luma(r.photo)).to_string(),
            count(&of, |r| r.delivered.harms_colour(r.photo)).to_string(),
            verdict("replaced"),
            verdict("untouched"),
        ]);
    }
    table
}
