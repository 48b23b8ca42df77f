//! Stored results of a sweep, one a line: an interrupted sweep is continued by the same command,
//! and tables are made again without solving.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;

use relens::pipeline::Verdict;

use super::sweep::{Found, METHODS, Plan, Run, same};
use super::{VIEWS, all_swept};
use crate::Failure;
use crate::change::Swept;
use crate::likeness::Likeness;

/// Stored results of a sweep, and the file to which more are appended.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    file: Option<File>,
    found: Found,
}

const HEAD: &str = "fault,strength,step,method,view,seed,photo SSIM,photo ΔE,SSIM,ΔE,\
    delivered SSIM,delivered ΔE,verdict";
/// Word in the column of methods if calibration was refused.
const REFUSED: &str = "refused";

const VERDICTS: [(Verdict, &str); 3] =
    [(Verdict::Sound, "sound"), (Verdict::Replaced, "replaced"), (Verdict::Untouched, "untouched")];

/// The results in the lines of `text`, without those of unknown faults, methods or views and
/// without a truncated line.
pub(crate) fn parsed(text: &str) -> Found {
    let mut found = Found::default();
    for line in text.lines().skip(1) {
        let parts: Vec<&str> = line.split(',').collect();
        match run_of(&parts) {
            Some(run) => found.runs.push(run),
            None if parts.get(3) == Some(&REFUSED) => {
                found.refused.extend(swept(parts[0]).zip(parts[1].parse().ok()));
            }
            None => {}
        }
    }
    found
}

impl Kept {
    /// Opens the file at `path` and reads its results; more are appended to it.
    pub(crate) fn open(path: &Path) -> Result<Kept, Failure> {
        let cannot = |e| format!("cannot open {}: {e}", path.display());
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(cannot)?;
        match text.as_str() {
            "" => writeln!(file, "{HEAD}")?,
            text if !text.ends_with('\n') => writeln!(file)?,
            _ => {}
        }
        Ok(Kept { file: Some(file), found: parsed(&text) })
    }

    /// Stored results of `plan` under `swept` at the strength with the index `step`.
    pub(crate) fn of(&self, plan: &Plan<'_>, swept: &'static Swept, step: usize) -> Vec<Run> {
        let is = |run: &&Run| {
            (run.step, run.seed) == (step, plan.seed)
                && same(run.swept, swept)
                && plan.methods.contains(&run.method)
                && plan.views.contains(&run.view)
        };
        self.found.runs.iter().filter(is).cloned().collect()
    }

    /// Whether calibration was refused under `swept` at `strength`.
    pub(super) fn refuses(&self, swept: &'static Swept, strength: f64) -> bool {
        self.found.refused.iter().any(|(other, at)| same(other, swept) && *at == strength)
    }

    /// Appends `runs`.
    pub(crate) fn keep(&mut self, runs: &[Run]) -> Result<(), Failure> {
        self.write(&runs.iter().map(|run| format!("{}\n", line(run))).collect::<String>())
    }

    /// Appends that calibration was refused under `swept` at `strength`.
    pub(super) fn keep_refused(&mut self, swept: &Swept, strength: f64) -> Result<(), Failure> {
        self.found.refused.extend(self::swept(swept.change.name).zip(Some(strength)));
        self.write(&format!("{},{strength},,{REFUSED}\n", swept.change.name))
    }

    fn write(&mut self, lines: &str) -> Result<(), Failure> {
        let Some(file) = &mut self.file else { return Ok(()) };
        file.write_all(lines.as_bytes())?;
        Ok(file.sync_data()?)
    }
}

fn swept(name: &str) -> Option<&'static Swept> {
    all_swept().into_iter().find(|swept| swept.change.name == name)
}

fn line(run: &Run) -> String {
    let name = |view: &str| view.replace(',', "");
    let mut cells = vec![
        run.swept.change.name.to_owned(),
        run.strength.to_string(),
        run.step.to_string(),
        run.method.to_owned(),
        name(&run.view.name()),
        run.seed.to_string(),
    ];
    for of in [run.photo, run.result, run.delivered] {
        cells.push(format!("{:.5}", of.ssim));
        cells.push(of.difference.map_or(String::new(), |difference| format!("{difference:.4}")));
    }
    let word = VERDICTS.iter().find(|(verdict, _)| *verdict == run.verdict);
    cells.extend(word.map(|(_, word)| (*word).to_owned()));
    cells.join(",")
}

fn run_of(parts: &[&str]) -> Option<Run> {
    let &[fault, strength, step, method, view, seed, .., verdict] = parts else { return None };
    let likeness = |n: usize| {
        let [ssim, difference] = parts.get(n..n + 2)? else { return None };
        Some(Likeness { ssim: ssim.parse().ok()?, difference: difference.parse().ok() })
    };
    Some(Run {
        swept: swept(fault)?,
        strength: strength.parse().ok()?,
        step: step.parse().ok()?,
        method: METHODS.into_iter().find(|name| *name == method)?,
        view: VIEWS.into_iter().find(|known| known.name().replace(',', "") == view)?,
        seed: seed.parse().ok()?,
        photo: likeness(6)?,
        result: likeness(8)?,
        delivered: likeness(10)?,
        verdict: VERDICTS.iter().find(|(_, word)| *word == verdict)?.0,
    })
}
