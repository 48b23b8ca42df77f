//! No more model than a scene needs, for the rig's own sizes: what more lens functions, wavelet
//! levels, captures averaged or other patches would gain over what its file has.
//!
//! Each size is changed alone, on a rig that was calibrated with it. Lens functions, levels and
//! averaging are tried with the rig file's method; patches with `residual`, whose captures they cut
//! up.

use relens::chart::contestants::Contestant;
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::chart::test_rig::TestRig;
use relens::chart::trade::{Point, Trade};
use relens::config::{Alignment, MethodName, RigFile};
use relens::deconvolution::method::averaging::Averaged;
use relens::pipeline::method;

use crate::change::set_patch;
use crate::made::Made;
use crate::{Failure, seconds, told};

/// SSIM that a larger size must gain to be worth having: the study, less means nothing.
const WORTH: f64 = 0.002;

/// A size to be tried.
struct Size {
    what: &'static str,
    value: String,
    /// Whether the rig file has it so.
    filed: bool,
    rig: RigFile,
    contestant: Contestant,
}

/// Every size on the study's photographs.
pub(crate) fn run(rig: &RigFile) -> Result<Made, Failure> {
    let mut points = Vec::new();
    let sizes = sizes(rig);
    for size in &sizes {
        let mut trade = Trade::default();
        let mut test_rig = TestRig::open(size.rig.clone(), seconds)?;
        trade.run(&mut test_rig, (&Scene::STUDY_PHOTOGRAPHS, 1), &size.contestant, &mut told)?;
        points.append(&mut trade.points);
    }
    let caption = format!(
        "What other sizes would gain over those of the rig file, rig {}, mean of astronaut, \
         coffee; less than {WORTH} SSIM is worth nothing.",
        rig.name
    );
    Ok(Made::table(format!("{}-sizes", rig.name), table(caption, &sizes, &points)))
}

fn sizes(rig: &RigFile) -> Vec<Size> {
    let mut all = Vec::new();
    let mut add = |what, value: String, filed, rig: RigFile, which: MethodName, times: u32| {
        let solver = method(&rig, which);
        let solver = if times > 1 { Box::new(Averaged { method: solver, times }) } else { solver };
        let contestant = Contestant::boxed(solver.name(), &format!("{what} {value}"), solver);
        all.push(Size { what, value, filed, rig, contestant });
    };
    let which = rig.restore.method;
    let (columns, rows) = (rig.calibration.function_columns, rig.calibration.function_rows);
    // A geometry that is seen on a board is centred by the functions, and one place does not tell
    // it.
    let first = usize::from(rig.calibration.geometry == Alignment::Checkerboard);
    for &(n, d) in &[(0, 1), (1, 2), (1, 1), (2, 1)][first..] {
        let mut changed = rig.clone();
        let grid = ((columns * n / d).max(1), (rows * n / d).max(1));
        (changed.calibration.function_columns, changed.calibration.function_rows) = grid;
        let value = format!("{}×{}", grid.0, grid.1);
        add("lens functions", value, grid == (columns, rows), changed, which, 1);
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
        set_patch(&mut changed, patch_px as f64);
        add("patch", format!("{patch_px} px"), patch_px == filed, changed, MethodName::Residual, 1);
    }
    all
}

/// What each of `points` gains in SSIM over the rig file's size of the same thing.
fn gains(of: &[(&str, bool)], points: &[Point]) -> Vec<f64> {
    let all = || of.iter().zip(points);
    let filed = |what| all().find(|((w, filed), _)| *filed && *w == what).map(|(_, p)| p.ssim);
    all().map(|((what, _), p)| p.ssim - filed(*what).unwrap_or(p.ssim)).collect()
}

fn table(caption: String, sizes: &[Size], points: &[Point]) -> Table {
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
    let of: Vec<(&str, bool)> = sizes.iter().map(|size| (size.what, size.filed)).collect();
    for ((size, point), gain) in sizes.iter().zip(points).zip(gains(&of, points)) {
        let (over, worth) = match (size.filed, gain > WORTH) {
            (true, _) => ("as filed".to_owned(), "–"),
            (false, true) => (format!("{gain:+.4}"), "yes"),
            (false, false) => (format!("{gain:+.4}"), "no"),
        };
        table.row(vec![
            size.what.to_owned(),
            size.value.clone(),
            point.family.to_owned(),
            format!("{:.1}", point.captures),
            format!("{:.2}", point.seconds()),
            format!("{:.4}", point.ssim),
            format!("{:.2}", point.psnr_db),
            over,
            worth.to_owned(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_size_is_compared_with_the_filed_one_of_the_same_thing() {
        let point = |ssim| Point {
            edge_difference: None,
            line: String::new(),
            family: "x",
            setting: String::new(),
            printed: false,
            captures: 1.0,
            capture_seconds: 0.1,
            computing_seconds: 0.1,
            ssim,
            psnr_db: 30.0,
        };
        let of = [("a", false), ("a", true), ("b", true), ("b", false)];
        let gains = gains(&of, &[0.90, 0.92, 0.80, 0.81].map(point));
        let wanted = [-0.02, 0.0, 0.0, 0.01];
        let near = |(gain, wanted): (&f64, f64)| (gain - wanted).abs() < 1e-12;
        assert!(gains.iter().zip(wanted).all(near), "{gains:?}");
    }

    #[test]
    fn every_thing_is_tried_as_filed_smaller_or_larger() {
        let sizes = sizes(&crate::rig("study.toml").unwrap());
        for what in ["lens functions", "shrinkage levels", "captures averaged", "patch"] {
            let of: Vec<_> = sizes.iter().filter(|size| size.what == what).collect();
            assert_eq!(of.iter().filter(|size| size.filed).count(), 1, "{what}");
            assert!(of.len() >= 3, "{what}");
        }
    }
}
