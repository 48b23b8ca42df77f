//! `relens status`: what the daemon is doing, from its state file.

use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;
use relens::daemon::{Doing, Folders, State};

use super::error::CliError;
use super::options::FolderOption;
use super::output::say;

/// Say what the daemon on a folder is doing
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens status --folder DIR")]
pub(super) struct StatusOptions {
    #[command(flatten)]
    folder: FolderOption,
}

/// Says what the daemon does, from its state file.
pub(super) fn run(options: &StatusOptions) -> Result<(), CliError> {
    let folder = &options.folder.folder;
    let state = State::read(folder)?.ok_or_else(|| CliError::NoState(folder.clone()))?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    say(&words(&state, Folders::in_use(folder), now));
    Ok(())
}

fn words(state: &State, running: bool, now_unix_s: u64) -> String {
    let doing = match (&state.doing, running) {
        (Doing::Restoring { photo }, true) => format!("restoring {photo}"),
        (Doing::Waiting, true) => "waiting for photos".to_owned(),
        (Doing::Paused { reason }, true) => format!("paused: {reason}"),
        (Doing::Held { reason }, true) => format!("needs help: {reason}"),
        (Doing::Ended, true) => "starting".to_owned(),
        (Doing::Ended, false) => "not running; it ended in good order".to_owned(),
        (Doing::Held { reason }, false) => format!("not running; it needed help: {reason}"),
        (_, false) => {
            "not running, and it did not end in good order; the next start goes on with what was \
             under way"
                .to_owned()
        }
    };
    let attention: String =
        state.attention.iter().map(|words| format!("\nattention: {words}")).collect();
    let ago = now_unix_s.saturating_sub(state.written_unix_s);
    format!(
        "{doing}{attention}\nrig {}; {}; written {} ago",
        state.rig,
        state.counts,
        duration(ago)
    )
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
    use relens::daemon::PhotoCounts;

    use super::*;

    #[test]
    fn a_daemon_that_died_is_told_from_one_that_ended() {
        let mut state = State {
            rig: "small".into(),
            doing: Doing::Waiting,
            counts: PhotoCounts { restored: 3, untouched: 2, failed: 1, left: 0 },
            attention: Vec::new(),
            written_unix_s: 100,
        };
        assert!(words(&state, true, 160).starts_with("waiting for photos\n"));
        assert!(
            words(&state, true, 160).contains("3 restored, 2 returned untouched, 1 failed")
                && words(&state, true, 160).contains("60 s ago")
        );
        assert!(words(&state, false, 160).contains("did not end in good order"));
        state.doing = Doing::Ended;
        assert!(words(&state, false, 160).contains("ended in good order"));
        state.attention.push("no photo was restored".into());
        assert!(words(&state, true, 160).contains("\nattention: no photo was restored\n"));
    }
}
