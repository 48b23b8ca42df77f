//! Figure 9: a photo taken at one distance, restored on a rig whose panel is at another.

use super::mosaic::{detail, functions_map, mosaic};
use super::stage::{Course, Stage, Taken, printed};
use super::{Figure, Finding, Picture};
use crate::Failure;
use crate::change::{NO_NOISE, lens};
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::RigFile;
use relens::deconvolution::lens_model::LensModel;
use relens::deconvolution::method::Method;
use relens::frame::Channel;
use relens::pipeline::hybrid;

/// The paper's two distances: name and millimetres.
const DISTANCES: [(&str, f64); 2] = [("4 m", 4000.0), ("40 cm", 400.0)];
/// Share of the gain that may be lost on a rig at the other distance if the result is still
/// "reasonable and promising"; guess.
const LOST_SHARE_MAX: f64 = 0.25;
/// Relative difference up to which functions are "very similar"; guess.
const SIMILAR: f64 = 0.2;

struct Cell {
    photo: usize,
    rig: usize,
    paper: bool,
    gain: f64,
}

/// Columns of the table.
const HEAD: [&str; 9] = [
    "scene",
    "photo at",
    "panel at",
    "method",
    "photo SSIM/dB",
    "SSIM",
    "PSNR dB",
    "gain SSIM",
    "captures",
];

/// The figure, measured without noise.
pub(super) fn measure(rig: &RigFile) -> Result<Figure, Failure> {
    let at = |mm: f64| {
        let mut rig = NO_NOISE.filed(rig, 0.0);
        lens(&mut rig, |lens| lens.object_distance_mm = mm);
        rig
    };
    let mut stages = Vec::new();
    for (_, mm) in DISTANCES {
        stages.push(Stage::open(at(mm))?);
    }
    let mut table = Table::new(
        "Photos of both distances restored on rigs of both, captures without noise.",
        &HEAD,
    );
    let methods: [(&str, Box<dyn Method>); 2] =
        [("paper", Box::new(printed(rig))), ("hybrid", Box::new(hybrid(rig)))];
    let (mut cells, mut crossed) = (Vec::new(), Vec::new());
    for scene in [Scene::Chart, Scene::Coffee] {
        for photo in [0, 1] {
            let taken = stages[photo].take(scene)?;
            for panel in [0, 1] {
                for (name, method) in &methods {
                    let course = stages[panel].solve(&taken, &**method, &[])?;
                    let mut row = vec![scene.name().to_owned()];
                    row.extend([photo, panel].map(|n| DISTANCES[n].0.to_owned()));
                    row.push((*name).to_owned());
                    row.extend(scores(&course, &taken));
                    table.row(row);
                    let gain = course.end(&taken.truth).0 - taken.floor().0;
                    cells.push(Cell { photo, rig: panel, paper: *name == "paper", gain });
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
                at 40 cm; photo at 40 cm, and restored with the panel at 4 m (the paper's loop, 11 \
                iterations).";
    let functions = "The lens's functions over the field, at 40 cm (left) and 4 m: square roots.";
    Ok(Figure {
        number: 9,
        stem: "figure-09-distances",
        title: "Photo and panel at different distances",
        findings: findings(&cells, difference(&stages[1].truth, &stages[0].truth)),
        drawings: Vec::new(),
        pictures: vec![
            Picture { suffix: "", seen: seen.to_owned(), picture: mosaic(&tiles, 4) },
            Picture { suffix: "-functions", seen: functions.to_owned(), picture: mosaic(&maps, 2) },
        ],
        table,
    })
}

/// Table cells: the photo's scores, the result's scores, and the number of captures.
fn scores(course: &Course, taken: &Taken) -> [String; 5] {
    let ((ssim, db), (blurred, blurred_db)) = (course.end(&taken.truth), taken.floor());
    [
        format!("{blurred:.4}/{blurred_db:.2}"),
        format!("{ssim:.4}"),
        format!("{db:.2}"),
        format!("{:+.4}", ssim - blurred),
        course.captures.to_string(),
    ]
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

fn findings(cells: &[Cell], [centre, corner, mean]: [f64; 3]) -> Vec<Finding> {
    // Largest share of the gain lost on the rig of the other distance.
    let lost = |paper: bool| {
        let of = |c: &&Cell| c.paper == paper;
        let matched = cells.iter().filter(of).filter(|c| c.photo == c.rig);
        let other = cells.iter().filter(of).filter(|c| c.photo != c.rig);
        // Both are in the same order of scenes and photos.
        matched.zip(other).map(|(m, o)| 1.0 - o.gain / m.gain).fold(f64::NEG_INFINITY, f64::max)
    };
    let gains = cells.iter().filter(|c| c.paper && c.photo != c.rig).all(|c| c.gain > 0.0);
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    vec![
        Finding::of(
            "the functions at 40 cm and 4 m are very similar",
            "relative difference of the functions over the field (root mean square, both \
             refocused)",
            percent(mean),
            "20 %",
            mean < SIMILAR,
        ),
        Finding::beside("the same in the centre", percent(centre)),
        Finding::beside("the same in the corner", percent(corner)),
        Finding::of(
            "a photo of one distance restored on a rig of the other is still reasonable and \
             promising",
            "share of its gain in SSIM that the paper's loop loses there, worst",
            percent(lost(true)),
            "25 %, and it gains",
            gains && lost(true) < LOST_SHARE_MAX,
        ),
        Finding::beside("the same of the default method", percent(lost(false))),
    ]
}
