//! The lens at focus offsets other than the panel's.

use serde::{Deserialize, Serialize};

use super::Calibration;
use super::operator_norms::OperatorNorms;
use crate::deconvolution::focus::FocusSeries;
use crate::deconvolution::lens_model::LensFunctions;
use crate::remedy::{Remediable, Remedy};

/// Maximum number of focuses besides the panel's: about five on each side, and two in reserve.
const FOCUSES_MAX: usize = 12;
/// Largest offset, dioptres: a scene at a hand's width from a lens focused far away.
const OFFSET_MAX: f32 = 10.0;
/// Offsets closer than this are the same, dioptres: below the precision of a focus ring.
const SAME_OFFSET: f32 = 0.001;

/// The lens at one focus offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OtherFocus {
    /// 1/distance − 1/(panel distance), dioptres; positive is nearer.
    pub offset: f32,
    /// The functions, on the same grid as those at the panel's focus.
    pub functions: LensFunctions,
    /// Norms of the lens model at this focus, as [`Calibration::norms`].
    pub norms: OperatorNorms,
    /// The same norms at sites, as [`Calibration::at_sites`].
    pub at_sites: Option<OperatorNorms>,
}

/// Why a focus cannot be added.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum FocusError {
    #[error(
        "found a focus offset of {0} dioptres, allowed {SAME_OFFSET} to {OFFSET_MAX} for a nearer \
         focus, and the same below zero for a farther one"
    )]
    Offset(f32),
    #[error(
        "{FOCUSES_MAX} other focuses are stored already; `relens calibrate --forget-focuses` \
         deletes them"
    )]
    TooMany,
    #[error(
        "the lens was measured with {} functions of {} px; allowed {} of {} px, as in the panel's \
         focus",
        .0[0], .0[1], .1[0], .1[1]
    )]
    Grid([usize; 2], [usize; 2]),
}

impl Remediable for FocusError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}

impl Calibration {
    /// The next generation with the lens of `measured` at `offset` dioptres from the panel's focus,
    /// replacing a previous one at that offset.
    ///
    /// # Errors
    /// When the offset is out of range, the grid differs, or too many are stored.
    pub fn with_focus(
        &self,
        offset: f32,
        measured: &Calibration,
    ) -> Result<Calibration, FocusError> {
        self.check_offset(offset)?;
        let (found, allowed) = (&measured.functions, &self.functions);
        if grid(found) != grid(allowed) {
            let [found, allowed] = [found, allowed].map(|f| [f.rows * f.columns, f.support_px]);
            return Err(FocusError::Grid(found, allowed));
        }
        let mut after = self.clone();
        after.focuses.retain(|focus| (focus.offset - offset).abs() >= SAME_OFFSET);
        after.focuses.push(OtherFocus {
            offset,
            functions: found.clone(),
            norms: measured.norms.clone(),
            at_sites: measured.at_sites.clone(),
        });
        after.focuses.sort_by(|a, b| a.offset.total_cmp(&b.offset));
        after.generation = self.generation.wrapping_add(1);
        Ok(after)
    }

    /// Takes over the other focuses of `before`, as far as they fit this grid. The panel must be in
    /// the same place in both calibrations.
    #[must_use]
    pub fn with_focuses_of(mut self, before: &Calibration) -> Calibration {
        let own = (grid(&self.functions), self.at_sites.is_some());
        let fits = |of: &&OtherFocus| {
            (grid(&of.functions), of.at_sites.is_some()) == own
                && of.norms.levels[0].levels() == self.norms.levels[0].levels()
        };
        self.focuses = before.focuses.iter().filter(fits).cloned().collect();
        self
    }

    /// Checks that a focus at `offset` dioptres from the panel's can be added.
    ///
    /// # Errors
    /// When the offset is out of range, or too many others are stored.
    pub fn check_offset(&self, offset: f32) -> Result<(), FocusError> {
        focus_offset(offset)?;
        let is_other = |focus: &&OtherFocus| (focus.offset - offset).abs() >= SAME_OFFSET;
        let others = self.focuses.iter().filter(is_other).count();
        (others < FOCUSES_MAX).then_some(()).ok_or(FocusError::TooMany)
    }

