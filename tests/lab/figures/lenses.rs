//! Figure 12: three lenses.
//!
//! The paper does not describe its three real lenses; here they are three singlets of 75 mm, as
//! different as possible.

use super::mosaic::{detail, functions_map, mosaic};
use super::stage::{Stage, printed};
use super::{Figure, Finding, Picture};
use crate::Failure;
use crate::change::{NO_NOISE, NOTHING, lens, simulation};
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::{Glass, LensSurface, Prescription, RigFile};
use relens::deconvolution::lens_model::LensModel;
use relens::frame::Channel;
use relens::pipeline::hybrid;

/// Share of the sensor's range that white fills. The rest is headroom: where the blur changes
/// quickly over the field, light gathers on some pixels.
const WHITE_SHARE: f64 = 0.9;

/// A lens: its name, the radii of its two surfaces, and its stop.
struct Singlet {
    name: &'static str,
    radii_mm: [f64; 2],
    stop_diameter_mm: f64,
}

/// The lenses, with radii by the lens maker's formula for a thin lens of 75 mm and N-BK7's index of
/// 1.5168 at 587.6 nm.
const LENSES: [Singlet; 3] = [
    Singlet {
        name: "biconvex, f/4",
        radii_mm: [75.954_953_636_158_31, -75.954_953_636_158_31],
        stop_diameter_mm: 18.75,
    },
    Singlet {
        name: "plano-convex, curved side to the scene, f/4",
        radii_mm: [38.76, f64::INFINITY],
        stop_diameter_mm: 18.75,
    },
    Singlet {
        name: "meniscus, hollow side to the camera, f/5.6",
        radii_mm: [27.93, 100.0],
        stop_diameter_mm: 13.4,
    },
];

impl Singlet {
    fn put_into(&self, lens: &mut Prescription) {
        let rim_mm = lens.surfaces.first().map_or(50.0, |s| s.clear_diameter_mm);
        let surface = |radius_mm, thickness_mm, glass| LensSurface {
            radius_mm,
            thickness_mm,
            glass,
            clear_diameter_mm: rim_mm,
        };
        let [front, back] = self.radii_mm;
        lens.surfaces = vec![surface(front, 9.0, Glass::NBk7), surface(back, 70.0, Glass::Air)];
        lens.stop_at_surface = 0;
        lens.stop_diameter_mm = self.stop_diameter_mm;
    }
}

/// Columns of the table.
const HEAD: [&str; 11] = [
    "lens",
    "spot px",
    "noise",
    "scene",
    "method",
    "captures",
    "photo SSIM/dB",
    "SSIM",
    "PSNR dB",
    "gain SSIM",
    "certificate",
];

