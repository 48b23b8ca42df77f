//! What a sweep found, as tables: where each method begins to do harm, who noticed, and how often
//! that goes wrong.

use relens::chart::table::Table;
use relens::pipeline::Verdict;

use super::sweep::{METHODS, Run, same};
use crate::Failure;
use crate::change::{SWEPT, Swept};

/// SSIM below the untouched photo's that counts as harm; the study: less means nothing.
pub(crate) const HARM: f64 = 0.002;

/// One method under one strength of one change, over all views.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) swept: &'static Swept,
    pub(super) strength: f64,
    /// Which of the strengths, 0 for none.
    pub(super) step: usize,
    pub(super) method: &'static str,
    /// Views.
    pub(super) runs: usize,
    /// Mean SSIM of the results.
    pub(super) ssim: f64,
    /// Mean SSIM of the untouched photos.
    pub(super) photo_ssim: f64,
    /// Mean SSIM of what is delivered.
    pub(super) delivered_ssim: f64,
    /// Results that harm.
    pub(super) harmful: usize,
    /// Of those, the ones the box noticed.
    pub(super) caught: usize,
    /// Results the box noticed, harmful or not.
    pub(super) noticed: usize,
}

impl Run {
    /// Whether the result is worse than the untouched photo.
    pub(crate) fn harms(&self) -> bool {
        self.ssim < self.photo_ssim - HARM
    }

    /// Whether what is delivered is.
    pub(crate) fn harms_delivered(&self) -> bool {
        self.delivered_ssim < self.photo_ssim - HARM
    }

    /// Whether what is delivered is worse than the result.
    fn gives_up(&self) -> bool {
        self.delivered_ssim < self.ssim - HARM
    }
}

impl Cell {
    /// Of `runs`, all of one method under one strength of one change.
    fn of(runs: &[&Run]) -> Option<Cell> {
        let first = runs.first()?;
        let mean =
            |of: fn(&Run) -> f64| runs.iter().map(|run| of(run)).sum::<f64>() / runs.len() as f64;
        let count = |of: fn(&Run) -> bool| runs.iter().filter(|run| of(run)).count();
        Some(Cell {
            swept: first.swept,
            strength: first.strength,
            step: first.step,
            method: first.method,
            runs: runs.len(),
            ssim: mean(|run| run.ssim),
            photo_ssim: mean(|run| run.photo_ssim),
            delivered_ssim: mean(|run| run.delivered_ssim),
            harmful: count(Run::harms),
            caught: count(|run| run.harms() && run.verdict.noticed()),
            noticed: count(|run| run.verdict.noticed()),
        })
    }

    /// Whether the method does harm here, on the mean of the views.
    fn harms(&self) -> bool {
        self.ssim < self.photo_ssim - HARM
    }
}

/// The means over the views: change by change, strength by strength, method by method.
pub(super) fn cells(runs: &[Run]) -> Vec<Cell> {
    let mut groups: Vec<Vec<&Run>> = Vec::new();
    for run in runs {
        let of = |group: &&mut Vec<&Run>| {
            let first = group[0];
            same(first.swept, run.swept) && (first.step, first.method) == (run.step, run.method)
        };
        match groups.iter_mut().find(of) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups.iter().filter_map(|group| Cell::of(group)).collect()
}

/// The methods in `cells`, in their order.
pub(super) fn methods_of(cells: &[Cell]) -> Vec<&'static str> {
    METHODS.into_iter().filter(|m| cells.iter().any(|cell| cell.method == *m)).collect()
}

/// The changes in `cells`, in their order.
pub(super) fn swept_of(cells: &[Cell]) -> Vec<&'static Swept> {
    SWEPT.iter().filter(|s| cells.iter().any(|cell| same(cell.swept, s))).collect()
}

