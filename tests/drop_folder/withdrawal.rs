//! A result that cannot be stood by is withdrawn, and its photo restored anew, whatever the power
//! does meanwhile.

use std::path::Path;

use relens::daemon::Delivered;

use crate::model_disk::{Contents, ModelDisk, Survivors, Verdict};
use crate::power::{Age, Found, Label, canonical, filled, good, live_at, search_at};
use crate::power_checks::{Dropped, ROOT};

/// A photo that is done, and a night that has decided to do it again: every state that power cuts
/// can lead to.
fn search(skip: Option<&Label>) -> Result<Found, String> {
    let photo = good("a.png", 30.0);
    let night = Age { nights: true, ..Age::default() };
    let life = live_at(Age::default(), filled(std::slice::from_ref(&photo), None), None, false);
    let (end, _) = life.instants.last().ok_or("no instants")?;
    let mut folders = end.folders().clone();
    folders.insert(Path::new(ROOT).join("outbox/withdrawn"));
    let disk = ModelDisk::new(
        Contents::after(&canonical(end.now()), &folders),
        Box::new(|_, _| Ok(Verdict::Done)),
    );
    let delivered = Delivered { kept: "a.png".into(), result: "a.png".into() };
    let record = serde_json::json!({
        "floor_unix_s": 0.0, "unproven": [delivered], "doubted": true, "again": true
    });
    disk.drop_in(&Path::new(ROOT).join(".relens-night.json"), record.to_string().as_bytes(), 80);
    let dropped: [Dropped; 1] = [photo];
    search_at(night, vec![disk.contents()], &dropped, skip, &|disk, end| {
        withdrawn(disk, &dropped[0], end)
    })
}

/// What is withdrawn is whole; in the end the photo waits, and all that belonged to its result is
/// withdrawn.
fn withdrawn(disk: &Survivors, photo: &Dropped, end: bool) -> Result<(), String> {
    let root = Path::new(ROOT);
    let folder = root.join("outbox/withdrawn");
    for (path, (_, holds)) in disk.iter().filter(|(path, _)| path.parent() == Some(&folder)) {
        let report = path.extension().is_some_and(|ending| ending == "json");
        if !report && photo.result.as_deref() != Some(&holds[..]) {
            return Err(format!("{} is not whole", path.display()));
        }
    }
    let there = |path: &&&str| disk.contains_key(&root.join(path));
    let wanted = ["inbox/a.png", "outbox/withdrawn/a.png", "outbox/withdrawn/a.png.json"];
    let elsewhere = ["done/a.png", "outbox/a.png", "outbox/a.png.json"];
    let over = wanted.iter().all(|path| there(&path)) && !elsewhere.iter().any(|path| there(&path));
    match over || !end {
        true => Ok(()),
        false => Err(format!("in the end there is {:?}", disk.keys().collect::<Vec<_>>())),
    }
}

#[test]
fn the_power_may_fail_while_results_are_withdrawn_and_each_synchronisation_is_needed() {
    let found = search(None).unwrap();
    println!("{} states of the disk, {} cuts", found.states, found.cuts);
    let moved = |from: &str| found.labels.iter().any(|(_, words, _)| words.starts_with(from));
    assert!(moved("rename box/done/a.png to box/inbox/a.png"), "{:#?}", found.labels);
    assert!(moved("rename box/outbox/a.png to box/outbox/withdrawn/a.png") && found.cuts > 100);
    let mut unseen = vec![];
    for label in found.labels.iter().filter(|(_, words, _)| words.starts_with("sync")) {
        match search(Some(label)) {
            Err(harm) => println!("{label:?}: {harm}"),
            Ok(_) => unseen.push((&label.1[..], label.2)),
        }
    }
    // Those of the folders themselves, which last at once on this disk; and of the night's record,
    // without which the same is done again.
    let harmless = ["sync folder /box", "sync folder box/outbox", "sync box/temporary"];
    unseen.retain(|(words, _)| !harmless.contains(words));
    assert!(unseen.is_empty(), "left out and nobody was harmed: {unseen:#?}");
}
