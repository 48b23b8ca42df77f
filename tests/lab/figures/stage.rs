//! The calibrated, simulated rig of the figures, with its true lens.

use relens::chart::scenes::Scene;
use relens::chart::test_rig::{PHOTO_SEED, TestPhoto};
use relens::config::RigFile;
use relens::deconvolution::backward_convolution::backward_convolution;
use relens::deconvolution::data_term;
use relens::deconvolution::forward_convolution::ForwardConvolution;
use relens::deconvolution::lens_model::{LensFunctions, LensModel};
use relens::deconvolution::method::paper::{Backward, Paper};
use relens::deconvolution::method::{About, Method, MethodError, Problem, Solution, Watch};
use relens::deconvolution::patches::{PatchGrid, PatchShape};
use relens::deconvolution::quality::{psnr, ssim};
use relens::frame::{Channel, Channels, Frame, Plane, Rect};
use relens::pipeline::paper;
use relens::rig::simulated::{Light, Witness};

use crate::Failure;
use crate::harness::Harness;

/// Photo width to which the paper's sizes in pixels refer.
const PAPER_WIDTH_PX: usize = 1024;
/// Number of the true lens's functions along the longer and the shorter side: 192 in all are within
/// 0.4 to 0.7 grey levels of the light (study); 768 take many times as long.
const TRUE_FUNCTIONS: (usize, usize) = (16, 12);

/// A rig and its true lens.
pub(super) struct Stage {
    pub(super) harness: Harness,
    pub(super) truth: LensModel,
}

/// A scene and the photo taken of it, green, photo-sized.
pub(super) struct Taken {
    pub(super) truth: Plane,
    pub(super) photo: TestPhoto,
}

impl Taken {
    /// The photo as displayed.
    pub(super) fn blurred(&self) -> Plane {
        shown(self.photo.light.plane(Channel::Green))
    }

    /// SSIM and PSNR (dB) of the untouched photo.
    pub(super) fn floor(&self) -> (f64, f64) {
        (ssim(&self.blurred(), &self.truth), psnr(&self.blurred(), &self.truth))
    }
}

/// Course of a solve: SSIM and PSNR (dB) after every step, and selected pictures.
pub(super) struct Course {
    pub(super) ssim: Vec<f64>,
    pub(super) psnr_db: Vec<f64>,
    pub(super) pictures: Vec<(u32, Plane)>,
    pub(super) last: Plane,
    pub(super) captures: usize,
    pub(super) certificate: Option<f32>,
}

impl Course {
    /// SSIM after `iteration`, or after the last.
    pub(super) fn ssim_at(&self, iteration: usize) -> f64 {
        self.ssim.get(iteration - 1).or(self.ssim.last()).copied().unwrap_or(0.0)
    }

    /// PSNR (dB) after `iteration`, or after the last.
    pub(super) fn psnr_at(&self, iteration: usize) -> f64 {
        self.psnr_db.get(iteration - 1).or(self.psnr_db.last()).copied().unwrap_or(0.0)
    }

    /// SSIM and PSNR of the finished picture against `truth`.
    pub(super) fn end(&self, truth: &Plane) -> (f64, f64) {
        (ssim(&self.last, truth), psnr(&self.last, truth))
    }
}

impl Stage {
    /// Opens the rig of `rig`, calibrates it from its own captures, and computes its true lens.
    pub(super) fn open(rig: RigFile) -> Result<Stage, Failure> {
        let (harness, _) = Harness::open(rig)?;
        let truth = true_lens(harness.config(), &harness.witness)?;
        Ok(Stage { harness, truth })
    }

    /// The photo that the rig's camera takes of `scene`.
    pub(super) fn take(&self, scene: Scene) -> Result<Taken, Failure> {
        let light = self.harness.test_rig.light(scene);
        let photo = self.harness.photograph(&light, PHOTO_SEED + scene as u64)?;
        Ok(Taken { truth: self.harness.truth(&light).plane(Channel::Green).clone(), photo })
    }

