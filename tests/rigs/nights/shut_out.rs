//! A night on which the rig cannot be opened: without a daemon, the missed night is still reported.

use std::cell::Cell;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use relens::daemon::{Doing, Folders, Nightly, Schedule, State, Times};
use rustix::process::{Pid, Signal, kill_process};

use super::{TestClock, nights, photos};

const HOUR: f64 = 3600.0;
const WHY: &str = "the camera is gone: no camera is called \"DFK 37AUR0234\"";

/// Report on missed nights after `hours` without a rig, from 21:50.
fn shut_out_for(root: &Path, hours: f64) -> Option<String> {
    let clock = TestClock(Cell::new(0.0));
    let ten_to_ten_unix_s = 1_768_042_800.0 + 9.0 * HOUR + 50.0 * 60.0;
    let calendar = || UNIX_EPOCH + Duration::from_secs_f64(ten_to_ten_unix_s + clock.0.get());
    let times =
        Times { clock: &clock, calendar: &calendar, is_set: &|| true, temperature_c: &|| None };
    let mut night =
        Nightly::new(&nights("22:00-06:00"), &Folders::open(root).unwrap(), times).unwrap();
    while clock.0.get() < hours * HOUR {
        night.set_rig_unavailable(WHY);
        clock.0.set(clock.0.get() + 30.0);
    }
    night.attention().first().map(ToString::to_string)
}

#[test]
fn a_night_without_a_rig_is_missed_once_it_is_over() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 2);
    assert_eq!(shut_out_for(root.path(), 8.0), None, "ten minutes before the end");
    let missed = shut_out_for(root.path(), 9.0).unwrap();
    assert!(
        missed.starts_with("no photo was restored in the night up to 2026-01-11 06:00"),
        "{missed}"
    );
    assert!(missed.contains("wait since 2026-01-10 21:50") && missed.ends_with(WHY), "{missed}");
    // Other files in the inbox do not wait.
    let root = tempfile::tempdir().unwrap();
    std::fs::create_dir(root.path().join("inbox")).unwrap();
    std::fs::write(root.path().join("inbox/.DS_Store"), b"junk").unwrap();
    assert_eq!(shut_out_for(root.path(), 9.0), None);
}

/// Runs the program over `root` until it is held; returns its state and log.
fn held(root: &Path, rig: &Path) -> (State, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    command.args(["run", "--rig"]).arg(rig).arg("--folder").arg(root).stderr(Stdio::piped());
    let mut child: Child = command.spawn().unwrap();
    let begun = Instant::now();
    let state = loop {
        match State::read(root).ok().flatten() {
            Some(state) if matches!(state.doing, Doing::Held { .. }) => break state,
            _ => assert!(begun.elapsed() < Duration::from_secs(60), "it is not held"),
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let mut log = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut log).unwrap();
    assert!(child.wait().unwrap().success(), "{log}");
    (state, log)
}

#[test]
fn the_program_reports_missed_nights_while_waiting_for_its_rig() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    photos(root, 2);
    // A simulated rig can always be opened, but not used without a folder for its calibration.
    std::fs::write(root.join("calibration"), b"a file where a folder should be").unwrap();
    let rig = root.join("rig.toml");
    let tables = "[nights]\nwindow = \"22:00-06:00\"\ntime-zone = \"Europe/Vienna\"\nclock = \
     \"battery\"\n\
        pilot-every-photos = 50\nrecalibrate = true\n";
    std::fs::write(&rig, format!("{}\n{tables}", include_str!("../../../rig-config/small.toml")))
        .unwrap();
    // From an earlier run: photos have waited for three days.
    let now_unix_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
    let since_unix_s = now_unix_s - 72.0 * HOUR;
    let record = serde_json::json!({
        "floor_unix_s": since_unix_s, "unproven": [], "must_repeat": false,
        "is_withdrawing": false, "waiting_since_unix_s": since_unix_s, "obstacle": "",
    });
    std::fs::write(root.join(".relens-night.json"), record.to_string()).unwrap();

    let (state, log) = held(root, &rig);
    let Doing::Held { reason } = state.doing else { panic!("held") };
    let [missed] = &state.attention[..] else { panic!("{:?}", state.attention) };
    assert!(
        missed.starts_with("no photo was restored in ") && missed.contains("nights"),
        "{missed}"
    );
    assert!(missed.contains("the box was off, or relens did not run, before"), "{missed}");
    assert_eq!(log.matches(&**missed).count(), 1, "one line: {log}");
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    assert!(page.contains("Attention: no photo was restored"), "the morning's report");

    // After a restart the reason is known.
    let (state, _) = held(root, &rig);
    let missed = &state.attention[0];
    assert!(missed.ends_with(&reason) && reason.contains("calibration"), "{missed}: {reason}");
}
