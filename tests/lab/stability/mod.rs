//! The stability sweep: every method under every fault, in growing strengths, and how much of the
//! harm is noticed.
//!
//! The rig is calibrated without the fault, which is then made to the rig, the photo or the method.
//! Imperfections of the rig itself ([`crate::truths`]) are present at calibration. The limits of
//! judging were set on whole scenes; the sweep takes quarters of two of them, with other seeds. It
//! set only the limits on what no scene gives (`tests/tables/judging.md`).

mod cells;
pub(crate) mod kept;
mod map;
pub(crate) mod report;
pub(crate) mod sweep;

use std::path::Path;

use relens::chart::scenes::Scene;
use relens::config::RigFile;

use crate::Failure;
use crate::change::{SWEPT, Swept};
use crate::likeness::{HARM, HARM_IN_COLOUR};
use crate::made::Made;
use crate::truths::TRUTHS;
use crate::view::View;
use cells::Sense;
use kept::Kept;
use report::{harm_table, rates_table};
use sweep::{Found, METHODS, Plan, Run, sweep};

/// Scenes whose quarters set no limit.
const HELD_OUT: [Scene; 2] = [Scene::Astronaut, Scene::Rocket];
/// Quarters of both scenes, alternating.
const VIEWS: [View; 8] = {
    let mut views = [View::quarter(HELD_OUT[0], 0); 8];
    let mut n = 0;
    while n < views.len() {
        views[n] = View::quarter(HELD_OUT[n % 2], n / 2);
        n += 1;
    }
    views
};
/// Seeds that set no limit: of the sweep, and of more results without a fault.
const SEEDS: [u64; 2] = [2, 3];

/// All faults: noise, imperfections of the rig, what goes wrong later.
pub(crate) fn all_swept() -> Vec<&'static Swept> {
    let (noise, wrong) = SWEPT.split_at(1);
    noise.iter().chain(&TRUTHS).chain(wrong).collect()
}

/// Tables and map of the stored results `kept`, without solving.
pub(crate) fn redrawn(rig: &RigFile, kept: &str) -> Made {
    made(rig, &kept::parsed(kept))
}

/// Sweeps the simulated rig `rig`; `quick` takes one strength of each fault and some of the views,
/// and omits the paper's method. An interrupted sweep into `out` is continued.
pub(crate) fn run(rig: &RigFile, quick: bool, out: &Path) -> Result<Made, Failure> {
    let swept = all_swept();
    // The paper's method takes as long as all others, and harms without a fault.
    let without_paper = &METHODS[1..];
    let plan = Plan {
        swept: &swept,
        steps: if quick { &[0, 3] } else { &[0, 1, 2, 3, 4] },
        methods: without_paper,
        views: if quick { &VIEWS[..2] } else { &VIEWS[..4] },
        seed: SEEDS[0],
    };
    let kept = &mut Kept::open(&out.join(format!("{}-stability-runs.csv", rig.name)))?;
    let mut found = sweep(rig, &plan, kept)?;
    if !quick {
        let paper = Plan { methods: &METHODS[..1], steps: &[0, 3], ..plan };
        found.runs.extend(sweep(rig, &paper, kept)?.runs);
    }
    let healthy = Plan {
        swept: &swept[..1],
        steps: &[0],
        methods: without_paper,
        views: &VIEWS,
        seed: SEEDS[1],
    };
    found.runs.extend(sweep(rig, &healthy, kept)?.runs);
    // A rate of one in a hundred needs some hundreds of results of the default method.
    for seed in (SEEDS[1] + 1..).take(if quick { 5 } else { 40 }) {
        let more = Plan { methods: &["hybrid"], seed, ..healthy };
        found.runs.extend(sweep(rig, &more, kept)?.runs);
    }
    Ok(made(rig, &found))
}

/// Tables and map of the results `found`.
fn made(rig: &RigFile, found: &Found) -> Made {
    let swept: Vec<Run> = found.runs.iter().filter(|run| run.seed == SEEDS[0]).cloned().collect();
    let cells = cells::cells(&swept, rig);
    let stem = |what: &str| format!("{}-stability{what}", rig.name);
    let views = VIEWS.iter().filter(|view| swept.iter().any(|run| run.view == **view));
    let names: Vec<String> = views.map(|view| view.name()).collect();
    let about = format!("rig {}, mean of {}", rig.name, names.join(" and "));
    let harm = |sense: Sense| {
        let begins = match sense {
            Sense::Luma => format!("SSIM more than {HARM} below"),
            Sense::Colour => format!("a mean ΔE (CIEDE2000) more than {HARM_IN_COLOUR} above"),
        };
        let caption = format!(
            "Strength at which a method begins to do harm: {begins} the untouched photo's; \
             {about}. In brackets: how many of the harmful results at that strength the box \
             noticed. A dash: the fault does not concern the method. The paper's method is tried \
             at the fourth strength."
        );
        harm_table(caption, &cells, found, sense)
    };
    let rates = format!(
        "Rates of wrong verdicts, rig {}. Its views and seeds set no limit but those on what no \
         scene gives. Healthy: harmless results without a fault, from {} views and more seeds than \
         in the map. False alarms: healthy results that were replaced; costly: by something less \
         good. Harmful: results worse than the photo in luma, in the last columns in colour. By \
         lens alone, by the photo: what replaced the harmful results that were noticed. Gain given \
         up: harmless results under a fault that were replaced by something less good.",
        rig.name,
        VIEWS.len()
    );
    let title = format!("Where methods harm, and what is noticed, rig {}", rig.name);
    Made {
        drawings: vec![(stem(""), map::draw(&cells, &title))],
        tables: vec![
            (stem(""), harm(Sense::Luma)),
            (stem("-colour"), harm(Sense::Colour)),
            (stem("-rates"), rates_table(rates, &found.runs)),
        ],
        ..Made::default()
    }
}
