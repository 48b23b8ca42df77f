//! Colours along their axes beside brightness and colour differences, where something is otherwise
//! than on the rig that the prior was set on: size, noise, lens, its model, glare.

use relens::chart::looks::{Looks, LooksScores};
use relens::chart::table::Table;
use relens::chart::test_rig::{PHOTO_SEED, TestPhoto, TestRig};
use relens::config::{ColourChoice, LensSurface, MethodName, RigFile};
use relens::deconvolution::lens_model::LensFunctions;
use relens::frame::Channels;
use relens::measurement::{calibrate, to_the_end};
use relens::picture::Tone;
use relens::pipeline::method;
use relens::rig::simulated::open;

use crate::change::{VEIL_MISSED, lens, simulation};
use crate::made::Made;
use crate::sized::sized;
use crate::{Failure, colour, seconds};

/// Charts of [`colour::scenes`] that are taken: in black and white, and in blue and yellow.
const CHARTS: usize = 2;
/// Photographs that `--quick` takes.
const QUICK: usize = 3;

/// What is otherwise.
struct Otherwise {
    words: &'static str,
    /// Of the rig file, before the rig is calibrated.
    filed: fn(&RigFile) -> RigFile,
    /// So many times as wide as they are measured, the model's functions.
    model_width: f64,
}

const fn otherwise(words: &'static str, filed: fn(&RigFile) -> RigFile) -> Otherwise {
    Otherwise { words, filed, model_width: 1.0 }
}

/// The sizes are of a rig of 1024×768; all else is at half of its pixels.
const CASES: [Otherwise; 13] = [
    otherwise("as filed", half),
    otherwise("a quarter of the pixels' rows and columns", |rig| sized(rig, 0.25)),
    otherwise("all of them", RigFile::clone),
    otherwise("twice as many", |rig| sized(rig, 2.0)),
    otherwise("noise 0.5 grey levels", |rig| noisy(rig, 0.5)),
    otherwise("noise 1", |rig| noisy(rig, 1.0)),
    otherwise("noise 2", |rig| noisy(rig, 2.0)),
    otherwise("noise 4", |rig| noisy(rig, 4.0)),
    Otherwise { words: "model 3 % too wide", filed: half, model_width: 1.03 },
    otherwise("plano-convex singlet", |rig| {
        glass(half(rig), &[(38.76, 9.0, "N-BK7"), (f64::INFINITY, 70.0, "air")])
    }),
    // An achromat of 75 mm: powers by the two glasses' Abbe numbers, the crown's sides alike.
    otherwise("cemented doublet", |rig| {
        glass(half(rig), &[(33.51, 9.0, "N-BK7"), (-33.51, 4.0, "F2"), (-624.0, 70.0, "air")])
    }),
    // The farther the stop is from the lens, the more its colours differ in size.
    otherwise("lateral colour: stop 60 mm before the lens", |rig| {
        let mut rig = half(rig);
        lens(&mut rig, |lens| {
            lens.surfaces[0].thickness_mm = 60.0;
            lens.surfaces.iter_mut().for_each(|surface| surface.clear_diameter_mm = 60.0);
        });
        rig
    }),
    otherwise("10 % of glare that nobody measured", |rig| VEIL_MISSED.filed(&half(rig), 10.0)),
];

fn half(rig: &RigFile) -> RigFile {
    sized(rig, 0.5)
}

fn noisy(rig: &RigFile, levels: f64) -> RigFile {
    let mut rig = half(rig);
    simulation(&mut rig, |simulation| {
        simulation.sensor.read_noise_levels = levels;
        simulation.sensor.full_well_electrons = f64::INFINITY;
    });
    rig
}

/// The rig with a lens of these surfaces behind its rim: radius, what follows, of which glass.
fn glass(mut rig: RigFile, surfaces: &[(f64, f64, &str)]) -> RigFile {
    lens(&mut rig, |lens| {
        lens.surfaces.truncate(1);
        lens.surfaces.extend(surfaces.iter().map(|&(radius_mm, thickness_mm, glass)| {
            LensSurface {
                radius_mm,
                thickness_mm,
                glass: glass.to_owned(),
                clear_diameter_mm: 25.0,
            }
        }));
    });
    rig
}

/// `functions`, each so many times as wide about its middle, its light kept.
fn stretched(functions: &LensFunctions, times: f64) -> LensFunctions {
    let side = functions.support_px;
    let middle = (side / 2) as f64;
    let mut wide = functions.clone();
    for (wide, taps) in wide.taps.iter_mut().zip(&functions.taps) {
        for (wide, taps) in wide.chunks_exact_mut(side * side).zip(taps.chunks_exact(side * side)) {
            let tap = |x: f64, y: f64| {
                let inside = (0.0..side as f64).contains(&x) && (0.0..side as f64).contains(&y);
                if inside { taps[y as usize * side + x as usize] } else { 0.0 }
            };
            for (n, wide) in wide.iter_mut().enumerate() {
                let [x, y] = [n % side, n / side].map(|at| middle + (at as f64 - middle) / times);
                let (u, v) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
                let row = |y: f64| (1.0 - u) * tap(x.floor(), y) + u * tap(x.floor() + 1.0, y);
                *wide = (1.0 - v) * row(y.floor()) + v * row(y.floor() + 1.0);
            }
            let (before, after): (f32, f32) = (taps.iter().sum(), wide.iter().sum());
            wide.iter_mut().for_each(|tap| *tap *= before / after);
        }
    }
    wide
}

