//! One result, a line of the stored list: its likeness to the scene, the findings on it, and what
//! is delivered.

use relens::deconvolution::method::Method;
use relens::pipeline::{Measures, Prepared, Verdict, WITNESSES};

use super::findings::Findings;
use crate::Failure;
use crate::harness::Harness;
use crate::likeness::{Likeness, Truth};

/// Result of one method on one photo.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    /// Rig, fault, strength, how the photo is kept, view, method.
    pub(crate) of: [String; 6],
    /// Whether the rig is without a fault.
    pub(crate) healthy: bool,
    pub(crate) verdict: Verdict,
    pub(crate) photo: Likeness,
    pub(crate) result: Likeness,
    pub(crate) delivered: Likeness,
    pub(crate) judged: Judged,
}

/// Quantities that determine the verdict on a result.
#[derive(Debug, Clone)]
pub(crate) struct Judged {
    /// Whether the photo was returned before any method saw it.
    pub(crate) before_solving: bool,
    /// Whether captures went into the result.
    pub(crate) by_captures: bool,
    /// Unexplained product of the reference solution.
    pub(crate) foreign: f64,
    pub(crate) reference_gain: Option<f64>,
    pub(crate) reference: Likeness,
    pub(crate) digital: Likeness,
    /// Measures of the result alone, of the result compared with the reference solution, and of the
    /// solution of `digital` compared with it.
    pub(crate) measures: [Measures; 3],
}

/// Prefixes of the columns of [`Judged::measures`].
const PREFIXES: [&str; 3] = ["alone", "beside", "digital"];

impl Record {
    /// The record of `method` on `photo`, whose scene is `truth`.
    pub(crate) fn of(
        harness: &mut Harness,
        photo: &Prepared<'_>,
        truth: &Truth,
        method: &dyn Method,
    ) -> Result<Record, Failure> {
        let restored = harness.restore(photo, method)?;
        let (pipeline, _) = harness.test_rig.parts();
        let Findings { alone, beside, digital, foreign, reference_gain, pictures } =
            Findings::of(pipeline, photo, &restored.solved)?;
        Ok(Record {
            of: Default::default(),
            healthy: false,
            photo: truth.likeness(&photo.photo),
            result: truth.likeness(&restored.solved.picture),
            delivered: truth.likeness(&restored.outcome.picture),
            verdict: restored.outcome.verdict,
            judged: Judged {
                before_solving: restored.before_solving,
                by_captures: restored.solved.captures > 0,
                foreign,
                reference_gain,
                reference: truth.likeness(&pictures[0]),
                digital: truth.likeness(&pictures[1]),
                measures: [alone, beside, digital],
            },
        })
    }

    /// Whether the method's result is worse than the photo.
    pub(crate) fn harms(&self) -> bool {
        self.result.harms(self.photo)
    }

    /// Whether this is a false alarm: a harmless result without a fault that is not delivered.
    pub(crate) fn is_alarm(&self) -> bool {
        self.healthy && !self.harms() && self.verdict.noticed()
    }

    /// Whether what is delivered is worse than the result.
    pub(crate) fn costs(&self) -> bool {
        self.delivered.harms(self.result)
    }

    /// Heads of the columns of [`Record::cells`].
    pub(crate) fn head() -> String {
        let mut head = "rig,fault,strength,photo,view,method,healthy,verdict,photo SSIM,photo ΔE,\
                        SSIM,ΔE,delivered SSIM,delivered ΔE,reference SSIM,reference ΔE,\
                        digital SSIM,digital ΔE,before solving,by captures,foreign,reference gain"
            .to_owned();
        for prefix in PREFIXES {
            WITNESSES.iter().for_each(|witness| head += &format!(",{prefix}: {}", witness.name));
        }
        head
    }

    /// The record as a line of comma-separated cells.
    pub(crate) fn cells(&self) -> String {
        let judged = &self.judged;
        let word = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let mut cells: Vec<String> = self.of.to_vec();
        cells.push(u8::from(self.healthy).to_string());
        cells.push(format!("{:?}", self.verdict).to_lowercase());
        for of in [self.photo, self.result, self.delivered, judged.reference, judged.digital] {
            cells.extend([word(Some(of.ssim)), word(of.difference)]);
        }
        cells
            .extend([judged.before_solving, judged.by_captures].map(|is| u8::from(is).to_string()));
        cells.extend([word(Some(judged.foreign)), word(judged.reference_gain)]);
        cells.extend(judged.measures.iter().flatten().map(|value| word(*value)));
        cells.join(",")
    }

    /// Parses a line of [`Record::cells`]; `None` for a line of another table.
    pub(crate) fn parse(line: &str) -> Option<Record> {
        let cells: Vec<&str> = line.split(',').collect();
        if cells.len() != Record::head().split(',').count() {
            return None;
        }
        let number = |n: usize| cells[n].parse::<f64>().ok();
        let likeness = |n: usize| Some(Likeness { ssim: number(n)?, difference: number(n + 1) });
        let verdicts = [Verdict::Sound, Verdict::Replaced, Verdict::Untouched];
        let is_named = |of: &Verdict| format!("{of:?}").eq_ignore_ascii_case(cells[7]);
        let rows = WITNESSES.len();
        let measures = |n: usize| (0..rows).map(|row| number(22 + n * rows + row)).collect();
        Some(Record {
            of: [0, 1, 2, 3, 4, 5].map(|n| cells[n].to_owned()),
            healthy: cells[6] == "1",
            verdict: verdicts.into_iter().find(is_named)?,
            photo: likeness(8)?,
            result: likeness(10)?,
            delivered: likeness(12)?,
            judged: Judged {
                reference: likeness(14)?,
                digital: likeness(16)?,
                before_solving: cells[18] == "1",
                by_captures: cells[19] == "1",
                foreign: number(20)?,
                reference_gain: number(21),
                measures: [0, 1, 2].map(measures),
            },
        })
    }
}
