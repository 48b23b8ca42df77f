//! Tables of a sweep: where each method begins to harm, and how often judging is wrong.

use relens::chart::table::Table;
use relens::pipeline::Verdict;

use super::cells::{Cell, Sense, methods_of, swept_of};
use super::sweep::{Found, METHODS, Run, same};

impl Run {
    /// Whether the result is worse than the untouched photo in luma.
    pub(crate) fn harms(&self) -> bool {
        self.result.harms_luma(self.photo)
    }

    /// Whether the delivered picture is worse than the untouched photo in luma.
    pub(crate) fn harms_delivered(&self) -> bool {
        self.delivered.harms_luma(self.photo)
    }

    /// Whether the delivered picture is worse than the result in luma.
    fn gives_up(&self) -> bool {
        self.delivered.harms_luma(self.result)
    }
}

/// Table of faults by methods: the strength at which harm begins, and how many of the harmful
/// results at that strength were noticed.
pub(super) fn harm_table(caption: String, cells: &[Cell], found: &Found, sense: Sense) -> Table {
    let methods = methods_of(cells);
    let mut head = vec!["fault"];
    head.extend(&methods);
    let mut table = Table::new(caption, &head);
    for swept in swept_of(cells) {
        let mut fault = format!("{}, {}", swept.change.name, swept.change.unit);
        let refused = found.refused.iter().filter(|(other, _)| same(other, swept));
        let refused: Vec<String> = refused.map(|(_, strength)| strength.to_string()).collect();
        if !refused.is_empty() {
            fault += &format!(" (the camera is refused at {})", refused.join(", "));
        }
        let mut row = vec![fault];
        row.extend(methods.iter().map(|&method| {
            let of = || cells.iter().filter(|c| c.method == method && same(c.swept, swept));
            match of().find(|cell| cell.harms(sense)) {
                Some(cell) => {
                    let at = match cell.step {
                        0 => "always".to_owned(),
                        _ => cell.strength.to_string(),
                    };
                    format!("{at} ({}/{})", sense.of(cell.caught), sense.of(cell.harmful))
                }
                None if of().any(|cell| cell.step > 0) => "never".to_owned(),
                None => "–".to_owned(),
            }
        }));
        table.row(row);
    }
    table
}

/// Table of the rates of wrong verdicts, by method and for all methods.
pub(crate) fn rates_table(caption: String, runs: &[Run]) -> Table {
    let head = [
        "method",
        "runs",
        "healthy",
        "false alarms",
        "costly",
        "harmful",
        "caught",
        "by lens alone",
        "by the photo",
        "harm delivered",
        "gain given up",
        "harmful in colour",
        "caught",
        "harm delivered in colour",
    ];
    let mut table = Table::new(caption, &head);
    for name in METHODS.into_iter().chain(["all"]) {
        let mut of: Vec<&Run> =
            runs.iter().filter(|run| name == "all" || run.method == name).collect();
        // A result without a fault counts once, not for every fault.
        let first = of.first().map(|run| run.swept);
        let again = |run: &&Run| run.step == 0 && first.is_some_and(|s| !same(s, run.swept));
        of.retain(|run| !again(run));
        if of.is_empty() {
            continue;
        }
        let count = |is: &dyn Fn(&Run) -> bool| of.iter().filter(|run| is(run)).count();
        let replaced = |by: Verdict| count(&|run| run.harms() && run.verdict == by).to_string();
        let coloured = |run: &Run| run.result.harms_colour(run.photo);
        let healthy = |run: &Run| run.step == 0 && !run.result.harms(run.photo);
        let harmless = |run: &Run| run.step > 0 && !run.result.harms(run.photo);
        let share = |is: &dyn Fn(&Run) -> bool, whole: usize| match (count(is), whole) {
            (_, 0) => "–".to_owned(),
            (part, _) => format!("{part} ({:.1} %)", 100.0 * part as f64 / whole as f64),
        };
        let (healthy_count, harmful) = (count(&healthy), count(&Run::harms));
        let in_colour = count(&coloured);
        table.row(vec![
            name.to_owned(),
            of.len().to_string(),
            healthy_count.to_string(),
            share(&|run| healthy(run) && run.verdict.noticed(), healthy_count),
            share(&|run| healthy(run) && run.gives_up(), healthy_count),
            harmful.to_string(),
            share(&|run| run.harms() && run.verdict.noticed(), harmful),
            replaced(Verdict::Replaced),
            replaced(Verdict::Untouched),
            share(&Run::harms_delivered, of.len()),
            share(&|run| harmless(run) && run.gives_up(), count(&harmless)),
            in_colour.to_string(),
            share(&|run| coloured(run) && run.verdict.noticed(), in_colour),
            share(&|run| run.delivered.harms_colour(run.photo), of.len()),
        ]);
    }
    table
}
