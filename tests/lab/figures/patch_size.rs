//! Figure 7: convergence with flip–FC–flip of several patch sizes, and with the exact adjoint.

use super::mosaic::{detail, mosaic};
use super::stage::{Course, Exact, Stage, Taken, printed, with_patches};
use super::{Figure, Finding, Picture};
use crate::Failure;
use crate::change::NO_NOISE;
use crate::conditions::whole_frame;
use crate::lines::{LineChart, PALETTE, Scale, Series};
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::RigFile;
use relens::deconvolution::method::paper::Paper;

/// Patch sizes for a photo 1024 wide; the paper tries 60, 80 and others that it does not print.
const PATCHES_PX: [usize; 6] = [40, 60, 80, 120, 160, 240];
/// Number of iterations; the paper stops at 11.
const ITERATIONS: u32 = 20;
/// Number of iterations in the paper.
const PRINTED: usize = 11;
/// Difference of SSIM that is "very small" or "almost the same": invisible. Guess.
const SMALL_SSIM: f64 = 0.005;
/// Largest gain in SSIM after the paper's 11 iterations for "optimal performance at around 10
/// iterations".
const FLAT_SSIM: f64 = 0.005;

/// Columns of the table.
const HEAD: [&str; 12] =
    ["scene", "backward convolution", "0", "1", "2", "3", "5", "8", "11", "15", "20", "dB at 11"];

/// The figure, measured without noise.
pub(super) fn measure(rig: &RigFile) -> Result<Figure, Failure> {
    let mut stage = Stage::open(NO_NOISE.filed(rig, 0.0))?;
    let mut table = Table::new("SSIM after so many iterations, captures without noise.", &HEAD);
    let mut drawn = Vec::new();
    let mut pictures = Vec::new();
    for scene in [Scene::Chart, Scene::Coffee] {
        let taken = stage.take(scene)?;
        let (blurred_ssim, _) = taken.floor();
        let mut details = vec![taken.truth.clone(), taken.blurred()];
        let courses = courses(&mut stage, &taken, rig)?;
        for (name, course) in &courses {
            let at = |n| format!("{:.4}", course.ssim_at(n));
            let mut row = vec![scene.name().to_owned(), name.clone(), format!("{blurred_ssim:.4}")];
            row.extend([1, 2, 3, 5, 8, 11, 15, 20].map(at));
            row.push(format!("{:.2}", course.psnr_at(PRINTED)));
            table.row(row);
        }
        if scene == Scene::Chart {
            for wanted in ["exact adjoint", "patch 60", "one patch, the whole frame"] {
                let course = courses.iter().find(|(name, _)| name == wanted);
                details
                    .extend(course.and_then(|(_, c)| c.pictures.first()).map(|(_, p)| p.clone()));
            }
            let tiles: Vec<_> = details.iter().map(|p| detail(p, (0.2, 0.25), 0.4, 1)).collect();
            let seen = "A corner of the chart, left to right: the scene; the photo; after 11 \
                        iterations with the exact adjoint, with patches of 60, and with one patch \
                        for the whole frame.";
            let picture = mosaic(&tiles, 5);
            pictures.push(Picture { suffix: "", seen: seen.to_owned(), picture });
        }
        drawn.push((scene, blurred_ssim, courses));
    }
    let drawings = drawn.iter().zip(["-chart", "-coffee"]);
    let drawings = drawings
        .map(|((scene, floor, courses), suffix)| (suffix, curves(*scene, *floor, courses).draw()));
    Ok(Figure {
        number: 7,
        stem: "figure-07-patch-size",
        title: "Patch size of flip–FC–flip",
        findings: findings(&drawn),
        drawings: drawings.collect(),
        pictures,
        table,
    })
}

