//! Runs methods under changes on a simulated rig that was calibrated healthy, and takes down what
//! became of them.

use relens::chart::test_rig::TestPhoto;
use relens::config::{MethodName, RigFile};
use relens::deconvolution::method::Method;
use relens::deconvolution::quality::ssim;
use relens::frame::{Frame, Plane, Work};
use relens::picture::Tone;
use relens::pipeline::{Verdict, method, reference_solution};

use crate::Failure;
use crate::change::{Swept, To, simulation};
use crate::harness::{Harness, calibration};
use crate::view::View;

/// The methods that are swept: those a rig file can name, and the reference solution.
pub(crate) const METHODS: [&str; 9] = [
    "paper",
    "residual",
    "unmatched",
    "hybrid",
    "block-matching",
    "digital",
    "wiener",
    "richardson-lucy",
    "total-variation",
];

/// One method under one change on one view.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    /// What was changed.
    pub(crate) swept: &'static Swept,
    /// How much.
    pub(crate) strength: f64,
    /// Which of the strengths, 0 for none.
    pub(crate) step: usize,
    /// The method.
    pub(crate) method: &'static str,
    /// What was photographed.
    pub(crate) view: View,
    /// SSIM of the method's result.
    pub(crate) ssim: f64,
    /// SSIM of the untouched photo.
    pub(crate) photo_ssim: f64,
    /// What the box made of the result.
    pub(crate) verdict: Verdict,
    /// SSIM of what is delivered.
    pub(crate) delivered_ssim: f64,
}

/// What is swept.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plan<'a> {
    /// Changes.
    pub(crate) swept: &'a [&'static Swept],
    /// Which of each change's strengths; 0 is none.
    pub(crate) steps: &'a [usize],
    /// Methods.
    pub(crate) methods: &'a [&'static str],
    /// Views.
    pub(crate) views: &'a [View],
    /// Seed of the rig and of the photos.
    pub(crate) seed: u64,
}

/// Runs `plan` on the simulated rig of `rig`.
pub(crate) fn sweep(rig: &RigFile, plan: &Plan<'_>) -> Result<Vec<Run>, Failure> {
    let mut healthy = rig.clone();
    simulation(&mut healthy, |simulation| simulation.seed = plan.seed);
    let calibration = calibration(&healthy)?;
    let mut runs: Vec<Run> = Vec::new();
    for (n, &swept) in plan.swept.iter().enumerate() {
        for (step, strength) in (swept.strengths)(&healthy).into_iter().enumerate() {
            if step == 0 && n > 0 {
                // No change is no change: run once.
                let none =
                    runs.iter().filter(|run| same(run.swept, plan.swept[0]) && run.step == 0);
                let none: Vec<Run> =
                    none.map(|run| Run { swept, strength, ..run.clone() }).collect();
                runs.extend(none);
                continue;
            }
            if !plan.steps.contains(&step) {
                continue;
            }
            let mut harness = Harness::changed(&healthy, &calibration, &swept.change, strength)?;
            // The photos were taken before anything happened to the rig.
            let photos = plan.views.iter().map(|&view| photograph(&harness, view, plan.seed));
            let photos: Vec<(TestPhoto, Plane)> = photos.collect::<Result<_, _>>()?;
            harness.change_captures();
            for (&view, (photo, truth)) in plan.views.iter().zip(photos) {
                let prepared = harness.prepare(&photo);
                for &name in plan.methods {
                    let solver = harness.method(&|rig| named(rig, name));
                    if step > 0 && !concerned(&*solver, swept) {
                        continue;
                    }
                    let (solved, outcome) = harness.judge(&prepared, &*solver)?;
                    let score = |picture: &Frame<Work>| ssim(&harness.seen(picture), &truth);
                    let run = Run {
                        swept,
                        strength,
                        step,
                        method: name,
                        view,
                        ssim: score(&solved.picture),
                        photo_ssim: score(&photo.light),
                        delivered_ssim: score(&outcome.picture),
                        verdict: outcome.verdict,
                    };
                    log::info!("{}", run.words());
                    runs.push(run);
                }
            }
        }
    }
    Ok(runs)
}

impl Run {
    /// The run in words.
    pub(crate) fn words(&self) -> String {
        let (change, view) = (self.swept.change.words(self.strength), self.view.name());
        format!(
            "{change}: {}, {view}: {:.4}, photo {:.4}, delivered {:.4}, {:?}",
            self.method, self.ssim, self.photo_ssim, self.delivered_ssim, self.verdict
        )
    }
}

/// Whether it is the same change.
pub(crate) fn same(one: &Swept, other: &Swept) -> bool {
    one.change.name == other.change.name
}

/// The method called `name` with the settings of `rig`.
fn named(rig: &RigFile, name: &str) -> Box<dyn Method + Send + Sync> {
    match MethodName::ALL.into_iter().find(|which| which.name() == name) {
        Some(which) => method(rig, which),
        None => Box::new(reference_solution(rig)),
    }
}

/// Whether a change can change anything for a method.
pub(crate) fn concerned(method: &dyn Method, swept: &Swept) -> bool {
    match swept.change.to {
        To::Captures(_) | To::EachJob(_) => method.captures_max() > 0,
        To::Patches(_) => method.about().by_patches,
        To::Step => method.about().by_steps,
        _ => true,
    }
}

/// The photo of `view`, and how the scene would be displayed.
fn photograph(harness: &Harness, view: View, seed: u64) -> Result<(TestPhoto, Plane), Failure> {
    let tone = Tone::of_curve(harness.config().photo.curve, 8);
    let codes = view.codes(harness.config().photo.size());
    let scene = Frame::from_fn(|c| {
        let codes = codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
        tone.plane(c, &codes)
    });
    let photo = harness.photograph(&scene, seed.wrapping_mul(1000) + view.number())?;
    Ok((photo, harness.seen(&harness.truth(&scene))))
}