/// One scene, solved both ways.
struct Pair {
    name: String,
    photograph: bool,
    together: LooksScores,
    axes: LooksScores,
}

/// Means of the charts and of the photographs in each case, and a table of all scenes; `quick`
/// takes three photographs and no size above the half.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let head = [
        "otherwise",
        "scenes",
        "SSIM",
        "RGB dB",
        "ΔE",
        "ΔE at edges",
        "C*ab",
        "99 %",
        "worst SSIM",
    ];
    let words =
        format!("Rig {}: brightness and colour differences → along the axes, `digital`.", rig.name);
    let mut means = Table::new(words.clone(), &head);
    let mut each = Table::new(words, &head[..8]);
    for case in CASES.iter().filter(|case| !quick || (case.filed)(rig).photo.width_px <= 512) {
        let pairs = pairs(case, rig, quick)?;
        for photograph in [false, true] {
            let some: Vec<&Pair> = pairs.iter().filter(|p| p.photograph == photograph).collect();
            let mean = |of: fn(&LooksScores) -> f64| {
                let sum = |which: fn(&Pair) -> &LooksScores| -> f64 {
                    some.iter().map(|pair| of(which(pair))).sum::<f64>() / some.len() as f64
                };
                [sum(|pair| &pair.together), sum(|pair| &pair.axes)]
            };
            let worst = some.iter().min_by(|a, b| a.gain().total_cmp(&b.gain()));
            let worst = worst.map(|pair| format!("{} {:+.4}", pair.name, pair.gain()));
            let scenes = if photograph { "photographs" } else { "charts" };
            let mut cells = vec![case.words.to_owned(), format!("{} {scenes}", some.len())];
            cells.extend(FIGURES.iter().map(|&(of, digits)| before_after(mean(of), digits)));
            cells.push(worst.unwrap_or_default());
            log::info!("{}", cells.join(" | "));
            means.row(cells);
        }
        for pair in &pairs {
            let mut cells = vec![case.words.to_owned(), pair.name.clone()];
            cells.extend(
                FIGURES.iter().map(|&(of, digits)| {
                    before_after([of(&pair.together), of(&pair.axes)], digits)
                }),
            );
            each.row(cells);
        }
    }
    let stem = format!("{}-colour-pairs", rig.name);
    let tables = vec![(stem.clone(), means), (format!("{stem}-scenes"), each)];
    Ok(Made { tables, ..Made::default() })
}

/// A score and its digits.
type Figure = (fn(&LooksScores) -> f64, usize);

/// What is told of a picture.
const FIGURES: [Figure; 6] = [
    (|scores| scores.ssim, 4),
    (|scores| scores.rgb_db, 2),
    (|scores| scores.difference, 2),
    (|scores| scores.edge_difference, 2),
    (|scores| scores.chroma, 2),
    (|scores| scores.chroma_99th, 1),
];

fn before_after([before, after]: [f64; 2], digits: usize) -> String {
    format!("{before:.digits$} → {after:.digits$}")
}

impl Pair {
    /// In SSIM.
    fn gain(&self) -> f64 {
        self.axes.ssim - self.together.ssim
    }
}

fn pairs(case: &Otherwise, rig: &RigFile, quick: bool) -> Result<Vec<Pair>, Failure> {
    let rig = (case.filed)(rig);
    let (mut devices, witness) = open(&rig)?;
    let measured = calibrate(&mut devices, &rig, None, &mut to_the_end)?;
    let measured = match case.model_width {
        1.0 => measured,
        times => measured.with_lens(stretched(&measured.functions, times))?,
    };
    let mut test_rig = TestRig::on(rig.clone(), devices, &measured, seconds)?;
    let size = rig.photo.size();
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let mut scenes = colour::with_kept(size, &tone)?;
    scenes.drain(CHARTS..colour::INKED);
    scenes.truncate(if quick { CHARTS + QUICK } else { scenes.len() });
    let mut pairs = Vec::new();
    for (n, (name, light)) in scenes.into_iter().enumerate() {
        let photo = TestPhoto::taken(&witness, rig.photo.curve, &light, PHOTO_SEED + n as u64);
        let scene = Looks::of(&tone, &witness.shaded(&light));
        let mut solved = |colours: ColourChoice| -> Result<LooksScores, Failure> {
            let mut rig = rig.clone();
            rig.restore.colours = colours;
            let solver = method(&rig, MethodName::Digital);
            let (solved, _) = test_rig.solve(&photo, Channels::Colour, &*solver, &mut |_, _| {})?;
            Ok(Looks::of(&tone, &solved.picture).scores(&scene))
        };
        let together = solved(ColourChoice::Together)?;
        let axes = solved(ColourChoice::AlongAxes)?;
        pairs.push(Pair { name, photograph: n >= CHARTS, together, axes });
    }
    Ok(pairs)
}
