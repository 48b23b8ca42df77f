//! A camera with pixels finer than its lens: photos are solved on its own pixels and on binned
//! ones, and delivered on its own.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use relens::calibration::store;
use relens::chart::appearance::display_luminance;
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::chart::test_rig::PHOTO_SEED;
use relens::config::RigFile;
use relens::deconvolution::quality::{psnr, ssim};
use relens::frame::binning::bin;
use relens::frame::resample::resize;
use relens::frame::{Counts, Frame, Size, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::{Dng, Format, Limits, Manner, Photo, RawTags, Tone, encode};
use relens::remedy::full_message;
use relens::restorer::Restorer;
use relens::restorer::on_rig::OnRig;
use relens::rig::simulated::{Witness, open};
use relens::rig::{Camera, Exposed, Moment, RigError};

use crate::change::{lens, simulation};
use crate::made::Made;
use crate::view::{KEPT, Subject, View};
use crate::{Failure, seconds};

/// `rig` with a camera of `times` the pixels along each side, binned by `by`.
fn camera(rig: &RigFile, times: usize, by: usize) -> RigFile {
    let mut rig = rig.clone();
    let finer = times as f64;
    lens(&mut rig, |lens| {
        lens.pixel_pitch_um /= finer;
        lens.support_px = (lens.support_px * times) | 1;
    });
    simulation(&mut rig, |simulation| {
        simulation.glare.radius_px *= finer as f32;
        simulation.pose.sensor_px_per_panel_px *= finer;
        simulation.pose.shift_x_px *= finer;
        simulation.pose.shift_y_px *= finer;
    });
    let (photo, camera) = (&mut rig.photo, &mut rig.camera);
    let lengths = [
        &mut photo.width_px,
        &mut photo.height_px,
        &mut camera.width_px,
        &mut camera.height_px,
        &mut camera.photo_x_px,
        &mut camera.photo_y_px,
        &mut rig.paper.margin_px,
        &mut rig.canvas.margin_px,
    ];
    lengths.into_iter().for_each(|px| *px = *px * times / by);
    rig.calibration.function_support_px = (rig.calibration.function_support_px * times / by) | 1;
    rig.camera.binning = by;
    rig
}

/// A developed photo of `light` by the camera of `witness`, and a raw one if it has colour filters.
fn taken(
    rig: &RigFile,
    witness: &Witness,
    light: &Frame<Work>,
    seed: u64,
) -> Result<Vec<Photo>, Failure> {
    let curve = rig.photo.curve;
    let read = |bytes: &[u8]| Photo::from_bytes("photo", bytes, curve, &Limits::default());
    let manner = Manner::plain(Format::Png, 8, curve);
    let codes = witness.photograph(light, seed);
    let decoded = Frame::from_fn(|c| manner.tone.plane(c, codes.plane(c)));
    let mut photos = vec![read(&encode("photo.png", &decoded, &manner, false)?)?];
    if let Some(raw) = witness.photograph_raw(light, seed) {
        let dng = Dng {
            sites: &raw.sites,
            mosaic: raw.mosaic,
            black: witness.black_level_counts(),
            white: witness.white_count().round() as u16,
            camera: &rig.name,
            exposure_s: None,
            crop: None,
            tags: RawTags::default(),
        };
        photos.push(read(&dng.bytes())?);
    }
    Ok(photos)
}

const SCENES: [Scene; 3] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];

/// A camera that can replay its frames, so that no time of the simulator is measured.
struct Replaying {
    inner: Box<dyn Camera + Send>,
    frames: Vec<Counts>,
    sequence: u32,
    is_replaying: Arc<AtomicBool>,
}

impl Camera for Replaying {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        self.sequence += 1;
        if self.is_replaying.load(Ordering::Relaxed) && !self.frames.is_empty() {
            let counts = self.frames.remove(0);
            return Ok(Exposed { counts, sequence: self.sequence, at: deadline });
        }
        let exposed = self.inner.frame(deadline)?;
        self.frames.push(exposed.counts.clone());
        Ok(Exposed { sequence: self.sequence, ..exposed })
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.inner.reopen()
    }
}

/// A restored photo with its cost.
struct Restored {
    picture: Frame<Work>,
    seconds: f64,
    peak_mib: f64,
}

/// Restores `photo` twice: with simulated captures, then, timed, with the same frames replayed.
fn restore(
    restorer: &mut OnRig,
    is_replaying: &AtomicBool,
    photo: &Photo,
) -> Result<Restored, Failure> {
    let mut once = || restorer.restore(photo, &mut |_| {}).map_err(|e| full_message(&*e));
    is_replaying.store(false, Ordering::Relaxed);
    drop(once()?);
    is_replaying.store(true, Ordering::Relaxed);
    // Resets the peak of resident memory (proc(5)).
    std::fs::write("/proc/self/clear_refs", "5")?;
    let (before, begun) = (resident("VmRSS")?, seconds());
    let picture = once()?.delivered(photo).whole().into_owned();
    let (seconds, grown) = (seconds() - begun, resident("VmHWM")? - before);
    // The photo's light was in memory before, so its size is added.
    let photo_mib = 12.0 * photo.light.size().area() as f64 / f64::from(1 << 20);
    Ok(Restored { picture, seconds, peak_mib: grown + photo_mib })
}

