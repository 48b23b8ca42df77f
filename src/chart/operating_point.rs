//! The operating point of a rig: settings of the methods worth having, tried on scenes shown on
//! that very rig.

use super::contestants::{Contestant, FILED};
use super::scenes::Scene;
use super::test_rig::{Score, TestRig, TestRigError};
use super::trade::{BALANCED, BEST, FAST, Trade};
use crate::config::{MethodName, OperatingPoint, RigFile};
use crate::pipeline::{Chosen, Setting};

/// What is shown: photographs of a portrait, a still life and a night.
const SCENES: [Scene; 3] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];

/// Rounds of block matching that pay on small photos, and cost four times as much.
const MANY_ROUNDS: u32 = 8;

/// The settings tried for what is `wanted`, the rig file's own first: those on or near the front of
/// `relens chart` on every simulated rig; block matching in many rounds only for the best.
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
    let matched = Setting { method: MethodName::BlockMatching, ..filed };
    let once = |steps, correction_steps, captures_max| Setting {
        steps,
        correction_steps,
        captures_max,
        rounds: 1,
        ..matched
    };
    let mut all = vec![filed];
    all.extend([4, 8, 16, 32].map(digital));
    all.extend([hybrid(8, 2, 1), hybrid(16, 4, 1), hybrid(16, 4, 2), hybrid(32, 8, 2)]);
    all.extend([once(16, 4, 0), once(8, 4, 1), once(16, 4, 1)]);
    if wanted == OperatingPoint::Best {
        all.push(Setting { rounds: matched.rounds.max(MANY_ROUNDS), ..matched });
    }
    let mut unlike = Vec::with_capacity(all.len());
    for setting in all {
        if !unlike.contains(&setting) {
            unlike.push(setting);
        }
    }
    unlike
}

/// How many restorations [`choose`] makes.
pub fn restorations(rig: &RigFile, wanted: OperatingPoint) -> usize {
    candidates(rig, wanted).len() * SCENES.len()
}

/// The operating point `wanted` of the rig that `test_rig` is on; `each` is told of every
/// restoration.
/// `None` when none gives a number.
///
/// # Errors
/// When a scene cannot be shown or a capture fails.
pub fn choose(
    test_rig: &mut TestRig,
    wanted: OperatingPoint,
    each: &mut dyn FnMut(&Score),
) -> Result<Option<Chosen>, TestRigError> {
    let rig = test_rig.config().clone();
    let settings = candidates(&rig, wanted);
    let mut trade = Trade::default();
    for (n, setting) in settings.iter().enumerate() {
        let contestant = Contestant {
            family: if n == 0 { FILED } else { setting.method.name() },
            line: String::new(),
            setting: setting.to_string(),
            method: setting.method(&rig),
            printed: false,
        };
        trade.run(test_rig, (&SCENES, 1), &contestant, each)?;
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
        ssim: rounded(trade.points[n].ssim),
        psnr_db: rounded(trade.points[n].psnr_db),
        best_ssim: rounded(trade.points[best].ssim),
        photo_ssim: rounded(trade.photo_ssim),
    }))
}

/// To four digits behind the point, as people read it.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
