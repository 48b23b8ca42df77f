//! The published chart of speed against accuracy: the program's own contestants, and a raw
//! developer's sharpening beside them. Measured rows are stored, so that an interrupted run can be
//! continued and the chart redrawn without measuring.

use std::path::Path;

use relens::chart::Chart;
use relens::chart::contestants::{Contestant, contestants};
use relens::chart::scenes::Scene;
use relens::chart::test_rig::{PictureQuality, Score, TestRig};
use relens::chart::trade::{Point, Trade};
use relens::config::RigFile;

use crate::capture_sharpening::sharpen;
use crate::csv::cells_of_csv;
use crate::made::{self, Made};
use crate::{Failure, report, seconds};

const SCENES: [Scene; 3] = [Scene::Astronaut, Scene::Coffee, Scene::Page];
/// Contestants measured first, so that an interrupted run has one of each family.
const FIRST: [&str; 9] = [
    "digital, 16 steps",
    "hybrid, 1 capture, 16+4 steps",
    "block-matching, no capture, 1 round",
    "block-matching, 1 capture, 8 rounds",
    "richardson-lucy, 20 steps",
    "paper, 11 iterations",
    "wiener, noise/signal 0.01",
    "total-variation, strength 0.3",
    "block-matching, 1 capture, 1 round",
];
/// Standard deviations of the sharpening's Gaussian, pixels; RawTherapee's slider ends at 2.
const SIGMAS_PX: [f32; 4] = [0.7, 1.0, 1.5, 2.0];
/// Family of the sharpening.
const SHARPENING: &str = "capture sharpening";

/// Measures the contestants missing in `out` on one photo of each scene, and draws the chart.
pub(crate) fn run(rig: &RigFile, out: &Path) -> Result<Made, Failure> {
    let file = format!("{}-by-scene.csv", rig.name);
    let kept = std::fs::read_to_string(out.join(&file)).unwrap_or_default();
    let mut trade = read(&kept)?;
    let is_kept = |trade: &Trade, name: &str| trade.points.iter().any(|p| p.name() == name);
    let all: Vec<Contestant> = contestants(rig);
    let mut missing: Vec<&Contestant> =
        all.iter().filter(|c| !is_kept(&trade, &c.name())).collect();
    missing.sort_by_key(|c| !c.is_filed && !FIRST.contains(&c.name().as_str()));
    if !missing.is_empty() {
        let mut test_rig = TestRig::open(rig.clone(), seconds)?;
        if !trade.points.iter().any(|point| point.family == SHARPENING) {
            for sigma_px in SIGMAS_PX {
                trade.points.push(sharpened(&mut test_rig, sigma_px)?);
            }
        }
        for contestant in missing {
            trade.run(&mut test_rig, &SCENES, 1, contestant, &mut report)?;
            made::write(out, &file, trade.score_table(String::new()).csv().as_bytes())?;
        }
    }
    drawn(rig, trade)
}

/// Draws the chart of stored `rows`.
pub(crate) fn redrawn(rig: &RigFile, rows: &str) -> Result<Made, Failure> {
    drawn(rig, read(rows)?)
}

fn drawn(rig: &RigFile, mut trade: Trade) -> Result<Made, Failure> {
    // The rig file's own setting is measured first, but its point belongs to a line of its family.
    trade.points.sort_by(|a, b| a.family.cmp(&b.family));
    let command = format!("`lab speed-accuracy --rig {}.toml`", rig.name);
    let Chart { stem, drawing, summary, scores } = Chart::new(rig, &trade, &[command]);
    Ok(Made {
        tables: vec![(stem.clone(), summary), (format!("{}-by-scene", rig.name), scores)],
        drawings: vec![(stem, drawing)],
        ..Made::default()
    })
}

/// The point of sharpening with `sigma_px`, scored on a photo of each scene.
fn sharpened(test_rig: &mut TestRig, sigma_px: f32) -> Result<Point, Failure> {
    let mut scores = Vec::new();
    for scene in SCENES {
        let (photo, truth) = (test_rig.photograph(scene, 0)?, test_rig.truth(scene));
        let begun = seconds();
        let picture = sharpen(&photo.light, sigma_px);
        let score = Score {
            scene,
            take: 0,
            captures: 0,
            capture_seconds: 0.0,
            computing_seconds: seconds() - begun,
            certificate: None,
            result: test_rig.quality(&picture, &truth),
            photo: test_rig.quality(&photo.light, &truth),
        };
        report(&format!("{SHARPENING}, σ {sigma_px} px"), &score);
        scores.push(score);
    }
    Ok(Point {
        family: SHARPENING.to_owned(),
        line: String::new(),
        setting: format!("σ {sigma_px} px"),
        is_filed: false,
        scores,
    })
}

/// The points of a table of scores ([`Trade::score_table`]) as CSV.
fn read(text: &str) -> Result<Trade, Failure> {
    let mut trade = Trade::default();
    for (n, cells) in cells_of_csv(text).into_iter().enumerate().skip(1) {
        let (point, score) = row(&cells).ok_or_else(|| format!("row {n} holds no score"))?;
        match trade.points.last_mut().filter(|last| last.name() == point.name()) {
            Some(last) => last.scores.push(score),
            None => trade.points.push(Point { scores: vec![score], ..point }),
        }
    }
    Ok(trade)
}

fn row(cells: &[String]) -> Option<(Point, Score)> {
    let cell = |n: usize| cells.get(n).map(String::as_str);
    let number = |n: usize| cell(n)?.parse::<f64>().ok();
    let quality = |n: usize| {
        Some(PictureQuality {
            ssim: number(n)?,
            psnr_db: number(n + 1)?,
            edge_difference: number(n + 2),
        })
    };
    let score = Score {
        scene: Scene::CHARTED.into_iter().find(|scene| Some(scene.name()) == cell(4))?,
        take: cell(5)?.parse().ok()?,
        captures: cell(6)?.parse().ok()?,
        capture_seconds: number(7)?,
        computing_seconds: number(8)?,
        result: quality(9)?,
        photo: quality(12)?,
        certificate: number(15).map(|ratio| ratio as f32),
    };
    let [family, line, setting] = [cell(0)?, cell(1)?, cell(2)?].map(str::to_owned);
    let is_filed = cell(3)? == "true";
    Some((Point { family, line, setting, is_filed, scores: Vec::new() }, score))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_rows_give_the_same_table_again() {
        let quality = |ssim| PictureQuality { ssim, psnr_db: 31.25, edge_difference: Some(4.5) };
        let score = |scene, certificate| Score {
            scene,
            take: 0,
            captures: 2,
            capture_seconds: 0.25,
            computing_seconds: 1.5,
            certificate,
            result: quality(0.9375),
            photo: quality(0.75),
        };
        let point = |setting: &str| Point {
            family: "hybrid".to_owned(),
            line: "2 captures".to_owned(),
            setting: setting.to_owned(),
            is_filed: setting.len() > 1,
            scores: vec![score(Scene::Astronaut, None), score(Scene::Page, Some(1.25))],
        };
        let trade = Trade { points: vec![point("a, b"), point("c")] };
        let csv = trade.score_table(String::new()).csv();
        let again = read(&csv).unwrap();
        assert_eq!(again.points, trade.points);
        assert!(read("head\nx,y\n").is_err());
    }
}
