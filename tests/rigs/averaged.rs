//! Raw photos whose noise, stated in the file or estimated from the photo, differs from that of one
//! exposure at the rig's gain; and a photo taken with the lens stopped down.

use relens::chart::scenes::Scene;
use relens::config::{Curve, Kind, RigFile};
use relens::frame::{Channel, Frame, PhotoGrid, RawSites, Work};
use relens::picture::{Limits, Photo};
use relens::pipeline::{AVERAGED_MIN, Verdict};
use relens::restorer::photo_file::{SensorFacts, raw_file};
use relens::rig::exposure::Devices;
use relens::rig::shoot::{CountRange, SiteNoise, shoot};
use relens::rig::simulated::{self, Witness};
use relens::{Outcome, PhotoRestorer, Rig};

use crate::load;
use crate::raw_file::score;

const RIG: &str = "truthful.toml";

/// A rig in front of a scene.
struct NoisyRig {
    file: RigFile,
    grid: PhotoGrid,
    devices: Devices,
    witness: Witness,
    scene: Frame<Work>,
    restorer: PhotoRestorer,
    /// Noise of one exposure, as stated in its files.
    noise: SiteNoise,
}

impl NoisyRig {
    fn new(slots: &std::path::Path) -> NoisyRig {
        let mut rig = Rig::open(RIG).unwrap();
        rig.calibrate(slots).unwrap();
        let restorer = rig.restorer(slots).unwrap();
        let file = load(RIG);
        let (devices, witness) = simulated::open(&file).unwrap();
        let grid = file.photo_grid();
        let scene = Scene::Coffee.light(grid.sensor);
        witness.put_before_lens(Some(&scene));
        let noise = witness.site_noise();
        NoisyRig { file, grid, devices, witness, scene, restorer, noise }
    }

    /// Takes a photo file: the mean of `frames` exposures minus the mean of `dark` dark ones.
    fn take(&mut self, frames: u8, dark: u8) -> Photo {
        let mosaic = self.file.mosaic().unwrap();
        let (black, max) = (self.witness.black_level_counts(), self.file.camera.count_max());
        let range = CountRange { black, max };
        let mut shot = shoot(&mut self.devices, Some(mosaic), range, frames).unwrap();
        if dark > 0 {
            self.witness.put_before_lens(Some(&Frame::zeros(self.grid.sensor)));
            let dark = shoot(&mut self.devices, Some(mosaic), range, dark).unwrap();
            self.witness.put_before_lens(Some(&self.scene));
            shot = shot.without_dark(&dark, range);
        }
        let sensor = SensorFacts { range, gains: None, noise: Some(self.noise) };
        let bytes = raw_file(&self.file, &shot, mosaic, &sensor, 0.05);
        let photo = Photo::from_bytes("a.dng", &bytes, Curve::Srgb, &Limits::default()).unwrap();
        photo.fit(self.grid).unwrap()
    }

    /// Restores and scores `photo`.
    fn restored(&mut self, photo: &Photo) -> Restored {
        let truth: Frame<Work> = Frame::from_fn(|c| self.scene.plane(c).crop(self.grid.photo));
        let outcome = self.restorer.restore(photo).unwrap();
        let stated = |note: &String| {
            note.strip_prefix("noise of the photo: ")?.split_once(' ')?.0.parse().ok()
        };
        let noise = outcome.notes.iter().find_map(stated).unwrap_or(f64::NAN);
        let score = score(&outcome.picture, &self.witness.shaded(&truth));
        Restored { outcome, noise, score }
    }
}

/// A restored photo.
struct Restored {
    outcome: Outcome,
    /// Noise reported in the notes, grey levels; NaN if they report none.
    noise: f64,
    /// SSIM and PSNR (dB).
    score: [f64; 2],
}

fn mean_light(photo: &Photo) -> f32 {
    photo.light.plane(Channel::Green).mean() as f32
}

/// Noise of the green sites of `photo` near its mean light, grey levels, from the difference to
/// `other`, a second photo of the same scene.
fn noise_present(photo: &Photo, other: &Photo) -> f64 {
    let (green, mosaic) = (photo.light.plane(Channel::Green), photo.raw.unwrap().mosaic);
    let (mean_light, mut differences) = (mean_light(photo), Vec::new());
    for y in 0..green.height() {
        for x in (0..green.width()).filter(|&x| mosaic.colour_at(x, y) == Channel::Green) {
            let (one, two) = (green.at(x, y), other.light.plane(Channel::Green).at(x, y));
            if (0.8..1.2).contains(&((one + two) / 2.0 / mean_light)) {
                differences.push(f64::from(one - two));
            }
        }
    }
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count;
    (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count / 2.0).sqrt()
}

/// Noise that the file of `photo` states for the mean light of green, grey levels.
fn noise_stated(photo: &Photo) -> f64 {
    let [at_black, per_level] = photo.raw.unwrap().noise.unwrap()[Channel::Green.index()];
    f64::from(at_black + per_level * mean_light(photo)).sqrt()
}