/// Memory of this process by the line `name` of /proc/self/status, MiB.
fn resident(name: &str) -> Result<f64, Failure> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find(|line| line.starts_with(name)).ok_or("no such line")?;
    Ok(line.split_whitespace().nth(1).ok_or("no number")?.parse::<f64>()? / 1024.0)
}

/// A calibrated binned rig.
struct Bed {
    rig: RigFile,
    witness: Witness,
    restorer: OnRig,
    is_replaying: Arc<AtomicBool>,
}

impl Bed {
    /// Opens and calibrates `rig`, and stores its calibration in `folder`.
    fn open(rig: RigFile, folder: &Path) -> Result<Bed, Failure> {
        let (mut devices, witness) = open(&rig)?;
        let calibration = calibrate(&mut devices, &rig, None, &mut to_the_end)?;
        let by = rig.camera.binning;
        let more = calibration.binning_without_loss(by);
        log::info!("calibrated, binned by {by}; by {more} more nothing is lost");
        store::save(folder, &calibration)?;
        let is_replaying = Arc::new(AtomicBool::new(false));
        let idle: Box<dyn Camera + Send> = Box::new(Idle(rig.camera.size()));
        devices.camera = Box::new(Replaying {
            inner: std::mem::replace(&mut devices.camera, idle),
            frames: Vec::new(),
            sequence: 1 << 20,
            is_replaying: Arc::clone(&is_replaying),
        });
        let restorer =
            OnRig::new(&rig, devices, folder.to_owned(), None, Arc::new(seconds), |_| {})
                .map_err(|e| full_message(&*e))?;
        Ok(Bed { rig, witness, restorer, is_replaying })
    }

    /// Adds to `table` the scores of photos of `subject` with noise from `seed`.
    fn measure(&mut self, subject: Subject, seed: u64, table: &mut Table) -> Result<(), Failure> {
        let (size, by) = (self.rig.photo_grid().photo.size, self.rig.camera.binning);
        let tone = Tone::of_curve(self.rig.photo.curve, 8);
        let codes = View { subject, quarter: None }.codes(size);
        let light = Frame::from_fn(|c| {
            tone.plane(c, &codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
        });
        let truth = display_luminance(&tone, &self.witness.shaded(&light));
        for photo in taken(&self.rig, &self.witness, &light, seed)? {
            let data = if photo.raw.is_some() { "raw" } else { "developed" };
            let restored = restore(&mut self.restorer, &self.is_replaying, &photo)?;
            let picture = &restored.picture;
            let enlarged = Frame::from_fn(|c| resize(&bin(picture.plane(c), by), size));
            let megapixels = size.area() as f64 / 1e6;
            let mut row = vec![subject.name().to_owned(), data.to_owned(), by.to_string()];
            row.push(format!("{:.2}", restored.seconds / megapixels));
            row.push(format!("{:.0}", restored.peak_mib));
            for light in [&photo.light, &enlarged, picture] {
                let seen = display_luminance(&tone, light);
                row.push(format!("{:.4}", ssim(&seen, &truth)));
                row.push(format!("{:.2}", psnr(&seen, &truth)));
            }
            log::info!("{}", row.join(" "));
            table.row(row);
        }
        Ok(())
    }
}

/// Restores photos of each photograph by a camera of `times` the rig's pixels along each side, at
/// each of `binnings`, and scores them; `quick` takes two photographs.
pub(crate) fn run(
    rig: &RigFile,
    quick: bool,
    times: usize,
    binnings: &[usize],
) -> Result<Made, Failure> {
    let kept = (0..KEPT.len()).map(Subject::Kept);
    let subjects: Vec<Subject> = SCENES.into_iter().map(Subject::Of).chain(kept).collect();
    let subjects = &subjects[..if quick { 2 } else { subjects.len() }];
    let head = [
        "photo",
        "data",
        "binning",
        "s/MP",
        "MiB",
        "photo: SSIM",
        "dB",
        "enlarged: SSIM",
        "dB",
        "result: SSIM",
        "dB",
    ];
    let words = format!(
        "{} with {times} times the pixels along each side. Luminance of display values, in the \
         photo's own pixels; processor seconds per megapixel of the photo and peak memory above \
         the idle program, both without the simulator; *enlarged*: the binned result by bicubic \
         interpolation alone.",
        rig.name
    );
    let mut table = Table::new(words, &head);
    for &by in binnings {
        let folder = tempfile::tempdir()?;
        let mut bed = Bed::open(camera(rig, times, by), folder.path())?;
        for (subject, seed) in subjects.iter().zip(PHOTO_SEED..) {
            bed.measure(*subject, seed, &mut table)?;
        }
    }
    Ok(Made::table(format!("{}-binned", rig.name), table))
}

/// A camera without frames.
struct Idle(Size);

impl Camera for Idle {
    fn size(&self) -> Size {
        self.0
    }

    fn frame(&mut self, _: Moment) -> Result<Exposed, RigError> {
        Err(RigError::NoFrame { waited_ms: 0.0 })
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        Ok(())
    }
}
