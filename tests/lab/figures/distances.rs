//! Figure 9: a photo taken at one distance, restored on a rig whose panel stands at another.

use super::super::scenes::Scene;
use super::super::study::Condition;
use super::super::table::Table;
use super::super::test_rig::{Stopwatch, TestRigError};
use super::mosaic::{detail, functions_map, mosaic};
use super::stage::{Stage, printed, with_lens};
use super::{Agreement, Figure};
use crate::config;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::method::Method;
use crate::frame::Channel;
use crate::pipeline::hybrid;

/// The paper's two distances: name and millimetres.
const DISTANCES: [(&str, f64); 2] = [("4 m", 4000.0), ("40 cm", 400.0)];
/// A rig at the other distance may lose this share of the gain and still be called "reasonable and
/// promising"; guess.
const LOST_SHARE_MAX: f64 = 0.25;
/// Relative difference of functions up to which they are "very similar"; guess.
const SIMILAR: f64 = 0.2;

struct Cell {
    photo: usize,
    rig: usize,
    paper: bool,
    gain: f64,
}

/// The figure, measured without noise.
///
/// # Errors
/// When a rig cannot be opened or calibrated, or a method fails.
pub(super) fn measure(rig: &config::Rig, stopwatch: Stopwatch) -> Result<Figure, TestRigError> {
    let at = |mm: f64| {
        with_lens(Condition::NoNoise.apply(rig.clone()), |lens| lens.object_distance_mm = mm)
    };
    let mut stages = Vec::new();
    for (_, mm) in DISTANCES {
        stages.push(Stage::open(at(mm), stopwatch)?);
    }
    let mut table = Table::new(
        "Photos of both distances restored on rigs of both, captures without noise.",
        &[
            "scene",
            "photo at",
            "panel at",
            "method",
            "photo SSIM/dB",
            "SSIM",
            "PSNR dB",
            "gain SSIM",
            "captures",
        ],
    );
    let methods: [(&str, Box<dyn Method>); 2] =
        [("paper", Box::new(printed(rig))), ("hybrid", Box::new(hybrid(rig)))];
    let (mut cells, mut crossed) = (Vec::new(), Vec::new());
    for scene in [Scene::Chart, Scene::Coffee] {
        for photo in [0, 1] {
            let taken = stages[photo].take(scene)?;
            let (blurred, blurred_db) = taken.floor();
            for panel in [0, 1] {
                for (name, method) in &methods {
                    let course = stages[panel].solve(&taken, &**method, &[])?;
                    let (ssim, db) = course.end(&taken.truth);
                    table.row(vec![
                        scene.name().to_owned(),
                        DISTANCES[photo].0.to_owned(),
                        DISTANCES[panel].0.to_owned(),
                        (*name).to_owned(),
                        format!("{blurred:.4}/{blurred_db:.2}"),
                        format!("{ssim:.4}"),
                        format!("{db:.2}"),
                        format!("{:+.4}", ssim - blurred),
                        course.captures.to_string(),
                    ]);
                    cells.push(Cell {
                        photo,
                        rig: panel,
                        paper: *name == "paper",
                        gain: ssim - blurred,
                    });
                    if scene == Scene::Chart && photo != panel && *name == "paper" {
                        crossed.extend([taken.blurred(), course.last]);
                    }
                }
            }
        }
    }
    let maps: Vec<_> = [1, 0].map(|n: usize| functions_map(&stages[n].truth, 5, 5)).into();
    let tiles: Vec<_> = crossed.iter().map(|p| detail(p, (0.5, 0.5), 0.5, 1)).collect();
    let seen = "The middle of the chart, left to right: photo at 4 m, and restored with the panel \
     at 40 cm; photo at 40 \
                cm, and restored with the panel at 4 m (the paper's loop, 11 iterations).";
    let functions = "The lens's functions over the field, at 40 cm (left) and 4 m: square roots.";
    let (agreement, text) = judged(&cells, difference(&stages[1].truth, &stages[0].truth));
    Ok(Figure {
        number: 9,
        stem: "figure-09-distances",
        title: "Photo and panel at different distances",
        agreement,
        text,
        drawings: Vec::new(),
        pictures: vec![
            ("", seen.to_owned(), mosaic(&tiles, 4)),
            ("-functions", functions.to_owned(), mosaic(&maps, 2)),
        ],
        table,
    })
}

/// Relative difference (of root mean squares) between the functions of two lenses in green: in the
/// centre, in the corner, and the mean over the field.
fn difference(one: &LensModel, other: &LensModel) -> [f64; 3] {
    let (a, b) = (one.functions(), other.functions());
    let at = |row: usize, column: usize| {
        let pairs = || {
            let other = b.function(Channel::Green, row, column);
            a.function(Channel::Green, row, column).iter().zip(other)
        };
        let apart: f64 = pairs().map(|(p, q)| f64::from(p - q).powi(2)).sum();
        let whole: f64 = pairs().map(|(_, q)| f64::from(*q).powi(2)).sum();
        (apart / whole.max(f64::MIN_POSITIVE)).sqrt()
    };
    let all: Vec<f64> = (0..a.rows)
        .flat_map(|r| (0..a.columns).map(move |c| (r, c)))
        .map(|(r, c)| at(r, c))
        .collect();
    [at(a.rows / 2, a.columns / 2), at(0, 0), all.iter().sum::<f64>() / all.len().max(1) as f64]
}

fn judged(cells: &[Cell], [centre, corner, mean]: [f64; 3]) -> (Agreement, String) {
    // The share of the gain that is lost on the rig of the other distance, worst and mean.
    let lost = |paper: bool| -> Vec<f64> {
        let of = |c: &&Cell| c.paper == paper;
        let matched: Vec<&Cell> = cells.iter().filter(of).filter(|c| c.photo == c.rig).collect();
        let other: Vec<&Cell> = cells.iter().filter(of).filter(|c| c.photo != c.rig).collect();
        // Scene by scene, photo by photo, both lists run in the same order of photos.
        matched.iter().zip(&other).map(|(m, o)| 1.0 - o.gain / m.gain).collect()
    };
    let worst = |lost: &[f64]| lost.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (paper, hybrid) = (lost(true), lost(false));
    let gains = cells.iter().filter(|c| c.paper && c.photo != c.rig).all(|c| c.gain > 0.0);
    let reasonable = gains && worst(&paper) < LOST_SHARE_MAX;
    let similar = mean < SIMILAR;
    let text = format!(
        "The paper: the functions at 40 cm and 4 m are very similar, and a photo of one distance \
         restored on a rig of the \
         other is still reasonable and promising. Here the functions differ by {:.0} % in the \
         centre, {:.0} % in the corner \
         and {:.0} % over the field (root mean square, both refocused): {} in the middle and {} \
         outside it. On the rig \
         of the other distance the paper's loop keeps {:.0} % of the gain in SSIM it has on its \
         own, at worst; the default \
         method, which trusts what it measured of the lens, keeps {:.0} % at worst, because its \
         gain is larger and rests on \
         detail. {}",
        100.0 * centre,
        100.0 * corner,
        100.0 * mean,
        if centre < SIMILAR { "very similar" } else { "not similar" },
        if corner < SIMILAR { "also" } else { "not" },
        100.0 * (1.0 - worst(&paper)),
        100.0 * (1.0 - worst(&hybrid)),
        if reasonable {
            "Distance may be neglected, as the paper says, if some quality may."
        } else {
            "Distance may not be neglected."
        },
    );
    (Agreement::of(&[similar, reasonable]), text)
}
