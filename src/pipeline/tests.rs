//! What is delivered for a photo, and whether stage, reason and method are true of it.

use std::path::Path;

use super::*;
use crate::config::MethodName as Named;
use crate::deconvolution::data_term::place_with_edges;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::method::{
    About, Certificate, IterationRecord, Method, MethodError, Problem, Solution, Watch,
};
use crate::deconvolution::stage::ResultStage;
use crate::frame::{Channels, Frame, Plane, Work};
use crate::measurement::{calibrate, to_the_end};
use crate::picture::Tone;
use crate::rig::simulated::{Witness, open};

/// The calibration of the small rig, measured once for all tests.
pub(super) fn small() -> &'static Calibration {
    static MEASURED: OnceLock<Calibration> = OnceLock::new();
    MEASURED.get_or_init(|| {
        let config = config::load(Path::new("small.toml")).unwrap();
        calibrate(&mut open(&config).unwrap().0, &config, None, &mut to_the_end).unwrap()
    })
}

/// The small rig, calibrated.
struct Bed {
    config: config::RigFile,
    rig: Devices,
    witness: Witness,
    pipeline: Pipeline,
}

impl Bed {
    fn new() -> Bed {
        Bed::of(config::load(Path::new("small.toml")).unwrap(), small())
    }

    fn of(config: config::RigFile, calibration: &Calibration) -> Bed {
        let (rig, witness) = open(&config).unwrap();
        let pipeline = Pipeline::new(&config, calibration).unwrap();
        Bed { config, rig, witness, pipeline }
    }

    /// A scene of discs and stripes, in light.
    fn scene(&self) -> Frame<Work> {
        let of = |x: usize, y: usize| match (x / 24 + y / 16) % 3 {
            0 => 40.0,
            1 => 120.0 + 0.4 * (x % 24) as f32,
            _ => 180.0,
        };
        Frame::from_fn(|_| Plane::from_fn(self.config.photo.size(), of))
    }

    /// A photo of [`Bed::scene`].
    fn photo(&self) -> Frame<Work> {
        self.photo_of(&self.scene())
    }

    /// A scene from a photograph, in light: a JPEG of few greys would pass for one coded twice.
    fn coffee(&self) -> Frame<Work> {
        let tone = Tone::of_curve(self.config.photo.curve, 8);
        let codes = crate::picture::embedded(include_bytes!("../../tests/scenes/coffee.png"));
        Frame::from_fn(|c| {
            let of = &codes[c.index()];
            let four = |x: usize, y: usize| of.at(x, y) + of.at(x + 1, y);
            let mean = |x, y| (four(2 * x, 2 * y) + four(2 * x, 2 * y + 1)) / 4.0;
            let halved: Plane = Plane::from_fn(self.config.photo.size(), mean);
            tone.plane(c, &halved.map(|code: f32| code.round() as u8))
        })
    }

    fn photo_of(&self, scene: &Frame<Work>) -> Frame<Work> {
        let tone = Tone::of_curve(self.config.photo.curve, 8);
        let codes = self.witness.photograph(scene, 5);
        Frame::from_fn(|c| tone.plane(c, codes.plane(c)))
    }

    fn restore(&mut self, photo: &Frame<Work>, method: &dyn Method) -> Outcome {
        let prepared = self.pipeline.prepare(PhotoData::developed(photo, Channels::Colour));
        self.restore_prepared(&prepared, method)
    }

    fn restore_prepared(&mut self, prepared: &Prepared<'_>, method: &dyn Method) -> Outcome {
        let restored = self.pipeline.restore(&mut self.rig, prepared, method, &mut |_, _| {});
        restored.unwrap().outcome
    }
}

/// A method that captures, corrects, and then returns a checkerboard.
struct Spoiler;

