//! `relens chart`: what the methods make of known scenes on this rig, as tables and pictures.

use super::drawing::Drawing;
use super::figures::Figure;
use super::peers;
use super::regimes::{self, Regime};
use super::scatter;
use super::scenes::Scene;
use super::sizes;
use super::study::{self, Condition, table};
use super::table::Table;
use super::test_rig::{Score, Stopwatch, TestRig, TestRigError};
use super::trade::{self, Trade, Within};
use crate::config::{self, Curve};
use crate::frame::{Channel, Plane};
use crate::pipeline::{method, paper};

/// What a chart is made of.
#[derive(Debug, Default)]
pub struct Chart {
    /// File stem and table.
    pub tables: Vec<(String, Table)>,
    /// File stem and drawing.
    pub drawings: Vec<(String, Drawing)>,
    /// File stem and grey picture, 0..255.
    pub pictures: Vec<(String, Plane)>,
    /// File name and content of whatever else there is.
    pub files: Vec<(String, Vec<u8>)>,
}

/// Speed against accuracy on the simulated rig of `rig`: every method with several settings.
/// `quick` leaves out most of the settings of the methods that lose. `peers` are rows of programs
/// from outside, see [`super::peers`].
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a method fails.
pub fn trade(
    rig: &config::Rig,
    quick: bool,
    peers: Option<&str>,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Score),
) -> Result<Chart, TestRigError> {
    let trade = trade::measure(rig, quick, scenes_for(rig), peers, stopwatch, each)?;
    let from_outside = peers
        .map_or("", |_| " The peers' seconds are from a run of their own on the same machine.");
    Ok(trade_chart(rig, &trade, from_outside))
}

/// The same on the rig that `stand` is on, which need not be simulated: scenes are shown to it.
///
/// # Errors
/// When a scene cannot be shown, or a method fails.
pub fn trade_on(
    mut test_rig: TestRig,
    quick: bool,
    each: &mut dyn FnMut(&Score),
) -> Result<Chart, TestRigError> {
    let rig = test_rig.config().clone();
    let mut trade = Trade::default();
    trade.run_all(&mut test_rig, quick, scenes_for(&rig), each)?;
    Ok(trade_chart(&rig, &trade, " The scenes were shown on the rig's own panel."))
}

/// The scenes that a rig's photos are charted by.
fn scenes_for(rig: &config::Rig) -> &'static [Scene] {
    if rig.photo.curve == Curve::Linear { &Scene::STUDY_PHOTOGRAPHS } else { &Scene::ALL }
}

fn trade_chart(rig: &config::Rig, trade: &Trade, remark: &str) -> Chart {
    let stem = format!("{}-speed-accuracy", rig.name);
    let chosen = |name: &str, within| {
        let point = trade.operating_point(within).map(|n| &trade.points[n]);
        point.map_or(String::new(), |p| {
            let (seconds, ssim, db) = (p.seconds(), p.ssim, p.psnr_db);
            format!(" {name}: {}, {} ({seconds:.2} s, {ssim:.4}/{db:.2} dB).", p.family, p.setting)
        })
    };
    let caption = format!(
        "Rig {}, {}; the blurred photos have {:.4}/{:.2} dB.{}{}{}{}",
        rig.name,
        rig.photo.size(),
        trade.photo_ssim,
        trade.photo_psnr_db,
        chosen("Fast", Within::FAST),
        chosen("Balanced", Within::BALANCED),
        chosen("Best", Within::NOTHING),
        remark
    );
    let title = format!("Speed against accuracy on rig {}", rig.name);
    let scores = table(format!("Rig {}, scene by scene.", rig.name), &trade.scores);
    Chart {
        drawings: vec![(stem.clone(), scatter::draw(trade, &title))],
        tables: vec![(stem, trade.table(caption)), (format!("{}-by-scene", rig.name), scores)],
        ..Chart::default()
    }
}

/// Where light earns its place over the measured lens, on a rig with linear photos.
///
/// # Errors
/// When a rig cannot be opened or calibrated, or a method fails.
pub fn regimes(
    rig: &config::Rig,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(Regime, &Score),
) -> Result<Chart, TestRigError> {
    let rows = regimes::measure(rig, &Regime::ALL, &Scene::STUDY_PHOTOGRAPHS, stopwatch, each)?;
    Ok(Chart {
        tables: vec![(format!("{}-regimes", rig.name), regimes::table(rig, &rows))],
        ..Chart::default()
    })
}

