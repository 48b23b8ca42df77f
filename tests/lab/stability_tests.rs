//! Tests that no harm is done: whatever is wrong, the delivered picture is no worse than the photo,
//! or is the photo. They use the small rig, with scenes and seeds on which no limit was set.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use relens::chart::scenes::Scene;
use relens::pipeline::Verdict;

use crate::change::{SWEPT, Swept};
use crate::likeness::Likeness;
use crate::stability::all_swept;
use crate::stability::kept::Kept;
use crate::stability::report::rates_table;
use crate::stability::sweep::{Plan, Run, sweep};
use crate::view::{Subject, View};

/// The swept change called `name`.
fn swept(name: &str) -> &'static Swept {
    all_swept().into_iter().find(|swept| swept.change.name == name).unwrap()
}

fn runs(
    swept: &'static Swept,
    steps: &[usize],
    methods: &[&'static str],
    views: &[View],
    seed: u64,
) -> Vec<Run> {
    let plan = Plan { swept: &[swept], steps, methods, views, seed };
    sweep(&crate::rig("small.toml").unwrap(), &plan, &mut Kept::default()).unwrap().runs
}

fn words(runs: &[Run]) -> Vec<String> {
    runs.iter().map(Run::words).collect()
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn healthy_results_are_delivered() {
    let views = [View::whole(Scene::Astronaut), View::quarter(Scene::Rocket, 2)];
    let methods = ["hybrid", "digital", "total-variation"];
    let runs = runs(swept("panel knocked"), &[0], &methods, &views, 11);
    assert!(runs.iter().all(|r| !r.harms() && !r.verdict.noticed()), "{:#?}", words(&runs));
}

#[test]
fn the_paper_s_loop_is_replaced_where_its_noise_harms() {
    let views = [View::whole(Scene::Astronaut)];
    let runs = runs(swept("capture noise"), &[3], &["paper"], &views, 12);
    assert!(runs.iter().all(|r| r.harms() && r.verdict.noticed()), "{:#?}", words(&runs));
    assert!(runs.iter().all(|r| r.delivered.ssim > r.photo.ssim), "{:#?}", words(&runs));
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn faults_at_random_do_no_harm() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(21_112_026);
    let mut all = Vec::new();
    for seed in 13..17 {
        let fault = &SWEPT[random.random_range(0..SWEPT.len())];
        let step = random.random_range(1..5);
        let scene = [Scene::Astronaut, Scene::Rocket][random.random_range(0..2)];
        let quarter = random.random_bool(0.5).then(|| random.random_range(0..4));
        let view = View { subject: Subject::Of(scene), quarter };
        all.extend(runs(fault, &[step], &["hybrid", "wiener"], &[view], seed));
    }
    assert!(!all.iter().any(Run::harms_delivered), "{:#?}", words(&all));
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_jpeg_is_restored_with_the_errors_of_its_coding_in_mind() {
    let views = [View::whole(Scene::Astronaut), View::quarter(Scene::Rocket, 1)];
    // Qualities 95, 85 and 70.
    let runs = runs(swept("photo's JPEG"), &[1, 2, 3], &["hybrid", "digital"], &views, 18);
    assert!(runs.iter().all(|r| !r.harms_delivered()), "{:#?}", words(&runs));
    let gain = |runs: &[Run]| {
        runs.iter().map(|r| r.delivered.ssim - r.photo.ssim).sum::<f64>() / runs.len() as f64
    };
    assert!(gain(&runs) > 0.03, "{:#?}", words(&runs));
}

#[test]
fn no_change_counts_once_in_the_rates() {
    // One harmful result without a change; it is noticed, and listed under two changes.
    let run = |swept| Run {
        swept,
        strength: 0.0,
        step: 0,
        method: "paper",
        view: View::whole(Scene::Astronaut),
        seed: 1,
        photo: Likeness { ssim: 0.9, difference: Some(2.0) },
        result: Likeness { ssim: 0.5, difference: Some(2.1) },
        verdict: Verdict::Replaced,
        delivered: Likeness { ssim: 0.95, difference: Some(1.0) },
    };
    let table = rates_table(String::new(), &[run(&SWEPT[0]), run(&SWEPT[1])]);
    assert_eq!(table.rows[0][..9].join(" "), "paper 1 0 – – 1 1 (100.0 %) 1 0");
    assert_eq!(table.rows[0][11..].join(" "), "1 1 (100.0 %) 0 (0.0 %)");
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn rigs_that_are_truthful_do_no_harm() {
    let views = [View::whole(Scene::Astronaut), View::quarter(Scene::Rocket, 1)];
    for (truth, step) in
        [("filters; photo raw", 1), ("uneven panel", 4), ("wander and vibration", 2)]
    {
        let runs = runs(swept(truth), &[step], &["hybrid"], &views, 19);
        assert_eq!(runs.len(), 2);
        assert!(runs.iter().all(|r| !r.delivered.harms(r.photo)), "{:#?}", words(&runs));
    }
}

#[test]
fn results_of_a_sweep_that_was_cut_off_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("runs.csv");
    let [one, other] = [0, 1].map(|n| View::quarter(Scene::Rocket, n));
    let panel = swept("uneven panel");
    let of = |view, difference| Run {
        swept: panel,
        strength: 10.0,
        step: 2,
        method: "hybrid",
        view,
        seed: 5,
        photo: Likeness { ssim: 0.9, difference },
        result: Likeness { ssim: 0.95, difference },
        verdict: Verdict::Sound,
        delivered: Likeness { ssim: 0.95, difference },
    };
    let both = [of(one, Some(2.5)), of(other, None)];
    let swept = [panel];
    let plan =
        Plan { swept: &swept, steps: &[2], methods: &["hybrid"], views: &[one, other], seed: 5 };
    Kept::open(&file).unwrap().keep(&both).unwrap();
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 3]).unwrap();
    // The second line is cut in its last word, so its result is to be run again.
    let mut kept = Kept::open(&file).unwrap();
    assert_eq!(words(&kept.of(&plan, panel, 2)), words(&both[..1]));
    kept.keep(&both[1..]).unwrap();
    assert_eq!(words(&Kept::open(&file).unwrap().of(&plan, panel, 2)), words(&both));
}

#[test]
fn every_fault_has_a_name_of_its_own_that_fits_a_line_of_values() {
    let mut names: Vec<&str> = all_swept().iter().map(|swept| swept.change.name).collect();
    assert!(names.iter().all(|name| !name.contains([',', '"'])));
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
}
