//! A calibrated simulated rig with its witness, on which one thing is changed.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use relens::calibration::Calibration;
use relens::chart::scenes::Scene;
use relens::chart::test_rig::{PHOTO_SEED, Score, TestPhoto, TestRig, seen};
use relens::config::RigFile;
use relens::deconvolution::forward_convolution::ForwardConvolution;
use relens::deconvolution::lens_model::LensFunctions;
use relens::deconvolution::level_norms::LevelNorms;
use relens::deconvolution::method::{About, Method, MethodError, Problem, Solution, Watch};
use relens::frame::{Channel, Frame, Plane, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{Outcome, Prepared, Restoration, Solved};
use relens::rig::simulated::{Witness, open};

use crate::change::{Change, NOTHING, Taking, To, simulation};
use crate::{Failure, seconds};

/// A rig with one change.
pub(crate) struct Harness {
    pub(crate) test_rig: TestRig,
    pub(crate) witness: Witness,
    /// Witness of the camera that takes the photos, if it is not the rig's.
    camera: Option<Witness>,
    taking: Taking,
    change: &'static Change,
    strength: f64,
}

/// What the pipeline made of a photo.
pub(crate) struct Restored {
    /// The method's result; for a photo returned before solving, what the result would have been.
    pub(crate) solved: Solved,
    pub(crate) outcome: Outcome,
    /// Whether the photo was returned before any method saw it.
    pub(crate) before_solving: bool,
}

/// Calibration of the simulated rig of `rig`.
pub(crate) fn calibration(rig: &RigFile) -> Result<Calibration, Failure> {
    Ok(calibrate(&mut open(rig)?.0, rig, None, &mut to_the_end)?)
}

/// Seeds tried for a calibration; one in four is refused because the panel moved too far.
const CHANCES: u64 = 6;

/// `rig` with the first seed, counted from its own, whose calibration under `change` is accepted,
/// and that calibration.
pub(crate) fn calibrated(
    rig: &RigFile,
    change: &Change,
    strength: f64,
) -> Result<(RigFile, Calibration), Failure> {
    let mut refused = None;
    for more in 0..CHANCES {
        let mut rig = rig.clone();
        simulation(&mut rig, |simulation| simulation.seed += more);
        match calibration(&change.filed(&rig, strength)) {
            Ok(measured) => return Ok((rig, measured)),
            Err(e) => {
                log::info!(
                    "calibration refused, seed + {more}: {}",
                    relens::remedy::full_message(&*e)
                );
                refused = Some(e);
            }
        }
    }
    Err(refused.unwrap_or_else(|| "no seed was tried".into()))
}

impl Harness {
    /// The simulated rig of `rig`, calibrated from its own captures.
    pub(crate) fn open(rig: RigFile) -> Result<(Harness, Calibration), Failure> {
        let (mut devices, witness) = open(&rig)?;
        let calibration = calibrate(&mut devices, &rig, None, &mut to_the_end)?;
        let harness = Harness {
            test_rig: TestRig::on(rig, devices, &calibration, seconds)?,
            witness,
            camera: None,
            taking: Taking::default(),
            change: &NOTHING,
            strength: 0.0,
        };
        Ok((harness, calibration))
    }

    /// The rig of `filed` with `change`, and with an earlier `calibration`.
    pub(crate) fn changed(
        filed: &RigFile,
        calibration: &Calibration,
        change: &'static Change,
        strength: f64,
    ) -> Result<Harness, Failure> {
        let now = change.now(filed, strength);
        let (devices, witness) = open(&now)?;
        let (mut camera, mut taking) = (None, Taking::default());
        match change.to {
            To::Camera(to) => {
                let mut rig = now.clone();
                to(&mut rig, strength);
                camera = Some(open(&rig)?.1);
            }
            To::Photo(to) | To::FileAndPhoto(_, to) => to(&mut taking, strength),
            _ => {}
        }
        let test_rig = match change.to {
            To::Functions(grid) => {
                let fewer = with_fewer_functions(calibration, grid(strength))?;
                TestRig::on(now, devices, &fewer, seconds)?
            }
            _ => TestRig::on(now, devices, calibration, seconds)?,
        };
        Ok(Harness { test_rig, witness, camera, taking, change, strength })
    }

    /// The rig file.
    pub(crate) fn config(&self) -> &RigFile {
        self.test_rig.config()
    }

    /// Applies the change to the running rig if it concerns captures, after photos were taken.
    pub(crate) fn change_captures(&mut self) {
        if let To::Captures(to) | To::EachJob(to) = self.change.to
            && let Some(simulation) = self.test_rig.config().simulation()
        {
            to(&mut self.witness, simulation, self.strength);
        }
    }

    /// A photo of `light`, photo-sized, with noise of `seed`.
    pub(crate) fn photograph(&self, light: &Frame<Work>, seed: u64) -> Result<TestPhoto, Failure> {
        let Taking { brighter, noise_levels, jpeg, developed } = self.taking;
        let tone = Tone::of_curve(self.config().photo.curve, 8);
        let camera = self.camera.as_ref().unwrap_or(&self.witness);
        let times = 1.0 + brighter as f32;
        let light = Frame::from_fn(|c| light.plane(c).map(|v: f32| v * times));
        let quiet = self.config().simulation().map_or(0.0, |s| s.sensor.read_noise_levels);
        if noise_levels > 0.0 {
            camera.change_sensor(|sensor| sensor.read_noise_levels = quiet.hypot(noise_levels));
        }
        let as_codes = |codes: &Frame<Work, u8>| {
            TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, codes.plane(c))))
        };
        let photo = match jpeg {
            Some(quality) => {
                let file = as_jpeg(&camera.photograph(&light, seed), quality)?;
                let curve = self.config().photo.curve;
                Photo::from_bytes("photo.jpg", &file, curve, &Limits::default())?.into()
            }
            None if developed => as_codes(&camera.photograph(&light, seed)),
            None => TestPhoto::taken(camera, self.config().photo.curve, &light, seed),
        };
        if noise_levels > 0.0 {
            camera.change_sensor(|sensor| sensor.read_noise_levels = quiet);
        }
        Ok(photo)
    }

    /// The ideal result of a photo of `light`: clipped and shaded as the photo.
    pub(crate) fn truth(&self, light: &Frame<Work>) -> Frame<Work> {
        let times = 1.0 + self.taking.brighter as f32;
        let camera = self.camera.as_ref().unwrap_or(&self.witness);
        let shaded = camera.shaded(&Frame::from_fn(|c| light.plane(c).map(|v: f32| v * times)));
        Frame::from_fn(|c| shaded.plane(c).map(|v: f32| v.min(255.0)))
    }

    /// The scored plane of `picture`.
    pub(crate) fn seen(&self, picture: &Frame<Work>) -> Plane {
        seen(self.config().photo.curve, self.test_rig.channels(), picture)
    }

    /// Scores `method` on a photo of `scene`.
    pub(crate) fn score(&mut self, scene: Scene, method: &dyn Method) -> Result<Score, Failure> {
        let light = self.test_rig.light(scene);
        let photo = self.photograph(&light, PHOTO_SEED + scene as u64)?;
        let truth = self.truth(&light);
        Ok(self.test_rig.score_photo(scene, &photo, &truth, method)?)
    }

    /// Prepares `photo` for methods.
    pub(crate) fn prepare<'a>(&mut self, photo: &'a TestPhoto) -> Prepared<'a> {
        let channels = self.test_rig.channels();
        photo.prepared(self.test_rig.parts().0, channels)
    }

    /// Restores `photo` by `method` as the daemon does.
    pub(crate) fn restore(
        &mut self,
        photo: &Prepared<'_>,
        method: &dyn Method,
    ) -> Result<Restored, Failure> {
        if let To::EachJob(_) = self.change.to {
            self.change_captures();
        }
        let (pipeline, rig) = self.test_rig.parts();
        let Restoration { outcome, solved } =
            pipeline.restore(rig, photo, method, &mut |_, _| {})?;
        let before_solving = solved.is_none();
        let solved = match solved {
            Some(solved) => solved,
            None => pipeline.solve(rig, photo, method, &mut |_, _| {})?,
        };
        Ok(Restored { solved, outcome, before_solving })
    }

    /// The method that `make` makes from the rig file, whose patches or step size may be changed.
    pub(crate) fn method(
        &self,
        make: &dyn Fn(&RigFile) -> Box<dyn Method + Send + Sync>,
    ) -> Box<dyn Method + Send + Sync> {
        let mut rig = self.config().clone();
        match self.change.to {
            To::Patches(to) => {
                to(&mut rig, self.strength);
                make(&rig)
            }
            To::Step => {
                rig.paper.tau *= self.strength as f32;
                Box::new(Longer { method: make(&rig), times: self.strength as f32 })
            }
            _ => make(&rig),
        }
    }
}