impl Method for Spoiler {
    fn about(&self) -> &'static About {
        const ABOUT: About = About { name: "spoiler", starts_from_lens: true };
        &ABOUT
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        _: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let board = |x: usize, y: usize| 255.0 * ((x / 2 + y / 2) % 2) as f32;
        let picture = Frame::from_fn(|_| Plane::from_fn(problem.size(), board));
        let seen = optics.forward(&picture)?;
        let mut certificate = Certificate { corrections: 1, ..Certificate::default() };
        certificate.measure(problem, &seen.light);
        Ok(Solution::of(picture, IterationRecord::default(), certificate))
    }
}

#[test]
fn a_replaced_result_is_told_as_what_is_delivered_and_why() {
    let mut bed = Bed::new();
    let photo = bed.photo();
    let outcome = bed.restore(&photo, &Spoiler);
    assert_eq!((outcome.verdict, outcome.method), (Verdict::Replaced, "digital"));
    assert_eq!((outcome.stage, outcome.captures), (ResultStage::LensModel, 1));
    assert!(outcome.reason.contains("returned in its place"), "{}", outcome.reason);
    // Certificate and record describe what is delivered, not the result that failed.
    assert_eq!(outcome.certificate, None);
    assert!(outcome.iterations.iter().all(|step| step.captures == 0));
    let alone = bed.restore(&photo, &Digital::default());
    assert_eq!((alone.verdict, alone.picture), (Verdict::Sound, outcome.picture));
}

#[test]
fn a_stamped_photo_is_restored_around_the_stamp() {
    let mut bed = Bed::new();
    let scene = bed.coffee();
    let photo = bed.photo_of(&scene);
    let stamp = |x: usize, y: usize| {
        (170..230).contains(&x) && (160..172).contains(&y) && (x / 3 + y / 3).is_multiple_of(2)
    };
    let stamped = Frame::from_fn(|c| {
        let of = photo.plane(c);
        Plane::from_fn(of.size(), |x, y| if stamp(x, y) { 250.0 } else { of.at(x, y) })
    });
    let solver = Digital::default();
    let outcome = bed.restore(&stamped, &solver);
    assert_eq!(outcome.verdict, Verdict::Sound, "{}", outcome.reason);
    let outliers = outcome.outliers.as_ref().expect("the stamp is an outlier");
    assert!(outliers.share() < 0.1, "{}", outliers.share());
    assert!(outcome.notes.contains(&outliers.note()), "{:?}", outcome.notes);
    let green = |frame: &Frame<Work>| frame.plane(Channel::Green).clone();
    let [stamped, scene, result] = [&stamped, &scene, &outcome.picture].map(green);
    let (mut before, mut after) = (0.0f32, 0.0f32);
    for (x, y) in (0..scene.size().area()).map(|i| (i % scene.width(), i / scene.width())) {
        match outliers.weight.at(x, y) {
            0.0 => {
                before += (stamped.at(x, y) - scene.at(x, y)).powi(2);
                after += (result.at(x, y) - scene.at(x, y)).powi(2);
            }
            1.0 => assert!((result.at(x, y) - stamped.at(x, y)).abs() < 1e-3, "({x}, {y})"),
            _ => {}
        }
    }
    assert!(after < 0.8 * before, "{after} for {before}");
    assert!(bed.restore(&photo, &solver).outliers.is_none());
}

/// The reference solution, altered by `change`.
struct Changed {
    about: &'static About,
    reference: Box<dyn Method>,
    change: fn(&mut Frame<Work>),
}

impl Method for Changed {
    fn about(&self) -> &'static About {
        self.about
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let mut solution = self.reference.solve(problem, optics, watch)?;
        (self.change)(&mut solution.picture);
        Ok(Solution { prediction: None, ..solution })
    }
}

/// Adds a tint that lightness does not show: red and blue in turn from column to column, of equal
/// luminance and too fine for the lens.
fn tint(picture: &mut Frame<Work>) {
    // Rec. 709 weighs red 0.2126 and blue 0.0722.
    for (plane, levels) in picture.planes_mut().iter_mut().zip([10.0, 0.0, -29.4]) {
        let turned = |x: usize| if x.is_multiple_of(2) { levels } else { -levels };
        *plane = Plane::from_fn(plane.size(), |x, y| plane.at(x, y) + turned(x));
    }
}

