//! `relens status`: the daemon's state, from its state file.

use std::time::SystemTime;

use clap::Args;
use relens::daemon::{Doing, Folders, State};
use relens::nights::trust::unix_s;
use serde::Serialize;

use super::error::CliError;
use super::options::FolderOption;
use super::output::say;

/// Show what the daemon on a folder is doing
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens status --folder DIR
  relens status --folder DIR --json")]
pub(super) struct StatusOptions {
    #[command(flatten)]
    folder: FolderOption,
    /// Print JSON, for other programs
    #[arg(long)]
    json: bool,
}

pub(super) fn run(options: &StatusOptions) -> Result<(), CliError> {
    let folder = &options.folder.folder;
    let state = State::read(folder)
        .map_err(CliError::BrokenState)?
        .ok_or_else(|| CliError::NoState(folder.to_owned()))?;
    let running = Folders::in_use(folder);
    let inbox_is_there = folder.join("inbox").is_dir();
    if options.json {
        let json = serde_json::to_string_pretty(&Status { running, inbox_is_there, state });
        say(&json.map_err(|e| CliError::writing(folder, e.into()))?);
    } else {
        let now_unix_s = unix_s(SystemTime::now()) as u64;
        say(&words(&state, running, inbox_is_there, now_unix_s));
    }
    Ok(())
}

#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
struct Status {
    running: bool,
    inbox_is_there: bool,
    #[serde(flatten)]
    state: State,
}

const GONE: &str = "its inbox is missing: make the folder again, or mount its disk";

fn words(state: &State, running: bool, is_there: bool, now_unix_s: u64) -> String {
    let doing = match (&state.doing, running) {
        // The daemon notices at its next poll.
        (Doing::Waiting | Doing::Paused { .. } | Doing::Held { .. }, true) if !is_there => {
            format!("needs help: {GONE}")
        }
        (Doing::Restoring { photo, done, remaining_s }, true) => {
            let left = remaining_s.map_or(String::new(), |remaining_s| {
                let all = if state.counts.waiting.turn > 0 { " for all" } else { "" };
                format!(", about {} left{all}", duration(remaining_s.ceil() as u64))
            });
            format!("restoring {photo}: {:.0} %{left}", 100.0 * done)
        }
        (Doing::Waiting, true) => "waiting for photos".to_owned(),
        (Doing::Paused { reason }, true) => format!("paused: {reason}"),
        (Doing::Held { reason }, true) => format!("needs help: {reason}"),
        (Doing::Ended, true) => "starting".to_owned(),
        (Doing::Ended, false) => "not running; it ended in good order".to_owned(),
        (Doing::Held { reason }, false) => format!("not running; it needed help: {reason}"),
        (_, false) => {
            "not running, and it did not end in good order; the next start resumes its work"
                .to_owned()
        }
    };
    let gone = if is_there || doing.ends_with(GONE) { String::new() } else { format!("\n{GONE}") };
    let written = match now_unix_s.checked_sub(state.written_unix_s) {
        Some(ago) => format!("{} ago", duration(ago)),
        None => "before the box's clock was set back".to_owned(),
    };
    format!("{doing}{gone}\nrig {}; {}; written {written}", state.rig, state.counts)
}

fn duration(seconds: u64) -> String {
    match seconds {
        s if s < 120 => format!("{s} s"),
        s if s < 7200 => format!("{} min", s / 60),
        s if s < 172_800 => format!("{} h", s / 3600),
        s => format!("{} days", s / 86_400),
    }
}

#[cfg(test)]
mod tests {
    use relens::daemon::{PhotoCounts, Waiting};

    use super::*;

    #[test]
    fn a_daemon_that_died_differs_from_one_that_ended() {
        let mut state = State {
            rig: "small".into(),
            doing: Doing::Waiting,
            counts: PhotoCounts { restored: 3, untouched: 2, failed: 1, ..PhotoCounts::default() },
            needs_button: false,
            written_unix_s: 100,
        };
        assert!(words(&state, true, true, 160).starts_with("waiting for photos\n"));
        assert!(
            words(&state, true, true, 160).contains("3 restored, 2 unchanged, 1 failed, 0 waiting")
                && words(&state, true, true, 160).contains("60 s ago")
        );
        assert!(words(&state, false, true, 160).contains("did not end in good order"));
        let year_s = 366 * 86_400;
        assert!(words(&state, true, true, 100 + year_s).ends_with("written 366 days ago"));
        let set_back = words(&state, true, true, 40);
        assert!(set_back.ends_with("written before the box's clock was set back"), "{set_back}");
        let gone = words(&state, true, false, 160);
        assert!(gone.starts_with("needs help: its inbox is missing"), "{gone}");
        assert!(!gone.contains("waiting for photos"), "{gone}");
        state.doing = Doing::Ended;
        assert!(words(&state, false, true, 160).contains("ended in good order"));
        state.doing =
            Doing::Restoring { photo: "a.jpg".into(), done: 0.4, remaining_s: Some(200.0) };
        state.counts.waiting = Waiting { turn: 2, settling: 1, ..Waiting::default() };
        let lines = words(&state, true, true, 160);
        assert!(lines.starts_with("restoring a.jpg: 40 %, about 3 min left for all\n"), "{lines}");
        assert!(lines.contains("3 waiting (2 for their turn, 1 arriving)"), "{lines}");
    }
}
