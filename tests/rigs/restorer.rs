//! The restorer on a simulated rig: progress, and a lens as measured.

// The other photographs of the laboratory are not used here.
#[allow(dead_code)]
#[path = "../lab/view.rs"]
mod view;

use std::io::Cursor;
use std::sync::Arc;

use relens::calibration::store;
use relens::chart::scenes::Scene;
use relens::config::RigFile;
use relens::frame::{Channel, Frame, Plane};
use relens::picture::{Limits, Photo, Tone};
use relens::restorer::Restorer;
use relens::restorer::on_rig::OnRig;
use relens::rig::simulated;
use view::View;

use crate::{load, measured};

/// Restores photos of `views` on `rig`; calls `check` with the notes and the reported progress of
/// each.
fn restore(rig: &RigFile, views: &[View], check: &mut dyn FnMut(&[String], &[f32])) {
    let folder = tempfile::tempdir().unwrap();
    store::save(folder.path(), &measured(rig).unwrap()).unwrap();
    let (devices, witness) = simulated::open(rig).unwrap();
    let slots = folder.path().to_owned();
    let mut restorer = OnRig::new(rig, devices, slots, None, Arc::new(|| 0.0), |_| {}).unwrap();
    let tone = Tone::of_curve(rig.photo.curve, 8);
    for view in views {
        let codes = view.codes(rig.photo.size());
        let rounded = |plane: &Plane| plane.map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
        let scene = Frame::from_fn(|c| tone.plane(c, &rounded(codes.plane(c))));
        let taken = witness.photograph(&scene, view.number());
        let size = rig.photo.size();
        let picture = image::RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
            image::Rgb(Channel::ALL.map(|c| taken.plane(c).at(x as usize, y as usize)))
        });
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        let limits = Limits::default();
        let photo = Photo::from_bytes("photo.png", bytes.get_ref(), rig.photo.curve, &limits);
        let mut done = Vec::new();
        let outcome =
            restorer.restore(&photo.unwrap(), &mut |progress| done.push(progress.done)).unwrap();
        check(&outcome.notes, &done);
    }
}

#[test]
fn progress_is_even_and_monotonic() {
    restore(&load("small.toml"), &[View::whole(Scene::Astronaut)], &mut |_, done| {
        for step in done.windows(2) {
            assert!((0.0..0.2).contains(&(step[1] - step[0])), "{done:?}");
        }
        assert!(done[0] == 0.0 && done.last().is_some_and(|&done| done > 0.5), "{done:?}");
    });
}

#[test]
fn a_lens_as_measured_is_not_refined() {
    let mut rig = load("small.toml");
    rig.restore.refine_lens = true;
    let views = [View::quarter(Scene::Astronaut, 0), View::quarter(Scene::Coffee, 0)];
    restore(&rig, &views, &mut |notes, _| {
        assert!(notes.iter().all(|note| !note.contains("refined")), "{notes:?}");
    });
}
