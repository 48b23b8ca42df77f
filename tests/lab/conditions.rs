//! Comparison of the methods, with their filed settings, under the study's conditions.

use relens::chart::contestants::Contestant;
use relens::chart::scenes::Scene;
use relens::chart::test_rig::TestRig;
use relens::chart::trade::Trade;
use relens::config::{Curve, MethodName, RigFile};
use relens::deconvolution::method::hybrid::Hybrid;
use relens::deconvolution::method::paper::{Backward, Paper};
use relens::deconvolution::patches::PatchShape;
use relens::pipeline::{hybrid, method, paper};

use crate::change::{Change, NO_NOISE, NOTHING, ONE_FUNCTION, VEIL};
use crate::made::Made;
use crate::{Failure, report, seconds};

/// A condition of the study.
struct Condition {
    slug: &'static str,
    change: &'static Change,
    strength: f64,
}

const CONDITIONS: [Condition; 4] = [
    Condition { slug: "no-noise", change: &NO_NOISE, strength: 0.0 },
    Condition { slug: "noise", change: &NOTHING, strength: 0.0 },
    Condition { slug: "glare", change: &VEIL, strength: 10.0 },
    Condition { slug: "one-function", change: &ONE_FUNCTION, strength: 0.0 },
];

/// Methods that a rig file can name; only those that start from the lens model if `by_the_lens`.
fn named(by_the_lens: bool) -> impl Iterator<Item = MethodName> {
    use MethodName::{BlockMatching, Digital, Hybrid};
    let all = MethodName::ALL.into_iter();
    all.filter(move |name| !by_the_lens || matches!(name, Digital | Hybrid | BlockMatching))
}

/// A table for each condition; a rig whose photos are not linear is measured as it is, in colour.
/// `quick` leaves out the chart or, in colour, the methods that do not start from the lens model.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let mut made = Made::default();
    if rig.photo.curve != Curve::Linear {
        let contestants = named(quick).map(|which| as_filed(rig, which)).collect();
        let caption =
            format!("Rig {}, {}; luminance of display values.", rig.name, rig.photo.size());
        let trade = compare(rig.clone(), &Scene::ALL, contestants)?;
        return Ok(Made::table(rig.name.clone(), trade.score_table(caption)));
    }
    let scenes = [Scene::Astronaut, Scene::Coffee, Scene::Chart];
    let scenes = if quick { &scenes[..2] } else { &scenes };
    for condition in &CONDITIONS {
        let Condition { slug, change, strength } = condition;
        let trade = compare(change.filed(rig, *strength), scenes, contestants(rig, slug))?;
        let words = change.words(*strength);
        let caption = format!("Rig {}; {words}; green channel, light.", rig.name);
        made.tables.push((format!("{}-{slug}", rig.name), trade.score_table(caption)));
    }
    Ok(made)
}

fn as_filed(rig: &RigFile, which: MethodName) -> Contestant {
    let method = method(rig, which);
    let [family, line, setting] = [which.name(), "", ""].map(str::to_owned);
    Contestant { family, line, setting, is_filed: false, method }
}

/// Methods compared under a condition.
fn contestants(rig: &RigFile, slug: &str) -> Vec<Contestant> {
    let named = named(!slug.ends_with("noise"));
    let mut all: Vec<Contestant> = named.map(|which| as_filed(rig, which)).collect();
    match slug {
        "no-noise" => {
            all.push(Contestant::new("paper", "", "one whole-frame patch", whole_frame(rig)));
        }
        "noise" => all.push(Contestant::new("paper", "", "margin 0", without_margin(rig))),
        _ => {}
    }
    if slug != "no-noise" {
        all.push(Contestant::new("hybrid", "", "1 capture", one_capture(rig)));
    }
    all
}

/// `contestants` on `scenes`, one photo each.
fn compare(rig: RigFile, scenes: &[Scene], contestants: Vec<Contestant>) -> Result<Trade, Failure> {
    let mut test_rig = TestRig::open(rig, seconds)?;
    let mut trade = Trade::default();
    for contestant in &contestants {
        trade.run(&mut test_rig, scenes, 1, contestant, &mut report)?;
    }
    Ok(trade)
}

/// The paper's loop, unbounded, with one patch for the whole frame, where flip–FC–flip is no
/// adjoint.
pub(crate) fn whole_frame(rig: &RigFile) -> Paper {
    let patch_px = rig.photo.width_px.max(rig.photo.height_px);
    let shape = PatchShape { patch_px, margin_px: rig.paper.margin_px };
    Paper { backward: Backward::Light(shape), bounded: false, ..paper(rig) }
}

/// The paper's loop without margins around patches.
fn without_margin(rig: &RigFile) -> Paper {
    let shape = PatchShape { patch_px: rig.paper.patch_px, margin_px: 0 };
    Paper { backward: Backward::Light(shape), ..paper(rig) }
}

/// `hybrid` with one capture, which corrects the result but does not certify it.
pub(crate) fn one_capture(rig: &RigFile) -> Hybrid {
    Hybrid { captures_max: 1, ..hybrid(rig) }
}
