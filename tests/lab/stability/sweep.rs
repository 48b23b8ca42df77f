//! Runs methods under faults on a simulated rig that was calibrated healthy, and takes down what
//! became of them.

use std::sync::Arc;

use super::contestant::Contestant;
use super::fault::{Fault, Place};
use super::view::View;
use crate::calibration::Calibration;
use crate::config::{self, Curve, Kind};
use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::quality::ssim;
use crate::evaluate::test_rig::{Stopwatch, TestRigError, display_luminance};
use crate::frame::{Channel, Channels, Frame, Plane, Work};
use crate::measurement::calibrate;
use crate::picture::Tone;
use crate::pipeline::{Outcome, Pipeline, PipelineError, Prepared, Solved, Verdict};
use crate::rig::exposure::Rig;
use crate::rig::simulated::{Witness, open};

/// One method under one fault on one view.
#[derive(Debug, Clone)]
pub struct Run {
    /// What was wrong.
    pub fault: Fault,
    /// How much.
    pub strength: f64,
    /// Which of the fault's strengths, 0 for none.
    pub step: usize,
    /// The method.
    pub contestant: Contestant,
    /// What was photographed.
    pub view: View,
    /// Seed of all noise.
    pub seed: u64,
    /// SSIM of the method's result.
    pub ssim: f64,
    /// SSIM of the untouched photo.
    pub photo_ssim: f64,
    /// Captures it cost.
    pub captures: usize,
    /// What the box made of the result.
    pub verdict: Verdict,
    /// SSIM of what is delivered.
    pub delivered_ssim: f64,
}

/// What is swept.
#[derive(Debug, Clone)]
pub struct Plan<'a> {
    /// Faults, each in all its strengths.
    pub faults: &'a [Fault],
    /// Methods.
    pub contestants: &'a [Contestant],
    /// Which of each fault's strengths; 0 is none.
    pub steps: &'a [usize],
    /// Views.
    pub views: &'a [View],
    /// Seed of the rig and of the photos.
    pub seed: u64,
}

/// Runs `plan` on the simulated rig of `rig`; `each` is called with every run as it ends.
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a method fails.
pub fn sweep(
    rig: &config::Rig,
    plan: &Plan<'_>,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Run),
) -> Result<Vec<Run>, TestRigError> {
    let mut healthy = rig.clone();
    if let Kind::Simulated(simulation) = &mut healthy.kind {
        simulation.seed = plan.seed;
    }
    let calibration = calibrated(&healthy)?;
    let mut runs: Vec<Run> = Vec::new();
    for &fault in plan.faults {
        for (step, strength) in fault.strengths(&healthy).into_iter().enumerate() {
            if step == 0 && fault != plan.faults[0] {
                // No fault is no fault: run once.
                let none: Vec<Run> = runs
                    .iter()
                    .filter(|run| run.fault == plan.faults[0] && run.step == 0)
                    .map(|run| Run { fault, strength, ..run.clone() })
                    .collect();
                runs.extend(none);
                continue;
            }
            if !plan.steps.contains(&step) {
                continue;
            }
            let mut ground = Ground::new(&healthy, &calibration, (fault, strength), stopwatch)?;
            // The photos were taken before anything happened to the rig.
            let photos = plan.views.iter().map(|&view| ground.photograph(view, plan.seed));
            let photos: Vec<(Frame<Work>, Plane)> = photos.collect::<Result<_, _>>()?;
            ground.put_fault_on();
            for (&view, (photo, truth)) in plan.views.iter().zip(photos) {
                let prepared = ground.prepare(&photo);
                for &contestant in plan.contestants.iter().filter(|c| concerned(**c, fault, step)) {
                    let (solved, outcome) = ground.run(contestant, &prepared)?;
                    let score = |picture: &Frame<Work>| ssim(&ground.display(picture), &truth);
                    let run = Run {
                        fault,
                        strength,
                        step,
                        contestant,
                        view,
                        seed: plan.seed,
                        ssim: score(&solved.picture),
                        photo_ssim: score(&photo),
                        captures: solved.captures,
                        delivered_ssim: score(&outcome.picture),
                        verdict: outcome.verdict,
                    };
                    each(&run);
                    runs.push(run);
                }
            }
        }
    }
    Ok(runs)
}

/// Whether a fault can change anything for a method; without fault they all run.
fn concerned(contestant: Contestant, fault: Fault, step: usize) -> bool {
    step == 0
        || match fault.place() {
            Place::Captures => contestant.captures(),
            Place::Patches => contestant.patches(),
            Place::Step => contestant.steps(),
            Place::Photo | Place::Lens | Place::Calibration => true,
        }
}

