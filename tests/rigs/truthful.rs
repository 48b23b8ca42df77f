//! Departures of a real rig from an ideal one and their cost: the table of `tests/tables`, and
//! tests.

use relens::chart::scenes::Scene;
use relens::config::{self, Kind, Simulation, Subpixels};
use relens::deconvolution::method::Method;
use relens::deconvolution::method::digital::Digital;
use relens::deconvolution::quality::{psnr, ssim};
use relens::frame::{Channel, Channels, Frame, Plane, RawSites, Rect, Size, Work};
use relens::picture::Tone;
use relens::pipeline::{PhotoData, Pipeline, hybrid};
use relens::rig::simulated::{self, Witness};

use crate::{load, measured};

/// A departure from the ideal rig, copied from a truthful one.
type Departure = fn(&mut config::RigFile, &Simulation);

fn simulation(rig: &mut config::RigFile) -> &mut Simulation {
    let Kind::Simulated(simulation) = &mut rig.kind else { panic!("a simulated rig") };
    simulation
}

fn scene_distance(rig: &mut config::RigFile, mm: f64) {
    simulation(rig).lens.scene_distance_mm = Some(mm);
}

const DEPARTURES: [(&str, Departure); 8] = [
    ("mosaic", |to, from| simulation(to).sensor.mosaic = from.sensor.mosaic),
    ("uneven panel", |to, from| simulation(to).display.uneven = from.display.uneven),
    ("subpixel stripes", |to, _| to.panel.subpixels = Subpixels::Rgb),
    ("scene at 3.8 m", |to, _| scene_distance(to, 3800.0)),
    ("wander, vibration", |to, from| {
        simulation(to).unrest = config::Unrest { flicker_share: 0.0, ..from.unrest };
    }),
    ("flicker", |to, from| simulation(to).unrest.flicker_share = from.unrest.flicker_share),
    ("fixed pattern, hot pixels", |to, from| {
        simulation(to).sensor.gain_deviation = from.sensor.gain_deviation;
        simulation(to).sensor.hot_pixel_share = from.sensor.hot_pixel_share;
        simulation(to).sensor.hot_pixel_levels = from.sensor.hot_pixel_levels;
    }),
    ("camera's curve", |to, from| simulation(to).sensor.curve = from.sensor.curve),
];

/// Departures larger than the truthful rig's.
const STRONGER: [(&str, Departure); 4] = [
    ("scene at 3.2 m", |to, _| scene_distance(to, 3200.0)),
    ("scene at 5 m", |to, _| scene_distance(to, 5000.0)),
    ("scene at 8 m", |to, _| scene_distance(to, 8000.0)),
    ("a webcam's gamma of 0.6", |to, _| simulation(to).sensor.curve.gamma = 0.6),
];

/// The small rig with `departures`.
fn departed(departures: &[Departure]) -> config::RigFile {
    let (mut rig, truthful) = (load("small.toml"), load("truthful.toml"));
    departures.iter().for_each(|take| take(&mut rig, truthful.simulation().unwrap()));
    rig
}

/// SSIM and PSNR (dB) of linear light, means over the channels.
fn score(picture: &Frame<Work>, truth: &Frame<Work>) -> [f64; 2] {
    let each = Channel::ALL.map(|c| (picture.plane(c), truth.plane(c)));
    [each.map(|(a, b)| ssim(a, b)), each.map(|(a, b)| psnr(a, b))]
        .map(|scores| scores.iter().sum::<f64>() / 3.0)
}

/// Scores of one scene: the photo, the results of `digital` (if requested) and `hybrid`, and the
/// delivered picture.
struct Tried {
    photo: [f64; 2],
    digital: Option<[f64; 2]>,
    hybrid: [f64; 2],
    delivered: [f64; 2],
    verdict: String,
}

/// Options of a trial.
#[derive(Clone, Copy)]
struct Asked {
    /// Restores raw sites instead of demosaiced pictures, if the camera has colour filters.
    raw: bool,
    /// Also tries `digital`.
    digital: bool,
}

impl Asked {
    /// A trial of the delivered picture alone.
    fn delivered(raw: bool) -> Asked {
        Asked { raw, digital: false }
    }
}

