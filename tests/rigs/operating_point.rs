//! The operating point chosen with scenes shown on the panel is good for photos.

use std::sync::Arc;

use relens::chart::operating_point::{choose, restorations};
use relens::chart::scenes::Scene;
use relens::chart::test_rig::TestRig;
use relens::config::OperatingPoint;
use relens::pipeline::Setting;
use relens::rig::simulated;

use crate::{load, measured};

/// A stopped clock, so that the cost of a setting is its captures alone.
fn no_clock() -> f64 {
    0.0
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn an_operating_point_chosen_with_shown_scenes_is_good_for_photos() {
    let rig = load("small.toml");
    // A test rig without access to the simulator's truth.
    let on_small = || {
        let (devices, witness) = simulated::open(&rig).unwrap();
        let calibration = measured(&rig).unwrap();
        (TestRig::on(rig.clone(), devices, &calibration, no_clock).unwrap(), witness)
    };
    let (mut test_rig, _) = on_small();
    let mut tried = 0;
    let best =
        choose(&mut test_rig, OperatingPoint::Best, &mut |_, _| tried += 1).unwrap().unwrap();
    assert_eq!(tried, restorations(&rig, OperatingPoint::Best));
    assert!(best.ssim == best.best_ssim && best.ssim > best.photo_ssim + 0.02, "{best}");
    let fast = choose(&mut test_rig, OperatingPoint::Fast, &mut |_, _| {}).unwrap().unwrap();
    // Block matching in many rounds is a candidate for `Best` only.
    assert!(
        fast.ssim >= fast.best_ssim - 0.01 && fast.best_ssim <= best.best_ssim,
        "{fast}; {best}"
    );
    assert!(fast.seconds <= best.seconds, "{fast}; {best}");

    let (test_rig, witness) = on_small();
    let mut test_rig = test_rig.witnessed(Arc::new(witness));
    let filed = Setting::as_filed(&rig, rig.restore.method);
    let mut mean = |setting: &Setting| {
        let ssim = |scene| test_rig.score(scene, 0, &*setting.method(&rig)).unwrap().result.ssim;
        Scene::STUDY_PHOTOGRAPHS.map(ssim).iter().sum::<f64>() / 2.0
    };
    let (of_best, of_fast, of_filed) = (mean(&best.setting), mean(&fast.setting), mean(&filed));
    assert!(of_best > of_filed - 0.002, "best {of_best:.4}, as filed {of_filed:.4}");
    assert!(of_fast > of_filed - 0.012, "fast {of_fast:.4}, as filed {of_filed:.4}");
}
