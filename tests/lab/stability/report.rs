//! What a sweep found, as tables: where each method begins to do harm, who noticed, and how often
//! that goes wrong.

use super::contestant::Contestant;
use super::fault::Fault;
use super::sweep::Run;
use crate::evaluate::table::Table;
use crate::pipeline::Verdict;

/// SSIM below the untouched photo's that counts as harm; the study: less means nothing.
pub const HARM: f64 = 0.002;

/// One method under one strength of one fault, over all views.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// What was wrong.
    pub fault: Fault,
    /// How much.
    pub strength: f64,
    /// Which of the fault's strengths, 0 for none.
    pub step: usize,
    /// The method.
    pub contestant: Contestant,
    /// Views.
    pub runs: usize,
    /// Mean SSIM of the results.
    pub ssim: f64,
    /// Mean SSIM of the untouched photos.
    pub photo_ssim: f64,
    /// Mean SSIM of what is delivered.
    pub delivered_ssim: f64,
    /// Results that harm.
    pub harmful: usize,
    /// Of those, the ones the box noticed.
    pub caught: usize,
    /// Results the box noticed, harmful or not.
    pub noticed: usize,
}

impl Run {
    /// Whether the result is worse than the untouched photo.
    pub fn harms(&self) -> bool {
        self.ssim < self.photo_ssim - HARM
    }

    /// Whether what is delivered is.
    pub fn harms_delivered(&self) -> bool {
        self.delivered_ssim < self.photo_ssim - HARM
    }
}

impl Cell {
    /// Whether the method does harm here, on the mean of the views.
    pub fn harms(&self) -> bool {
        self.ssim < self.photo_ssim - HARM
    }
}

/// The means over the views, in the order of the runs.
pub fn cells(runs: &[Run]) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::new();
    for run in runs {
        let same =
            |c: &Cell| (c.fault, c.step, c.contestant) == (run.fault, run.step, run.contestant);
        let n = cells.iter().position(same).unwrap_or_else(|| {
            cells.push(Cell {
                fault: run.fault,
                strength: run.strength,
                step: run.step,
                contestant: run.contestant,
                runs: 0,
                ssim: 0.0,
                photo_ssim: 0.0,
                delivered_ssim: 0.0,
                harmful: 0,
                caught: 0,
                noticed: 0,
            });
            cells.len() - 1
        });
        let cell = &mut cells[n];
        cell.runs += 1;
        // Running means.
        let share = 1.0 / cell.runs as f64;
        cell.ssim += share * (run.ssim - cell.ssim);
        cell.photo_ssim += share * (run.photo_ssim - cell.photo_ssim);
        cell.delivered_ssim += share * (run.delivered_ssim - cell.delivered_ssim);
        cell.harmful += usize::from(run.harms());
        cell.caught += usize::from(run.harms() && run.verdict.noticed());
        cell.noticed += usize::from(run.verdict.noticed());
    }
    cells
}

