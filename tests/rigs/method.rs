//! The paper's mathematics, compared with arrays of an independent program, and choices that the
//! paper does not specify.

use std::path::Path;
use std::sync::Arc;

use crate::computed_optics::ComputedOptics;
use crate::npy::read_npy_f32;
use relens::deconvolution::backward_convolution::backward_convolution;
use relens::deconvolution::data_term::TRUSTED;
use relens::deconvolution::forward_convolution::ForwardConvolution;
use relens::deconvolution::lens_model::{LensFunctions, LensModel};
use relens::deconvolution::level_norms::LevelNorms;
use relens::deconvolution::method::blocks::Blocks;
use relens::deconvolution::method::digital::Digital;
use relens::deconvolution::method::hybrid::Hybrid;
use relens::deconvolution::method::paper::{Backward, Paper};
use relens::deconvolution::method::{Method, Problem};
use relens::deconvolution::observation::{Developed, Observation};
use relens::deconvolution::patches::{PatchGrid, PatchShape};
use relens::deconvolution::quality::ssim;
use relens::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};

const GREEN: Channel = Channel::Green;

fn golden(name: &str) -> Plane {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    let (shape, values) = read_npy_f32(&path).unwrap();
    Plane::from_vec(Size::new(shape[1], shape[0]), values).unwrap()
}

/// The golden lens functions.
pub(crate) fn golden_functions() -> LensFunctions {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/psf_grid.npy");
    let (shape, values) = read_npy_f32(&path).unwrap();
    let [rows, columns, 3, k, _] = shape[..] else { panic!("{shape:?}") };
    let taps =
        |c: usize| values.chunks_exact(k * k).skip(c).step_by(3).flatten().copied().collect();
    LensFunctions { rows, columns, support_px: k, taps: [0, 1, 2].map(taps) }
}

fn golden_model() -> LensModel {
    LensModel::new(Size::new(128, 96), 0, &golden_functions()).unwrap()
}

fn green_only(plane: Plane) -> Frame<Work> {
    let mut frame = Frame::zeros(plane.size());
    *frame.plane_mut(GREEN) = plane;
    frame
}

/// Level norms of the golden lens.
static LEVEL_NORMS: std::sync::OnceLock<LevelNorms> = std::sync::OnceLock::new();

/// A fully trusted photo, solved in green.
struct Case {
    observation: Observation,
    level_norms: [LevelNorms; 3],
}

impl Case {
    fn new(photo: Plane, noise: f32) -> Self {
        let size = photo.size();
        let observation = Observation {
            light: green_only(photo),
            trust: Frame::filled(size, TRUSTED),
            rect: Rect { x: 0, y: 0, size },
            channels: Channels::Green,
            noise: [noise; 3],
            dark_light: [f32::INFINITY; 3],
            sampling: Arc::new(Developed { interpolated: None, has_blocks: false }),
        };
        let level_norms =
            LEVEL_NORMS.get_or_init(|| LevelNorms::measure(&golden_model(), GREEN, 2, 12, 1));
        let level_norms = std::array::from_fn(|_| level_norms.clone());
        Case { observation, level_norms }
    }

    fn problem<'a>(&'a self, model: &'a LensModel) -> Problem<'a> {
        Problem {
            observation: &self.observation,
            model,
            norm_squared: [1.0; 3],
            level_norms: &self.level_norms,
            pixel_norms: &self.level_norms,
            capture_mosaic: None,
            capture_noise: self.observation.noise,
            is_hopeless: None,
            stopwatch: &|| 0.0,
        }
    }
}

fn relative_distance(a: &Plane, b: &Plane) -> f64 {
    let mut difference = a.clone();
    difference.add_scaled(-1.0, b);
    difference.rms() / b.rms()
}

fn paper(iterations: u32, tau: f32, backward: Backward) -> Paper {
    Paper { iterations, tau, lambda: 3.0, backward, levels: 2, bounded: false }
}

/// Runs `method` on the golden photo with unrounded golden optics.
fn solve_golden(method: &dyn Method) -> Plane {
    let model = golden_model();
    let case = Case::new(golden("ist_b.npy"), 0.0);
    let mut optics = ComputedOptics::new(&model, false);
    let solution = method.solve(&case.problem(&model), &mut optics, &mut |_, _| {}).unwrap();
    solution.picture.plane(GREEN).clone()
}

#[test]
fn flip_fc_flip_equals_the_reference_for_every_patch_size() {
    let model = golden_model();
    let picture = golden("operator_x.npy");
    for patch_px in [16, 20, 24, 32] {
        let mut optics = ComputedOptics::new(&model, false);
        let rect = Rect { x: 0, y: 0, size: picture.size() };
        let grid = PatchGrid::new(
            picture.size(),
            rect,
            PatchShape { patch_px, margin_px: 10.min(patch_px / 2) },
        );
        let frame = green_only(picture.clone());
        let back = backward_convolution(&mut optics, &frame, &grid, Channels::Green).unwrap();
        let expected = golden(&format!("operator_flip{patch_px}_noguard.npy"));
        let distance = relative_distance(back.plane(GREEN), &expected);
        assert!(distance < 1e-4, "patch {patch_px}: relative distance {distance:.2e}");
    }
}