/// Copy of `photo` that states `noise`, or no noise if `None`.
fn with_noise(photo: &Photo, noise: Option<[[f32; 2]; 3]>) -> Photo {
    let raw = photo.raw.map(|raw| RawSites { noise, ..raw });
    Photo { raw, ..photo.clone() }
}

fn near(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 0.1
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn a_photo_is_restored_with_the_noise_stated_in_its_file() {
    let slots = tempfile::tempdir().unwrap();
    let mut bed = NoisyRig::new(slots.path());
    let mut scores = Vec::new();
    for (frames, dark) in [(1, 0), (4, 0), (16, 0), (4, 1)] {
        let (photo, other) = (bed.take(frames, dark), bed.take(frames, dark));
        let (stated, present) = (noise_stated(&photo), noise_present(&photo, &other));
        let Restored { outcome, noise: used, score: scored } = bed.restored(&photo);
        let Restored { noise: as_one, score: unstated, .. } =
            bed.restored(&with_noise(&photo, None));
        println!(
            "{frames} exposures, {dark} dark: noise {present:.3}, stated {stated:.3}, used \
             {used:.2}; {scored:.4?} (not stated: {as_one:.2}; {unstated:.4?})"
        );
        assert!(near(stated, present), "{frames}: {stated} stated, {present} present");
        // The noise of more exposures falls below the error of the lens model.
        let least = f64::from(AVERAGED_MIN).sqrt() * as_one;
        assert!(near(used, stated.max(least)), "{used}, not {stated} or {least}");
        let is_noted = outcome.notes.iter().any(|note| note.contains("of one exposure's noise"));
        assert_eq!(is_noted, frames > 1, "{:?}", outcome.notes);
        assert!(scored[0] > unstated[0] - 0.001, "{frames}: {scored:?} {unstated:?}");
        scores.push(scored);
    }
    let better = |n: usize| scores[n][0] > scores[0][0] && scores[n][1] > scores[0][1];
    assert!(better(1) && better(2), "more exposures are a better photo: {scores:?}");
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn an_unknown_gain_is_read_from_the_file_and_implausible_noise_is_ignored() {
    let slots = tempfile::tempdir().unwrap();
    let mut bed = NoisyRig::new(slots.path());
    let photo = bed.take(1, 0);
    let Restored { noise: own, .. } = bed.restored(&with_noise(&photo, None));
    for times in [1e-4, 1e4] {
        let noise = Some([[0.05 * times, 0.005 * times]; 3]);
        let Restored { outcome, noise: used, .. } = bed.restored(&with_noise(&photo, noise));
        let is_noted = outcome.notes.iter().any(|note| note.contains("which is not plausible"));
        assert!(is_noted && near(used, own), "{used}, not the rig's {own}: {:?}", outcome.notes);
    }
    // A sixteenth of the exposure time at sixteen times the gain; the stated noise follows the
    // gain.
    bed.noise = bed.noise.amplified(16.0);
    assert_eq!(bed.devices.camera.amplify_times(16.0).unwrap(), Some(16.0));
    assert!(bed.devices.expose_times(1.0 / 16.0).unwrap());
    let (photo, other) = (bed.take(1, 0), bed.take(1, 0));
    let present = noise_present(&photo, &other);
    let Restored { noise: used, score: scored, .. } = bed.restored(&photo);
    let Restored { outcome, noise: found, score: unstated } =
        bed.restored(&with_noise(&photo, None));
    println!("16 times the gain: noise {present:.3}");
    println!("stated {used:.2}, {scored:.4?}; not stated {found:.2}, {unstated:.4?}");
    assert!(near(used, present), "{used} used, {present} present");
    // Without a stated noise it is estimated from the photo.
    assert!(near(found, present), "{found} found, {present} present");
    assert!(outcome.notes.iter().any(|note| note.contains("as at a higher gain")), "{outcome:?}");
    let alike = [0.003, 0.2].into_iter().zip(scored.into_iter().zip(unstated));
    assert!(alike.into_iter().all(|(by, (a, b))| (a - b).abs() < by), "{scored:?} {unstated:?}");
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_photo_with_the_lens_stopped_down_is_left_untouched() {
    let slots = tempfile::tempdir().unwrap();
    let mut bed = NoisyRig::new(slots.path());
    let photo = bed.take(1, 0);
    let Restored { outcome: wide, score: wide_scored, .. } =
        bed.restored(&with_noise(&photo, None));
    assert_ne!(wide.verdict, Verdict::Untouched, "{}", wide.reason);
    let mut stopped = bed.file.clone();
    if let Kind::Simulated(simulation) = &mut stopped.kind {
        simulation.lens.stop_diameter_mm /= 2.5;
    }
    (bed.devices, bed.witness) = simulated::open(&stopped).unwrap();
    bed.witness.put_before_lens(Some(&bed.scene));
    let photo = bed.take(1, 0);
    let Restored { outcome, score: scored, .. } = bed.restored(&with_noise(&photo, None));
    println!("wide open {wide_scored:.4?}, stopped down {scored:.4?}: {}", outcome.reason);
    assert_eq!(outcome.verdict, Verdict::Untouched);
    assert!(outcome.reason.contains("far sharper"), "{}", outcome.reason);
    assert_eq!(outcome.captures, 0, "detected before anything is shown");
}
