//! What to do about a failure: the question every error of relens answers.
//!
//! The daemon acts on the [`Remedy`] alone and never on the wording of a message.

use std::error::Error;

/// What the one who meets a failure should do next, from the mildest to the gravest.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Remedy {
    /// The frame was not the one asked for; the same picture shown again will most likely do.
    ShootAgain,
    /// This photo cannot be restored whatever is done; set it aside with the reason and go on.
    SkipPhoto,
    /// The world is in the way for now (disk full, file still growing); try again by itself later.
    RetryLater,
    /// The rig no longer is what was calibrated; calibrate, then do it again.
    Recalibrate,
    /// A device went away; close and open it again, then do it again.
    ReopenRig,
    /// Nothing the box can do; tell the operator and hold.
    CallOperator,
}

impl Remedy {
    /// What somebody who stands before the box may do, for its panel.
    pub fn what_to_do(self) -> &'static str {
        match self {
            Remedy::SkipPhoto => "The photo lies in the folder failed, with the reason beside it.",
            Remedy::RetryLater => "Nothing: the box tries again by itself.",
            Remedy::Recalibrate => {
                "Measure the lens anew: hold the button while the box starts, then press it long."
            }
            Remedy::ShootAgain | Remedy::ReopenRig | Remedy::CallOperator => {
                "Look after camera, panel and their cables. The box tries again every minute."
            }
        }
    }
}

/// An error that knows its remedy.
pub trait Remediable: Error {
    /// What to do about this failure.
    fn remedy(&self) -> Remedy;

    /// The same in words, for the one who stands before the box.
    fn what_to_do(&self) -> &'static str {
        self.remedy().what_to_do()
    }

    /// Whether this is no failure, but the end that somebody asked for.
    fn was_asked_for(&self) -> bool {
        false
    }
}

/// Any error with its remedy, for seams where the kinds of failure are open (the optics behind a
/// method).
pub type AnyFailure = Box<dyn Remediable + Send + Sync + 'static>;

/// The message of `error` and of each of its causes, joined with `: `, without repeating a cause
/// that is already spelled out by its parent.
pub fn full_message(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let words = inner.to_string();
        let words = without_number(&words);
        if !text.contains(words) {
            text.push_str(": ");
            text.push_str(words);
        }
        cause = inner.source();
    }
    text
}

/// What a system's error says, without its number, ` (os error 2)`, which no user needs.
fn without_number(words: &str) -> &str {
    let numbered = words.strip_suffix(')').and_then(|rest| rest.rsplit_once(" (os error "));
    match numbered {
        Some((said, number)) if number.parse::<i32>().is_ok() => said,
        _ => words,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedies_are_ordered_from_mild_to_grave() {
        assert!(Remedy::ShootAgain < Remedy::SkipPhoto && Remedy::ReopenRig < Remedy::CallOperator);
    }

    #[test]
    fn a_message_names_its_causes_once() {
        #[derive(Debug, thiserror::Error)]
        #[error("cannot read a.jpg")]
        struct Outer(#[source] std::io::Error);
        let error = Outer(std::io::Error::other("disk gone"));
        assert_eq!(full_message(&error), "cannot read a.jpg: disk gone");
        let error = Outer(std::io::Error::from_raw_os_error(2));
        assert_eq!(full_message(&error), "cannot read a.jpg: No such file or directory");
    }
}
