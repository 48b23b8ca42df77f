//! What is tried for the chart of speed against accuracy: methods, each with several settings.

use crate::config::{self, Curve};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::Strength;
use crate::deconvolution::method::averaging::Averaged;
use crate::deconvolution::method::digital::{Colours, Digital};
use crate::deconvolution::method::paper::{Backward, Paper};
use crate::deconvolution::method::residual::Residual;
use crate::deconvolution::method::richardson_lucy::RichardsonLucy;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::deconvolution::method::unmatched::Unmatched;
use crate::deconvolution::method::wiener::Wiener;
use crate::deconvolution::patches::PatchShape;
use crate::pipeline::{Setting, counted, digital, hybrid, method, paper};

/// The family of what the rig file has.
pub const FILED: &str = "as filed";
/// The family of programs from outside, whose rows are taken into a chart.
pub const OUTSIDE: &str = "scikit-image";

/// A method with one setting.
pub struct Contestant {
    /// The method's family: its colour in the chart.
    pub family: &'static str,
    /// Which line of the chart it lies on in its family: settings that differ in one number alone.
    /// Empty where it lies on none.
    pub line: String,
    /// What sets it apart in its family.
    pub setting: String,
    /// The method.
    pub method: Box<dyn Method + Send + Sync>,
    /// Whether it is the paper's own setting, marked in the chart.
    pub printed: bool,
}

impl Contestant {
    /// A `method`, with what sets it apart in its `family`.
    pub fn new(
        family: &'static str,
        setting: &str,
        method: impl Method + Send + Sync + 'static,
    ) -> Self {
        Contestant::boxed(family, setting, Box::new(method))
    }

    /// [`Contestant::new`] of a boxed method.
    pub fn boxed(
        family: &'static str,
        setting: &str,
        method: Box<dyn Method + Send + Sync>,
    ) -> Self {
        let (line, setting) = (String::new(), setting.to_owned());
        Contestant { family, line, setting, method, printed: false }
    }

    /// The same on a line of its family.
    #[must_use]
    pub fn on(self, line: impl Into<String>) -> Self {
        Contestant { line: line.into(), ..self }
    }

    /// The words of its rows.
    pub fn name(&self) -> String {
        name(self.family, &self.setting)
    }
}

/// A contestant's name by its family and setting.
pub(super) fn name(family: &str, setting: &str) -> String {
    match setting {
        "" => family.to_owned(),
        setting => format!("{family}, {setting}"),
    }
}

/// All that are tried on `rig`; fewer when it must be `quick`.
pub(super) fn contestants(rig: &config::RigFile, quick: bool) -> Vec<Contestant> {
    let mut all = papers(rig, quick);
    all.extend(captures_only(rig, quick));
    all.extend(lens_alone(rig));
    all.extend(lens_and_captures(rig, quick));
    all.extend(usual(quick));
    let named = method(rig, rig.restore.method);
    let name = named.name();
    all.push(Contestant::boxed(FILED, name, named));
    all
}

/// The first of two lists when it must be `quick`.
fn either<T: Copy>(quick: bool, few: &[T], many: &[T]) -> Vec<T> {
    if quick { few } else { many }.to_vec()
}

/// The paper's loop.
fn papers(rig: &config::RigFile, quick: bool) -> Vec<Contestant> {
    let printed = paper(rig);
    let mut all = Vec::new();
    for iterations in either(quick, &[3, 11], &[1, 2, 3, 5, 8, 11, 16]) {
        let setting = counted(iterations as usize, "iteration");
        let solver = Paper { iterations, ..printed };
        all.push(Contestant {
            printed: iterations == printed.iterations,
            ..Contestant::new("paper", &setting, solver).on("iterations")
        });
    }
    if !quick {
        for patch_px in [rig.paper.patch_px / 2, rig.paper.patch_px * 2] {
            let backward = Backward::Light(PatchShape { patch_px, margin_px: rig.paper.margin_px });
            let setting = format!("patch {patch_px} px");
            all.push(Contestant::new("paper", &setting, Paper { backward, ..printed }));
        }
        let averaged = Averaged { method: Box::new(printed), times: 4 };
        all.push(Contestant::new("paper", "each capture 4 times", averaged));
    }
    all
}

