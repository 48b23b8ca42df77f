//! Cells of the map: means over the views of one method under one strength of one fault.

use relens::config::RigFile;

use super::all_swept;
use super::sweep::{METHODS, Run, same};
use crate::change::Swept;
use crate::likeness::Likeness;

/// One method under one strength of one fault, over all views.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) swept: &'static Swept,
    pub(super) strength: f64,
    /// Index of the strength; 0 is without the fault.
    pub(super) step: usize,
    pub(super) method: &'static str,
    /// Number of views.
    pub(super) runs: usize,
    /// Mean likeness of the untouched photos.
    pub(super) photo: Likeness,
    /// Mean likeness of the results.
    pub(super) result: Likeness,
    /// Mean likeness of the delivered pictures.
    pub(super) delivered: Likeness,
    /// Number of harmful results.
    pub(super) harmful: Harmful,
    /// Number of harmful results that were noticed.
    pub(super) caught: Harmful,
    /// Number of results that were not delivered, harmful or not.
    pub(super) noticed: usize,
}

/// Numbers of results that are worse than their photos.
#[derive(Debug, Clone, Copy)]
pub(super) struct Harmful {
    pub(super) in_luma: usize,
    pub(super) in_colour: usize,
}

/// The aspect in which harm is counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sense {
    Luma,
    Colour,
}

impl Sense {
    pub(super) fn harms(self, picture: Likeness, photo: Likeness) -> bool {
        match self {
            Sense::Luma => picture.harms_luma(photo),
            Sense::Colour => picture.harms_colour(photo),
        }
    }

    pub(super) fn of(self, harmful: Harmful) -> usize {
        match self {
            Sense::Luma => harmful.in_luma,
            Sense::Colour => harmful.in_colour,
        }
    }
}

impl Cell {
    /// The cell of `runs`, all of one method under one strength of one fault.
    fn of(runs: &[&Run]) -> Option<Cell> {
        let first = runs.first()?;
        let mean = |of: fn(&Run) -> Likeness| {
            Likeness::mean(&runs.iter().map(|run| of(run)).collect::<Vec<_>>())
        };
        let count = |is: &dyn Fn(&Run) -> bool| runs.iter().filter(|run| is(run)).count();
        let harmful = |noticed: bool| {
            let of = |sense: Sense| {
                let is = |run: &Run| !noticed || run.verdict.noticed();
                count(&|run| is(run) && sense.harms(run.result, run.photo))
            };
            Harmful { in_luma: of(Sense::Luma), in_colour: of(Sense::Colour) }
        };
        Some(Cell {
            swept: first.swept,
            strength: first.strength,
            step: first.step,
            method: first.method,
            runs: runs.len(),
            photo: mean(|run| run.photo)?,
            result: mean(|run| run.result)?,
            delivered: mean(|run| run.delivered)?,
            harmful: harmful(false),
            caught: harmful(true),
            noticed: count(&|run| run.verdict.noticed()),
        })
    }

    /// Whether the method harms in the mean over the views.
    pub(super) fn harms(&self, sense: Sense) -> bool {
        sense.harms(self.result, self.photo)
    }

    /// ΔE of the photo minus that of the result; `None` for grey photos.
    pub(super) fn gain_in_colour(&self) -> Option<f64> {
        let both = self.photo.difference.zip(self.result.difference);
        both.map(|(photo, result)| photo - result)
    }
}

/// The cells by fault, strength and method. Results without a fault are the first strength of every
/// fault.
pub(super) fn cells(runs: &[Run], rig: &RigFile) -> Vec<Cell> {
    let (none, some): (Vec<&Run>, Vec<&Run>) = runs.iter().partition(|run| run.step == 0);
    let mut runs = Vec::new();
    for swept in all_swept() {
        let of: Vec<&Run> = some.iter().copied().filter(|run| same(run.swept, swept)).collect();
        if !of.is_empty() {
            let strength = (swept.strengths)(rig)[0];
            runs.extend(none.iter().map(|run| Run { swept, strength, ..(*run).clone() }));
            runs.extend(of.into_iter().cloned());
        }
    }
    let mut groups: Vec<Vec<&Run>> = Vec::new();
    for run in &runs {
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

/// Methods in `cells`, in their order.
pub(super) fn methods_of(cells: &[Cell]) -> Vec<&'static str> {
    METHODS.into_iter().filter(|m| cells.iter().any(|cell| cell.method == *m)).collect()
}

/// Faults in `cells`, in their order.
pub(super) fn swept_of(cells: &[Cell]) -> Vec<&'static Swept> {
    let known = all_swept().into_iter();
    known.filter(|s| cells.iter().any(|cell| same(cell.swept, s))).collect()
}
