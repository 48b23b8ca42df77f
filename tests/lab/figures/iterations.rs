//! Figure 11: the first iterations, as pictures.

use super::mosaic::{detail, mosaic};
use super::stage::{Course, Stage, printed};
use super::{Figure, Finding, Picture};
use crate::Failure;
use crate::change::{NO_NOISE, NOTHING};
use crate::lines::{LineChart, PALETTE, Scale, Series};
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::RigFile;

const SHOWN: [u32; 5] = [1, 2, 3, 5, 11];
/// Iterations, and share of the whole gain after them, for "within a few iterations".
const FEW: (usize, f64) = (5, 0.8);

/// The figure, with the rig's noise and without.
pub(super) fn measure(rig: &RigFile) -> Result<Figure, Failure> {
    let mut table = Table::new(
        "SSIM/PSNR (dB) after so many iterations of the paper's loop, astronaut.",
        &["captures", "photo", "1", "2", "3", "5", "11"],
    );
    let (mut pictures, mut measured, mut series) = (Vec::new(), Vec::new(), Vec::new());
    let conditions =
        [(&NO_NOISE, "without noise", ""), (&NOTHING, "with the rig's noise", "-noise")];
    for (n, (change, name, suffix)) in conditions.into_iter().enumerate() {
        let mut stage = Stage::open(change.filed(rig, 0.0))?;
        let taken = stage.take(Scene::Astronaut)?;
        let (blurred, blurred_db) = taken.floor();
        let course = stage.solve(&taken, &printed(rig), &SHOWN)?;
        let mut row = vec![name.to_owned(), format!("{blurred:.4}/{blurred_db:.2}")];
        let at =
            |n: u32| format!("{:.4}/{:.2}", course.ssim_at(n as usize), course.psnr_at(n as usize));
        row.extend(SHOWN.map(at));
        table.row(row);
        let photo = [taken.truth.clone(), taken.blurred()];
        let steps = course.pictures.iter().map(|(_, picture)| picture.clone());
        let tiles: Vec<_> =
            photo.into_iter().chain(steps).map(|p| detail(&p, (0.45, 0.25), 0.4, 1)).collect();
        let seen = format!(
            "Captures {name}, left to right: the scene, the photo, and after 1, 2, 3, 5 and 11 \
             iterations."
        );
        pictures.push(Picture { suffix, seen, picture: mosaic(&tiles, 4) });
        let steps = course.ssim.iter().enumerate().map(|(n, &ssim)| [n as f64 + 1.0, ssim]);
        let points = std::iter::once([0.0, blurred]).chain(steps).collect();
        series.push(Series { name: name.to_owned(), colour: PALETTE[n], dashed: false, points });
        measured.push((blurred, course));
    }
    let chart = LineChart {
        title: "Figure 11: the first iterations, astronaut".to_owned(),
        x_label: "iterations".to_owned(),
        y_label: "SSIM".to_owned(),
        x_scale: Scale::Linear,
        x_ticks: (0..=11).map(f64::from).collect(),
        y_least: None,
        floor: measured.first().map(|(blurred, _)| (*blurred, "the blurred photo".to_owned())),
        series,
    };
    Ok(Figure {
        number: 11,
        stem: "figure-11-iterations",
        title: "The first iterations",
        findings: findings(&measured),
        drawings: vec![("-curves", chart.draw())],
        pictures,
        table,
    })
}

fn findings(measured: &[(f64, Course)]) -> Vec<Finding> {
    let [(blurred, quiet), (noisy_blurred, noisy)] = measured else { return Vec::new() };
    let share = |n: usize| (quiet.ssim_at(n) - blurred) / (quiet.ssim_at(11) - blurred);
    let percent = |n: usize| format!("{:.0} %", 100.0 * share(n));
    let change = |n: usize| noisy.ssim_at(n) - noisy_blurred;
    let (few, enough) = FEW;
    vec![
        Finding::of(
            "the loop comes to a sharp picture within a few iterations",
            "share of the gain of 11 iterations that is there after 5, without noise",
            percent(few),
            "80 % at least, and it gains",
            quiet.ssim_at(11) > *blurred && share(few) > enough,
        ),
        Finding::beside("the same after 1", percent(1)),
        Finding::beside("the same after 3", percent(3)),
        Finding::of(
            "robustly",
            "change of SSIM in 11 iterations with the rig's noise in every capture",
            format!("{:+.3}", change(11)),
            "more than 0",
            change(11) > 0.0,
        ),
        Finding::beside("the same after the first", format!("{:+.3}", change(1))),
    ]
}