/// A raw photo as demosaiced linear light with the properties of its sites; `None` without filters.
fn raw_photo(witness: &Witness, truth: &Frame<Work>, seed: u64) -> Option<(Frame<Work>, RawSites)> {
    let raw = witness.photograph_raw(truth, seed)?;
    let (black, gain) = (witness.black_level_counts(), witness.counts_per_level());
    let sites = raw.sites.map(|count| ((f64::from(count) - black) / gain) as f32);
    let properties = RawSites::new(raw.mosaic, gain as f32);
    Some((raw.mosaic.interpolated(&sites), properties))
}

/// Restores photos of `scenes` on `rig`, which `since` changes after its calibration.
fn tried(
    rig: &config::RigFile,
    scenes: &[Scene],
    Asked { raw, digital: with_digital }: Asked,
    since: &dyn Fn(&mut Witness),
) -> Result<Vec<Tried>, String> {
    let (mut devices, mut witness) = simulated::open(rig).unwrap();
    let calibration = measured(rig)?;
    let pipeline = Pipeline::new(rig, &calibration).map_err(|error| error.to_string())?;
    since(&mut witness);
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let light_of = |codes: &Frame<Work, u8>| Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
    let mut all = Vec::new();
    for &scene in scenes {
        let rounded = |plane: &Plane| plane.map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
        let codes = scene.codes(rig.photo.size());
        let truth = light_of(&Frame::from_fn(|c| rounded(codes.plane(c))));
        let seed = 1 + scene as u64;
        let raw = raw.then(|| raw_photo(&witness, &truth, seed)).flatten();
        let photo = match &raw {
            Some((photo, _)) => photo.clone(),
            None => light_of(&witness.photograph(&truth, seed)),
        };
        let truth = witness.shaded(&truth);
        let prepared = match raw {
            Some((_, raw)) => pipeline.prepare(PhotoData::raw(&photo, raw)),
            None => pipeline.prepare(PhotoData::developed(&photo, Channels::Colour)),
        };
        let mut by = |method: &dyn Method| {
            pipeline.restore(&mut devices, &prepared, method, &mut |_, _| {}).unwrap()
        };
        let (plain, light) = (with_digital.then(|| by(&Digital::default())), by(&hybrid(rig)));
        let solved_score = |solved: &relens::pipeline::Restoration| {
            solved.solved.as_ref().map_or([0.0; 2], |solved| score(&solved.picture, &truth))
        };
        all.push(Tried {
            photo: score(&photo, &truth),
            digital: plain.as_ref().map(solved_score),
            hybrid: solved_score(&light),
            delivered: score(&light.outcome.picture, &truth),
            verdict: format!("{:?}", light.outcome.verdict),
        });
    }
    Ok(all)
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn the_panel_s_stripes_do_not_affect_the_lens_measurement() {
    let errors = |whole: bool| {
        let mut rig = load("truthful.toml");
        simulation(&mut rig).seed = 4;
        assert_eq!(rig.panel.subpixels, Subpixels::Rgb);
        if whole {
            rig.panel.subpixels = Subpixels::Whole;
        }
        measured(&rig).unwrap().operator_error
    };
    let (whole, stripes) = (errors(true), errors(false));
    for (whole, stripes) in whole.iter().zip(&stripes) {
        assert!(*stripes < 1.25 * whole, "{stripes:?} grey levels, {whole:?} of whole pixels");
    }
}

#[test]
#[ignore = "makes a table; a minute or two"]
fn what_each_truth_costs() {
    println!("| rig | scene | photo | digital | hybrid | delivered | verdict |");
    println!("|---|---|---|---|---|---|---|");
    let all: Vec<Departure> = DEPARTURES.iter().map(|&(_, departure)| departure).collect();
    // The calibration can also measure sites and linearity.
    let measured = |departures: &[Departure]| {
        let mut rig = departed(departures);
        (rig.calibration.response_flats, rig.calibration.linearity) = (100, true);
        rig
    };
    let [pattern, curve] = [DEPARTURES[6], DEPARTURES[7]];
    let mended = [
        ("fixed pattern, hot pixels, measured", measured(&[pattern.1])),
        ("camera's curve, measured", measured(&[curve.1])),
        ("all of these (truthful.toml), measured", measured(&all)),
    ];
    let rows = [("ideal (small.toml)", Vec::new())]
        .into_iter()
        .chain(DEPARTURES.map(|(name, departure)| (name, vec![departure])))
        .chain([("all of these (truthful.toml)", all.clone())])
        .chain(STRONGER.map(|(name, departure)| (name, vec![departure])))
        .map(|(name, departures)| (name, departed(&departures)))
        .chain(mended);
    let scenes = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];
    // ROW=mosaic makes only the rows whose names contain "mosaic".
    let wanted = std::env::var("ROW").unwrap_or_default();
    for (name, rig) in rows.filter(|(name, _)| name.contains(&wanted)) {
        let raw = std::env::var_os("RAW").is_some();
        match tried(&rig, &scenes, Asked { raw, digital: true }, &|_| {}) {
            Err(refused) => println!("| {name} | | not calibrated: {refused} | | | | |"),
            Ok(tried) => {
                for (scene, tried) in scenes.iter().zip(tried) {
                    let cell = |[ssim, db]: [f64; 2]| format!("{ssim:.3}/{db:.1}");
                    println!(
                        "| {name} | {} | {} | {} | {} | {} | {} |",
                        scene.name(),
                        cell(tried.photo),
                        tried.digital.map_or(String::new(), cell),
                        cell(tried.hybrid),
                        cell(tried.delivered),
                        tried.verdict
                    );
                }
            }
        }
    }
}