/// Broad waves, fainter than the photo's noise.
fn wave(picture: &mut Frame<Work>) {
    let wave = |x: usize, y: usize| 1.4 * (0.4 * x as f32).sin() * (0.4 * y as f32).sin();
    for plane in picture.planes_mut() {
        plane.add_scaled(1.0, &Plane::from_fn(plane.size(), wave));
    }
}

#[test]
fn a_tint_that_lightness_does_not_show_is_replaced() {
    let mut bed = Bed::new();
    let photo = bed.photo();
    const ABOUT: About = About { name: "tinter", starts_from_lens: false };
    let reference = Box::new(TotalVariation::default());
    let outcome = bed.restore(&photo, &Changed { about: &ABOUT, reference, change: tint });
    assert_eq!((outcome.verdict, outcome.method), (Verdict::Replaced, "digital"));
    assert!(outcome.reason.contains("too far in colour"), "{}", outcome.reason);
}

#[test]
fn what_the_lens_model_missed_of_its_chart_is_not_held_against_a_photo() {
    let missed = |levels: f32| {
        let calibration = Calibration { operator_error: [levels; 3], ..small().clone() };
        let mut bed = Bed::of(config::load(Path::new("small.toml")).unwrap(), &calibration);
        let photo = bed.photo();
        let outcome = bed.restore(&photo, &*method(&bed.config, Named::Digital));
        let evidence = outcome.evidence.unwrap();
        (evidence.channels[1].model_error, evidence.channels[1].over_floor())
    };
    let ((none, noises), (some, fewer)) = (missed(0.0), missed(6.0));
    assert_eq!(none, 0.0);
    assert!(some > 0.5 && fewer < noises, "{some} levels, {fewer} floors for {noises}");
}