    /// The lens at all focuses; `None` if it was measured at the panel's focus only.
    fn focus_series(&self) -> Option<FocusSeries<'_>> {
        let others = self.focuses.iter().map(|focus| (focus.offset, &focus.functions));
        FocusSeries::new(others.chain([(0.0, &self.functions)]).collect())
    }

    /// Checks that the other focuses are valid; the error describes the fault.
    pub(super) fn check_focuses(&self) -> Result<(), String> {
        if self.focuses.len() > FOCUSES_MAX {
            return Err(format!("{} focuses; {FOCUSES_MAX} are allowed", self.focuses.len()));
        }
        for focus in &self.focuses {
            let OtherFocus { offset, functions, norms, at_sites } = focus;
            functions.check().map_err(|e| e.to_string())?;
            let whole = is_offset(*offset)
                && norms.is_whole()
                && at_sites.as_ref().is_none_or(OperatorNorms::is_whole);
            if !whole {
                return Err(format!(
                    "a focus of {offset} dioptres with norms of {norms:?}; they must be positive"
                ));
            }
        }
        let fits = self.focuses.is_empty() || self.focus_series().is_some();
        let other = "focuses with other grids of functions than the panel's, or two with the same \
                     offset";
        fits.then_some(()).ok_or_else(|| other.to_owned())
    }
}

/// Checks that `offset`, in dioptres, is that of a focus other than the panel's, and returns it.
///
/// # Errors
/// [`FocusError::Offset`] if not.
pub fn focus_offset(offset: f32) -> Result<f32, FocusError> {
    is_offset(offset).then_some(offset).ok_or(FocusError::Offset(offset))
}

fn grid(functions: &LensFunctions) -> [usize; 3] {
    [functions.rows, functions.columns, functions.support_px]
}

fn is_offset(offset: f32) -> bool {
    (SAME_OFFSET..=OFFSET_MAX).contains(&offset.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::example;

    #[test]
    fn a_focus_is_added_or_replaces_the_same_one() {
        let calibration = example::calibration();
        let mut sharper = example::calibration();
        sharper.functions.taps[1][0] = 0.9;
        let first = calibration.with_focus(-0.05, &calibration).unwrap();
        let both = first.with_focus(0.02, &calibration).unwrap();
        let again = both.with_focus(-0.0502, &sharper).unwrap();
        let offsets: Vec<f32> = again.focuses.iter().map(|focus| focus.offset).collect();
        assert_eq!(offsets, [-0.0502, 0.02]);
        assert_eq!(again.focuses[0].functions, sharper.functions);
        assert_eq!(again.generation, calibration.generation + 3);
        assert_eq!(again.check(), Ok(()));
        assert!(again.focus_series().is_some());
        assert!(calibration.focus_series().is_none());
    }

    #[test]
    fn an_invalid_focus_is_refused_with_a_message() {
        let calibration = example::calibration();
        for offset in [0.0, 0.0005, 11.0, -10.5, f32::NAN, f32::INFINITY] {
            let message = calibration.with_focus(offset, &calibration).unwrap_err().to_string();
            assert!(message.contains("dioptres") && message.contains("allowed"), "{message}");
        }
        let mut wide = calibration.clone();
        wide.functions.columns += 1;
        let message = calibration.with_focus(0.1, &wide).unwrap_err().to_string();
        assert!(message.contains("2 functions of 1 px; allowed 1 of 1 px"), "{message}");
        let full = (1..=FOCUSES_MAX as u32)
            .fold(calibration.clone(), |c, n| c.with_focus(0.01 * n as f32, &calibration).unwrap());
        let message = full.with_focus(-0.1, &calibration).unwrap_err().to_string();
        assert!(message.contains("--forget-focuses"), "{message}");
        assert!(full.with_focus(0.01, &calibration).is_ok());
    }

    #[test]
    fn focuses_of_another_grid_are_neither_kept_nor_valid() {
        let with = example::calibration().with_focus(0.1, &example::calibration()).unwrap();
        assert_eq!(example::calibration().with_focuses_of(&with).focuses, with.focuses);
        let mut wide = example::calibration();
        wide.functions.columns += 1;
        assert!(wide.clone().with_focuses_of(&with).focuses.is_empty());
        let mut wrong = with.clone();
        wrong.focuses[0].functions = LensFunctions { columns: 2, ..wide.functions };
        wrong.focuses[0].functions.taps.iter_mut().for_each(|taps| taps.resize(2, 0.5));
        assert!(wrong.check().unwrap_err().contains("other grids"));
        let mut twice = with.clone();
        twice.focuses.push(with.focuses[0].clone());
        assert!(twice.check().is_err());
    }
}
