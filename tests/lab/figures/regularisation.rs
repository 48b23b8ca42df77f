//! Figure 10: the best λ for each noise variance, with two readings of where noise enters.
//!
//! The paper adds "Gaussian white noise after each simulated display-imaging operation". Literally,
//! that is every capture, including those of the backward convolution. In the other reading, the
//! photo and the forward captures have noise, and the backward convolution is computed.

use super::mosaic::{detail, mosaic};
use super::stage::{Exact, Stage, printed};
use super::{Figure, Finding, Picture};
use crate::Failure;
use crate::change::NO_NOISE;
use crate::lines::{LineChart, PALETTE, Scale, Series};
use crate::sized::sized;
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::RigFile;
use relens::deconvolution::method::Method;
use relens::deconvolution::method::paper::Paper;
use relens::frame::Plane;

const LAMBDAS: [f32; 7] = [1.0, 3.0, 8.0, 18.0, 30.0, 45.0, 70.0];
const VARIANCES: [f64; 4] = [3.0, 8.0, 18.0, 40.0];
/// The paper's example: variance and λ.
const PRINTED: (f64, f32) = (18.0, 18.0);
/// Factor, either way, within which λ is "near the noise variance".
const NEAR: f64 = 2.5;

/// Reading of the paper on which captures have noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reading {
    EveryCapture,
    ForwardOnly,
}

impl Reading {
    const ALL: [Reading; 2] = [Reading::EveryCapture, Reading::ForwardOnly];

    const fn name(self) -> &'static str {
        match self {
            Reading::EveryCapture => "noise in every capture",
            Reading::ForwardOnly => "noise in photo and forward captures",
        }
    }
}

/// SSIM for every λ at one variance.
struct Row {
    scene: Scene,
    reading: Reading,
    variance: f64,
    blurred: f64,
    ssim: Vec<f64>,
}

impl Row {
    fn best(&self) -> (f32, f64) {
        let pairs = LAMBDAS.iter().copied().zip(self.ssim.iter().copied());
        pairs.fold((0.0, f64::NEG_INFINITY), |best, pair| if pair.1 > best.1 { pair } else { best })
    }
}

/// The figure, on the rig at half its size because of its many runs.
pub(super) fn measure(rig: &RigFile) -> Result<Figure, Failure> {
    // The rig is calibrated without noise; only photos and captures have it.
    let mut stage = Stage::open(NO_NOISE.filed(&sized(rig, 0.5), 0.0))?;
    let as_printed = printed(stage.harness.config());
    let lens = stage.truth.clone();
    let (mut rows, mut details) = (Vec::new(), Vec::new());
    for scene in [Scene::Chart, Scene::Coffee] {
        for variance in VARIANCES {
            stage
                .harness
                .witness
                .change_sensor(|sensor| sensor.read_noise_levels = variance.sqrt());
            let taken = stage.take(scene)?;
            let (blurred, _) = taken.floor();
            let shows = scene == Scene::Chart && variance == PRINTED.0;
            if shows {
                details.extend([taken.truth.clone(), taken.blurred()]);
            }
            for reading in Reading::ALL {
                let mut ssim = Vec::new();
                for lambda in LAMBDAS {
                    let loop_ = Paper { lambda, ..as_printed };
                    let solver: Box<dyn Method> = match reading {
                        Reading::EveryCapture => Box::new(loop_),
                        Reading::ForwardOnly => Box::new(Exact { paper: loop_, lens: &lens }),
                    };
                    let course = stage.solve(&taken, &*solver, &[])?;
                    ssim.push(course.end(&taken.truth).0);
                    if shows && lambda == PRINTED.1 {
                        details.push(course.last);
                    }
                }
                rows.push(Row { scene, reading, variance, blurred, ssim });
            }
        }
    }
    let drawings = Reading::ALL.into_iter().zip(["-every-capture", "-forward-only"]);
    Ok(Figure {
        number: 10,
        stem: "figure-10-regularisation",
        title: "λ against noise variance",
        findings: findings(&rows),
        drawings: drawings
            .map(|(reading, suffix)| (suffix, curves(&rows, reading).draw()))
            .collect(),
        pictures: vec![Picture { suffix: "", seen: seen(), picture: strip(&details) }],
        table: table(&rows, stage.harness.config()),
    })
}

