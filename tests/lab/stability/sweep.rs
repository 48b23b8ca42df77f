//! Runs methods under faults on a simulated rig; only faults of the rig file precede calibration.

use relens::calibration::Calibration;
use relens::chart::test_rig::TestPhoto;
use relens::config::{MethodName, RigFile};
use relens::deconvolution::method::Method;
use relens::deconvolution::method::total_variation::TotalVariation;
use relens::frame::Frame;
use relens::picture::Tone;
use relens::pipeline::{Verdict, method};

use super::kept::Kept;
use crate::Failure;
use crate::change::{Swept, To, simulation};
use crate::harness::{Harness, Restored, calibration};
use crate::likeness::{Likeness, Truth};
use crate::view::View;

/// The methods of the sweep: those of rig files, and the reference solution.
pub(crate) const METHODS: [&str; 7] = [
    "paper",
    "hybrid",
    "block-matching",
    "digital",
    "wiener",
    "richardson-lucy",
    "total-variation",
];

/// One method under one fault on one view.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    /// The fault.
    pub(crate) swept: &'static Swept,
    /// Strength of the fault.
    pub(crate) strength: f64,
    /// Index of the strength; 0 is without the fault.
    pub(crate) step: usize,
    /// The method.
    pub(crate) method: &'static str,
    /// The photographed view.
    pub(crate) view: View,
    /// Seed of the rig and of the photos.
    pub(crate) seed: u64,
    /// Likeness of the untouched photo.
    pub(crate) photo: Likeness,
    /// Likeness of the method's result.
    pub(crate) result: Likeness,
    /// The verdict on the result.
    pub(crate) verdict: Verdict,
    /// Likeness of the delivered picture.
    pub(crate) delivered: Likeness,
}

/// The plan of a sweep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plan<'a> {
    /// Faults.
    pub(crate) swept: &'a [&'static Swept],
    /// Indices of strengths; 0 is without the fault.
    pub(crate) steps: &'a [usize],
    /// Methods.
    pub(crate) methods: &'a [&'static str],
    /// Views.
    pub(crate) views: &'a [View],
    /// Seed of the rig and of the photos.
    pub(crate) seed: u64,
}

/// Results of a sweep.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    /// The results.
    pub(crate) runs: Vec<Run>,
    /// Changes and strengths at which calibration was refused.
    pub(crate) refused: Vec<(&'static Swept, f64)>,
}

/// Runs `plan` on the simulated rig of `rig`; results in `kept` are not run again.
pub(crate) fn sweep(rig: &RigFile, plan: &Plan<'_>, kept: &mut Kept) -> Result<Found, Failure> {
    let mut healthy = rig.clone();
    simulation(&mut healthy, |simulation| simulation.seed = plan.seed);
    let mut as_healthy: Option<Calibration> = None;
    let mut found = Found::default();
    for (n, &swept) in plan.swept.iter().enumerate() {
        for (step, strength) in (swept.strengths)(&healthy).into_iter().enumerate() {
            // The first strength of every fault is no change, so it is run once.
            if (step == 0 && n > 0) || !plan.steps.contains(&step) {
                continue;
            }
            if kept.refuses(swept, strength) {
                found.refused.push((swept, strength));
                continue;
            }
            let before = kept.of(plan, swept, step);
            let is_left = |view: &&View| before.iter().all(|run| run.view != **view);
            let left: Vec<View> = plan.views.iter().filter(is_left).copied().collect();
            found.runs.extend(before);
            let concerns = |name: &&str| step == 0 || concerned(&*named(&healthy, name), swept);
            if left.is_empty() || !plan.methods.iter().any(concerns) {
                continue;
            }
            let own = match swept.change.is_filed() && step > 0 {
                true => Some(calibration(&swept.change.filed(&healthy, strength))),
                false => None,
            };
            let calibrated = match (&own, &mut as_healthy) {
                (Some(Ok(own)), _) => own,
                (Some(Err(error)), _) => {
                    let words = swept.change.words(strength);
                    log::info!("# {words}: {}", relens::remedy::full_message(&**error));
                    kept.keep_refused(swept, strength)?;
                    found.refused.push((swept, strength));
                    continue;
                }
                (None, Some(before)) => before,
                (None, empty) => empty.insert(calibration(&healthy)?),
            };
            let harness = Harness::changed(&healthy, calibrated, &swept.change, strength)?;
            let left = Plan { views: &left, ..*plan };
            let runs = under(harness, &left, (swept, strength, step))?;
            kept.keep(&runs)?;
            found.runs.extend(runs);
        }
    }
    Ok(found)
}