/// Every cell.
pub fn cells_table(caption: String, cells: &[Cell]) -> Table {
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
        let (name, unit) = cell.fault.name();
        table.row(vec![
            name.to_owned(),
            cell.strength.to_string(),
            unit.to_owned(),
            cell.contestant.name().to_owned(),
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

/// The first strength at which `contestant` does harm under `fault`.
pub fn begins(cells: &[Cell], contestant: Contestant, fault: Fault) -> Option<&Cell> {
    cells.iter().find(|c| c.contestant == contestant && c.fault == fault && c.harms())
}

/// Methods by faults: the strength at which harm begins, and how many of the harmful results there
/// were noticed.
pub fn harm_table(caption: String, cells: &[Cell]) -> Table {
    let mut head = vec!["fault"];
    let contestants: Vec<Contestant> = Contestant::ALL
        .into_iter()
        .filter(|c| cells.iter().any(|cell| cell.contestant == *c))
        .collect();
    head.extend(contestants.iter().map(|c| c.name()));
    let mut table = Table::new(caption, &head);
    for fault in Fault::ALL.into_iter().filter(|f| cells.iter().any(|cell| cell.fault == *f)) {
        let (name, unit) = fault.name();
        let mut row = vec![format!("{name}, {unit}")];
        row.extend(contestants.iter().map(|&contestant| {
            let concerned =
                cells.iter().any(|c| c.contestant == contestant && c.fault == fault && c.step > 0);
            match begins(cells, contestant, fault) {
                Some(cell) if cell.step == 0 => {
                    format!("always ({}/{})", cell.caught, cell.harmful)
                }
                Some(cell) => format!("{} ({}/{})", cell.strength, cell.caught, cell.harmful),
                None if concerned => "never".to_owned(),
                None => "–".to_owned(),
            }
        }));
        table.row(row);
    }
    table
}

/// How often noticing goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rates {
    /// Results without a fault that do no harm.
    pub healthy: usize,
    /// Of those, the ones noticed all the same.
    pub false_alarms: usize,
    /// Of those, the ones whose replacement was less good.
    pub costly: usize,
    /// Results that harm.
    pub harmful: usize,
    /// Of those, the ones noticed.
    pub caught: usize,
    /// Runs.
    pub runs: usize,
    /// Deliveries worse than the untouched photo.
    pub harm_delivered: usize,
    /// Results that do no harm, under a fault.
    pub harmless: usize,
    /// Of those, the ones given up for something less good.
    pub given_up: usize,
}

impl Rates {
    /// Of `runs`, those without fault counted once.
    pub fn of<'a>(runs: impl Iterator<Item = &'a Run>) -> Rates {
        let mut rates = Rates::default();
        let mut first = None;
        for run in runs {
            // No fault is no fault, whichever fault it is the first strength of.
            if run.step == 0 && *first.get_or_insert(run.fault) != run.fault {
                continue;
            }
            let (harms, noticed) = (run.harms(), run.verdict.noticed());
            rates.runs += 1;
            rates.harmful += usize::from(harms);
            rates.caught += usize::from(harms && noticed);
            rates.harm_delivered += usize::from(run.harms_delivered());
            rates.healthy += usize::from(!harms && run.step == 0);
            rates.false_alarms += usize::from(!harms && noticed && run.step == 0);
            let worse = run.delivered_ssim < run.ssim - HARM;
            rates.costly += usize::from(!harms && worse && run.step == 0);
            rates.harmless += usize::from(!harms && run.step > 0);
            rates.given_up += usize::from(!harms && worse && run.step > 0);
        }
        rates
    }
}

/// The rates, method by method and of all.
pub fn rates_table(caption: String, runs: &[Run]) -> Table {
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
    let mut row = |name: &str, of: &[&Run]| {
        let rates = Rates::of(of.iter().copied());
        let replaced = |by: fn(Verdict) -> bool| {
            of.iter().filter(|r| r.harms() && by(r.verdict)).count().to_string()
        };
        let share = |part: usize, whole: usize| match whole {
            0 => "–".to_owned(),
            _ => format!("{part} ({:.1} %)", 100.0 * part as f64 / whole as f64),
        };
        table.row(vec![
            name.to_owned(),
            rates.runs.to_string(),
            rates.healthy.to_string(),
            share(rates.false_alarms, rates.healthy),
            share(rates.costly, rates.healthy),
            rates.harmful.to_string(),
            share(rates.caught, rates.harmful),
            replaced(|v| v == Verdict::Replaced),
            replaced(|v| v == Verdict::Untouched),
            share(rates.harm_delivered, rates.runs),
            share(rates.given_up, rates.harmless),
        ]);
    };
    for contestant in Contestant::ALL {
        let of: Vec<&Run> = runs.iter().filter(|r| r.contestant == contestant).collect();
        if !of.is_empty() {
            row(contestant.name(), &of);
        }
    }
    row("all", &runs.iter().collect::<Vec<_>>());
    table
}