fn seen() -> String {
    let (variance, lambda) = PRINTED;
    format!(
        "The middle of the chart at noise variance {variance}, left to right: the scene; the \
         photo; after 11 iterations with λ = {lambda} and {}; the same with {}.",
        Reading::ALL[0].name(),
        Reading::ALL[1].name()
    )
}

fn strip(details: &[Plane]) -> Plane {
    let tiles: Vec<_> = details.iter().map(|p| detail(p, (0.5, 0.5), 0.5, 2)).collect();
    mosaic(&tiles, 4)
}

fn table(rows: &[Row], rig: &RigFile) -> Table {
    let head = [
        "scene", "noise", "variance", "blurred", "λ 1", "λ 3", "λ 8", "λ 18", "λ 30", "λ 45",
        "λ 70", "best λ",
    ];
    let caption = format!(
        "SSIM after 11 iterations; photo {}, patches as the paper's in proportion.",
        rig.photo.size()
    );
    let mut table = Table::new(caption, &head);
    for row in rows {
        let mut cells = vec![
            row.scene.name().to_owned(),
            row.reading.name().to_owned(),
            row.variance.to_string(),
            format!("{:.4}", row.blurred),
        ];
        cells.extend(row.ssim.iter().map(|s| format!("{s:.4}")));
        cells.push(row.best().0.to_string());
        table.row(cells);
    }
    table
}

fn curves(rows: &[Row], reading: Reading) -> LineChart {
    let of = |r: &&Row| r.reading == reading && r.scene == Scene::Chart;
    let series = rows.iter().filter(of).enumerate().flat_map(|(n, row)| {
        let colour = PALETTE[n % PALETTE.len()];
        let points = LAMBDAS.iter().zip(&row.ssim).map(|(&l, &s)| [f64::from(l), s]).collect();
        let name = format!("variance {}", row.variance);
        let ends = [LAMBDAS[0], LAMBDAS[LAMBDAS.len() - 1]].map(|l| [f64::from(l), row.blurred]);
        [
            Series { name, colour, dashed: false, points },
            Series {
                name: "its blurred photo".to_owned(),
                colour,
                dashed: true,
                points: ends.to_vec(),
            },
        ]
    });
    LineChart {
        title: format!("Figure 10: {}, chart", reading.name()),
        x_label: "λ".to_owned(),
        y_label: "SSIM after 11 iterations".to_owned(),
        x_scale: Scale::LogAbove(1.0),
        x_ticks: LAMBDAS.map(|l| f64::from((10.0 * l).round()) / 10.0).to_vec(),
        y_least: None,
        floor: None,
        series: series.collect(),
    }
}

fn findings(rows: &[Row]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for reading in Reading::ALL {
        let of: Vec<&Row> = rows.iter().filter(|row| row.reading == reading).collect();
        let near = |row: &&&Row| {
            let ratio = f64::from(row.best().0) / row.variance;
            (1.0 / NEAR..=NEAR).contains(&ratio)
        };
        let (all, count) = (of.len(), of.iter().filter(near).count());
        let helped = of.iter().filter(|row| row.best().1 > row.blurred).count();
        let name = reading.name();
        findings.push(Finding::of(
            "SSIM is best when λ is near the noise variance",
            &format!("best λ within a factor of {NEAR} of the variance, {name}"),
            format!("{count} of {all}"),
            "more than half",
            2 * count > all,
        ));
        let better = format!("best λ better than the blurred photo, {name}");
        findings.push(Finding::beside(better, format!("{helped} of {all}")));
        let row = of.iter().find(|r| r.scene == Scene::Chart && r.variance == PRINTED.0);
        let place = LAMBDAS.iter().position(|&lambda| lambda == PRINTED.1);
        if let Some((row, n)) = row.zip(place) {
            let what = format!("SSIM of the chart at variance and λ of 18, {name}");
            let found = format!("{:.3}, blurred {:.3}", row.ssim[n], row.blurred);
            findings.push(Finding::beside(what, found));
        }
    }
    findings
}