/// Runs the methods of `plan` on its views, with the changed rig of `harness`.
fn under(
    mut harness: Harness,
    plan: &Plan<'_>,
    (swept, strength, step): (&'static Swept, f64, usize),
) -> Result<Vec<Run>, Failure> {
    // Photos are taken before the captures are changed.
    let photos = plan.views.iter().map(|&view| photograph(&harness, view, plan.seed));
    let photos: Vec<(TestPhoto, Truth)> = photos.collect::<Result<_, _>>()?;
    harness.change_captures();
    let mut runs = Vec::new();
    for (&view, (photo, truth)) in plan.views.iter().zip(&photos) {
        let prepared = harness.prepare(photo);
        let untouched = truth.likeness(&photo.light);
        for &name in plan.methods {
            let solver = harness.method(&|rig| named(rig, name));
            if step > 0 && !concerned(&*solver, swept) {
                continue;
            }
            let Restored { solved, outcome, .. } = harness.restore(&prepared, &*solver)?;
            let run = Run {
                swept,
                strength,
                step,
                method: name,
                view,
                seed: plan.seed,
                photo: untouched,
                result: truth.likeness(&solved.picture),
                delivered: truth.likeness(&outcome.picture),
                verdict: outcome.verdict,
            };
            log::info!("{}", run.words());
            runs.push(run);
        }
    }
    Ok(runs)
}

impl Run {
    /// The run in words.
    pub(crate) fn words(&self) -> String {
        let (change, view) = (self.swept.change.words(self.strength), self.view.name());
        format!(
            "{change}: {}, {view}: {}, photo {}, delivered {}, {:?}",
            self.method, self.result, self.photo, self.delivered, self.verdict
        )
    }
}

/// Whether `one` and `other` are the same change.
pub(crate) fn same(one: &Swept, other: &Swept) -> bool {
    one.change.name == other.change.name
}

/// The method called `name` with the settings of `rig`.
fn named(rig: &RigFile, name: &str) -> Box<dyn Method + Send + Sync> {
    match MethodName::ALL.into_iter().find(|which| which.name() == name) {
        Some(which) => method(rig, which),
        None => Box::new(TotalVariation::default()),
    }
}

/// Whether the change `swept` can affect the results of `method`.
pub(crate) fn concerned(method: &dyn Method, swept: &Swept) -> bool {
    match swept.change.to {
        To::Captures(_) | To::EachJob(_) => method.captures_max() > 0,
        To::Patches(_) => method.name() == MethodName::Paper.name(),
        // Wiener's filter and Richardson–Lucy have no step length.
        To::Step => ![MethodName::Wiener, MethodName::RichardsonLucy]
            .iter()
            .any(|without| without.name() == method.name()),
        _ => true,
    }
}

/// The photo of `view`, and its scene.
fn photograph(harness: &Harness, view: View, seed: u64) -> Result<(TestPhoto, Truth), Failure> {
    let tone = Tone::of_curve(harness.config().photo.curve, 8);
    let codes = view.codes(harness.config().photo.size());
    let scene = Frame::from_fn(|c| {
        let codes = codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
        tone.plane(c, &codes)
    });
    let photo = harness.photograph(&scene, seed.wrapping_mul(1000) + view.number())?;
    let channels = harness.test_rig.channels();
    let truth = Truth::of(harness.config(), channels, &harness.truth(&scene));
    Ok((photo, truth))
}