fn calibrated(rig: &config::Rig) -> Result<Calibration, TestRigError> {
    let (mut devices, _) = open(rig)?;
    Ok(calibrate(&mut devices, rig, None, &mut |_| {})?)
}

/// The same calibration with the mean functions of a coarser grid of columns and rows.
fn with_fewer_functions(
    calibration: &Calibration,
    (columns, rows): (usize, usize),
) -> Result<Calibration, TestRigError> {
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
    Ok(calibration.with_lens(fewer).map_err(PipelineError::from)?)
}

/// A rig with a fault, and the camera that takes the photos.
struct Ground {
    config: config::Rig,
    fault: Fault,
    strength: f64,
    devices: Rig,
    witness: Witness,
    pipeline: Pipeline,
    /// Of the camera that took the photo, when that was another.
    camera: Option<Witness>,
}

impl Ground {
    fn new(
        healthy: &config::Rig,
        calibration: &Calibration,
        (fault, strength): (Fault, f64),
        stopwatch: Stopwatch,
    ) -> Result<Ground, TestRigError> {
        let config = fault.changed_rig(strength, healthy).unwrap_or_else(|| healthy.clone());
        let pipeline = match fault.functions(strength) {
            Some(grid) => Pipeline::new(&config, &with_fewer_functions(calibration, grid)?)?,
            None => Pipeline::new(&config, calibration)?,
        };
        let pipeline = pipeline.timed_by(Arc::new(stopwatch));
        let (devices, witness) = open(&config)?;
        let camera = match fault.photo_rig(strength, &config) {
            Some(rig) => Some(open(&rig)?.1),
            None => None,
        };
        Ok(Ground { config, fault, strength, devices, witness, pipeline, camera })
    }

    fn put_fault_on(&mut self) {
        if let Some(simulation) = self.config.simulation() {
            self.fault.put_on(self.strength, &mut self.witness, simulation);
        }
    }

    fn channels(&self) -> Channels {
        if self.config.photo.curve == Curve::Linear { Channels::Green } else { Channels::Colour }
    }

    /// The photo of `view`, and how the scene would be displayed.
    fn photograph(&self, view: View, seed: u64) -> Result<(Frame<Work>, Plane), TestRigError> {
        let tone = Tone::of_curve(self.config.photo.curve, 8);
        let codes = view.codes(self.config.photo.size());
        let brighter = if self.fault == Fault::Saturation { self.strength as f32 } else { 1.0 };
        let scene = Frame::from_fn(|c| {
            let codes = codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
            tone.plane(c, &codes).map(|v: f32| v * brighter)
        });
        let camera = self.camera.as_ref().unwrap_or(&self.witness);
        let noise = self.config.simulation().map_or(0.0, |s| s.sensor.read_noise_levels);
        let more = if self.fault == Fault::PhotoNoise { self.strength } else { 0.0 };
        camera.set_read_noise_levels(noise.hypot(more));
        let mut taken = camera.photograph(&scene, seed.wrapping_mul(1000) + view.number());
        camera.set_read_noise_levels(noise);
        if self.fault == Fault::Jpeg && self.strength < 100.0 {
            taken = super::jpeg::through(&taken, self.strength as u8)?;
        }
        let photo = Frame::from_fn(|c| tone.plane(c, taken.plane(c)));
        let truth = Frame::from_fn(|c| scene.plane(c).map(|v: f32| v.min(255.0)));
        Ok((photo, self.display(&truth)))
    }

    fn prepare<'a>(&self, photo: &'a Frame<Work>) -> Prepared<'a> {
        self.pipeline.prepare(photo, self.channels())
    }

    /// What the contestant makes of `photo`, and what is delivered of it.
    fn run(
        &mut self,
        contestant: Contestant,
        photo: &Prepared<'_>,
    ) -> Result<(Solved, Outcome), TestRigError> {
        if self.fault == Fault::WarmUp {
            // Each job finds the panel cold.
            self.put_fault_on();
        }
        let method = contestant.method(&self.config, self.fault, self.strength);
        let solved = self.pipeline.solve(&mut self.devices, photo, &*method, &mut |_, _| {})?;
        let outcome = self.pipeline.judge(photo, &solved, &mut |_, _| {})?;
        Ok((solved, outcome))
    }

    /// A picture as it is scored: luminance of display values, or light where the photo is linear.
    fn display(&self, picture: &Frame<Work>) -> Plane {
        match self.channels() {
            Channels::Green => picture.plane(Channel::Green).map(|v: f32| v.clamp(0.0, 255.0)),
            Channels::Colour => {
                display_luminance(&Tone::of_curve(self.config.photo.curve, 8), picture)
            }
        }
    }
}
