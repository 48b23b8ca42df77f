//! `relens chart`: what the methods make of scenes whose truth is known, on any rig; and the choice
//! of a rig's operating point by the same means.

pub mod contestants;
pub mod crops;
pub mod drawing;
pub mod drawn;
pub mod looks;
pub mod marks;
pub mod operating_point;
pub mod scatter;
pub mod scenes;
mod strip;
pub mod table;
pub mod test_rig;
pub mod trade;

use crate::config::{Curve, MethodName, RigFile};
use crate::pipeline::{Setting, counted, digital, hybrid};
use crate::remedy::full_message;
use contestants::{Contestant, contestants};
use drawing::Drawing;
use scatter::Words;
use scenes::Scene;
use table::Table;
use test_rig::{Score, TestRig, TestRigError};
use trade::{BALANCED, BEST, FAST, Point, Trade};

/// Tables and drawings, each with the stem of its file's name.
#[derive(Debug, Default)]
pub struct Chart {
    /// Tables.
    pub tables: Vec<(String, Table)>,
    /// Drawings.
    pub drawings: Vec<(String, Drawing)>,
}

/// Grids of lens functions that are tried in place of the rig file's: columns and rows.
const FEWER_FUNCTIONS: [(usize, usize); 2] = [(1, 1), (4, 3)];
/// Photos of each scene, which differ in their noise.
const TAKES: u64 = 3;

/// Speed against accuracy on the simulated rig of `rig`: every method with several settings.
/// `quick` leaves out most of the settings of the methods that lose.
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a method fails.
pub fn trade(
    rig: &RigFile,
    quick: bool,
    stopwatch: fn() -> f64,
    each: &mut dyn FnMut(&Score),
) -> Result<Trade, TestRigError> {
    let mut trade = trade_on(&mut TestRig::open(rig.clone(), stopwatch)?, quick, each)?;
    let fewer = if quick { &[][..] } else { &FEWER_FUNCTIONS };
    for &(columns, rows) in fewer {
        let mut changed = rig.clone();
        changed.calibration.function_columns = columns;
        changed.calibration.function_rows = rows;
        let mut test_rig = match TestRig::open(changed, stopwatch) {
            Ok(test_rig) => test_rig,
            // Too few to be centred by, or a panel that moved: the rest of the chart stands.
            Err(reason) => {
                log::warn!("left out, {columns}×{rows} functions: {}", full_message(&reason));
                continue;
            }
        };
        let setting = counted(columns * rows, "function");
        for contestant in [
            Contestant::new("digital", &setting, digital(rig)),
            Contestant::new("hybrid", &setting, hybrid(rig)),
        ] {
            trade.run(&mut test_rig, photos_for(rig, quick), &contestant, each)?;
        }
    }
    Ok(trade)
}

/// The same on the rig that `test_rig` is on, which need not be simulated: scenes are shown to it.
///
/// # Errors
/// When a scene cannot be shown, or a method fails.
pub fn trade_on(
    test_rig: &mut TestRig,
    quick: bool,
    each: &mut dyn FnMut(&Score),
) -> Result<Trade, TestRigError> {
    let rig = test_rig.config().clone();
    let mut trade = Trade::default();
    for contestant in contestants(&rig, quick) {
        trade.run(test_rig, photos_for(&rig, quick), &contestant, each)?;
    }
    Ok(trade)
}

/// How many restorations [`trade()`] makes; [`trade_on`] a few less.
pub fn restorations(rig: &RigFile, quick: bool) -> usize {
    let fewer = if quick { 0 } else { 2 * FEWER_FUNCTIONS.len() };
    let (scenes, takes) = photos_for(rig, quick);
    (contestants(rig, quick).len() + fewer) * scenes.len() * takes as usize
}

/// The scenes that a rig's photos are charted by, and photos of each.
fn photos_for(rig: &RigFile, quick: bool) -> (&'static [Scene], u64) {
    // A rig of devices has its own noise, and a panel to wait for.
    match (rig.photo.curve, quick || rig.simulation().is_none()) {
        (Curve::Linear, true) => (&Scene::STUDY_PHOTOGRAPHS, 1),
        (Curve::Srgb, true) => (&Scene::CHARTED, 1),
        (_, false) => (&Scene::CHARTED, TAKES),
    }
}

/// The drawing of `trade` on `rig` and its tables, with a `remark` under them; `made` says of the
/// drawing by what it was made.
pub fn chart(rig: &RigFile, trade: &Trade, remark: &str, made: &str) -> Chart {
    let stem = format!("{}-speed-accuracy", rig.name);
    let chosen = |name: &str, keeps| {
        let point = trade.operating_point(keeps).map(|n| &trade.points[n]);
        point.map_or(String::new(), |p| {
            let (seconds, ssim, db) = (p.seconds(), p.ssim, p.psnr_db);
            format!(" {name}: {}, {} ({seconds:.2} s, {ssim:.4}/{db:.2} dB).", p.family, p.setting)
        })
    };
    let mut scenes: Vec<&str> = Vec::new();
    for name in trade.scores.iter().map(|score| score.scene.name()) {
        if !scenes.contains(&name) {
            scenes.push(name);
        }
    }
    let takes = trade.scores.iter().map(|score| score.take + 1).max().unwrap_or(1);
    let scenes = format!(
        "{} photo{} each of {}",
        takes,
        if takes == 1 { "" } else { "s" },
        scenes.join(", ")
    );
    let caption = format!(
        "Rig {}, {}; {scenes}, {:.4}/{:.2} dB as they are.{}{}{} They are the cheapest that keep \
         90, 98 and 100 % of the most that any setting gains, the mean of SSIM, PSNR and ΔE at \
         edges (*share*).{remark}",
        rig.name,
        rig.photo.size(),
        trade.photo_ssim,
        trade.photo_psnr_db,
        chosen("Fast", FAST),
        chosen("Balanced", BALANCED),
        chosen("Best", BEST),
    );
    let megapixels = rig.photo.size().area() as f64 / 1e6;
    let mut below = vec![format!("{scenes}, {}", rig.photo.size()), made.to_owned()];
    below.extend(certificate(rig, trade));
    let words =
        Words { title: format!("Speed against accuracy on rig {}", rig.name), megapixels, below };
    let scores = trade::scores_table(format!("Rig {}, photo by photo.", rig.name), &trade.scores);
    Chart {
        drawings: vec![(stem.clone(), scatter::draw(trade, &words))],
        tables: vec![
            (stem, trade.table(caption, megapixels)),
            (format!("{}-by-scene", rig.name), scores),
        ],
    }
}

/// What a certificate costs, in words: the filed steps with one capture and with none.
fn certificate(rig: &RigFile, trade: &Trade) -> Option<String> {
    let steps = Setting::as_filed(rig, MethodName::Hybrid).steps;
    let of = |family: &str, line: &str, setting: &str| {
        let is =
            |p: &&Point| p.family == family && p.line == line && p.setting.starts_with(setting);
        trade.points.iter().find(is)
    };
    let alone = of("digital", "steps", &format!("{steps} steps"))?;
    let with = of("hybrid", "1 capture", &format!("{steps}+"))?;
    let computing = with.computing_seconds - alone.computing_seconds;
    Some(format!(
        "A certificate costs {} of {:.2} s at any size, and {computing:.2} s of processor time \
         with its correction (hybrid beside digital, {steps} steps).",
        counted(with.captures.round() as usize, "capture"),
        with.capture_seconds / with.captures.max(1.0)
    ))
}
