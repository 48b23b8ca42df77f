//! Invariants of the disk, at every instant and at the end.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use relens::daemon::Report;

use crate::model_disk::Survivors;

/// The root of the model's folders.
pub const ROOT: &str = "/box";

/// A dropped photo and its expected result.
#[derive(Clone)]
pub struct Dropped {
    pub name: &'static str,
    pub bytes: Vec<u8>,
    pub result: Option<Vec<u8>>,
}

fn folder(path: &Path) -> &str {
    path.parent().and_then(|p| p.strip_prefix(ROOT).ok()).and_then(Path::to_str).unwrap_or("")
}

fn name(path: &Path) -> &str {
    path.file_name().and_then(OsStr::to_str).unwrap_or("")
}

/// Checks that every photo is whole and in exactly one place, every result is whole and has its
/// report and previews, and photos in `done` have a result, photos in `failed` a note.
pub fn at_every_instant(disk: &Survivors, dropped: &[Dropped]) -> Result<(), String> {
    let at =
        |path: &str| disk.get(Path::new(&format!("{ROOT}/{path}"))).map(|(_, holds)| &holds[..]);
    for photo in dropped {
        let homes: Vec<&PathBuf> = disk
            .iter()
            .filter(|(path, (_, holds))| {
                ["inbox", "working", "done", "failed"].contains(&folder(path))
                    && holds[..] == photo.bytes[..]
            })
            .map(|(path, _)| path)
            .collect();
        let [home] = homes[..] else { return Err(format!("{} is in {homes:?}", photo.name)) };
        if folder(home) == "done" && results(disk, photo).is_empty() {
            return Err(format!("{} is done without a result", photo.name));
        }
        let note = at(&format!("failed/{}.txt", name(home)));
        if folder(home) == "failed"
            && !note.is_some_and(|note| note.ends_with(b"put it back into the inbox.\n"))
        {
            return Err(format!("{} is rejected without a note: {note:?}", photo.name));
        }
    }
    for (path, (_, holds)) in disk.iter().filter(|(path, _)| folder(path) == "outbox") {
        let name = name(path);
        if name.starts_with('.') || name.ends_with(".json") {
            continue;
        }
        if name == "index.html" {
            if !holds.ends_with(b"</html>\n") {
                return Err("the gallery is not whole".into());
            }
            continue;
        }
        if !dropped.iter().any(|photo| photo.result.as_deref() == Some(&holds[..])) {
            let report =
                at(&format!("outbox/{name}.json")).map(|r| String::from_utf8_lossy(r).into_owned());
            return Err(format!("outbox/{name} ({} bytes) is not whole: {report:?}", holds.len()));
        }
        let report =
            at(&format!("outbox/{name}.json")).ok_or(format!("outbox/{name} has no report"))?;
        let report: Report = serde_json::from_slice(report)
            .map_err(|e| format!("the report of outbox/{name}: {e}"))?;
        for preview in [&report.before, &report.after] {
            // A JPEG from its first marker to its last.
            if !at(&format!("outbox/{preview}"))
                .is_some_and(|p| p.starts_with(&[0xff, 0xd8]) && p.ends_with(&[0xff, 0xd9]))
            {
                return Err(format!("the preview {preview} of outbox/{name} is not whole"));
            }
        }
    }
    Ok(())
}

fn results<'a>(disk: &'a Survivors, photo: &Dropped) -> Vec<&'a PathBuf> {
    let Some(wanted) = &photo.result else { return vec![] };
    let is = |(path, (_, holds)): &(&PathBuf, &(u64, std::sync::Arc<[u8]>))| {
        folder(path) == "outbox" && holds[..] == wanted[..]
    };
    disk.iter().filter(is).map(|(path, _)| path).collect()
}

/// Checks that no photo waits or is under way, no temporary file remains, and each photo is done
/// with one result or rejected without a result.
pub fn in_the_end(disk: &Survivors, dropped: &[Dropped]) -> Result<(), String> {
    at_every_instant(disk, dropped)?;
    for photo in dropped {
        let home = disk
            .iter()
            .find(|(path, (_, holds))| folder(path) != "outbox" && holds[..] == photo.bytes[..]);
        // A good photo may be rejected because the program ended too often.
        let note =
            home.and_then(|(path, _)| disk.get(Path::new(&format!("{}.txt", path.display()))));
        let interrupted =
            note.is_some_and(|(_, note)| String::from_utf8_lossy(note).contains("found 3 such"));
        let home = home.map_or("", |(path, _)| folder(path));
        let results = results(disk, photo);
        match (home, &photo.result, results.len()) {
            ("done", Some(_), 1) => {}
            ("failed", None, 0) => {}
            ("failed", Some(_), 0) if interrupted => {}
            (home, ..) => {
                return Err(format!("{} is in {home} with the results {results:?}", photo.name));
            }
        }
    }
    let mut left: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for path in disk.keys() {
        let result = name(path)
            .strip_suffix(".json")
            .map(|result| Path::new(ROOT).join("outbox").join(result));
        let orphan =
            folder(path) == "outbox" && result.is_some_and(|result| !disk.contains_key(&result));
        let ours = name(path).starts_with('.') && !folder(path).is_empty();
        if ["inbox", "working"].contains(&folder(path)) || orphan || ours {
            left.entry(folder(path)).or_default().push(name(path));
        }
    }
    if left.is_empty() { Ok(()) } else { Err(format!("{left:?} is left")) }
}
