//! Lamps by state: colours and rhythms. Trouble is recognised by its rhythm alone, since one man in
//! twelve confuses red and green. Colours and rates after IEC 60073 as summarised in trade pages:
//! green normal, red fault; slow flashing below 0.8 Hz, normal 1.4 to 2.8 Hz.

use super::front_panel::BoxState;
use crate::rig::Lamp;

/// A repeated rhythm: duration in seconds and lit lamps of each part.
type Rhythm = &'static [(f64, &'static [Lamp])];

const GREEN: &[Lamp] = &[Lamp::Ready];
const WHITE: &[Lamp] = &[Lamp::Busy];
const RED: &[Lamp] = &[Lamp::Trouble];
const GREEN_WHITE: &[Lamp] = &[Lamp::Ready, Lamp::Busy];
const GREEN_RED: &[Lamp] = &[Lamp::Ready, Lamp::Trouble];
const DARK: &[Lamp] = &[];

fn rhythm(state: BoxState) -> Rhythm {
    match state {
        BoxState::Starting => &[(1.0, WHITE), (1.0, DARK)],
        BoxState::Ready => &[(3600.0, GREEN)],
        // Ready, with the outcome of the last photo.
        BoxState::Done => &[(0.2, GREEN_WHITE), (1.8, GREEN)],
        BoxState::Refused => &[(0.2, GREEN_RED), (1.8, GREEN)],
        // Slow flashing: press the button.
        BoxState::Waiting => &[(1.0, GREEN), (1.0, DARK)],
        BoxState::Heard => &[(0.25, WHITE), (0.25, DARK)],
        // Once a second, with the countdown.
        BoxState::Counting => &[(0.1, WHITE), (0.9, DARK)],
        BoxState::Working => &[(3600.0, WHITE)],
        // Two slow flashes: the user must act, but not at the button.
        BoxState::Asking => &[(0.3, GREEN), (0.3, DARK), (0.3, GREEN), (1.1, DARK)],
        // A short flash and a long pause: at rest.
        BoxState::Resting => &[(0.2, GREEN), (3.8, DARK)],
        BoxState::Trouble => &[(0.2, RED), (0.2, DARK), (0.2, RED), (0.9, DARK)],
        BoxState::Maintenance => &[(0.5, RED), (0.5, WHITE)],
    }
}

/// The lamps lit `since_s` seconds after the state began, and the seconds until they change.
pub fn lit(state: BoxState, since_s: f64) -> (&'static [Lamp], f64) {
    let parts = rhythm(state);
    let period: f64 = parts.iter().map(|part| part.0).sum();
    let mut at = since_s.max(0.0) % period;
    for &(length, lights) in parts {
        if at < length {
            return (lights, length - at);
        }
        at -= length;
    }
    // Reached only by rounding, at the very end of a period.
    (parts[0].1, parts[0].0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<BoxState> {
        vec![
            BoxState::Starting,
            BoxState::Ready,
            BoxState::Done,
            BoxState::Refused,
            BoxState::Waiting,
            BoxState::Heard,
            BoxState::Counting,
            BoxState::Working,
            BoxState::Asking,
            BoxState::Resting,
            BoxState::Trouble,
            BoxState::Maintenance,
        ]
    }

    /// The rhythm without its colours, in 50 ms steps over 8 s.
    fn beats(state: BoxState) -> Vec<bool> {
        (0..160).map(|n| !lit(state, f64::from(n) * 0.05 + 0.01).0.is_empty()).collect()
    }

    #[test]
    fn all_states_differ() {
        let shown =
            |s: BoxState| (0..160).map(|n| lit(s, f64::from(n) * 0.05).0).collect::<Vec<_>>();
        for (n, a) in all().iter().enumerate() {
            for b in &all()[n + 1..] {
                assert_ne!(shown(*a), shown(*b), "{a:?} and {b:?}");
            }
        }
    }

    /// The rhythm of `state` in the words of the operator's page.
    fn in_words(state: BoxState) -> String {
        let colour = |lamp: &Lamp| match lamp {
            Lamp::Ready => "green",
            Lamp::Busy => "white",
            Lamp::Trouble => "red",
        };
        let colours = |lit: &[Lamp]| match lit {
            [] => "dark".to_owned(),
            lit => lit.iter().map(colour).collect::<Vec<_>>().join("+"),
        };
        match rhythm(state) {
            [(_, lit)] => colours(lit),
            parts => {
                let part = |&(length, lit): &(f64, _)| format!("{} {length} s", colours(lit));
                parts.iter().map(part).collect::<Vec<_>>().join(", ")
            }
        }
    }

    #[test]
    fn the_operator_s_page_lists_every_rhythm() {
        let page = include_str!("../../systemd/README.md");
        for state in all() {
            let row = format!("| {} |", in_words(state));
            assert!(page.contains(&row), "{state:?}: {row}");
        }
    }

    #[test]
    fn trouble_differs_without_colours() {
        let trouble = BoxState::Trouble;
        for other in all().iter().filter(|s| **s != trouble) {
            assert_ne!(beats(trouble), beats(*other), "{other:?}");
        }
    }

    #[test]
    fn a_press_is_acknowledged_at_once_and_no_state_is_dark() {
        assert_eq!(lit(BoxState::Heard, 0.0).0, WHITE);
        for state in all() {
            let longest =
                beats(state).split(|&on| on).map(<[bool]>::len).max().unwrap_or(0) as f64 * 0.05;
            assert!(longest < 4.0, "{state:?} is dark for {longest} s");
        }
    }

    #[test]
    fn the_next_change_is_when_the_lamps_change() {
        for state in all() {
            let (before, remaining_s) = lit(state, 0.3);
            let after = lit(state, 0.3 + remaining_s + 1e-6).0;
            assert!(
                remaining_s > 0.0 && (after != before || rhythm(state).len() == 1),
                "{state:?}"
            );
        }
    }
}