/// The methods that go by captures at every step.
fn captures_only(rig: &config::RigFile, quick: bool) -> Vec<Contestant> {
    let strength = digital(rig).strength;
    let (levels, cycle_spun) = (rig.restore.levels, rig.restore.cycle_spun);
    let patches = PatchShape { patch_px: rig.paper.patch_px, margin_px: rig.paper.margin_px };
    let mut all = Vec::new();
    for iterations in either(quick, &[5], &[1, 2, 3, 5, 8]) {
        let strength = Strength { at_one_grey_level: 3.0 * strength.at_one_grey_level };
        let residual = Residual { iterations, strength, patches, levels, cycle_spun };
        let setting = counted(iterations as usize, "iteration");
        all.push(Contestant::new("residual", &setting, residual).on("iterations"));
    }
    for iterations in either(quick, &[11], &[3, 6, 11, 20]) {
        let unmatched = Unmatched { iterations, strength, levels, cycle_spun };
        let setting = format!("{iterations} captures");
        all.push(Contestant::new("unmatched", &setting, unmatched).on("captures"));
    }
    all
}

/// The measured lens alone.
fn lens_alone(rig: &config::RigFile) -> Vec<Contestant> {
    let filed = digital(rig);
    let of = |steps| {
        Contestant::new("digital", &format!("{steps} steps"), Digital { steps, ..filed })
            .on("steps")
    };
    let mut all: Vec<Contestant> = [2, 4, 8, 16, 32, 64].map(of).into();
    let still = Digital { cycle_spun: false, ..filed };
    all.push(Contestant::new("digital", "not spun", still));
    if rig.photo.curve == Curve::Srgb {
        let apart = Digital { colours: Colours::Apart, ..filed };
        all.push(Contestant::new("digital", "colours apart", apart));
    }
    all
}

/// The measured lens, corrected by captures, without block matching and with it.
fn lens_and_captures(rig: &config::RigFile, quick: bool) -> Vec<Contestant> {
    let of = |set: Setting| Contestant::boxed(set.method.name(), &set.numbers(), set.method(rig));
    // Steps change along a line, or rounds; captures do from line to line.
    let by_captures = |set: Setting| of(set).on(counted(set.captures_max as usize, "capture"));
    let mut all = Vec::new();
    let filed = Setting::as_filed(rig, config::MethodName::Hybrid);
    let steps = [(4, 2), (8, 2), (16, 4), (32, 8)];
    for captures_max in [1, 2] {
        for (steps, correction_steps) in steps {
            all.push(by_captures(Setting { captures_max, steps, correction_steps, ..filed }));
        }
    }
    let most = Setting { captures_max: 4, steps: 64, correction_steps: 30, ..filed };
    all.extend([of(Setting { captures_max: 4, ..filed }), of(most)]);
    let averaged = Averaged { method: Box::new(hybrid(rig)), times: 4 };
    all.push(Contestant::new("hybrid", "each capture 4 times", averaged));
    let filed = Setting::as_filed(rig, config::MethodName::BlockMatching);
    for rounds in either(quick, &[1, 8], &[1, 2, 4, 8, 12, 16]) {
        all.push(by_captures(Setting { rounds, captures_max: 0, ..filed }));
    }
    for captures_max in [1, 2] {
        for rounds in either(quick, &[1, 8], &[1, 2, 4, 8, 12]) {
            all.push(by_captures(Setting { rounds, captures_max, ..filed }));
        }
    }
    for (steps, correction_steps) in [(4, 2), (8, 4)] {
        all.push(of(Setting { steps, correction_steps, rounds: 1, captures_max: 1, ..filed }));
    }
    all
}

/// What people use today.
fn usual(quick: bool) -> Vec<Contestant> {
    let mut all = Vec::new();
    for noise_to_signal in [0.003, 0.01, 0.03] {
        let setting = format!("noise to signal {noise_to_signal}");
        all.push(Contestant::new("wiener", &setting, Wiener { noise_to_signal }));
    }
    for steps in either(quick, &[20], &[5, 10, 20, 40]) {
        let setting = format!("{steps} steps");
        all.push(
            Contestant::new("richardson-lucy", &setting, RichardsonLucy { steps }).on("steps"),
        );
    }
    for (steps, at_one_grey_level) in
        either(quick, &[(40, 0.3)], &[(20, 0.3), (40, 0.3), (40, 0.15), (40, 0.6), (80, 0.3)])
    {
        let setting = format!("{steps} steps, strength {at_one_grey_level}");
        let strength = Strength { at_one_grey_level };
        let line = format!("strength {at_one_grey_level}");
        let solver = TotalVariation { steps, strength };
        all.push(Contestant::new("total-variation", &setting, solver).on(line));
    }
    all
}
