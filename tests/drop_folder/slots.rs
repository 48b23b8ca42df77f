//! Calibration slots across power cuts: afterwards the old or the new calibration is whole.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex};

use relens::calibration::{Calibration, store};
use relens::config;
use relens::disk::Disk;
use relens::measurement::{calibrate, to_the_end};
use relens::rig::simulated;

use crate::model_disk::{Contents, ModelDisk, Op, Survivors, Verdict};

const FOLDER: &str = "/flash";

/// Saves `new` on `start`, omitting the operation `skip`. Returns every disk that a cut may leave,
/// with whether saving had ended, and the operations.
fn save(
    start: Contents,
    new: &Calibration,
    skip: Option<usize>,
) -> (Vec<(Survivors, bool)>, Vec<Op>) {
    type Seen = (Vec<Contents>, Vec<Op>);
    let seen: Arc<Mutex<Seen>> = Arc::default();
    let watched = Arc::clone(&seen);
    let disk = ModelDisk::new(
        start,
        Box::new(move |op, contents| {
            if matches!(op, Op::Read(_)) {
                return Ok(Verdict::Done);
            }
            let mut seen = watched.lock().unwrap();
            seen.0.push(contents.clone());
            seen.1.push(op.clone());
            Ok(if skip == Some(seen.1.len() - 1) { Verdict::Skipped } else { Verdict::Done })
        }),
    );
    store::save_to(&disk, Path::new(FOLDER), new).unwrap();
    let (instants, ops) = std::mem::take(&mut *seen.lock().unwrap());
    let instants = instants.into_iter().map(|c| (c, false)).chain([(disk.contents(), true)]);
    let cuts = instants.flat_map(|(c, end)| c.cuts(&|_| false).into_iter().map(move |s| (s, end)));
    (cuts.collect(), ops)
}

fn saved_on(survivors: &Survivors, rig: u64) -> Result<u32, String> {
    let folders = BTreeSet::from([FOLDER.into()]);
    let disk =
        ModelDisk::new(Contents::after(survivors, &folders), Box::new(|_, _| Ok(Verdict::Done)));
    store::load_from(&disk, Path::new(FOLDER), rig).map(|c| c.generation).map_err(|e| e.to_string())
}

/// Saves one generation after another with cuts at every instant, continuing from each resulting
/// disk.
fn search(first: &Calibration, skip: Option<usize>) -> Result<(usize, usize), String> {
    let empty = ModelDisk::new(Contents::default(), Box::new(|_, _| Ok(Verdict::Done)));
    empty.make_folder(Path::new(FOLDER)).unwrap();
    let generation = |generation| Calibration { generation, ..first.clone() };
    store::save_to(&empty, Path::new(FOLDER), &generation(1)).unwrap();
    let folders = empty.contents().folders().clone();
    let mut level: BTreeSet<Survivors> = BTreeSet::from([empty.contents().now()]);
    let (mut seen, mut ops) = (0, 0);
    // Save and cut, three times in a row.
    for next in 2..=4 {
        let mut reached = BTreeSet::new();
        for survivors in &level {
            let before = saved_on(survivors, first.rig)?;
            let (cuts, done) = save(Contents::after(survivors, &folders), &generation(next), skip);
            ops = done.len();
            for (survivors, end) in cuts {
                seen += 1;
                let found = saved_on(&survivors, first.rig)?;
                if found != next && (end || found != before) {
                    return Err(format!(
                        "generation {found}, allowed {next} or, before the end, {before}"
                    ));
                }
                reached.insert(survivors);
            }
        }
        // Continue from one disk of each kind.
        let mut kinds = BTreeSet::new();
        reached.retain(|s| {
            kinds.insert(
                s.iter()
                    .map(|(p, (_, b))| (p.clone(), b.len(), crc32fast::hash(b)))
                    .collect::<Vec<_>>(),
            )
        });
        level = reached;
    }
    Ok((seen, ops))
}

#[test]
fn after_any_power_cut_a_calibration_is_whole() {
    let config = config::load(Path::new("small.toml")).unwrap();
    let (mut rig, _) = simulated::open(&config).unwrap();
    let measured = calibrate(&mut rig, &config, None, &mut to_the_end).unwrap();
    let (cuts, ops) = search(&measured, None).unwrap();
    println!("{cuts} disks after cuts, {ops} operations");
    for skip in 0..ops {
        let harm = search(&measured, Some(skip));
        println!("operation {skip} omitted: {harm:?}");
        // The first is the write itself, which this disk never omits.
        assert!(skip == 0 || harm.is_err(), "operation {skip} is not needed");
    }
}
