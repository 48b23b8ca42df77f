//! Raw photos of the rig's sensor, written by another program.

use std::path::Path;
use std::process::Command;

use relens::Rig;
use relens::frame::RawSites;
use relens::picture::{Photo, PhotoCamera};

use crate::SCENE;

#[test]
#[ignore = "a minute: the gate runs it"]
fn the_same_sites_in_other_units_are_the_same_photo() {
    let folder = tempfile::tempdir().unwrap();
    let truthful = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig-config/truthful.toml");
    let text = std::fs::read_to_string(truthful).unwrap();
    // Restored without captures, whose noise is random.
    let text = text.replacen("method = \"block-matching\"", "method = \"digital\"", 1);
    let kept: Vec<&str> =
        text.lines().filter(|line| !line.starts_with("corrections-max")).collect();
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, kept.join("\n")).unwrap();
    let mut shoot = Command::new(env!("CARGO_BIN_EXE_relens"));
    shoot.args(["shoot", "--rig", "rig.toml", "--scene", SCENE, "-o", "own.dng"]);
    assert!(shoot.current_dir(folder.path()).status().unwrap().success());

    let mut rig = Rig::open(&path).unwrap();
    let slots = folder.path().join("slots");
    rig.calibrate(&slots).unwrap();
    let own = rig.read(folder.path().join("own.dng")).unwrap();
    let mut restorer = rig.restorer(&slots).unwrap();
    // Ten bits in the upper part of sixteen, as on a Raspberry Pi 5.
    let by = |times: f32, name: Option<&str>| {
        let raw = own.raw.unwrap();
        let camera =
            name.map(|name| PhotoCamera { name: name.to_owned(), serial: None, setting: None });
        let raw = Some(RawSites { counts_per_level: times * raw.counts_per_level, ..raw });
        Photo { raw, camera, ..own.clone() }
    };
    let mut restored = |photo: &Photo| restorer.restore(photo).unwrap();
    let wanted = restored(&own);
    let upper = restored(&by(64.0, Some("Raspberry Pi imx296")));
    assert_eq!(upper.picture, wanted.picture);
    let told = |notes: &[String], word: &str| notes.iter().any(|note| note.contains(word));
    assert!(told(&upper.notes, "names Raspberry Pi imx296 as its camera"), "{:?}", upper.notes);
    // An unknown camera is noted.
    let unknown = restored(&by(1.0, None));
    assert!(told(&unknown.notes, "does not name its camera"), "{:?}", unknown.notes);
    assert!(!told(&wanted.notes, "its camera"), "{:?}", wanted.notes);
}
