//! Numbers of photos waiting in the inbox, by what they wait for.

use serde::{Deserialize, Serialize};

/// What complete photos wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Awaited {
    /// A press of the button.
    Button,
    /// The hours of work.
    Window,
    /// The panel to be put before the lens.
    Panel,
    /// The rig: warm-up, maintenance.
    Rig,
}

/// Numbers of photos waiting in the inbox, by what they wait for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // As those of [`Awaited`].
pub struct Waiting {
    pub turn: usize,
    pub button: usize,
    pub window: usize,
    pub panel: usize,
    pub rig: usize,
    /// Photos that have just arrived and may still change.
    pub settling: usize,
    /// Photos that have arrived only in part.
    pub unfinished: usize,
    /// Photos to be tried again.
    pub retry: usize,
}

impl Waiting {
    /// Number of all waiting photos.
    pub fn all(self) -> usize {
        let Waiting { turn, button, window, panel, rig, settling, unfinished, retry } = self;
        turn + button + window + panel + rig + settling + unfinished + retry
    }

    /// Counts the photos that wait for their turn as waiting for `awaited` instead.
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

    /// Sentences for the panel on photos that are incomplete or will be tried again; empty if there
    /// are none.
    pub(crate) fn describe_incomplete(self) -> String {
        let photos = |n: usize, one: &str, many: &str| match n {
            0 => None,
            1 => Some(format!("1 photo {one}.")),
            n => Some(format!("{n} photos {many}.")),
        };
        let some = [
            photos(self.settling, "is still arriving", "are still arriving"),
            photos(
                self.unfinished,
                "is waiting for the rest of its file",
                "are waiting for the rest of their files",
            ),
            photos(self.retry, "will be tried again", "will be tried again"),
        ];
        some.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }
}

impl std::fmt::Display for Waiting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = [
            (self.turn, "for their turn"),
            (self.button, "for the button"),
            (self.window, "for the working hours"),
            (self.panel, "for the panel"),
            (self.rig, "for the rig"),
            (self.settling, "arriving"),
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
    fn photos_are_counted_by_what_they_wait_for() {
        let found = Waiting { turn: 3, settling: 1, unfinished: 2, ..Waiting::default() };
        for (awaited, words) in [
            (Awaited::Button, "3 for the button"),
            (Awaited::Window, "3 for the working hours"),
            (Awaited::Panel, "3 for the panel"),
            (Awaited::Rig, "3 for the rig"),
        ] {
            let held = found.held_for(awaited);
            let wanted = format!("6 waiting ({words}, 1 arriving, 2 for the rest of the file)");
            assert_eq!((held.to_string(), held.all()), (wanted, 6));
        }
        assert_eq!(
            found.describe_incomplete(),
            "1 photo is still arriving. 2 photos are waiting for the rest of their files."
        );
        assert_eq!(Waiting::default().describe_incomplete(), "");
    }
}
