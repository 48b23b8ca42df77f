//! The built program on a simulated rig that takes its own photos.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::SCENE;

fn relens(words: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    command.args(words).current_dir(folder).stderr(Stdio::piped());
    command
}

/// Waits until `is` returns true; `what` describes it.
fn wait_for(what: &str, is: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is() {
        assert!(begun.elapsed() < Duration::from_secs(90), "{what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Terminates `child`; returns its log.
fn stopped(child: Child) -> String {
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let Output { status, stderr, .. } = child.wait_with_output().unwrap();
    assert!(status.success());
    String::from_utf8_lossy(&stderr).into_owned()
}

/// Names in `folder` with this `ending`.
fn names(folder: &Path, ending: &str) -> Vec<String> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = files.map(|file| file.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.ends_with(ending)).collect()
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_press_takes_a_raw_photo_that_is_restored_before_the_panel() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rig = include_str!("../../rig-config/small.toml");
    let filtered = rig
        .replace("[sensor]\n", "[sensor]\nmosaic = \"rggb\"\n")
        .replace("[photo]\n", "[photo]\nraw-results = \"jpeg\"\n");
    std::fs::write(folder.join("filtered.toml"), filtered).unwrap();
    let run = ["run", "--rig", "filtered.toml", "--scene", SCENE];
    let child = relens(&run, folder).spawn().unwrap();
    wait_for("it starts", || folder.join("outbox/index.html").exists());
    assert!(relens(&["press"], folder).status().unwrap().success());
    wait_for("a photo is taken", || !names(&folder.join("inbox"), ".dng").is_empty());
    wait_for("it is restored", || !names(&folder.join("done"), ".dng").is_empty());
    assert!(!names(&folder.join("outbox"), ".jpg").is_empty(), "as the rig file says");
    let said = stopped(child);
    let place = |words| said.find(words).unwrap_or_else(|| panic!("no `{words}` in {said}"));
    let asked = place("the panel is needed: The photo is saved");
    assert!(
        place("taken") < asked && asked < place("putting the simulated panel before the lens"),
        "{said}"
    );
    assert!(place("restored (") > asked, "{said}");
}

#[test]
fn only_simulated_rigs_take_a_scene_and_they_need_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let shooting =
        concat!(include_str!("../../rig-config/small.toml"), "\n[run]\nmode = \"shoot\"\n");
    std::fs::write(folder.join("shooting.toml"), shooting).unwrap();
    let devices = concat!(env!("CARGO_MANIFEST_DIR"), "/rig-config/raspberry-pi-5.toml");
    for (words, wanted) in [
        (&["--rig", devices, "--scene", SCENE][..], "devices"),
        (&["--rig", "shooting.toml"], "give --scene PICTURE"),
        (&["--rig", "small.toml", "--scene", "no-such.png"], "no-such.png"),
        (&["--rig", "small.toml", "--scene", SCENE, "--once"], "--once"),
    ] {
        let output = relens(&[&["run"], words].concat(), folder).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(wanted), "{words:?}: {said}");
    }
    assert!(!folder.join("inbox").exists(), "nothing was begun");
}

#[test]
fn the_inbox_is_made_for_the_first_photo() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let shoot = ["shoot", "--rig", "truthful.toml", "--scene", SCENE];
    for (options, code) in [
        (&["--folder", "box", "-o", "box/inbox/a.dng"][..], 0),
        (&["-o", "inbox/a.dng"], 0),
        (&["--folder", "box", "-o", "bok/inbox/b.dng"], 2),
    ] {
        let status = relens(&[&shoot, options].concat(), folder).status().unwrap();
        assert_eq!(status.code(), Some(code), "{options:?}");
    }
    assert!(folder.join("box/inbox/a.dng").exists() && folder.join("inbox/a.dng").exists());
    assert!(!folder.join("bok").exists());
}
