//! A simulated rig with colour filters that takes and restores its own photos, also with faults.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::{Arc, Mutex};

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use relens::chart::scenes::{Scene, cut};
use relens::config::{self, Curve, Faults, Kind};
use relens::daemon::{DaemonSetting, Folders};
use relens::frame::{Frame, Mosaic, Work};
use relens::kiosk::front_panel::{BoxState, FrontPanel};
use relens::kiosk::press::Press;
use relens::kiosk::screen::Screen;
use relens::picture::{Limits, Photo};
use relens::restorer::on_rig::{OnRig, measure};
use relens::rig::simulated::{self, Witness};

use crate::bed::*;
use crate::model_disk::{Contents, ModelDisk, Op, Verdict};
use crate::power::filled;
use crate::power_checks::ROOT;
use crate::shooting::{Ran, run};

/// small.toml with colour filters, calibrated into `slots`.
fn rig(slots: &Path) -> (config::RigFile, OnRig, Witness) {
    let mut rig = config::load(Path::new("small.toml")).unwrap();
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.mosaic = Some(Mosaic::Rggb);
    }
    let (mut devices, witness) = simulated::open(&rig).unwrap();
    measure(&rig, &mut devices, slots, |_| {}, None).unwrap();
    let stopwatch = Arc::new(|| 0.0);
    let restorer = OnRig::new(&rig, devices, slots.into(), None, stopwatch, |_| {}).unwrap();
    (rig, restorer, witness)
}

fn setting_of(rig: &config::RigFile) -> DaemonSetting {
    DaemonSetting {
        hints: false,
        ..DaemonSetting::new(&rig.name, rig.photo_grid(), rig.photo.curve)
    }
}

fn before_the_lens(rig: &config::RigFile) -> Frame<Work> {
    let sensor = rig.photo_grid().sensor;
    cut(&Scene::ALL[0].light(sensor), sensor)
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn own_photos_are_restored_and_a_knock_is_measured() {
    let (root, slots) = (fresh_root(), fresh_root());
    let (rig, mut restorer, witness) = rig(slots.path());
    let scene = before_the_lens(&rig);
    witness.put_before_lens(Some(&scene));
    let witness = RefCell::new(witness);
    let mut acts = (0..).zip([6.0, 30.0, 80.0, 100.0]).peekable();
    let (front, mut waited) = (FrontPanel::default(), false);
    let folders = Folders::open(root.path()).unwrap();
    let ran: Ran = run(
        folders,
        setting_of(&rig),
        &mut restorer,
        Arc::default(),
        &front,
        (0.0, 130.0),
        |now, front| {
            let Some((n, _)) = acts.next_if(|(_, at)| now >= *at) else { return };
            let mut witness = witness.borrow_mut();
            match n {
                0 => front.press(Press::Down),
                1 => {
                    waited = front.state() == BoxState::Asking;
                    witness.put_before_lens(None);
                }
                2 => {
                    witness.put_before_lens(Some(&scene));
                    witness.knock_panel(1.5, -1.0);
                    front.press(Press::Down);
                }
                _ => witness.put_before_lens(None),
            }
        },
    );
    assert!(waited, "the panel was away");
    assert_eq!((ran.taken.len(), ran.summary.restored.len()), (2, 2), "{:?}", ran.summary);
    let read = Photo::from_bytes("x.dng", &ran.taken[0], Curve::Srgb, &Limits::default()).unwrap();
    assert_eq!(read.camera.unwrap().setting.unwrap().identity, rig.identity);
    let measured = ran.screens.iter().filter(|s| matches!(s, Screen::Measuring { .. })).count();
    assert_eq!(measured, 1, "only after the knock");
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn photos_with_faults_are_whole_or_absent() {
    let shoots: usize = match std::env::var("RELENS_SHOOTS") {
        Ok(count) => count.parse().unwrap(),
        Err(_) => 24,
    };
    let slots = fresh_root();
    let (rig, mut restorer, witness) = rig(slots.path());
    witness.put_before_lens(Some(&before_the_lens(&rig)));
    witness.set_faults(Faults {
        stale: 0.05,
        duplicate: 0.05,
        missing: 0.1,
        mixed: 0.05,
        unplugged: 0.03,
        unplugged_ms: 20.0,
    });
    // Each operation may find the disk full; the contents before each are recorded.
    let instants: Arc<Mutex<Vec<Contents>>> = Arc::default();
    let disk = ModelDisk::new(filled(&[], None), Box::new(|_, _| Ok(Verdict::Done)));
    let folders = Folders::on(Arc::new(disk.clone()), Path::new(ROOT)).unwrap();
    let (watched, mut random) = (Arc::clone(&instants), Xoshiro256PlusPlus::seed_from_u64(18));
    disk.guarded_by(Box::new(move |op, contents| {
        let of_photos = match op {
            Op::Write(path) | Op::Sync(path) | Op::SyncFolder(path) => {
                path.starts_with("/box/inbox")
            }
            Op::Rename(_, to) => to.starts_with("/box/inbox"),
            Op::Read(_) | Op::Remove(_) => false,
        };
        if of_photos {
            watched.lock().unwrap().push(contents.clone());
            if random.random::<f64>() < 0.05 {
                return Err(ErrorKind::StorageFull.into());
            }
        }
        Ok(Verdict::Done)
    }));
    let (front, mut pressed, mut refused, mut was) =
        (FrontPanel::default(), 0, 0, BoxState::Starting);
    // Time for every photo to wait for the end of a trouble.
    let until_s = 140.0 * shoots as f64;
    let ran = run(
        folders,
        setting_of(&rig),
        &mut restorer,
        Arc::default(),
        &front,
        (0.0, until_s),
        |_, front| {
            let state = front.state();
            refused += usize::from(state == BoxState::Trouble && was != BoxState::Trouble);
            was = state;
            use BoxState::{Asking, Done, Ready, Refused};
            if pressed < shoots && matches!(state, Ready | Done | Refused | Asking) {
                pressed += 1;
                front.press(Press::Down);
                front.press(Press::Short);
            }
        },
    );
    disk.guarded_by(Box::new(|_, _| Ok(Verdict::Done)));
    assert_eq!(pressed, shoots);
    let mut instants = std::mem::take(&mut *instants.lock().unwrap());
    instants.push(disk.contents());
    let (mut cuts, mut there, mut known) = (0, 0, BTreeSet::new());
    for contents in instants {
        for cut in contents.cuts(&|_| false) {
            cuts += 1;
            let photos = cut.iter().filter(|(path, _)| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                path.starts_with("/box/inbox") && !name.starts_with('.')
            });
            there = 0;
            for (path, (_, holds)) in photos {
                there += 1;
                if known.insert((path.clone(), holds.as_ptr(), holds.len())) {
                    assert!(ran.taken.iter().any(|taken| taken[..] == holds[..]), "{path:?}");
                }
            }
        }
    }
    println!(
        "{shoots} presses, {} photos taken, {there} saved, {refused} troubles, {cuts} cuts",
        ran.taken.len()
    );
    // The last cut is at the end, where nothing is pending.
    assert!(there <= ran.taken.len() && ran.taken.len() <= shoots);
    assert!(ran.taken.len() + refused >= shoots && there >= shoots / 2);
}