/// A method for which ‖K‖ is underestimated, so that its steps are too long.
struct Longer {
    method: Box<dyn Method + Send + Sync>,
    times: f32,
}

impl Method for Longer {
    fn about(&self) -> &'static About {
        self.method.about()
    }

    fn captures_max(&self) -> u32 {
        self.method.captures_max()
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let scaled = |norms: &[LevelNorms; 3]| norms.each_ref().map(|n| n.scaled(1.0 / self.times));
        let (level_norms, pixel_norms) = (scaled(problem.level_norms), scaled(problem.pixel_norms));
        let norm_squared = problem.norm_squared.map(|norm| norm / self.times);
        let (level_norms, pixel_norms) = (&level_norms, &pixel_norms);
        let problem = Problem { norm_squared, level_norms, pixel_norms, ..*problem };
        self.method.solve(&problem, optics, watch)
    }
}

/// The calibration with lens functions averaged over a coarser grid of columns and rows.
fn with_fewer_functions(
    calibration: &Calibration,
    (columns, rows): (usize, usize),
) -> Result<Calibration, Failure> {
    let all = &calibration.functions;
    let mut fewer = LensFunctions { columns, rows, ..all.clone() };
    let area = all.support_px * all.support_px;
    for (taps, all_taps) in fewer.taps.iter_mut().zip(&all.taps) {
        *taps = vec![0.0; columns * rows * area];
        let mut counts = vec![0.0f32; columns * rows];
        for (n, function) in all_taps.chunks_exact(area).enumerate() {
            let at = n / all.columns * rows / all.rows * columns
                + n % all.columns * columns / all.columns;
            taps[at * area..][..area].iter_mut().zip(function).for_each(|(sum, tap)| *sum += tap);
            counts[at] += 1.0;
        }
        for (sum, count) in taps.chunks_exact_mut(area).zip(counts) {
            sum.iter_mut().for_each(|tap| *tap /= count);
        }
    }
    with_lens(calibration, fewer)
}

/// The calibration with other lens functions and their norms.
fn with_lens(calibration: &Calibration, functions: LensFunctions) -> Result<Calibration, Failure> {
    let mut changed = Calibration { functions, ..calibration.clone() };
    let (model, levels) = (changed.lens_model()?, calibration.norms.levels[0].levels());
    changed.measure_norms(&model, levels, calibration.at_sites.is_some());
    let green = Channel::Green.index();
    changed.norm_squared_seen *= changed.norms.squared[green] / calibration.norms.squared[green];
    Ok(changed)
}

/// `codes` as a JPEG file of `quality` (1 to 100).
fn as_jpeg(codes: &Frame<Work, u8>, quality: u8) -> Result<Vec<u8>, Failure> {
    let size = codes.size();
    let [red, green, blue] = codes.planes().each_ref().map(|plane| plane.data());
    let pixels: Vec<u8> =
        red.iter().zip(green).zip(blue).flat_map(|((&r, &g), &b)| [r, g, b]).collect();
    let mut file = Vec::new();
    JpegEncoder::new_with_quality(&mut file, quality).write_image(
        &pixels,
        size.width as u32,
        size.height as u32,
        ExtendedColorType::Rgb8,
    )?;
    Ok(file)
}
