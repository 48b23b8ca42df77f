//! Where methods fail, and who notices: every method under every change, in growing strengths.
//!
//! The rig is calibrated while it is healthy; then the change is made to it, to the photo or to the
//! method. The limits by which the box notices ([`relens::pipeline::Verdict`]) were set on whole
//! scenes; here quarters of two of them are used, with other seeds.

mod map;
pub(crate) mod report;
pub(crate) mod sweep;

use relens::chart::scenes::Scene;
use relens::config::RigFile;

use crate::Failure;
use crate::change::SWEPT;
use crate::made::Made;
use crate::view::View;
use report::{cells, cells_table, harm_table, rates_table};
use sweep::{METHODS, Plan, sweep};

/// Scenes whose quarters no limit was set on.
const HELD_OUT: [Scene; 2] = [Scene::Astronaut, Scene::Rocket];
/// Seeds that no limit was set on: of the sweep, and of more results without a change.
const SEEDS: [u64; 2] = [2, 3];

/// The map of cells that were kept before, drawn anew; nothing is measured.
pub(crate) fn redrawn(rig: &RigFile, cells: &str) -> Result<Made, Failure> {
    let drawing = map::draw(&report::kept(cells)?, &title(rig));
    Ok(Made { drawings: vec![(format!("{}-stability", rig.name), drawing)], ..Made::default() })
}

fn title(rig: &RigFile) -> String {
    format!("Where methods harm, and who notices, on rig {}", rig.name)
}

/// Sweeps the simulated rig of `rig`; `quick` takes one strength of each change and a part of the
/// views, and leaves out the paper's loop.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let quarters = |n: usize| HELD_OUT.map(|scene| View::quarter(scene, n));
    let every: Vec<View> = (0..4).flat_map(quarters).collect();
    let views = if quick { &every[..2] } else { &every[..4] };
    // The paper's loop takes as long as all the others.
    let without_paper = &METHODS[1..];
    let plan = Plan {
        swept: &SWEPT.each_ref(),
        steps: if quick { &[0, 3] } else { &[0, 1, 2, 3, 4] },
        methods: if quick { without_paper } else { &METHODS },
        views,
        seed: SEEDS[0],
    };
    let mut runs = sweep(rig, &plan)?;
    let names: Vec<String> = views.iter().map(|view| view.name()).collect();
    let about = format!("rig {}, mean of {}", rig.name, names.join(" and "));
    let cells = cells(&runs);
    let healthy = Plan {
        swept: &[&SWEPT[0]],
        steps: &[0],
        methods: without_paper,
        views: &every,
        seed: SEEDS[1],
    };
    runs.extend(sweep(rig, &healthy)?);
    // A rate of one in a hundred wants some hundreds of results of the method that is the default.
    for seed in (SEEDS[1] + 1..).take(if quick { 5 } else { 40 }) {
        runs.extend(sweep(rig, &Plan { methods: &["hybrid"], seed, ..healthy })?);
    }
    let harm = format!(
        "The strength at which a method begins to do harm: SSIM more than {} below the untouched \
         photo; {about}. In brackets: how many of the harmful results there the box noticed. A \
         dash: the fault cannot touch the method.",
        report::HARM
    );
    let rates = format!(
        "How often noticing goes wrong, rig {}; views and seeds that no limit was set on. \
         Healthy: results without a fault that do no harm; more of them than in the map, from {} \
         views and other seeds. Costly: those whose replacement was less good. By lens alone, by \
         the photo: what caught results were replaced by. Gain given up: results under a fault \
         that did no harm and were replaced by something less good.",
        rig.name,
        every.len()
    );
    let stem = |what: &str| format!("{}-stability{what}", rig.name);
    Ok(Made {
        drawings: vec![(stem(""), map::draw(&cells, &title(rig)))],
        tables: vec![
            (stem(""), harm_table(harm, &cells)),
            (stem("-cells"), cells_table(format!("Every strength: {about}."), &cells)),
            (stem("-rates"), rates_table(rates, &runs)),
        ],
        ..Made::default()
    })
}
