//! The built program, killed or stopped at work: every photo is in one place and done once.

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::{SCENE, calibrated};

const PHOTOS: [&str; 4] = ["a.png", "b.png", "c.png", "d.png"];

fn relens(words: &[&str], folder: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    command
        .args(words)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn hang_up_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrated(folder);
    let press = |long: &[&str]| relens(&[&["press"], long].concat(), folder).wait().unwrap();
    assert_eq!(press(&[]).code(), Some(2), "no daemon to press for");
    assert!(!folder.join(".relens-button-is-down").exists());
    let mut child = Command::new(env!("CARGO_BIN_EXE_relens"))
        .args(["run", "--rig", "small.toml"])
        .current_dir(folder)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !folder.join("outbox/index.html").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "the daemon does not start");
        std::thread::sleep(Duration::from_millis(50));
    }
    kill_process(Pid::from_child(&child), Signal::HUP).unwrap();
    assert!(!ended_within(&mut child, 1), "still running");
    let calibrated = relens(&["calibrate", "--rig", "small.toml"], folder).wait().unwrap();
    assert_eq!(calibrated.code(), Some(3), "the folder is in use");
    let pressed =
        Command::new(env!("CARGO_BIN_EXE_relens")).arg("press").current_dir(folder).output();
    let told = String::from_utf8(pressed.unwrap().stdout).unwrap();
    assert!(told.contains("this box needs no button"), "{told}");
    let (state, down) = (".relens-state.json", ".relens-button-is-down");
    let kept = std::fs::read(folder.join(state)).unwrap();
    std::fs::write(folder.join(state), "{").unwrap();
    for command in ["press", "status"] {
        let output =
            Command::new(env!("CARGO_BIN_EXE_relens")).arg(command).current_dir(folder).output();
        let output = output.unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{command}: {said}");
        assert!(said.contains(state) && said.contains("restart `relens run`"), "{command}: {said}");
        assert!(!said.contains("EOF"), "no parser's message: {said}");
        assert!(said.contains("nothing was done") && !folder.join(down).exists(), "{said}");
    }
    std::fs::write(folder.join(state), kept).unwrap();
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    assert!(ended_within(&mut child, 30));
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(said.contains("SIGHUP is ignored"), "{said}");
    assert!(!said.contains("<6>"), "no priorities in a pipe: {said}");
}

#[test]
fn a_stop_during_a_calibration_is_quick() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut child = relens(&["run", "--rig", "simulated.toml"], folder);
    let begun = Instant::now();
    while !folder.join("calibration").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "not begun");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_secs(1));
    assert!(child.try_wait().unwrap().is_none(), "measuring the lens");
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let asked = Instant::now();
    // Generous for a busy machine; a whole calibration takes half a minute.
    assert!(ended_within(&mut child, 5));
    println!("ended {:.2} s after it was asked to", asked.elapsed().as_secs_f64());
    assert!(child.wait().unwrap().success(), "exits with 0");
    assert!(!folder.join("outbox/index.html").exists(), "before the end");
    let kept = std::fs::read_dir(folder.join("calibration")).into_iter().flatten().flatten();
    let slots = kept.filter(|file| file.file_name().to_string_lossy().ends_with(".slot"));
    assert_eq!(slots.count(), 0, "none incomplete");
}

fn empty_inbox(folder: &Path) -> Child {
    relens(&["run", "--rig", "small.toml", "--once"], folder)
}

/// Folder of each photo; panics if a photo is in none or several.
fn homes(folder: &Path) -> Vec<&'static str> {
    let home = |photo: &str| {
        let homes = ["inbox", "working", "done", "failed"];
        let found: Vec<_> =
            homes.into_iter().filter(|home| folder.join(home).join(photo).exists()).collect();
        let [home] = found[..] else { panic!("{photo} is in {found:?}") };
        assert!(
            home != "done" || folder.join("outbox").join(photo).is_file(),
            "{photo}: done means delivered"
        );
        home
    };
    PHOTOS.map(home).to_vec()
}

fn ended_within(child: &mut Child, seconds: u64) -> bool {
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > Duration::from_secs(seconds) {
            return false;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    true
}

#[test]
fn kills_and_stops_lose_and_repeat_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::create_dir(folder.join("inbox")).unwrap();
    let photo = ["photograph", "--rig", "small.toml", SCENE, "-o", "inbox/a.png"];
    assert!(relens(&photo, folder).wait().unwrap().success());
    for other in &PHOTOS[1..] {
        std::fs::copy(folder.join("inbox/a.png"), folder.join("inbox").join(other)).unwrap();
    }
    calibrated(folder);

    // Killed at a random moment.
    for n in 0..5 {
        let mut child = empty_inbox(folder);
        std::thread::sleep(Duration::from_millis(150 + 170 * n));
        let _ = child.kill();
        child.wait().unwrap();
        homes(folder);
    }

    // Stopped: the photo under way is put back or finished.
    for n in 0..3 {
        let mut child = empty_inbox(folder);
        std::thread::sleep(Duration::from_millis(300 + 250 * n));
        // It may have ended already.
        let _ = kill_process(Pid::from_child(&child), Signal::TERM);
        // A third of the unit's TimeoutStopSec.
        assert!(ended_within(&mut child, 30), "still there after 30 s");
        assert!(!homes(folder).contains(&"working"), "{:?}", homes(folder));
    }

    let mut last = empty_inbox(folder);
    assert!(ended_within(&mut last, 120));
    let homes = homes(folder);
    println!("{homes:?}");
    let outbox = std::fs::read_dir(folder.join("outbox")).unwrap().flatten();
    let results = outbox.filter(|e| e.file_name().to_string_lossy().ends_with(".png")).count();
    assert_eq!(results, homes.iter().filter(|home| **home == "done").count(), "one result each");
    for (photo, home) in PHOTOS.iter().zip(homes) {
        // A photo interrupted three times is rejected.
        let note =
            std::fs::read_to_string(folder.join(format!("failed/{photo}.txt"))).unwrap_or_default();
        assert!(
            home == "done" || note.contains("found 3 such attempts"),
            "{photo} is in {home}: {note}"
        );
    }
}

#[test]
fn a_stop_while_emptying_the_inbox_begins_no_further_photo() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    calibrated(folder);
    std::fs::create_dir(folder.join("inbox")).unwrap();
    let photo = ["photograph", "--rig", "small.toml", SCENE, "-o", "inbox/a.png"];
    assert!(relens(&photo, folder).wait().unwrap().success());
    for other in 0..6 {
        let name = format!("inbox/b-{other}.png");
        std::fs::copy(folder.join("inbox/a.png"), folder.join(name)).unwrap();
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    command.args(["run", "--rig", "small.toml", "--once"]).current_dir(folder);
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let count = |name: &str| std::fs::read_dir(folder.join(name)).map_or(0, Iterator::count);
    let begun = Instant::now();
    while count("working") == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no photo was begun");
        std::thread::sleep(Duration::from_millis(5));
    }
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let said = String::from_utf8(child.wait_with_output().unwrap().stderr).unwrap();
    // The photo under way may have been finished.
    assert!(count("inbox") >= 6, "{} of 7 left: {said}", count("inbox"));
    assert!(said.matches("kept in the inbox").count() <= 1, "{said}");
    assert!(!said.contains("a capture failed"), "nothing failed: {said}");
}