/// The cells that [`cells_table`] once gave, from its comma-separated values; those of changes and
/// methods that are there no more are left out.
pub(super) fn kept(text: &str) -> Result<Vec<Cell>, Failure> {
    let mut cells: Vec<Cell> = Vec::new();
    for line in text.lines().skip(1) {
        // A unit may have a comma, between quotes.
        let mut quoted = false;
        let ends = |c: char| {
            quoted ^= c == '"';
            c == ',' && !quoted
        };
        let parts: Vec<&str> = line.split(ends).collect();
        let &[
            fault,
            strength,
            _,
            method,
            runs,
            photo,
            ssim,
            _,
            delivered,
            harmful,
            caught,
            noticed,
        ] = &parts[..]
        else {
            return Err(format!("found `{line}`, allowed rows of cells").into());
        };
        let swept = SWEPT.iter().find(|swept| swept.change.name == fault);
        let method = METHODS.into_iter().find(|name| *name == method);
        let (Some(swept), Some(method)) = (swept, method) else { continue };
        let strength: f64 = strength.parse()?;
        let before = cells.iter().filter(|c| same(c.swept, swept) && c.method == method);
        cells.push(Cell {
            step: before.count(),
            swept,
            strength,
            method,
            runs: runs.parse()?,
            ssim: ssim.parse()?,
            photo_ssim: photo.parse()?,
            delivered_ssim: delivered.parse()?,
            harmful: harmful.parse()?,
            caught: caught.parse()?,
            noticed: noticed.parse()?,
        });
    }
    Ok(cells)
}

/// Every cell.
pub(super) fn cells_table(caption: String, cells: &[Cell]) -> Table {
    let head = [
        "fault",
        "strength",
        "unit",
        "method",
        "views",
        "photo SSIM",
        "SSIM",
        "gain",
        "delivered SSIM",
        "harmful",
        "caught",
        "noticed",
    ];
    let mut table = Table::new(caption, &head);
    for cell in cells {
        table.row(vec![
            cell.swept.change.name.to_owned(),
            cell.strength.to_string(),
            cell.swept.change.unit.to_owned(),
            cell.method.to_owned(),
            cell.runs.to_string(),
            format!("{:.4}", cell.photo_ssim),
            format!("{:.4}", cell.ssim),
            format!("{:+.4}", cell.ssim - cell.photo_ssim),
            format!("{:.4}", cell.delivered_ssim),
            cell.harmful.to_string(),
            cell.caught.to_string(),
            cell.noticed.to_string(),
        ]);
    }
    table
}

/// Changes by methods: the strength at which harm begins, and how many of the harmful results there
/// were noticed.
pub(super) fn harm_table(caption: String, cells: &[Cell]) -> Table {
    let methods = methods_of(cells);
    let mut head = vec!["fault"];
    head.extend(&methods);
    let mut table = Table::new(caption, &head);
    for swept in swept_of(cells) {
        let mut row = vec![format!("{}, {}", swept.change.name, swept.change.unit)];
        row.extend(methods.iter().map(|&method| {
            let of = || cells.iter().filter(|c| c.method == method && same(c.swept, swept));
            match of().find(|cell| cell.harms()) {
                Some(Cell { step: 0, caught, harmful, .. }) => {
                    format!("always ({caught}/{harmful})")
                }
                Some(Cell { strength, caught, harmful, .. }) => {
                    format!("{strength} ({caught}/{harmful})")
                }
                None if of().any(|cell| cell.step > 0) => "never".to_owned(),
                None => "–".to_owned(),
            }
        }));
        table.row(row);
    }
    table
}

/// The rates at which noticing goes wrong, method by method and of all.
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
    ];
    let mut table = Table::new(caption, &head);
    for name in METHODS.into_iter().chain(["all"]) {
        let mut of: Vec<&Run> =
            runs.iter().filter(|run| name == "all" || run.method == name).collect();
        // No change is no change, whichever change it is the first strength of.
        let first = of.first().map(|run| run.swept);
        let again = |run: &&Run| run.step == 0 && first.is_some_and(|s| !same(s, run.swept));
        of.retain(|run| !again(run));
        if of.is_empty() {
            continue;
        }
        let count = |is: &dyn Fn(&Run) -> bool| of.iter().filter(|run| is(run)).count();
        let replaced = |by: Verdict| count(&|run| run.harms() && run.verdict == by).to_string();
        let healthy = |run: &Run| !run.harms() && run.step == 0;
        let harmless = |run: &Run| !run.harms() && run.step > 0;
        let share = |is: &dyn Fn(&Run) -> bool, whole: usize| match (count(is), whole) {
            (_, 0) => "–".to_owned(),
            (part, _) => format!("{part} ({:.1} %)", 100.0 * part as f64 / whole as f64),
        };
        let (healthy_count, harmful) = (count(&healthy), count(&Run::harms));
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
        ]);
    }
    table
}