#[test]
fn flip_fc_flip_approaches_the_exact_adjoint_for_small_patches() {
    // Bounds: the reference program's distances at these sizes, plus a tenth.
    let (model, picture, exact) =
        (golden_model(), golden("operator_x.npy"), golden("operator_kt_x.npy"));
    let size = picture.size();
    for (patch_px, name) in
        [(16, "operator_flip16_noguard.npy"), (32, "operator_flip32_noguard.npy")]
    {
        let bound = 1.1 * relative_distance(&golden(name), &exact);
        let mut optics = ComputedOptics::new(&model, false);
        let shape = PatchShape { patch_px, margin_px: 10 };
        let grid = PatchGrid::new(size, Rect { x: 0, y: 0, size }, shape);
        let frame = green_only(picture.clone());
        let back = backward_convolution(&mut optics, &frame, &grid, Channels::Green).unwrap();
        let distance = relative_distance(back.plane(GREEN), &exact);
        assert!(distance <= bound, "patch {patch_px}: {distance:.4} > {bound:.4}");
    }
}

#[test]
fn the_printed_loop_equals_the_reference_step_by_step() {
    for (iterations, name) in [(1, "ist_l1.npy"), (2, "ist_l2.npy"), (11, "ist_l11.npy")] {
        let ours = solve_golden(&paper(iterations, 0.8, Backward::Model));
        let mut difference = ours;
        difference.add_scaled(-1.0, &golden(name));
        let worst = difference.data().iter().fold(0.0f32, |m, v| m.max(v.abs()));
        assert!(worst < 0.05, "{name}: worst pixel off by {worst} grey levels");
    }
}

#[test]
fn small_patches_hardly_matter_and_a_whole_frame_patch_is_worse() {
    let truth = golden("operator_x.npy");
    let light = |patch_px| Backward::Light(PatchShape { patch_px, margin_px: 10 });
    let exact = ssim(&solve_golden(&paper(11, 0.8, Backward::Model)), &truth);
    let small = ssim(&solve_golden(&paper(11, 0.8, light(16))), &truth);
    assert!((exact - small).abs() < 0.01, "exact {exact:.4}, patch 16 {small:.4}");
    // With one patch for the whole frame of a rotationally symmetric lens, K replaces Kᵀ.
    let whole = ssim(&solve_golden(&paper(11, 0.8, light(128))), &truth);
    assert!(whole < small - 0.005, "whole-frame patch {whole:.4}, patch 16 {small:.4}");
}

#[test]
fn the_step_of_equation_7_is_stable_up_to_the_inverse_norm() {
    // ‖K‖² = 0.995 for this lens, so with the factor 2 the limit is τ = 1.005.
    let size_after = |tau| solve_golden(&paper(60, tau, Backward::Model)).rms();
    let photo = golden("ist_b.npy").rms();
    assert!(size_after(0.8) < 1.1 * photo);
    assert!(size_after(1.2) > 10.0 * photo);
}

#[test]
fn the_printed_threshold_is_half_of_the_proximal_one() {
    // λτ/2 as printed shrinks less than λτ, and keeps more of the picture.
    let printed = paper(11, 0.8, Backward::Model);
    let proximal = Paper { lambda: 2.0 * printed.lambda, ..printed };
    let truth = golden("operator_x.npy");
    assert!(ssim(&solve_golden(&printed), &truth) > ssim(&solve_golden(&proximal), &truth));
}

fn digital() -> Digital {
    let strength = 0.1;
    Digital { steps: 30, strength, levels: 2, blocks: None }
}

#[test]
fn model_based_methods_sharpen_the_photo_and_count_captures() {
    let model = golden_model();
    let truth = golden("operator_x.npy");
    let case = Case::new(golden("ist_b.npy"), 0.3);
    let blurred = ssim(case.observation.light.plane(GREEN), &truth);
    let hybrid = Hybrid { digital: digital(), correction_steps: 10, captures_max: 3 };
    let matched = Hybrid {
        digital: Digital { blocks: Some(Blocks { rounds: 4, model_error: [0.0; 3] }), ..digital() },
        ..hybrid
    };
    // The first capture shows no defect and certifies the result of either hybrid.
    let methods: [(&dyn Method, usize); 3] = [(&digital(), 0), (&hybrid, 1), (&matched, 1)];
    for (method, captures) in methods {
        let mut optics = ComputedOptics::new(&model, true);
        let mut reports = 0;
        let solution =
            method.solve(&case.problem(&model), &mut optics, &mut |_, _| reports += 1).unwrap();
        let quality = ssim(solution.picture.plane(GREEN), &truth);
        assert!(quality > blurred + 0.05, "{}: {quality:.4}, blurred {blurred:.4}", method.name());
        assert_eq!(optics.captures(), captures, "{}", method.name());
        let steps = solution.record.steps().len();
        assert!(
            steps > 0 && reports >= steps,
            "{}: {reports} progress reports in {steps} steps",
            method.name()
        );
    }
}

#[test]
fn a_correct_model_is_unchanged_and_a_wrong_one_is_corrected() {
    let right = golden_model();
    // The wrong model has blue's functions for green.
    let mut functions = right.functions().clone();
    functions.taps[GREEN.index()] = functions.taps[Channel::Blue.index()].clone();
    let wrong = LensModel::new(Size::new(128, 96), 0, &functions).unwrap();
    let truth = golden("operator_x.npy");
    let case = Case::new(golden("ist_b.npy"), 0.3);
    let hybrid = Hybrid { digital: digital(), correction_steps: 15, captures_max: 3 };
    let run = |model: &LensModel, method: &dyn Method| {
        let mut optics = ComputedOptics::new(&right, true);
        let solution = method.solve(&case.problem(model), &mut optics, &mut |_, _| {}).unwrap();
        (ssim(solution.picture.plane(GREEN), &truth), solution.certificate)
    };
    let (_, untouched) = run(&right, &hybrid);
    assert_eq!(untouched.corrections, 0);
    let (alone, _) = run(&wrong, &digital());
    let (corrected, certificate) = run(&wrong, &hybrid);
    assert!(certificate.corrections > 0);
    assert!(corrected > alone + 0.01, "model alone {alone:.4}, corrected {corrected:.4}");
}
