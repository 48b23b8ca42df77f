//! Light scattered beyond the lens functions, against the simulator's truth.

use relens::config::{self, Kind};
use relens::frame::Channel;
use relens::rig::simulated::{self, Light, Witness};

use crate::{load, measured};

/// Share of a Gaussian's light within a square of `side` pixels around its centre.
fn within(side: usize, radius_px: f64) -> f64 {
    let bell = |t: f64| (-0.5 * (t / radius_px).powi(2)).exp();
    let half = side as i32 / 2;
    let inside: f64 = (-half..=half).map(|t| bell(f64::from(t))).sum();
    let reach = (8.0 * radius_px) as i32;
    let all: f64 = (-reach..=reach).map(|t| bell(f64::from(t))).sum();
    (inside / all).powi(2)
}

/// Number of points along each side of the photo at which functions are compared.
const ALONG: usize = 6;

/// Share of a channel's light that falls outside the measured functions, mean over the photo.
fn beyond(rig: &config::RigFile, witness: &Witness, channel: Channel) -> f64 {
    let side = rig.calibration.function_support_px;
    let glare = rig.simulation().unwrap().glare;
    let (photo, mut kept) = (rig.photo_on_sensor(), 0.0);
    for n in 0..ALONG * ALONG {
        let at = |k: usize, from: usize, length: usize| {
            from as f64 + length as f64 * (k as f64 + 0.5) / ALONG as f64 - 0.5
        };
        let place =
            [at(n % ALONG, photo.x, photo.size.width), at(n / ALONG, photo.y, photo.size.height)];
        let function = witness.function(Light::Panel, channel, place);
        let skip = (function.width().saturating_sub(side)) / 2;
        let rows = skip..(skip + side).min(function.height());
        let inside =
            |y: usize| function.row(y)[rows.clone()].iter().map(|&v| f64::from(v)).sum::<f64>();
        kept += rows.clone().map(inside).sum::<f64>() / (ALONG * ALONG) as f64;
    }
    let share = f64::from(glare.share);
    1.0 - (1.0 - share) * kept - share * within(side, f64::from(glare.radius_px))
}

/// Checks that the light measured beyond the functions is right to within a hundredth of all light.
fn check_scatter(rig: &config::RigFile) {
    let (_, witness) = simulated::open(rig).unwrap();
    let calibration = measured(rig).unwrap();
    for (c, found) in Channel::ALL.into_iter().zip(calibration.scattered()) {
        let (truth, halos) = (beyond(rig, &witness, c), &calibration.broad[c.index()]);
        let glare = rig.simulation().unwrap().glare;
        println!(
            "{}, {glare:?}: {} {found:.4} of {truth:.4} beyond, {halos:.4?}, operator error {:.2}",
            rig.name,
            c.name(),
            calibration.operator_error[c.index()]
        );
        assert!((f64::from(found) - truth).abs() <= 0.01, "{c:?}: {found} of {truth}");
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn measured_broad_light_equals_the_lens_s_scatter() {
    // Without and with colour filters.
    check_scatter(&load("small.toml"));
    check_scatter(&load("truthful.toml"));
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn broad_light_of_other_lenses_is_measured_behind_filters() {
    for (seed, share, radius_px) in [(1, 0.0, 15.0), (3, 0.06, 30.0), (4, 0.1, 15.0)] {
        let mut rig = load("truthful.toml");
        let Kind::Simulated(simulation) = &mut rig.kind else { panic!("a simulated rig") };
        simulation.seed = seed;
        let glare = &mut simulation.glare;
        (glare.share, glare.radius_px) = (share, radius_px);
        check_scatter(&rig);
    }
}
