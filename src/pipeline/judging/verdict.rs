//! Evaluation of the witnesses of a result.

use super::measures::Case;
use super::table::{Unit, WITNESSES, WitnessRow};

/// Measures of a result, one per witness of a table; `None` where a measure does not apply.
pub type Measures = Vec<Option<f64>>;

impl Case<'_> {
    /// One measure for each of the [`WITNESSES`].
    pub fn measures(&self) -> Measures {
        WITNESSES.iter().map(|witness| (witness.measure)(self)).collect()
    }
}

/// Whether a result needs a reference solution: because its method does not start from the lens
/// model, or because a witness suspects it.
pub fn is_suspect(table: &[WitnessRow], found: &Measures, starts_from_lens: bool) -> bool {
    let mut each = table.iter().zip(found);
    !starts_from_lens || each.any(|(witness, found)| exceeds(*found, witness.suspect_above))
}

/// The first witness by which a result harms, and its index in the table.
pub fn harm<'a>(table: &'a [WitnessRow], found: &Measures) -> Option<(usize, &'a WitnessRow)> {
    let mut each = table.iter().enumerate().zip(found);
    let harmful = each.find(|((_, witness), found)| exceeds(**found, witness.harm_above));
    harmful.map(|(witness, _)| witness)
}

/// The user's sentence on the first witness by which a result harms.
pub(super) fn harm_in_words(table: &[WitnessRow], found: &Measures) -> Option<String> {
    let (n, witness) = harm(table, found)?;
    let allowed = witness.harm_above.unwrap_or(f64::NAN);
    let words = |number: f64| match witness.unit {
        Unit::Share => format!("{:.0} %", 100.0 * number),
        Unit::Times => format!("{number:.1} times"),
    };
    let found = words(found[n].unwrap_or(f64::NAN));
    let sentence =
        witness.sentence.replace("{found}", &found).replace("{allowed}", &words(allowed));
    Some(format!(
        "{sentence}; what the measured lens alone makes of the photo is returned in its place"
    ))
}

/// Whether a measure is above a limit; one that is not a number is above every limit.
pub(super) fn exceeds(found: Option<f64>, limit: Option<f64>) -> bool {
    found.zip(limit).is_some_and(|(found, limit)| found > limit || found.is_nan())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Measures of the witness `name` alone; the others are missing.
    fn only(name: &str, value: f64) -> Measures {
        WITNESSES.iter().map(|witness| (witness.name == name).then_some(value)).collect()
    }

    #[test]
    fn one_witness_above_its_limit_is_enough() {
        for witness in &WITNESSES {
            for (above, limit) in [(false, witness.suspect_above), (true, witness.harm_above)] {
                let Some(limit) = limit else { continue };
                let exceeded = |value: f64| {
                    let found = only(witness.name, value);
                    match above {
                        true => harm(&WITNESSES, &found).is_some(),
                        false => is_suspect(&WITNESSES, &found, true),
                    }
                };
                assert!(!exceeded(limit) && exceeded(1.01 * limit), "{}", witness.name);
                assert!(exceeded(f64::NAN), "{}", witness.name);
            }
        }
        let nothing: Measures = vec![None; WITNESSES.len()];
        assert!(!is_suspect(&WITNESSES, &nothing, true) && harm(&WITNESSES, &nothing).is_none());
        assert!(is_suspect(&WITNESSES, &nothing, false));
    }

    #[test]
    fn a_sentence_states_what_was_found_and_allowed() {
        let words = harm_in_words(&WITNESSES, &only("light", 0.12)).unwrap();
        assert!(words.contains("by 12 % (allowed 4 %)"), "{words}");
        let silent =
            WITNESSES.iter().filter(|of| of.harm_above.is_some() && of.sentence.is_empty());
        assert_eq!(silent.count(), 0);
    }
}
