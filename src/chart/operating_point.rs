//! The operating point of a rig: the choice of a setting by scenes shown on that rig.

use super::contestants::{Contestant, distinct};
use super::scenes::Scene;
use super::test_rig::{Score, TestRig, TestRigError};
use super::trade::{BALANCED, BEST, FAST, Measure, Trade};
use crate::config::{MethodName, OperatingPoint, RigFile};
use crate::pipeline::{Chosen, Setting};

/// Scenes shown: a portrait, a still life and a night.
const SCENES: [Scene; 3] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];

/// Rounds of block matching for the best result: a gain on small photos at four times the cost.
const MANY_ROUNDS: u32 = 8;

/// Settings tried, the rig file's first: those on or near the front of `relens chart` on every
/// simulated rig. Many rounds of block matching are tried only if the best is `wanted`.
fn candidates(rig: &RigFile, wanted: OperatingPoint) -> Vec<Setting> {
    let filed = Setting::as_filed(rig, rig.restore.method);
    let digital = |steps| Setting { method: MethodName::Digital, steps, ..filed };
    let hybrid = |steps, correction_steps, captures_max| Setting {
        method: MethodName::Hybrid,
        steps,
        correction_steps,
        captures_max,
        ..filed
    };
    let matched = Setting::as_filed(rig, MethodName::BlockMatching);
    let once = |steps, captures_max| Setting { steps, captures_max, rounds: 1, ..matched };
    let mut all = vec![filed];
    all.extend([4, 8, 16, 32].map(digital));
    all.extend([hybrid(8, 2, 1), hybrid(16, 4, 1), hybrid(16, 4, 2), hybrid(32, 8, 2)]);
    all.extend([once(16, 0), once(8, 1), once(16, 1)]);
    if wanted == OperatingPoint::Best {
        all.push(Setting { rounds: matched.rounds.max(MANY_ROUNDS), ..matched });
    }
    distinct(all)
}

/// Number of restorations that [`choose`] makes.
pub fn restorations(rig: &RigFile, wanted: OperatingPoint) -> usize {
    candidates(rig, wanted).len() * SCENES.len()
}

/// Chooses the operating point `wanted` for the rig of `test_rig`; `each` gets the name of the
/// setting and the score of every restoration. `None` if no setting was scored.
///
/// # Errors
/// When a scene cannot be shown or a capture fails.
pub fn choose(
    test_rig: &mut TestRig,
    wanted: OperatingPoint,
    each: &mut dyn FnMut(&str, &Score),
) -> Result<Option<Chosen>, TestRigError> {
    let rig = test_rig.config().clone();
    let settings = candidates(&rig, wanted);
    let mut trade = Trade::default();
    for (n, setting) in settings.iter().enumerate() {
        let contestant = Contestant { is_filed: n == 0, ..Contestant::of_setting(&rig, setting) };
        trade.run(test_rig, &SCENES, 1, &contestant, each)?;
    }
    let keeps = match wanted {
        OperatingPoint::Fast => FAST,
        OperatingPoint::Balanced => BALANCED,
        OperatingPoint::Best => BEST,
    };
    let (best, chosen) = (trade.operating_point(BEST), trade.operating_point(keeps));
    Ok(best.zip(chosen).map(|(best, n)| Chosen {
        operating_point: wanted,
        setting: settings[n],
        seconds: rounded(trade.points[n].seconds()),
        ssim: rounded(trade.points[n].ssim()),
        psnr_db: rounded(trade.points[n].psnr_db()),
        best_ssim: rounded(trade.points[best].ssim()),
        photo_ssim: rounded(trade.photo(Measure::Ssim).unwrap_or_default()),
    }))
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
