//! The gain pattern of the rig's sensor, as found in photos that were turned or cut after they were
//! taken and in dark, noisy ones.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ImageFormat};
use relens::calibration::store;
use relens::chart::scenes::Scene;
use relens::chart::test_rig::TestPhoto;
use relens::config::{MethodName, RigFile};
use relens::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};
use relens::picture::{Photo, ReadOptions, Tone};
use relens::pipeline::{Outcome, PhotoData, Pipeline, Verdict};
use relens::restorer::Restorer;
use relens::restorer::on_rig::OnRig;
use relens::rig::simulated;

use crate::restorer::developed;
use crate::restorer::view::View;
use crate::{load, measured};

/// Width of the rim of a part that is excluded from comparison, pixels.
const INNER: usize = 24;

/// A restorer on `rig`, and a developed photo taken by the rig's camera.
fn restorer_and_photo(rig: &RigFile, slots: &Path) -> (OnRig, DynamicImage) {
    store::save(slots, &measured(rig).unwrap()).unwrap();
    let (devices, witness) = simulated::open(rig).unwrap();
    let method = Some(MethodName::Digital);
    let restorer =
        OnRig::new(rig, devices, slots.to_owned(), method, Arc::new(|| 0.0), |_| {}).unwrap();
    let picture = developed(rig, &witness, View::whole(Scene::Coffee));
    (restorer, picture.into())
}

/// Outcome of restoring `picture`, and the resulting picture upright.
fn restored(
    restorer: &mut OnRig,
    rig: &RigFile,
    picture: &DynamicImage,
    is_jpeg: bool,
) -> (Outcome, Frame<Work>) {
    let mut bytes = Cursor::new(Vec::new());
    match is_jpeg {
        true => JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(picture).unwrap(),
        false => picture.write_to(&mut bytes, ImageFormat::Png).unwrap(),
    }
    let photo: Photo = ReadOptions::of(rig).photo_of_bytes("a", bytes.get_ref()).unwrap();
    let outcome = restorer.restore(&photo, &mut |_| {}).unwrap();
    let upright = photo.for_display(&outcome.picture);
    (outcome, upright)
}

/// `picture` turned clockwise.
fn clockwise(picture: &Frame<Work>) -> Frame<Work> {
    Frame::from_fn(|c| {
        let plane = picture.plane(c);
        let (width, height) = (plane.width(), plane.height());
        let size = Size::new(height, width);
        Plane::from_fn(size, |x, y| plane.at(y, height - 1 - x))
    })
}

#[test]
fn a_turned_photo_is_restored_as_it_was_taken() {
    let rig = load("truthful.toml");
    let slots = tempfile::tempdir().unwrap();
    let (mut restorer, photo) = restorer_and_photo(&rig, slots.path());
    let (outcome, mut wanted) = restored(&mut restorer, &rig, &photo, false);
    assert_eq!(outcome.verdict, Verdict::Sound);
    assert!(!outcome.notes.iter().any(|note| note.contains("turned after")), "{outcome:?}");
    let mut turned = photo;
    for quarter in 1..4 {
        (turned, wanted) = (turned.rotate90(), clockwise(&wanted));
        let (outcome, seen) = restored(&mut restorer, &rig, &turned, false);
        assert_eq!(outcome.verdict, Verdict::Sound, "{quarter}: {}", outcome.reason);
        assert!(outcome.notes.iter().any(|note| note.contains("turned after")), "{quarter}");
        assert!(seen == wanted, "{quarter}");
        let (outcome, _) = restored(&mut restorer, &rig, &turned, true);
        assert_eq!(outcome.verdict, Verdict::Sound, "{quarter}: {}", outcome.reason);
    }
    // A mirrored photo is like one of another sensor; in portrait it is returned as it was.
    let mirrored = turned.fliph();
    let (outcome, seen) = restored(&mut restorer, &rig, &mirrored, false);
    assert_eq!(outcome.verdict, Verdict::Untouched);
    assert!(outcome.reason.contains("in portrait"), "{}", outcome.reason);
    assert_eq!(seen.size().width, rig.photo.size().height);
}

