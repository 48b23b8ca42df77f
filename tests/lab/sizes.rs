//! No more model than a scene needs, for the rig's own sizes: what more lens functions, wavelet
//! levels, captures averaged or other patches would gain over what its file has.
//!
//! Each size is changed alone, on a rig that was calibrated with it. Lens functions, levels and
//! averaging are tried with the rig file's method; patches with `residual`, whose captures they cut
//! up.

use super::chart::Chart;
use super::scenes::Scene;
use super::table::Table;
use super::test_rig::{Score, Stopwatch, TestRig, TestRigError};
use super::trade::{Contestant, Point, Trade};
use crate::config::{Geometry, Method as Named, Rig};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::averaging::Averaged;
use crate::pipeline::method;

/// SSIM that a larger size must gain to be worth having: the study, less means nothing.
pub const WORTH: f64 = 0.002;

/// One size of one thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// What is sized.
    pub what: &'static str,
    /// How large.
    pub value: String,
    /// Whether the rig file has it so.
    pub filed: bool,
    /// What it makes of the scenes.
    pub point: Point,
}

/// A size to be tried: what, how large, whether it is the rig file's, the rig so changed, and the
/// solver.
struct Tried {
    what: &'static str,
    value: String,
    filed: bool,
    rig: Rig,
    solver: Box<dyn Method + Send + Sync>,
}

fn tried(rig: &Rig) -> Vec<Tried> {
    let mut all = Vec::new();
    let mut add = |what, value: String, filed, rig: Rig, which: Named, times: u32| {
        let solver = method(&rig, which);
        let solver = if times > 1 { Box::new(Averaged { method: solver, times }) } else { solver };
        all.push(Tried { what, value, filed, rig, solver });
    };
    let which = rig.restore.method;
    let (columns, rows) = (rig.calibration.function_columns, rig.calibration.function_rows);
    // A geometry that is seen on a board is centred by the functions, and one place does not tell
    // it.
    let first = usize::from(rig.calibration.geometry == Geometry::Checkerboard);
    for &(n, d) in &[(0, 1), (1, 2), (1, 1), (2, 1)][first..] {
        let mut changed = rig.clone();
        let grid = ((columns * n / d).max(1), (rows * n / d).max(1));
        (changed.calibration.function_columns, changed.calibration.function_rows) = grid;
        add(
            "lens functions",
            format!("{}×{}", grid.0, grid.1),
            grid == (columns, rows),
            changed,
            which,
            1,
        );
    }
    let filed = rig.restore.levels;
    for levels in filed.saturating_sub(2).max(1)..=filed + 1 {
        let mut changed = rig.clone();
        changed.restore.levels = levels;
        add("shrinkage levels", levels.to_string(), levels == filed, changed, which, 1);
    }
    for times in [1, 2, 4] {
        add("captures averaged", times.to_string(), times == 1, rig.clone(), which, times);
    }
    let filed = rig.paper.patch_px;
    for patch_px in [filed / 4, filed / 2, filed, 2 * filed] {
        let mut changed = rig.clone();
        changed.paper.patch_px = patch_px;
        // A margin wider than the patch would sew its neighbours' light in.
        changed.paper.margin_px = rig.paper.margin_px.min(patch_px / 2);
        add("patch", format!("{patch_px} px"), patch_px == filed, changed, Named::Residual, 1);
    }
    all
}

/// Every size on `scenes` on the simulated rig of `rig`; `each` is told of every score.
///
/// # Errors
/// When a rig cannot be opened or calibrated, or a method fails.
pub fn measure(
    rig: &Rig,
    scenes: &[Scene],
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Score),
) -> Result<Vec<Row>, TestRigError> {
    let mut rows = Vec::new();
    for Tried { what, value, filed, rig, solver } in tried(rig) {
        let mut test_rig = TestRig::open(rig, stopwatch)?;
        let setting = format!("{what} {value}");
        let contestant =
            Contestant { family: solver.name(), setting, method: solver, printed: false };
        let mut trade = Trade::default();
        trade.run(&mut test_rig, scenes, &contestant, each)?;
        let points = trade.points.into_iter();
        rows.extend(points.map(|point| Row { what, value: value.clone(), filed, point }));
    }
    Ok(rows)
}

/// What each of `rows` gains in SSIM over the rig file's size of the same thing.
pub fn gains(rows: &[Row]) -> Vec<f64> {
    let filed =
        |what| rows.iter().find(|row| row.filed && row.what == what).map(|row| row.point.ssim);
    rows.iter().map(|row| row.point.ssim - filed(row.what).unwrap_or(row.point.ssim)).collect()
}

/// The sizes as a table.
///
/// # Errors
/// As [`measure`].
pub fn chart(
    rig: &Rig,
    scenes: &[Scene],
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Score),
) -> Result<Chart, TestRigError> {
    let rows = measure(rig, scenes, stopwatch, each)?;
    let names: Vec<&str> = scenes.iter().map(|scene| scene.name()).collect();
    let caption = format!(
        "What other sizes would gain over those of the rig file, rig {}, mean of {}; less than \
         {WORTH} SSIM is worth nothing.",
        rig.name,
        names.join(", ")
    );
    let head = [
        "size",
        "value",
        "method",
        "captures",
        "seconds",
        "SSIM",
        "PSNR dB",
        "over the filed",
        "worth it",
    ];
    let mut table = Table::new(caption, &head);
    for (row, gain) in rows.iter().zip(gains(&rows)) {
        let (over, worth) = match (row.filed, gain > WORTH) {
            (true, _) => ("as filed".to_owned(), "–"),
            (false, true) => (format!("{gain:+.4}"), "yes"),
            (false, false) => (format!("{gain:+.4}"), "no"),
        };
        table.row(vec![
            row.what.to_owned(),
            row.value.clone(),
            row.point.family.to_owned(),
            format!("{:.1}", row.point.captures),
            format!("{:.2}", row.point.seconds()),
            format!("{:.4}", row.point.ssim),
            format!("{:.2}", row.point.psnr_db),
            over,
            worth.to_owned(),
        ]);
    }
    Ok(Chart { tables: vec![(format!("{}-sizes", rig.name), table)], ..Chart::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_size_is_compared_with_the_filed_one_of_the_same_thing() {
        let row = |what, filed, ssim| Row {
            what,
            value: String::new(),
            filed,
            point: Point {
                family: "x",
                setting: String::new(),
                printed: false,
                captures: 1.0,
                capture_seconds: 0.1,
                computing_seconds: 0.1,
                ssim,
                psnr_db: 30.0,
            },
        };
        let rows = [
            row("a", false, 0.90),
            row("a", true, 0.92),
            row("b", true, 0.80),
            row("b", false, 0.81),
        ];
        let gains = gains(&rows);
        let wanted = [-0.02, 0.0, 0.0, 0.01];
        assert!(
            gains.iter().zip(wanted).all(|(gain, wanted)| (gain - wanted).abs() < 1e-12),
            "{gains:?}"
        );
    }

    #[test]
    fn every_thing_is_tried_as_filed_smaller_or_larger() {
        let rig = crate::config::load(std::path::Path::new("study.toml"))
            .expect("it comes with the program");
        let tried = tried(&rig);
        for what in ["lens functions", "shrinkage levels", "captures averaged", "patch"] {
            let of: Vec<_> = tried.iter().filter(|tried| tried.what == what).collect();
            assert_eq!(of.iter().filter(|tried| tried.filed).count(), 1, "{what}");
            assert!(of.len() >= 3, "{what}");
        }
    }
}
