//! Figure 8: where flip–FC–flip differs from the exact adjoint.

use super::mosaic::{enlarged, functions_map, halved, mosaic};
use super::stage::{Stage, scaled, shown};
use super::{Figure, Finding, Picture};
use crate::Failure;
use crate::change::NO_NOISE;
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::RigFile;
use relens::deconvolution::patches::PatchShape;
use relens::frame::Plane;

/// The paper's patch size for a photo 1024 wide.
const PATCH_PX: usize = 80;
/// Patch sizes compared.
const PATCHES_PX: [usize; 4] = [40, 80, 160, 1024];
/// Factor that makes the error visible.
const BRIGHTER: f32 = 20.0;
/// Mean error in the corners up to which accuracy is "very high", grey levels; guess: invisible.
const SMALL_LEVELS: f64 = 1.0;

/// Mean and 99th percentile of the error in each of the [`ZONES`], grey levels.
struct Zones {
    mean: [f64; 4],
    high: [f64; 4],
}

const ZONES: [&str; 4] = ["centre", "between", "corners", "at the frame"];

impl Zones {
    /// Zones by distance from the centre, in thirds of the half diagonal; a border of `border_px`
    /// is a zone of its own.
    fn of(error: &Plane, border_px: usize) -> Zones {
        let (width, height) = (error.width(), error.height());
        let (cx, cy) = (0.5 * (width - 1) as f64, 0.5 * (height - 1) as f64);
        let mut values: [Vec<f64>; 4] = Default::default();
        for y in 0..height {
            for x in 0..width {
                let inner = |at: usize, length: usize| at >= border_px && at + border_px < length;
                let zone = if inner(x, width) && inner(y, height) {
                    let share = (x as f64 - cx).hypot(y as f64 - cy) / cx.hypot(cy);
                    ((3.0 * share) as usize).min(2)
                } else {
                    3
                };
                values[zone].push(f64::from(error.at(x, y)));
            }
        }
        values.iter_mut().for_each(|zone| zone.sort_unstable_by(f64::total_cmp));
        Zones {
            mean: std::array::from_fn(|z| {
                values[z].iter().sum::<f64>() / values[z].len().max(1) as f64
            }),
            high: std::array::from_fn(|z| {
                values[z].get(values[z].len() * 99 / 100).copied().unwrap_or(0.0)
            }),
        }
    }
}

/// The figure, measured without noise.
pub(super) fn measure(rig: &RigFile) -> Result<Figure, Failure> {
    let mut stage = Stage::open(NO_NOISE.filed(rig, 0.0))?;
    let taken = stage.take(Scene::Chart)?;
    let border_px = stage.truth.functions().support_px / 2;
    let mut head = vec!["patch"];
    head.extend(ZONES.iter().flat_map(|_| ["mean", "99 %"]));
    let caption = format!(
        "Absolute difference in grey levels between backward convolution by light and by the true \
         lens, chart: mean and 99th percentile in the centre, between, in the corners (thirds of \
         the half diagonal) and, on the right, in the border of {border_px} pixels around them."
    );
    let mut table = Table::new(caption, &head);
    let mut printed = None;
    for patch_px in PATCHES_PX {
        // Without noise a margin as wide as the functions costs nothing.
        let shape = PatchShape { patch_px: scaled(rig, patch_px), margin_px: border_px };
        let (exact, light) = stage.backward(&taken.truth, shape)?;
        let mut error = exact.clone();
        error.add_scaled(-1.0, &light);
        let error = error.map(f32::abs);
        let zones = Zones::of(&error, border_px);
        let mut row = vec![patch_px.to_string()];
        row.extend(
            (0..4).flat_map(|z| [format!("{:.2}", zones.mean[z]), format!("{:.2}", zones.high[z])]),
        );
        table.row(row);
        if patch_px == PATCH_PX {
            printed = Some((exact, light, error, zones));
        }
    }
    let (exact, light, error, zones) = printed.ok_or("the paper's patch size was not tried")?;
    let tiles = [&taken.truth, &taken.blurred(), &shown(&exact), &shown(&light)].map(halved);
    let bright = shown(&halved(&error).map(|v: f32| BRIGHTER * v));
    let [scene, photo, exact, light] = tiles;
    let seen = format!(
        "Left to right, above: the scene; the photo; backward convolution of the scene by the \
         true lens. Below: the same by light, patches of {PATCH_PX}; the difference, {BRIGHTER} \
         times as bright."
    );
    let functions = "The lens's functions over the field, each to its own maximum, square roots.";
    Ok(Figure {
        number: 8,
        stem: "figure-08-error-map",
        title: "Where flip–FC–flip errs",
        findings: findings(&zones, stage.truth_error(&taken.truth)),
        drawings: Vec::new(),
        pictures: vec![
            Picture { suffix: "", seen, picture: mosaic(&[scene, photo, exact, light, bright], 3) },
            Picture {
                suffix: "-functions",
                seen: functions.to_owned(),
                picture: enlarged(&functions_map(&stage.truth, 7, 7), 1),
            },
        ],
        table,
    })
}

/// Findings for patches of [`PATCH_PX`]; `accuracy` is the error of the true lens as computed.
fn findings(zones: &Zones, accuracy: f64) -> Vec<Finding> {
    let [centre, _, corners, frame] = zones.mean;
    let levels = |value: f64| format!("{value:.2} grey levels");
    vec![
        Finding::of(
            "the error grows slightly towards the corners",
            "mean error in the corners less that in the centre",
            levels(corners - centre),
            "more than 0",
            corners > centre,
        ),
        Finding::of(
            "with patches of 80 the approximation is hard to tell from the truth",
            "mean error in the corners",
            levels(corners),
            "1",
            corners < SMALL_LEVELS,
        ),
        Finding::beside("mean error in the centre", levels(centre)),
        Finding::beside("its worst hundredth in the centre", levels(zones.high[0])),
        Finding::beside("its worst hundredth in the corners", levels(zones.high[2])),
        Finding::beside(
            "part of it: the true lens as computed against the light (the rest of what is not the \
             approximation's is four roundings to 8 bits)",
            levels(accuracy),
        ),
        Finding::beside(
            "mean error in the border: light thrown out of the frame does not come back",
            levels(frame),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use relens::frame::Size;

    #[test]
    fn every_pixel_is_in_the_zone_it_lies_in() {
        let size = Size::new(61, 45);
        // 9 in the border of 4, 1 near the centre, 5 elsewhere.
        let error = Plane::from_fn(size, |x, y| {
            let border = x < 4 || y < 4 || x >= 57 || y >= 41;
            let near = (x as f64 - 30.0).hypot(y as f64 - 22.0) < 30f64.hypot(22.0) / 3.0;
            if border {
                9.0
            } else if near {
                1.0
            } else {
                5.0
            }
        });
        let zones = Zones::of(&error, 4);
        assert_eq!((zones.mean, zones.high), ([1.0, 5.0, 5.0, 9.0], [1.0, 5.0, 5.0, 9.0]));
    }
}
