//! Speed against accuracy where the measured lens is wrong: what captures are for, drawn.

use relens::chart::contestants::{Contestant, FILED};
use relens::chart::scatter::{self, PanelOf, Words};
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::chart::test_rig::Score;
use relens::chart::trade::{Measure, Trade};
use relens::config::{MethodName, RigFile};
use relens::pipeline::Setting;

use crate::change::{Change, DECENTRED, NOTHING, SCENE_AT, SMEARED, VEIL_MISSED};
use crate::harness::{Harness, calibration};
use crate::made::Made;
use crate::{Failure, told};

/// What is wrong, and how much; first nothing is.
pub(crate) const WRONG: [(&Change, f64); 5] =
    [(&NOTHING, 0.0), (&VEIL_MISSED, 10.0), (&SMEARED, 15.0), (&DECENTRED, 10.0), (&SCENE_AT, 4.4)];

/// Photographs, and print.
const SCENES: [Scene; 4] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket, Scene::Page];

/// The lens alone and with captures, by steps.
fn contestants(rig: &RigFile) -> Vec<Contestant> {
    let filed = |method| Setting::as_filed(rig, method);
    let of = |set: Setting, family| Contestant::boxed(family, &set.numbers(), set.method(rig));
    let mut all = Vec::new();
    for (steps, correction_steps) in [(4, 2), (8, 2), (16, 4), (32, 8)] {
        let alone = Setting { steps, ..filed(MethodName::Digital) };
        all.push(of(alone, "digital").on("steps"));
        for captures_max in [1, 2, 4] {
            let with = filed(MethodName::Hybrid);
            let with = Setting { steps, correction_steps, captures_max, ..with };
            all.push(of(with, "hybrid").on(format!("{captures_max}")));
        }
    }
    let named = filed(rig.restore.method).method(rig);
    let name = named.name();
    all.push(Contestant::boxed(FILED, name, named));
    all
}

/// A panel and a table for each.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let scenes = if quick { &SCENES[..2] } else { &SCENES };
    let mut trades: Vec<(String, Trade)> = Vec::new();
    for (change, strength) in WRONG {
        let calibration = calibration(&change.filed(rig, strength))?;
        let mut harness = Harness::changed(rig, &calibration, change, strength)?;
        let mut trade = Trade::default();
        for contestant in contestants(rig) {
            let score = |&scene: &Scene| -> Result<Score, Failure> {
                let score = harness.score(scene, &*contestant.method)?;
                told(&score);
                Ok(Score { method: contestant.name(), ..score }.without_pictures())
            };
            trade.add(&contestant, scenes.iter().map(score).collect::<Result<_, _>>()?);
        }
        trades.push((change.words(strength), trade));
    }
    let names: Vec<&str> = scenes.iter().map(|scene| scene.name()).collect();
    let words = Words {
        title: format!("Where the measured lens is wrong, rig {}", rig.name),
        megapixels: rig.photo.size().area() as f64 / 1e6,
        below: vec![format!("mean of {}, {}", names.join(", "), rig.photo.size())],
    };
    let shown = trades.iter().map(|(words, trade)| PanelOf {
        trade,
        measure: Measure::Psnr,
        words: words.clone(),
    });
    let drawing = scatter::draw_panels(&shown.collect::<Vec<_>>(), &words);
    let stem = format!("{}-wrong-models", rig.name);
    Ok(Made {
        tables: vec![(stem.clone(), table(rig, &trades))],
        drawings: vec![(stem, drawing)],
        ..Made::default()
    })
}

/// As many steps as the rig file has, by captures.
fn table(rig: &RigFile, trades: &[(String, Trade)]) -> Table {
    let caption = format!(
        "Where the measured lens is wrong, rig {}: SSIM/dB of what the photo is, of the measured \
         lens alone, and of captures with it, 16 steps and 4 for each correction; what light \
         gains.",
        rig.name
    );
    let head = ["what is wrong", "photo", "digital", "1 capture", "2", "4", "light gains"];
    let mut table = Table::new(caption, &head);
    for (words, trade) in trades {
        let both = |ssim: f64, db: f64| format!("{ssim:.4}/{db:.2}");
        let of = |family: &str, line: &str| {
            let is = |p: &&relens::chart::trade::Point| {
                p.family == family && p.line == line && p.setting.starts_with("16")
            };
            trade.points.iter().find(is).map_or((f64::NAN, f64::NAN), |p| (p.ssim, p.psnr_db))
        };
        let alone = of("digital", "steps");
        let with = ["1", "2", "4"].map(|line| of("hybrid", line));
        let mut cells = vec![words.clone(), both(trade.photo_ssim, trade.photo_psnr_db)];
        cells.push(both(alone.0, alone.1));
        cells.extend(with.map(|(ssim, db)| both(ssim, db)));
        cells.push(format!("{:+.4}/{:+.2}", with[1].0 - alone.0, with[1].1 - alone.1));
        table.row(cells);
    }
    table
}
