//! The built program on a terminal: progress line and remaining output.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, ExitStatus};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

use crate::{SCENE, calibrated};

/// Rows of the terminals.
const ROWS: u16 = 60;

/// Contents of a terminal.
struct Seen {
    status: ExitStatus,
    bytes: Vec<u8>,
    screen: vt100::Parser,
    /// Every progress line visible after a write.
    bars: Vec<String>,
}

impl Seen {
    /// Remaining rows, with wrapped ones joined.
    fn remaining(&self) -> String {
        self.screen.screen().contents()
    }
}

fn is_bar(row: &str) -> bool {
    row.contains(['█', '░'])
}

/// Runs relens on a terminal with `columns`; `interrupt` stops it at its first progress line.
fn on_terminal(
    words: &[&str],
    folder: &Path,
    (name, columns): (&str, u16),
    interrupt: bool,
) -> Seen {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let path = ptsname(&master, Vec::new()).unwrap();
    let size = Winsize { ws_row: ROWS, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(master.as_fd(), size).unwrap();
    let slave: OwnedFd =
        File::options().read(true).write(true).open(path.to_str().unwrap()).unwrap().into();
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    // Assignments before the command set the environment.
    let set = words.iter().map_while(|word| word.split_once('=')).collect::<Vec<_>>();
    command.args(&words[set.len()..]).current_dir(folder).env_remove("COLUMNS");
    command.envs(set).env("TERM", name).env("NO_COLOR", "1");
    command.stdin(slave.try_clone().unwrap()).stdout(slave.try_clone().unwrap()).stderr(slave);
    let mut child = command.spawn().unwrap();
    // The program now holds the only other end.
    drop(command);
    let mut screen = vt100::Parser::new(ROWS.try_into().unwrap(), columns.try_into().unwrap(), 0);
    let (mut bytes, mut bars) = (Vec::new(), Vec::new());
    let (mut master, mut piece) = (File::from(master), [0; 4096]);
    // Reading fails once the terminal is closed.
    while let Ok(length @ 1..) = master.read(&mut piece) {
        bytes.extend_from_slice(&piece[..length]);
        screen.process(&piece[..length]);
        let rows: Vec<String> =
            screen.screen().rows(0, columns).filter(|row| is_bar(row)).collect();
        assert!(rows.len() <= 1, "one progress line at a time: {rows:#?}");
        if interrupt && bars.is_empty() && !rows.is_empty() {
            // The key's echo comes before its signal, which this terminal does not send by itself.
            master.write_all(b"\x03").unwrap();
            std::thread::sleep(Duration::from_millis(100));
            kill_process(Pid::from_child(&child), Signal::INT).unwrap();
        }
        bars.extend(rows);
    }
    Seen { status: child.wait().unwrap(), bytes, screen, bars }
}

/// A folder with a photo in its inbox.
fn folder_with_photo() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("inbox")).unwrap();
    let photo = "inbox/a-photo-with-a-name-that-is-long.png";
    let words = ["photograph", "--rig", "small.toml", SCENE, "-o", photo];
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    let output = command.args(words).current_dir(folder.path()).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "no progress in a pipe");
    folder
}

#[test]
fn progress_fits_fifty_columns_and_is_cleared() {
    let folder = folder_with_photo();
    let words = ["run", "--rig", "small.toml", "--once", "-v"];
    let seen = on_terminal(&words, folder.path(), ("xterm", 50), false);
    let remaining = seen.remaining();
    assert!(seen.status.success(), "{remaining}");
    for doing in ["calibrating: ", "a-photo"] {
        let bar = seen.bars.iter().find(|bar| bar.contains(doing));
        assert!(bar.is_some_and(|bar| bar.contains(" %  ")), "{doing}: {:#?}", seen.bars);
    }
    assert!(!is_bar(&remaining), "{remaining}");
    assert!(!seen.bytes.windows(3).any(|bytes| bytes == b"\x1b[3"), "no colours");
    // Each log line begins a row.
    for line in ["calibrating the simulated rig small", "a-photo-with-a-name", "1 restored"] {
        assert!(
            remaining.lines().any(|row| row.trim_start().starts_with(line)),
            "{line}: {remaining}"
        );
    }
}

#[test]
fn the_columns_variable_is_respected() {
    let folder = folder_with_photo();
    calibrated(folder.path());
    let words = ["run", "--rig", "small.toml", "--once"];
    let seen = on_terminal(&words, folder.path(), ("xterm", 80), false);
    let longest = |seen: &Seen| seen.bars.iter().map(|bar| bar.trim_end().chars().count()).max();
    assert!(longest(&seen) > Some(46), "{:#?}", seen.bars);
    let folder = folder_with_photo();
    calibrated(folder.path());
    let words = ["COLUMNS=40", "run", "--rig", "small.toml", "--once"];
    let seen = on_terminal(&words, folder.path(), ("xterm", 80), false);
    assert!(seen.status.success() && longest(&seen) <= Some(36), "{:#?}", seen.bars);
}

#[test]
fn an_interrupt_clears_the_line_and_is_reported_to_the_shell() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["calibrate", "--rig", "small.toml"];
    let seen = on_terminal(&words, folder.path(), ("xterm", 80), true);
    assert_eq!(seen.status.signal(), Some(Signal::INT.as_raw()));
    assert!(!seen.bars.is_empty() && seen.remaining().trim().is_empty(), "{}", seen.remaining());
}

#[test]
fn a_dumb_terminal_gets_plain_lines() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["photograph", "--rig", "small.toml", SCENE, "-o", "a.png", "-v"];
    let seen = on_terminal(&words, folder.path(), ("dumb", 50), false);
    assert!(seen.status.success() && seen.bars.is_empty());
    let text = String::from_utf8(seen.bytes).unwrap();
    assert!(!text.contains('\x1b') && !text.replace("\r\n", "").contains('\r'), "{text:?}");
}
