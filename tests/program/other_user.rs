//! The built program with another user's files in its inbox.

use std::fs::Permissions;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use crate::SCENE;

/// Unprivileged user for the program if these tests run as root.
const NOBODY: u32 = 65534;

fn relens(program: &Path, words: &[&str], folder: &Path) -> std::process::Output {
    let mut command = Command::new(program);
    if rustix::process::geteuid().is_root() {
        command.uid(NOBODY).gid(NOBODY);
    }
    command.args(words).current_dir(folder).output().unwrap()
}

#[test]
fn files_of_another_user_delay_no_photo() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::set_permissions(folder, Permissions::from_mode(0o755)).unwrap();
    let program = folder.join("relens");
    // Copied by another process: a child of another test may hold a file open that this one writes,
    // and the kernel runs no file open for writing (ETXTBSY).
    let copied = Command::new("cp").arg(env!("CARGO_BIN_EXE_relens")).arg(&program).status();
    assert!(copied.unwrap().success());
    let home = folder.join("home");
    std::fs::create_dir(&home).unwrap();
    if rustix::process::geteuid().is_root() {
        chown(&home, Some(NOBODY), Some(NOBODY)).unwrap();
    }
    // A fast method, because the delay before the photo is measured.
    let small = include_str!("../../rig-config/small.toml");
    let digital = small.replace("[restore]\n", "[restore]\nmethod = \"digital\"\n");
    assert_ne!(small, digital);
    std::fs::write(home.join("digital.toml"), digital).unwrap();
    let calibrated = relens(&program, &["calibrate", "--rig", "digital.toml"], &home);
    assert!(calibrated.status.success(), "{}", String::from_utf8_lossy(&calibrated.stderr));
    std::fs::copy(SCENE, home.join("scene.png")).unwrap();
    let words = ["photograph", "--rig", "digital.toml", "scene.png", "-o", "photo.png"];
    assert!(relens(&program, &words, &home).status.success());
    for bad in [1, 4, 400] {
        let inbox = home.join("inbox");
        let _ = std::fs::remove_dir_all(&inbox);
        std::fs::create_dir(&inbox).unwrap();
        for n in 0..bad {
            let path = inbox.join(format!("theirs-{n}.png"));
            std::fs::copy(home.join("photo.png"), &path).unwrap();
            // Owned by root, or by the same user and unreadable.
            std::fs::set_permissions(&path, Permissions::from_mode(0o000)).unwrap();
        }
        let good = format!("good-{bad}.png");
        std::fs::copy(home.join("photo.png"), inbox.join(&good)).unwrap();
        if rustix::process::geteuid().is_root() {
            chown(&inbox, Some(NOBODY), Some(NOBODY)).unwrap();
        }
        let begun = Instant::now();
        let output = relens(&program, &["run", "--rig", "digital.toml", "--once"], &home);
        let seconds = begun.elapsed().as_secs_f64();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        println!("{bad}: {seconds:.1} s");
        assert!(home.join("outbox").join(&good).is_file() && seconds < 10.0, "{bad}: {said}");
        assert_eq!(output.status.code(), Some(1), "{said}");
        let lines = said.lines().filter(|line| line.contains("/inbox/theirs-")).count();
        let by_root = rustix::process::geteuid().is_root();
        let remedy = if by_root { "chown" } else { "chmod u+r" };
        assert_eq!((lines, said.contains(remedy)), (bad, true), "each once: {said}");
    }
    each_has_its_own_remedy(&program, &home);
}

/// Checks that the remedies differ between an unreadable file and a folder of another user.
fn each_has_its_own_remedy(program: &Path, home: &Path) {
    if !rustix::process::geteuid().is_root() {
        return;
    }
    let inbox = home.join("inbox");
    let holiday = inbox.join("holiday");
    std::fs::remove_dir_all(&inbox).unwrap();
    std::fs::create_dir_all(&holiday).unwrap();
    for path in [inbox.join("closed.png"), holiday.join("there.png")] {
        std::fs::copy(home.join("photo.png"), &path).unwrap();
        chown(&path, Some(NOBODY), Some(NOBODY)).unwrap();
    }
    std::fs::set_permissions(inbox.join("closed.png"), Permissions::from_mode(0o000)).unwrap();
    chown(&inbox, Some(NOBODY), Some(NOBODY)).unwrap();
    let output = relens(program, &["run", "--rig", "digital.toml", "--once"], home);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let of = |name: &str| said.lines().find(|line| line.contains(name)).unwrap_or_default();
    assert!(of("closed.png").contains("chmod u+r"), "{said}");
    let folder = of("there.png");
    assert!(folder.contains("give the folder") && folder.contains("inbox/holiday to"), "{said}");
}
