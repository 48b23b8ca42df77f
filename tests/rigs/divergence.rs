//! No method diverges under the worst errors of a rig.

use std::path::Path;
use std::sync::Arc;

use crate::computed_optics::ComputedOptics;
use crate::npy::read_npy_f32;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use relens::deconvolution::data_term::TRUSTED;
use relens::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use relens::deconvolution::lens_model::{LensFunctions, LensModel};
use relens::deconvolution::level_norms::LevelNorms;
use relens::deconvolution::method::blocks::Blocks;
use relens::deconvolution::method::digital::Digital;
use relens::deconvolution::method::hybrid::Hybrid;
use relens::deconvolution::method::paper::{Backward, Paper};
use relens::deconvolution::method::richardson_lucy::RichardsonLucy;
use relens::deconvolution::method::total_variation::TotalVariation;
use relens::deconvolution::method::wiener::Wiener;
use relens::deconvolution::method::{Method, Problem, ResidualOf};
use relens::deconvolution::observation::{Developed, Observation};
use relens::deconvolution::patches::PatchShape;
use relens::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};
use relens::remedy::AnyFailure;

const SIZE: Size = Size::new(128, 96);
const GREEN: Channel = Channel::Green;

fn golden(name: &str) -> (Vec<usize>, Vec<f32>) {
    read_npy_f32(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)).unwrap()
}

/// The golden lens functions, with those of channel `from` used for green.
fn functions(from: Channel) -> LensFunctions {
    let mut functions = crate::method::golden_functions();
    functions.taps[GREEN.index()] = functions.taps[from.index()].clone();
    functions
}

/// Optics with a gain, a displacement and noise.
struct FaultyOptics<'a> {
    optics: ComputedOptics<'a>,
    gain: f32,
    shift_px: usize,
    noise: f32,
    random: Xoshiro256PlusPlus,
}

impl ForwardConvolution for FaultyOptics<'_> {
    fn size(&self) -> Size {
        SIZE
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        let mut seen = self.optics.forward(shown)?;
        let light = seen.light.plane(GREEN).clone();
        *seen.light.plane_mut(GREEN) = Plane::from_fn(SIZE, |x, y| {
            let noise: f32 = StandardNormal.sample(&mut self.random);
            self.gain * light.at(x.saturating_sub(self.shift_px), y) + self.noise * noise
        });
        Ok(seen)
    }

    fn captures(&self) -> usize {
        self.optics.captures()
    }

    fn seconds(&self) -> f64 {
        0.0
    }
}

fn methods(patch_px: usize) -> Vec<Box<dyn Method>> {
    let strength = 0.1;
    let digital = Digital { steps: 40, strength, levels: 2, blocks: None };
    let patches = PatchShape { patch_px, margin_px: 8 };
    let hybrid = Hybrid { digital, correction_steps: 20, captures_max: 12 };
    vec![
        Box::new(Paper {
            iterations: 40,
            tau: 16.0,
            lambda: 3.0,
            backward: Backward::Light(patches),
            levels: 2,
            bounded: true,
        }),
        Box::new(digital),
        Box::new(hybrid),
        Box::new(Hybrid {
            digital: Digital {
                blocks: Some(Blocks { rounds: 8, model_error: [0.0; 3] }),
                ..digital
            },
            ..hybrid
        }),
        Box::new(Wiener { noise_to_signal: 1e-6 }),
        Box::new(RichardsonLucy { steps: 200 }),
        Box::new(TotalVariation { steps: 40, strength }),
    ]
}

/// The errors of one case.
#[derive(Debug, Clone, Copy)]
struct Fault {
    /// Factor by which ‖K‖ is underestimated.
    norms: f32,
    /// Channel whose lens functions the optics use.
    lens: Channel,
    gain: f32,
    shift_px: usize,
    noise: f32,
    patch_px: usize,
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn no_method_diverges_under_faults() {
    let right = Fault { norms: 1.0, lens: GREEN, gain: 1.0, shift_px: 0, noise: 0.0, patch_px: 16 };
    let model = LensModel::new(SIZE, 0, &functions(GREEN)).unwrap();
    let level_norms = LevelNorms::measure(&model, GREEN, 2, 12, 1);
    let (_, blurred) = golden("ist_b.npy");
    let mut photo = Frame::zeros(SIZE);
    *photo.plane_mut(GREEN) = Plane::from_vec(SIZE, blurred).unwrap();
    let observation = Observation {
        light: photo,
        trust: Frame::filled(SIZE, TRUSTED),
        rect: Rect { x: 0, y: 0, size: SIZE },
        channels: Channels::Green,
        noise: [0.3; 3],
        dark_light: [f32::INFINITY; 3],
        sampling: Arc::new(Developed { interpolated: None, has_blocks: false }),
    };
    for wrong in [
        Fault { norms: 16.0, ..right },
        Fault { gain: 2.0, ..right },
        Fault { patch_px: 128, ..right },
        Fault { shift_px: 4, ..right },
        Fault { noise: 20.0, ..right },
        Fault {
            norms: 4.0,
            lens: Channel::Blue,
            gain: 1.5,
            shift_px: 2,
            noise: 8.0,
            patch_px: 128,
        },
    ] {
        let norms = std::array::from_fn(|_| level_norms.scaled(1.0 / wrong.norms));
        let problem = Problem {
            observation: &observation,
            model: &model,
            norm_squared: [1.0 / wrong.norms; 3],
            level_norms: &norms,
            pixel_norms: &norms,
            capture_mosaic: None,
            capture_noise: observation.noise,
            is_hopeless: None,
            stopwatch: &|| 0.0,
        };
        let lens = LensModel::new(SIZE, 0, &functions(wrong.lens)).unwrap();
        for method in methods(wrong.patch_px) {
            let random = Xoshiro256PlusPlus::seed_from_u64(7);
            let (optics, Fault { gain, shift_px, noise, .. }) =
                (ComputedOptics::new(&lens, true), wrong);
            let mut faulty = FaultyOptics { optics, gain, shift_px, noise, random };
            let solution = method.solve(&problem, &mut faulty, &mut |_, _| {}).unwrap();
            let name = method.name();
            let rms = solution.picture.plane(GREEN).rms();
            assert!(rms < 255.0, "{name}, {wrong:?}: RMS {rms}");
            // The optical residual does not grow.
            let optical = solution.record.steps().iter().filter(|s| s.of == ResidualOf::Optics);
            let optical: Vec<f32> = optical.map(|s| s.residual).collect();
            if let (Some(first), Some(last)) = (optical.first(), optical.last()) {
                assert!(*last < 2.0 * first, "{name}, {wrong:?}: residuals {optical:?}");
            }
        }
    }
}