/// What other sizes of the rig's models would gain.
///
/// # Errors
/// When a rig cannot be opened or calibrated, or a method fails.
pub fn sizes(
    rig: &config::Rig,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Score),
) -> Result<Chart, TestRigError> {
    sizes::chart(rig, &Scene::STUDY_PHOTOGRAPHS, stopwatch, each)
}

/// A figure's files: its numbers, drawings and pictures.
pub fn figure(figure: &Figure) -> Chart {
    let named = |suffix: &str| format!("{}{suffix}", figure.stem);
    let (drawings, pictures) = (figure.drawings.iter(), figure.pictures.iter());
    Chart {
        files: vec![(named(".csv"), figure.table.csv().into_bytes())],
        drawings: drawings.map(|(suffix, drawing)| (named(suffix), drawing.clone())).collect(),
        pictures: pictures.map(|(suffix, _, picture)| (named(suffix), picture.clone())).collect(),
        ..Chart::default()
    }
}

/// What programs from outside need to restore the same photos, see [`super::peers`].
///
/// # Errors
/// When the rig cannot be opened or calibrated.
pub fn captures(rig: &config::Rig, stopwatch: Stopwatch) -> Result<Chart, TestRigError> {
    Ok(Chart {
        files: peers::captures(rig, &Scene::STUDY_PHOTOGRAPHS, stopwatch)?,
        ..Chart::default()
    })
}

/// Charts the simulated rig of `rig`; `quick` leaves out all but the photographs and the
/// model-based methods. `each` is called with every score as it comes.
///
/// A rig whose photos are linear, as the study's, is charted under the study's conditions in green;
/// any other in colour, in luminance of display values.
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a method fails.
pub fn conditions(
    rig: &config::Rig,
    quick: bool,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Score),
) -> Result<Chart, TestRigError> {
    let mut chart = Chart::default();
    if rig.photo.curve == Curve::Linear {
        let scenes: &[Scene] = &[Scene::Astronaut, Scene::Coffee, Scene::Chart];
        let scenes = if quick { &scenes[..2] } else { scenes };
        for condition in Condition::STUDY {
            let scores = study::compare(rig.clone(), condition, stopwatch, scenes, each)?;
            let caption = format!("Rig {}, {}; green channel, light.", rig.name, condition.name());
            chart
                .tables
                .push((format!("{}-{}", rig.name, slug(condition)), table(caption, &scores)));
        }
        chart.pictures = first_iterations(rig, Scene::Astronaut, stopwatch)?;
        return Ok(chart);
    }
    use config::Method::{
        BlockMatching, Digital, Hybrid, Paper, Residual, RichardsonLucy, Unmatched, Wiener,
    };
    let methods: &[config::Method] = if quick {
        &[Digital, Hybrid, BlockMatching]
    } else {
        &[Paper, Residual, Unmatched, Digital, Hybrid, BlockMatching, Wiener, RichardsonLucy]
    };
    let mut test_rig = TestRig::open(rig.clone(), stopwatch)?;
    let mut scores = Vec::new();
    for scene in Scene::ALL {
        for &which in methods {
            let solver = method(rig, which);
            let score = test_rig.score_colour(scene, solver.name(), &*solver)?;
            each(&score);
            scores.push(score);
        }
    }
    let caption = format!("Rig {}, {}; luminance of display values.", rig.name, rig.photo.size());
    chart.tables.push((rig.name.clone(), table(caption, &scores)));
    Ok(chart)
}

fn slug(condition: Condition) -> &'static str {
    match condition {
        Condition::AsFiled => "noise",
        Condition::NoNoise => "no-noise",
        Condition::Glare(_) => "glare",
        Condition::OneFunction => "one-function",
    }
}

/// The paper's Fig. 11: the photo and the first iterations of its loop, captures without noise.
fn first_iterations(
    rig: &config::Rig,
    scene: Scene,
    stopwatch: Stopwatch,
) -> Result<Vec<(String, Plane)>, TestRigError> {
    let mut test_rig = study::open(rig.clone(), Condition::NoNoise, stopwatch)?;
    let solver = paper(test_rig.config());
    let rect = test_rig.config().photo_on_canvas();
    let mut pictures = Vec::new();
    test_rig.score_grey_watched(scene, "paper", &solver, &mut |step, picture| {
        if let Some(picture) = picture.filter(|_| [1, 2, 3, 5, 11].contains(&step.iteration)) {
            let seen = picture.plane(Channel::Green).crop(rect).map(|v: f32| v.clamp(0.0, 255.0));
            pictures.push((
                format!("figure-11-{}-iteration-{:02}", scene.name(), step.iteration),
                seen,
            ));
        }
    })?;
    Ok(pictures)
}
