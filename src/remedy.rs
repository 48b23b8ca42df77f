//! Remedies: what to do about a failure. Every error of relens has one.
//!
//! The daemon acts on the [`Remedy`] alone, never on a message.

use std::error::Error;

/// What to do next, from the mildest to the gravest.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Remedy {
    /// The frame was the wrong one; show the same picture again.
    ShootAgain,
    /// This photo cannot be restored; set it aside with the reason and go on.
    SkipPhoto,
    /// A temporary obstacle (disk full, file still growing); try again later.
    RetryLater,
    /// The rig differs from its calibration; calibrate, then try again.
    Recalibrate,
    /// A device disappeared; reopen it, then try again.
    ReopenRig,
    /// The box can do nothing; report to the operator and wait.
    CallOperator,
}

impl Remedy {
    /// Instruction for the user, shown on the panel.
    pub fn what_to_do(self) -> &'static str {
        match self {
            Remedy::SkipPhoto => "The photo is in the folder failed, with the reason beside it.",
            Remedy::RetryLater => "Nothing: the box will try again.",
            Remedy::Recalibrate => {
                "Recalibrate: hold the button while the box starts, then press it long."
            }
            Remedy::ShootAgain | Remedy::ReopenRig | Remedy::CallOperator => {
                "Check the camera, the panel and their cables. The box tries again every minute."
            }
        }
    }
}

/// An error with a remedy.
pub trait Remediable: Error {
    /// The remedy.
    fn remedy(&self) -> Remedy;

    /// Instruction for the user.
    fn what_to_do(&self) -> &'static str {
        self.remedy().what_to_do()
    }

    /// Whether this is a cancellation rather than a failure.
    fn was_asked_for(&self) -> bool {
        false
    }
}

/// Any error with a remedy, for interfaces with an open set of failures (the optics behind a
/// method).
pub type AnyFailure = Box<dyn Remediable + Send + Sync + 'static>;

impl<E: Remediable + Send + Sync + 'static> From<E> for AnyFailure {
    fn from(error: E) -> AnyFailure {
        Box::new(error)
    }
}

/// The messages of `error` and its causes joined with `: `, without causes that the text already
/// contains.
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

/// The message of a system error without its number, ` (os error 2)`.
fn without_number(words: &str) -> &str {
    let numbered = words.strip_suffix(')').and_then(|rest| rest.rsplit_once(" (os error "));
    match numbered {
        Some((message, number)) if number.parse::<i32>().is_ok() => message,
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
