//! No harm: whatever is wrong, what is delivered is no worse than the photo, or is the photo. On
//! the small simulated rig, with scenes and seeds that no limit was set on.

// A failed unwrap is a failed test, also in the functions the tests share.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use relens::config;
use relens::evaluate::scenes::Scene;
use relens::evaluate::stability::contestant::Contestant;
use relens::evaluate::stability::fault::Fault;
use relens::evaluate::stability::report::Rates;
use relens::evaluate::stability::sweep::{Plan, Run, sweep};
use relens::evaluate::stability::view::View;

const DEFAULT: Contestant = Contestant::Named(config::Method::Hybrid);
const PAPER: Contestant = Contestant::Named(config::Method::Paper);
const WIENER: Contestant = Contestant::Named(config::Method::Wiener);

fn swept(
    faults: &[Fault],
    steps: &[usize],
    contestants: &[Contestant],
    views: &[View],
    seed: u64,
) -> Vec<Run> {
    let rig = config::load(Path::new("small.toml")).unwrap();
    sweep(&rig, &Plan { faults, steps, contestants, views, seed }, || 0.0, &mut |_| {}).unwrap()
}

fn told(runs: &[Run]) -> Vec<String> {
    let about = |r: &Run| {
        let (fault, method, view) = (r.fault.name().0, r.contestant.name(), r.view.name());
        format!(
            "{fault} {}, {method}, {view}: {:.4}, photo {:.4}, delivered {:.4}, {:?}",
            r.strength, r.ssim, r.photo_ssim, r.delivered_ssim, r.verdict
        )
    };
    runs.iter().map(about).collect()
}

#[test]
fn healthy_results_are_delivered() {
    let views = [View::whole(Scene::Astronaut), View::quarter(Scene::Rocket, 2)];
    let methods = [DEFAULT, Contestant::Named(config::Method::Digital), Contestant::TotalVariation];
    let runs = swept(&[Fault::Shift], &[0], &methods, &views, 11);
    assert!(runs.iter().all(|r| !r.harms() && !r.verdict.noticed()), "{:#?}", told(&runs));
}

#[test]
fn the_paper_s_loop_is_replaced_where_its_noise_harms() {
    let runs = swept(&[Fault::CaptureNoise], &[3], &[PAPER], &[View::whole(Scene::Astronaut)], 12);
    assert!(runs.iter().all(|r| r.harms() && r.verdict.noticed()), "{:#?}", told(&runs));
    assert!(runs.iter().all(|r| r.delivered_ssim > r.photo_ssim), "{:#?}", told(&runs));
}

#[test]
fn faults_at_random_do_no_harm() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(21_112_026);
    let mut runs = Vec::new();
    for seed in 13..17 {
        let fault = Fault::ALL[random.random_range(0..Fault::ALL.len())];
        let step = random.random_range(1..5);
        let scene = [Scene::Astronaut, Scene::Rocket][random.random_range(0..2)];
        let view =
            View { scene, quarter: random.random_bool(0.5).then(|| random.random_range(0..4)) };
        runs.extend(swept(&[fault], &[step], &[DEFAULT, WIENER], &[view], seed));
    }
    let rates = Rates::of(runs.iter());
    assert_eq!(rates.harm_delivered, 0, "{:#?}", told(&runs));
}

#[test]
fn a_jpeg_is_restored_with_the_errors_of_its_coding_in_mind() {
    let views = [View::whole(Scene::Astronaut), View::quarter(Scene::Rocket, 1)];
    let methods = [DEFAULT, Contestant::Named(config::Method::Digital)];
    // Qualities 95, 85 and 70.
    let runs = swept(&[Fault::Jpeg], &[1, 2, 3], &methods, &views, 18);
    assert!(runs.iter().all(|r| !r.harms_delivered()), "{:#?}", told(&runs));
    let gain = |runs: &[Run]| {
        runs.iter().map(|r| r.delivered_ssim - r.photo_ssim).sum::<f64>() / runs.len() as f64
    };
    assert!(gain(&runs) > 0.03, "{:#?}", told(&runs));
}
