//! The progress of a restoration on a simulated rig.

// The other photographs of the laboratory are not used here.
#[allow(dead_code)]
#[path = "../lab/view.rs"]
pub(crate) mod view;

use std::io::Cursor;
use std::sync::Arc;

use image::{ImageFormat, RgbImage};
use relens::calibration::store;
use relens::chart::scenes::Scene;
use relens::config::RigFile;
use relens::frame::{Channel, Frame, Plane};
use relens::picture::{Limits, Photo, Tone};
use relens::restorer::Restorer;
use relens::restorer::on_rig::OnRig;
use relens::rig::simulated::{self, Witness};
use view::View;

use crate::{load, measured};

/// Developed photo of `view`, taken by the camera of `rig`.
pub(crate) fn developed(rig: &RigFile, witness: &Witness, view: View) -> RgbImage {
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let codes = view.codes(rig.photo.size());
    let rounded = |plane: &Plane| plane.map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
    let scene = Frame::from_fn(|c| tone.plane(c, &rounded(codes.plane(c))));
    let taken = witness.photograph(&scene, view.number());
    let size = rig.photo.size();
    RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
        image::Rgb(Channel::ALL.map(|c| taken.plane(c).at(x as usize, y as usize)))
    })
}

/// Progress reported while a photo of `view`, stored in `format`, is restored on `rig`.
fn progress(rig: &RigFile, view: View, format: ImageFormat) -> Vec<f32> {
    let folder = tempfile::tempdir().unwrap();
    store::save(folder.path(), &measured(rig).unwrap()).unwrap();
    let (devices, witness) = simulated::open(rig).unwrap();
    let slots = folder.path().to_owned();
    let mut restorer = OnRig::new(rig, devices, slots, None, Arc::new(|| 0.0), |_| {}).unwrap();
    let picture = developed(rig, &witness, view);
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    let limits = Limits::default();
    let photo = Photo::from_bytes("photo", bytes.get_ref(), rig.photo.curve, &limits).unwrap();
    let mut done = Vec::new();
    restorer.restore(&photo, &mut |progress| done.push(progress.done)).unwrap();
    done
}

#[test]
fn progress_is_even_and_never_goes_back() {
    for (rig, format) in [("small.toml", ImageFormat::Png), ("truthful.toml", ImageFormat::Jpeg)] {
        let done = progress(&load(rig), View::whole(Scene::Astronaut), format);
        for step in done.windows(2) {
            assert!((0.0..0.2).contains(&(step[1] - step[0])), "{format:?}: {done:?}");
        }
        assert!(done[0] == 0.0 && done.last().is_some_and(|&done| done > 0.5), "{done:?}");
        let at_the_end = done.iter().filter(|&&done| done >= 0.99).count();
        assert!(at_the_end <= 1, "{format:?}: {done:?}");
    }
}