#[test]
fn a_part_of_the_sensor_is_restored_in_its_place() {
    let rig = load("truthful.toml");
    let slots = tempfile::tempdir().unwrap();
    let (mut restorer, photo) = restorer_and_photo(&rig, slots.path());
    let (_, whole) = restored(&mut restorer, &rig, &photo, false);
    // 3:2, 16:9 and square, in the middle and elsewhere.
    for (x, y, width, height) in [(0, 11, 256, 171), (0, 24, 256, 144), (13, 0, 192, 192)] {
        let place = Rect { x, y, size: Size::new(width, height) };
        let [left, top, across, down] = [x, y, width, height].map(|n| n as u32);
        let part = photo.crop_imm(left, top, across, down);
        for is_jpeg in [false, true] {
            let (outcome, seen) = restored(&mut restorer, &rig, &part, is_jpeg);
            assert_eq!(outcome.verdict, Verdict::Sound, "{place:?}: {}", outcome.reason);
            let words = format!("column {x}, row {y} of the rig");
            assert!(outcome.notes.iter().any(|note| note.contains(&words)), "{:?}", outcome.notes);
            if !is_jpeg {
                // Farther from the cut than the lens's reach, nothing changes.
                let inner = |of: Rect| {
                    let size = Size::new(of.size.width - 2 * INNER, of.size.height - 2 * INNER);
                    Rect { x: of.x + INNER, y: of.y + INNER, size }
                };
                let mut off = seen.crop(inner(Rect { x: 0, y: 0, ..place }));
                for c in Channel::ALL {
                    off.plane_mut(c).add_scaled(-1.0, &whole.plane(c).crop(inner(place)));
                    println!("{place:?} {c:?} {}", off.plane(c).rms());
                    assert!(off.plane(c).rms() < 1.0, "{place:?}");
                }
            }
        }
        let (outcome, _) = restored(&mut restorer, &rig, &part.fliph(), false);
        assert_eq!(outcome.verdict, Verdict::Untouched, "mirrored");
    }
}

#[test]
fn noise_is_not_expected_to_show_the_pattern() {
    let rig = load("truthful.toml");
    let pipeline = Pipeline::new(&rig, &measured(&rig).unwrap()).unwrap();
    let (_, witness) = simulated::open(&rig).unwrap();
    witness.change_sensor(|sensor| sensor.read_noise_levels = 16.0);
    let squares = |x, y| 2.0 + 2.0 * ((x / 16 + y / 16) % 2) as f32;
    let dark = Frame::from_fn(|_| Plane::from_fn(rig.photo.size(), squares));
    let photo = TestPhoto::taken(&witness, rig.photo.curve, &dark, 3);
    let sensor = photo.prepared(&pipeline, Channels::Colour).sensor.unwrap();
    println!("{sensor:?}");
    // Both in standard errors.
    assert!((sensor.found - sensor.expected).abs() < 3.0, "{sensor:?}");
}

#[test]
fn bad_sites_of_a_developed_photo_do_not_remain_in_its_data() {
    let rig = load("truthful.toml");
    let pipeline = Pipeline::new(&rig, &measured(&rig).unwrap()).unwrap();
    let (_, witness) = simulated::open(&rig).unwrap();
    let wall = Frame::from_fn(|_| Plane::filled(rig.photo.size(), 10.0));
    let (codes, tone) = (witness.photograph(&wall, 3), Tone::of_curve(rig.photo.curve, 8));
    let light: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
    let observation = pipeline.prepare(PhotoData::developed(&light, Channels::Colour)).observation;
    let prepared = observation.light.crop(observation.rect);
    // Neither shading nor noise moves the light of a dark wall by 6 grey levels.
    let spots = |of: &Frame<Work>| {
        let green = of.plane(Channel::Green);
        let mean = green.mean() as f32;
        green.data().iter().filter(|&&v| (v - mean).abs() > 6.0).count()
    };
    println!("{} before, {} after", spots(&light), spots(&prepared));
    assert!(spots(&light) > 0 && spots(&prepared) == 0);
}