#[test]
fn captures_of_a_panel_that_dimmed_do_not_make_the_picture_brighter() {
    let mut bed = Bed::new();
    let photo = bed.photo_of(&bed.coffee());
    let simulation = bed.config.simulation().unwrap();
    bed.witness.change_sensor(|sensor| sensor.white_share = 0.8 * simulation.sensor.white_share);
    let outcome = bed.restore(&photo, &*method(&bed.config, Named::Hybrid));
    assert_eq!(outcome.verdict, Verdict::Replaced, "{}", outcome.reason);
    assert!(outcome.reason.starts_with("the brightness of the result"), "{}", outcome.reason);
    let light = |of: &Frame<Work>| of.planes().each_ref().map(Plane::mean);
    for (delivered, photo) in light(&outcome.picture).into_iter().zip(light(&photo)) {
        assert!((delivered / photo - 1.0).abs() < 0.05, "{delivered} for {photo}");
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn the_reason_of_a_stage_speaks_of_captures_only_where_some_were_made() {
    let mut bed = Bed::new();
    let photo = bed.photo();
    let alone = bed.restore(&photo, &*method(&bed.config, Named::Digital));
    assert_eq!((alone.stage, alone.captures), (ResultStage::LensModel, 0));
    assert!(alone.reason.contains("was not photographed"), "{}", alone.reason);
    let looked = bed.restore(&photo, &*method(&bed.config, Named::Hybrid));
    assert!(looked.captures > 0 && looked.certificate.is_some(), "{}", looked.reason);
    assert!(looked.reason.contains("captures"), "{}", looked.reason);
}

#[test]
fn where_noise_hides_what_the_lens_did_a_result_that_adds_to_it_is_replaced() {
    let mut bed = Bed::new();
    let hill = |x: usize, y: usize| 120.0 + 50.0 * (0.05 * x as f32 + 0.03 * y as f32).sin();
    let scene = Frame::from_fn(|_| Plane::from_fn(bed.config.photo.size(), hill));
    let photo = bed.photo_of(&scene);
    const ABOUT: About = About { name: "waver", starts_from_lens: true };
    let reference = Box::new(TotalVariation::default());
    let outcome = bed.restore(&photo, &Changed { about: &ABOUT, reference, change: wave });
    assert_eq!(outcome.verdict, Verdict::Replaced, "{:?}", outcome.evidence);
    assert!(outcome.reason.contains("noise hides"), "{}", outcome.reason);
}

#[test]
fn a_blank_photo_is_delivered_as_it_is() {
    let mut bed = Bed::new();
    let wall = Frame::from_fn(|_| Plane::filled(bed.config.photo.size(), 90.0));
    let outcome = bed.restore(&wall, &*method(&bed.config, Named::Hybrid));
    assert_eq!((outcome.verdict, outcome.stage), (Verdict::Untouched, ResultStage::Photo));
    assert_eq!((outcome.captures, outcome.picture), (0, wall));
    assert!(outcome.reason.contains("blank"), "{}", outcome.reason);
}

#[test]
fn a_dithered_picture_is_not_called_blank() {
    let mut bed = Bed::new();
    // Ordered dither of a ramp (Bayer's matrix of two by two).
    let dot = |x: usize, y: usize| {
        let limit = [[32.0, 160.0], [224.0, 96.0]][y % 2][x % 2];
        if x as f32 > limit { 255.0 } else { 0.0 }
    };
    let dithered = Frame::from_fn(|_| Plane::from_fn(bed.config.photo.size(), dot));
    let outcome = bed.restore(&dithered, &*method(&bed.config, Named::Digital));
    assert_eq!((outcome.verdict, outcome.stage), (Verdict::Untouched, ResultStage::Photo));
    assert!(outcome.reason.contains("dithered"), "{}", outcome.reason);
    assert!(!outcome.reason.contains("blank"), "{}", outcome.reason);
}

#[test]
fn captures_are_converted_to_the_photo_s_focus() {
    // Rigs with the same seed have the same noise.
    let [mut there, mut here, mut known] = [(); 3].map(|()| Bed::new());
    let panel = Arc::clone(here.pipeline.model());
    let mut functions = panel.functions().clone();
    functions.taps.swap(0, 2);
    let at = here.config.photo_on_canvas();
    let photo = panel.with_functions(&functions).unwrap();
    let scene = here.scene();
    let shown = Frame::from_fn(|c| place_with_edges(scene.plane(c), panel.canvas(), at));
    let at_panel = here.pipeline.light_path(&mut here.rig).forward(&shown).unwrap().light;
    let mut path = there.pipeline.light_path(&mut there.rig).at_focus_of(&photo);
    let at_photo = path.forward(&shown).unwrap().light;
    let (seen, by_panel) = (photo.seen(&Channel::ALL, &shown), panel.seen(&Channel::ALL, &shown));
    let mut path = known.pipeline.light_path(&mut known.rig).at_focus_of(&photo);
    let predicted = path.forward_predicted(&shown, &seen).unwrap().light;
    for c in Channel::ALL {
        let mut off = at_photo.plane(c).clone();
        off.add_scaled(-1.0, at_panel.plane(c));
        assert!(c == Channel::Green || off.rms() > 0.1, "{c:?}: {}", off.rms());
        off.add_scaled(-1.0, seen.plane(c));
        off.add_scaled(1.0, by_panel.plane(c));
        assert!(off.rms() < 1e-3, "{c:?}: {}", off.rms());
        assert_eq!(predicted.plane(c), at_photo.plane(c));
    }
}

#[test]
fn a_refused_photo_is_returned_as_it_is() {
    let mut bed = Bed::new();
    let hybrid = method(&bed.config, Named::Hybrid);
    let sharp = bed.scene();
    let refused = bed.restore(&sharp, &*hybrid);
    assert_eq!((refused.verdict, refused.picture), (Verdict::Untouched, sharp));
    assert!(refused.reason.contains("the measured lens does not explain"), "{}", refused.reason);
}

#[test]
fn a_text_over_a_photo_is_an_outlier() {
    let mut bed = Bed::new();
    let (scene, solver) = (bed.coffee(), Digital::default());
    let photo = bed.photo_of(&scene);
    let is_ink = |x: usize, y: usize| {
        let is_inside = (64..192).contains(&x) && (58..134).contains(&y) && y % 24 < 15;
        is_inside && (x / 3 + y / 3).is_multiple_of(2)
    };
    let marked = Frame::from_fn(|c| {
        let of = |x, y| photo.plane(c).at(x, y);
        let ink = |x, y| if is_ink(x, y) { 0.5 * of(x, y) + 120.0 } else { of(x, y) };
        Plane::from_fn(bed.config.photo.size(), ink)
    });
    let outcome = bed.restore(&marked, &solver);
    assert_ne!(outcome.verdict, Verdict::Untouched, "{}", outcome.reason);
    assert!(outcome.outliers.is_some_and(|of| of.weight.at(100, 80) > 0.5));
}

#[test]
fn hot_pixels_cost_little() {
    let mut bed = Bed::new();
    let solver = Digital::default();
    let photo = bed.photo_of(&bed.coffee());
    let is_hot = |x: usize, y: usize| x % 19 == 7 && y % 17 == 5;
    let hot = Frame::from_fn(|c| {
        let light = photo.plane(c);
        Plane::from_fn(light.size(), |x, y| {
            let own = if is_hot(x, y) && x % 3 == c.index() { 90.0 } else { 0.0 };
            (light.at(x, y) + own).min(255.0)
        })
    });
    let [sound, mended] = [(&photo, 0), (&hot, 1)].map(|(photo, notes)| {
        let prepared = bed.pipeline.prepare(PhotoData::developed(photo, Channels::Colour));
        assert_eq!(prepared.notes.len(), notes, "{:?}", prepared.notes);
        bed.restore_prepared(&prepared, &solver)
    });
    assert_eq!(mended.verdict, Verdict::Sound, "{}", mended.reason);
    for c in Channel::ALL {
        let mut off = mended.picture.plane(c).clone();
        off.add_scaled(-1.0, sound.picture.plane(c));
        // Without the search for them 8 to 10 grey levels.
        assert!(off.rms() < 7.0, "{c:?}: {}", off.rms());
    }
}

#[test]
fn what_is_full_of_white_pixels_is_judged_all_the_same() {
    let mut bed = Bed::new();
    let (tone, size) = (Tone::of_curve(bed.config.photo.curve, 8), bed.config.photo.size());
    let sharp = bed.scene();
    for (what, share, noise) in [("noise", 0.0, 74.0f32), ("a sharp photo", 0.03, 0.0)] {
        let mut seed = 7u32;
        let mut next = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 16_777_216.0
        };
        let photo = Frame::from_fn(|c| {
            let seen = tone.display(c, sharp.plane(c));
            let codes = Plane::from_fn(size, |x, y| {
                let normal: f32 = (0..12).map(|_| next()).sum::<f32>() - 6.0;
                let scene = if noise > 0.0 { 128.0 } else { seen.at(x, y) };
                let code = (scene + noise * normal).round().clamp(0.0, 255.0) as u8;
                if next() < share { 255 } else { code }
            });
            tone.plane(c, &codes)
        });
        let outcome = bed.restore(&photo, &*method(&bed.config, Named::Hybrid));
        assert_eq!(outcome.verdict, Verdict::Untouched, "{what}: {}", outcome.reason);
    }
}

#[test]
fn each_method_has_the_name_by_which_a_rig_file_selects_it() {
    let rig = config::load(Path::new("small.toml")).unwrap();
    for which in Named::ALL {
        assert_eq!(method(&rig, which).name(), which.name());
    }
}