    /// Solves a photo with `method`, scores every step and keeps pictures of `wanted` iterations.
    pub(super) fn solve(
        &mut self,
        taken: &Taken,
        method: &dyn Method,
        wanted: &[u32],
    ) -> Result<Course, Failure> {
        let rect = self.harness.config().photo_on_canvas();
        let (mut ssims, mut psnrs, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
        let (restored, _) = self.harness.test_rig.solve(
            &taken.photo,
            Channels::Green,
            method,
            &mut |step, picture| {
                let Some(picture) = picture else { return };
                let seen = shown(&picture.plane(Channel::Green).crop(rect));
                ssims.push(ssim(&seen, &taken.truth));
                psnrs.push(psnr(&seen, &taken.truth));
                if wanted.contains(&step.iteration) {
                    pictures.push((step.iteration, seen));
                }
            },
        )?;
        Ok(Course {
            ssim: ssims,
            psnr_db: psnrs,
            pictures,
            last: shown(restored.picture.plane(Channel::Green)),
            captures: restored.captures,
            certificate: restored.solution.certificate.ratio(),
        })
    }

    /// KᵀX by the true lens and by light with patches of `shape`, both photo-sized.
    pub(super) fn backward(
        &mut self,
        x: &Plane,
        shape: PatchShape,
    ) -> Result<(Plane, Plane), Failure> {
        let margin = self.harness.config().canvas.margin_px;
        let (canvas, rect) = data_term::canvas_of(x.size(), margin);
        let mut shown = Frame::zeros(canvas);
        *shown.plane_mut(Channel::Green) = data_term::place(x, canvas, rect, 0.0);
        let mut exact = Plane::zeros(canvas);
        self.truth.adjoint(Channel::Green, shown.plane(Channel::Green), &mut exact);
        let grid = PatchGrid::new(canvas, rect, shape);
        let (pipeline, rig) = self.harness.test_rig.parts();
        let mut path = pipeline.light_path(rig);
        let light = backward_convolution(&mut path, &shown, &grid, Channels::Green)
            .map_err(MethodError::from)?;
        Ok((exact.crop(rect), light.plane(Channel::Green).crop(rect)))
    }

    /// RMS difference between the true lens as computed and the light, for scene `x`, grey levels.
    pub(super) fn truth_error(&self, x: &Plane) -> f64 {
        let margin = self.harness.config().canvas.margin_px;
        let (canvas, rect) = data_term::canvas_of(x.size(), margin);
        let mut scene = Frame::zeros(canvas);
        *scene.plane_mut(Channel::Green) = data_term::place(x, canvas, rect, 0.0);
        let mut difference = Plane::zeros(canvas);
        self.truth.forward(Channel::Green, scene.plane(Channel::Green), &mut difference);
        let light = self.harness.witness.forward(&scene, Light::Panel);
        difference.add_scaled(-1.0, light.plane(Channel::Green));
        difference.crop(rect).rms()
    }
}

/// `plane` clipped to the range of a screen.
pub(super) fn shown(plane: &Plane) -> Plane {
    plane.map(|v: f32| v.clamp(0.0, 255.0))
}

/// `px` pixels of the paper's photo, 1024 wide, scaled to the width of the photos of `rig`.
pub(super) fn scaled(rig: &RigFile, px: usize) -> usize {
    (px * rig.photo.width_px / PAPER_WIDTH_PX).max(1)
}

/// The paper's loop as printed, unbounded.
pub(super) fn printed(rig: &RigFile) -> Paper {
    Paper { bounded: false, ..paper(rig) }
}

/// The paper's loop with patches of `patch_px` (for a photo 1024 wide).
pub(super) fn with_patches(rig: &RigFile, patch_px: usize) -> Paper {
    let shape = PatchShape { patch_px: scaled(rig, patch_px), margin_px: rig.paper.margin_px };
    Paper { backward: Backward::Light(shape), ..printed(rig) }
}

/// The paper's loop with light forward and, backward, the "accurate numerical calculation" of §4.1,
/// the adjoint of the true lens.
pub(super) struct Exact<'a> {
    pub(super) paper: Paper,
    pub(super) lens: &'a LensModel,
}

impl Method for Exact<'_> {
    fn about(&self) -> &'static About {
        self.paper.about()
    }

    fn captures_max(&self) -> u32 {
        self.paper.captures_max()
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let known = Problem { model: self.lens, ..*problem };
        Paper { backward: Backward::Model, ..self.paper }.solve(&known, optics, watch)
    }
}

/// Operator of a simulated rig's true lens, from the witness's functions.
fn true_lens(rig: &RigFile, witness: &Witness) -> Result<LensModel, Failure> {
    let (columns, rows) = TRUE_FUNCTIONS;
    let Rect { x, y, size } = rig.photo_on_sensor();
    let centre = |n: usize, of: usize, length: usize, start: usize| {
        (n as f64 + 0.5) * length as f64 / of as f64 - 0.5 + start as f64
    };
    let mut support_px = 1;
    let taps = Channel::ALL.map(|channel| {
        let mut taps = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                let at =
                    [centre(column, columns, size.width, x), centre(row, rows, size.height, y)];
                let function = witness.function(Light::Panel, channel, at);
                support_px = function.width();
                taps.extend(function.into_vec());
            }
        }
        taps
    });
    let functions = LensFunctions { rows, columns, support_px, taps };
    Ok(LensModel::new(rig.photo.size(), rig.canvas.margin_px, &functions)?)
}
