//! Withdrawal of results, also across power cuts.

use std::path::Path;

use relens::daemon::Delivered;

use crate::model_disk::{Contents, ModelDisk, Survivors, Verdict};
use crate::power::{Found, Label, canonical, filled, good, live_in, search_in};
use crate::power_checks::{Dropped, ROOT};

/// Visits every state that power cuts can lead to while a night withdraws the result of a photo.
fn search(skip: Option<&Label>) -> Result<Found, String> {
    let photo = good("a.png", 30.0);
    let life = live_in(false, filled(std::slice::from_ref(&photo), None), None, false);
    let (end, _) = life.instants.last().ok_or("no instants")?;
    let mut folders = end.folders().clone();
    folders.insert(Path::new(ROOT).join("outbox/withdrawn"));
    let disk = ModelDisk::new(
        Contents::after(&canonical(end.now()), &folders),
        Box::new(|_, _| Ok(Verdict::Done)),
    );
    let delivered = Delivered { kept: "a.png".into(), result: "a.png".into() };
    let record = serde_json::json!({
        "floor_unix_s": 0.0, "unproven": [delivered], "must_repeat": true,
        "is_withdrawing": true,
    });
    disk.drop_in(&Path::new(ROOT).join(".relens-night.json"), record.to_string().as_bytes(), 80);
    let dropped: [Dropped; 1] = [photo];
    search_in(true, vec![disk.contents()], &dropped, skip, &|disk, end| {
        withdrawn(disk, &dropped[0], end)
    })
}

/// Checks that withdrawn results are whole; in the end the photo waits, its result and report
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
    let done = wanted.iter().all(|path| there(&path)) && !elsewhere.iter().any(|path| there(&path));
    match done || !end {
        true => Ok(()),
        false => Err(format!("in the end there is {:?}", disk.keys().collect::<Vec<_>>())),
    }
}

#[test]
fn withdrawal_survives_power_cuts_and_needs_each_synchronisation() {
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
    // Omitting these is harmless: folders are durable at once on this disk, and without the night's
    // record the withdrawal is repeated.
    let harmless = ["sync folder /box", "sync folder box/outbox", "sync box/temporary"];
    unseen.retain(|(words, _)| !harmless.contains(words));
    assert!(unseen.is_empty(), "omitted without harm: {unseen:#?}");
}