/// The paper's loop by the exact adjoint, and by light with patches of every size.
fn courses(
    stage: &mut Stage,
    taken: &Taken,
    rig: &RigFile,
) -> Result<Vec<(String, Course)>, Failure> {
    let lens = stage.truth.clone();
    let exact = Exact { paper: Paper { iterations: ITERATIONS, ..printed(rig) }, lens: &lens };
    let mut courses = vec![("exact adjoint".to_owned(), stage.solve(taken, &exact, &[11])?)];
    for patch_px in PATCHES_PX {
        let solver = Paper { iterations: ITERATIONS, ..with_patches(rig, patch_px) };
        courses.push((format!("patch {patch_px}"), stage.solve(taken, &solver, &[11])?));
    }
    let whole = Paper { iterations: ITERATIONS, ..whole_frame(rig) };
    let course = stage.solve(taken, &whole, &[11])?;
    courses.push(("one patch, the whole frame".to_owned(), course));
    Ok(courses)
}

type Measured = (Scene, f64, Vec<(String, Course)>);

fn curves(scene: Scene, floor: f64, courses: &[(String, Course)]) -> LineChart {
    let series = courses.iter().enumerate().map(|(n, (name, course))| {
        let steps = course.ssim.iter().enumerate().map(|(n, &ssim)| [n as f64 + 1.0, ssim]);
        Series {
            name: name.clone(),
            colour: PALETTE[n % PALETTE.len()],
            dashed: n == 0,
            points: std::iter::once([0.0, floor]).chain(steps).collect(),
        }
    });
    LineChart {
        title: format!("Figure 7: patch size, {}", scene.name()),
        x_label: "iterations".to_owned(),
        y_label: "SSIM".to_owned(),
        x_scale: Scale::Linear,
        x_ticks: (0..=10).map(|n| f64::from(2 * n)).collect(),
        // The diverging curve is cut off to keep the others apart.
        y_least: Some(floor - 0.05),
        floor: Some((floor, "the blurred photo".to_owned())),
        series: series.collect(),
    }
}

fn findings(drawn: &[Measured]) -> Vec<Finding> {
    let named = |courses: &[(String, Course)], name: &str, iteration: usize| {
        courses.iter().find(|(n, _)| n == name).map_or(f64::NAN, |(_, c)| c.ssim_at(iteration))
    };
    let worst =
        |of: &dyn Fn(&Measured) -> f64| drawn.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let exact = |c: &[(String, Course)], n| named(c, "exact adjoint", n);
    let gap_60 = worst(&|(.., c)| exact(c, PRINTED) - named(c, "patch 60", PRINTED));
    let gap_80 = worst(&|(.., c)| exact(c, PRINTED) - named(c, "patch 80", PRINTED));
    let below_80 =
        worst(&|(.., c)| (named(c, "patch 40", PRINTED) - named(c, "patch 80", PRINTED)).abs());
    let rise = worst(&|(.., courses)| {
        let at = PATCHES_PX.map(|p| named(courses, &format!("patch {p}"), PRINTED));
        at.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::NEG_INFINITY, f64::max)
    });
    let more = worst(&|(.., c)| exact(c, ITERATIONS as usize) - exact(c, PRINTED));
    let whole = worst(&|(_, floor, c)| named(c, "one patch, the whole frame", PRINTED) - floor);
    let ssim = |value: f64| format!("{value:+.4} SSIM");
    vec![
        Finding::of(
            "smaller patches are better",
            "what the next larger patch gains at 11 iterations, at most",
            ssim(rise),
            "0.0005",
            rise <= 0.0005,
        ),
        Finding::of(
            "below 80 the size hardly matters",
            "between patches of 80 and 40, at most",
            ssim(below_80),
            "0.005",
            below_80 < SMALL_SSIM,
        ),
        Finding::of(
            "patches of 60 are almost the same as accurate calculation",
            "the exact adjoint over patches of 60, at most",
            ssim(gap_60),
            "0.005",
            gap_60 < SMALL_SSIM,
        ),
        Finding::beside("the exact adjoint over patches of 80, at most", ssim(gap_80)),
        Finding::of(
            "around 10 iterations are optimal",
            "what 20 iterations gain over 11, at most",
            ssim(more),
            "0.005",
            more < FLAT_SSIM,
        ),
        Finding::beside("one patch for the whole frame over the blurred photo", ssim(whole)),
    ]
}