/// The figure: the paper's loop without noise, the default method with the rig's.
pub(super) fn measure(rig: &RigFile) -> Result<Figure, Failure> {
    let mut table = Table::new(
        "Three lenses; spots in pixels (root mean square, green) in the centre and in the corner.",
        &HEAD,
    );
    let (mut pictures, mut maps, mut gains) = (Vec::new(), Vec::new(), Vec::new());
    for singlet in &LENSES {
        for (change, noise) in [(&NO_NOISE, "without noise"), (&NOTHING, "with noise")] {
            let mut changed = change.filed(rig, 0.0);
            lens(&mut changed, |lens| singlet.put_into(lens));
            simulation(&mut changed, |simulation| simulation.sensor.white_share = WHITE_SHARE);
            let mut stage = Stage::open(changed)?;
            let quiet = noise == "without noise";
            let spots = spots_px(&stage.truth);
            for scene in [Scene::Astronaut, Scene::Coffee] {
                let taken = stage.take(scene)?;
                let (blurred, blurred_db) = taken.floor();
                let mut courses = vec![("paper", stage.solve(&taken, &printed(rig), &[])?)];
                courses.push(("hybrid", stage.solve(&taken, &hybrid(rig), &[])?));
                for (method, course) in &courses {
                    let (ssim, db) = course.end(&taken.truth);
                    let mut row = vec![singlet.name.to_owned()];
                    row.push(format!("{:.1}, {:.1}", spots[0], spots[1]));
                    row.extend([noise, scene.name(), method].map(str::to_owned));
                    row.push(course.captures.to_string());
                    row.push(format!("{blurred:.4}/{blurred_db:.2}"));
                    row.extend([format!("{ssim:.4}"), format!("{db:.2}")]);
                    row.push(format!("{:+.4}", ssim - blurred));
                    row.push(course.certificate.map_or("–".to_owned(), |r| format!("{r:.2}")));
                    table.row(row);
                    gains.push((*method, quiet, ssim - blurred));
                }
                if scene == Scene::Astronaut && !quiet {
                    let last = courses.last().map(|(_, course)| course.last.clone());
                    let tiles = [Some(taken.truth.clone()), Some(taken.blurred()), last];
                    pictures
                        .extend(tiles.iter().flatten().map(|p| detail(p, (0.45, 0.25), 0.4, 1)));
                    maps.push(functions_map(&stage.truth, 5, 5));
                }
            }
        }
    }
    let seen = "A row a lens: the scene, the photo, and what the default method makes of it, with \
     the rig's noise.";
    let functions =
        "The lenses' functions over the field, in the same order from the left: square roots.";
    Ok(Figure {
        number: 12,
        stem: "figure-12-lenses",
        title: "Three lenses",
        findings: findings(&gains),
        drawings: Vec::new(),
        pictures: vec![
            Picture { suffix: "", seen: seen.to_owned(), picture: mosaic(&pictures, 3) },
            Picture { suffix: "-functions", seen: functions.to_owned(), picture: mosaic(&maps, 3) },
        ],
        table,
    })
}

/// Root mean square radius in pixels of the green function in the centre and in the corner.
fn spots_px(lens: &LensModel) -> [f64; 2] {
    let functions = lens.functions();
    let k = functions.support_px;
    [(functions.rows / 2, functions.columns / 2), (0, 0)].map(|(row, column)| {
        let taps = functions.function(Channel::Green, row, column);
        let moment = |weight: &dyn Fn(f64, f64) -> f64| -> f64 {
            taps.iter()
                .enumerate()
                .map(|(n, &t)| f64::from(t) * weight((n % k) as f64, (n / k) as f64))
                .sum()
        };
        let sum = moment(&|_, _| 1.0);
        let (x, y) = (moment(&|u, _| u) / sum, moment(&|_, v| v) / sum);
        (moment(&|u, v| (u - x).powi(2) + (v - y).powi(2)) / sum).sqrt()
    })
}

fn findings(gains: &[(&str, bool, f64)]) -> Vec<Finding> {
    let range = |method: &str, quiet: bool| {
        let of = gains.iter().filter(|g| g.0 == method && g.1 == quiet).map(|g| g.2);
        of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), g| (a.min(g), b.max(g)))
    };
    let words = |(least, most): (f64, f64)| format!("{least:+.3} to {most:+.3}");
    let (quiet, noisy) = (range("paper", true), range("paper", false));
    let promising = "promising results on three lenses it does not describe";
    let (allowed, change) = ("more than 0", "change of SSIM by the paper's loop");
    vec![
        Finding::of(
            promising,
            &format!("{change}, without noise"),
            words(quiet),
            allowed,
            quiet.0 > 0.0,
        ),
        Finding::of(
            promising,
            &format!("{change}, with the rig's noise"),
            words(noisy),
            allowed,
            noisy.0 > 0.0,
        ),
        Finding::beside(
            "the same by the default method, without noise",
            words(range("hybrid", true)),
        ),
        Finding::beside(
            "the same by the default method, with the rig's noise",
            words(range("hybrid", false)),
        ),
    ]
}