/// Gain of `hybrid` over the photo, SSIM and dB; means over the scenes.
fn gain(all: &[Tried]) -> [f64; 2] {
    let mean = |n: usize| {
        all.iter().map(|one| one.hybrid[n] - one.photo[n]).sum::<f64>() / all.len() as f64
    };
    [mean(0), mean(1)]
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn a_knock_of_half_a_pixel_costs_less_than_a_tenth_of_the_gain() {
    let scenes = [Scene::Astronaut, Scene::Coffee];
    let unrest: Departure = |to, from| simulation(to).unrest = from.unrest;
    for (name, rig) in [("steady", load("small.toml")), ("unrest", departed(&[unrest]))] {
        let asked = Asked::delivered(false);
        let still = gain(&tried(&rig, &scenes, asked, &|_| {}).unwrap());
        for px in [0.1, 0.25, 0.5] {
            let knocked = tried(&rig, &scenes, asked, &|witness| {
                witness.knock_panel(0.8 * px, -0.6 * px);
            });
            let knocked = knocked.unwrap();
            let found = gain(&knocked);
            println!("{name}, {px} px: gain {found:.4?} of {still:.4?}");
            assert!(found[0] >= 0.9 * still[0] && found[1] >= 0.9 * still[1], "{name} {px}");
            for one in &knocked {
                assert!(one.delivered[0] > one.photo[0], "{name} {px} {}", one.verdict);
            }
        }
    }
}

#[test]
fn motion_and_flicker_of_the_panel_do_not_count_as_noise() {
    let calm = departed(&[]);
    let unrest: Departure = |to, from| simulation(to).unrest = from.unrest;
    let noise = |rig: &config::RigFile| measured(rig).unwrap().noise;
    for departures in [&[unrest][..], &[DEPARTURES[0].1, unrest]] {
        for (calm, found) in noise(&calm).into_iter().zip(noise(&departed(departures))) {
            let levels = [20.0, 128.0, 230.0];
            println!(
                "{:.3?}, calm {:.3?}",
                levels.map(|v| found.sigma(v)),
                levels.map(|v| calm.sigma(v))
            );
            for light in levels {
                assert!((found.sigma(light) / calm.sigma(light) - 1.0).abs() < 0.1, "{light}");
            }
        }
    }
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn uneven_sites_cost_at_most_a_tenth_of_a_decibel() {
    let scenes = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];
    let [mosaic, pattern] = [DEPARTURES[0].1, DEPARTURES[6].1];
    let with_flats = |departures: &[Departure], flats: usize| {
        let mut rig = departed(departures);
        rig.calibration.response_flats = flats;
        tried(&rig, &scenes, Asked { raw: true, digital: true }, &|_| {}).unwrap()
    };
    let alike = with_flats(&[mosaic], 0);
    let [smooth, measured] = [0, 100].map(|flats| with_flats(&[mosaic, pattern], flats));
    let loss = |of: &[Tried], by: fn(&Tried) -> [f64; 2]| {
        let each = alike.iter().zip(of).map(|(a, b)| by(a)[1] - by(b)[1]);
        each.sum::<f64>() / scenes.len() as f64
    };
    for (name, by) in
        [("digital", (|t| t.digital.unwrap()) as fn(&Tried) -> _), ("hybrid", |t| t.hybrid)]
    {
        let [smooth, measured] = [loss(&smooth, by), loss(&measured, by)];
        println!("{name}: {smooth:.3} dB lost with smooth flats, {measured:.3} site by site");
        assert!(measured <= 0.1 && smooth > 5.0 * measured, "{name}");
    }
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn a_camera_s_curve_is_linearised() {
    let scenes = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];
    let rig = |departures: &[Departure]| {
        let mut rig = departed(departures);
        rig.calibration.linearity = true;
        rig
    };
    let [mosaic, curve] = [DEPARTURES[0].1, DEPARTURES[7].1];
    for (name, raw, before) in [("developed", false, vec![]), ("raw", true, vec![mosaic])] {
        let straight = tried(&rig(&before), &scenes, Asked::delivered(raw), &|_| {}).unwrap();
        let with_curve: Vec<Departure> = before.into_iter().chain([curve]).collect();
        let undone = tried(&rig(&with_curve), &scenes, Asked::delivered(raw), &|_| {}).unwrap();
        for (straight, undone) in straight.iter().zip(&undone) {
            let (ought, is) = (straight.delivered, undone.delivered);
            println!("{name}: {ought:.4?} of a straight camera, {is:.4?} of a bent one");
            assert!(is[0] > ought[0] - 0.01, "{name}: {is:?} {ought:?}");
        }
    }
}

/// Side of the compared corners, pixels.
const CORNER_PX: usize = 24;

/// Mean light of the four corners in the three channels.
fn corners(picture: &Frame<Work>) -> Vec<f64> {
    let Size { width, height } = picture.size();
    let (right, bottom) = (width - CORNER_PX, height - CORNER_PX);
    let size = Size::new(CORNER_PX, CORNER_PX);
    let mean = |c: Channel, (x, y): (usize, usize)| {
        let part = picture.plane(c).crop(Rect { x, y, size });
        part.data().iter().map(|&v| f64::from(v)).sum::<f64>() / part.data().len() as f64
    };
    let places = [(0, 0), (right, 0), (0, bottom), (right, bottom)];
    Channel::ALL.iter().flat_map(|&c| places.map(|place| mean(c, place))).collect()
}

#[test]
fn an_uneven_panel_does_not_change_the_photo_s_shading() {
    let uneven: Departure = |to, from| simulation(to).display.uneven = from.display.uneven;
    let rig = departed(&[uneven]);
    let (mut devices, witness) = simulated::open(&rig).unwrap();
    let calibration = measured(&rig).unwrap();
    let pipeline = Pipeline::new(&rig, &calibration).unwrap();
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let light = |x: usize, y: usize| match (x / 12 + y / 8) % 3 {
        0 => 60.0,
        1 => 110.0 + 0.2 * x as f32,
        _ => 150.0 - 0.2 * y as f32,
    };
    let scene = Frame::from_fn(|_| Plane::from_fn(rig.photo.size(), light));
    let codes = witness.photograph(&scene, 3);
    let photo: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
    let prepared = pipeline.prepare(PhotoData::developed(&photo, Channels::Colour));
    let restored = pipeline.restore(&mut devices, &prepared, &hybrid(&rig), &mut |_, _| {});
    let outcome = restored.unwrap().outcome;
    assert!(outcome.captures > 0, "{}", outcome.reason);
    let ought = corners(&witness.shaded(&scene));
    let off = corners(&outcome.picture).into_iter().zip(ought).map(|(is, ought)| is / ought - 1.0);
    let worst = off.map(f64::abs).fold(0.0, f64::max);
    println!("largest error of a corner {:.2} %", 100.0 * worst);
    assert!(worst < 0.01);
}
