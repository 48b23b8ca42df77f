//! How many photos wait in the inbox, and for what.

use serde::{Deserialize, Serialize};

/// What a photo that could be taken waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Awaited {
    /// A press of the button.
    Button,
    /// The hours in which the box may work.
    Window,
    /// The panel before the lens.
    Panel,
    /// The rig: it warms up, or is being looked after.
    Rig,
}

/// How many photos wait in the inbox, by what they wait for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct Waiting {
    /// For the photo before them.
    pub turn: usize,
    /// For the button.
    pub button: usize,
    /// For the hours in which the box may work.
    pub window: usize,
    /// For the panel before the lens.
    pub panel: usize,
    /// For the rig, which warms up or is being looked after.
    pub rig: usize,
    /// Changed a moment ago, and may change again.
    pub settling: usize,
    /// For the rest of the file.
    pub unfinished: usize,
    /// Cannot be had for now; tried again by itself.
    pub retry: usize,
}

impl Waiting {
    /// All of them.
    pub fn all(self) -> usize {
        let Waiting { turn, button, window, panel, rig, settling, unfinished, retry } = self;
        turn + button + window + panel + rig + settling + unfinished + retry
    }

    /// The same, where those that wait for their turn wait for what is `awaited`.
    pub(crate) fn held_for(self, awaited: Awaited) -> Waiting {
        let mut held = Waiting { turn: 0, ..self };
        *match awaited {
            Awaited::Button => &mut held.button,
            Awaited::Window => &mut held.window,
            Awaited::Panel => &mut held.panel,
            Awaited::Rig => &mut held.rig,
        } += self.turn;
        held
    }

    /// Those that cannot be taken whatever the schedule says, in whole sentences for the panel;
    /// empty when there are none.
    pub(crate) fn beside(self) -> String {
        let photos = |n: usize, one: &str, many: &str| match n {
            0 => None,
            1 => Some(format!("1 photo {one}.")),
            n => Some(format!("{n} photos {many}.")),
        };
        let some = [
            photos(self.settling, "is still arriving", "are still arriving"),
            photos(
                self.unfinished,
                "waits for the rest of its file",
                "wait for the rest of their files",
            ),
            photos(
                self.retry,
                "cannot be had for now and is tried again",
                "cannot be had for now and are tried again",
            ),
        ];
        some.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }
}

impl std::fmt::Display for Waiting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = [
            (self.turn, "for a turn"),
            (self.button, "for the button"),
            (self.window, "for the hours of work"),
            (self.panel, "for the panel before the lens"),
            (self.rig, "for the rig"),
            (self.settling, "settling"),
            (self.unfinished, "for the rest of the file"),
            (self.retry, "to be tried again"),
        ];
        let some = parts.into_iter().filter(|(n, _)| *n > 0);
        let words: Vec<String> = some.map(|(n, what)| format!("{n} {what}")).collect();
        write!(f, "{} waiting", self.all())?;
        if words.is_empty() { Ok(()) } else { write!(f, " ({})", words.join(", ")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_are_told_apart_by_what_they_wait_for() {
        let found = Waiting { turn: 3, settling: 1, unfinished: 2, ..Waiting::default() };
        for (awaited, words) in [
            (Awaited::Button, "3 for the button"),
            (Awaited::Window, "3 for the hours of work"),
            (Awaited::Panel, "3 for the panel before the lens"),
            (Awaited::Rig, "3 for the rig"),
        ] {
            let held = found.held_for(awaited);
            let wanted = format!("6 waiting ({words}, 1 settling, 2 for the rest of the file)");
            assert_eq!((held.to_string(), held.all()), (wanted, 6));
        }
        assert_eq!(
            found.beside(),
            "1 photo is still arriving. 2 photos wait for the rest of their files."
        );
        assert_eq!(Waiting::default().beside(), "");
    }

    #[test]
    fn a_state_written_by_an_earlier_version_is_read() {
        let old: Waiting = serde_json::from_str(r#"{"turn":2,"settling":1}"#).unwrap();
        assert_eq!((old.turn, old.all()), (2, 3));
    }
}
