//! Colours of results on photographs and on charts in black and white and in coloured inks, by the
//! rig's own method and by `digital` and `hybrid`.

use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::chart::test_rig::{PHOTO_SEED, TestPhoto, TestRig};
use relens::config::{MethodName, RigFile};
use relens::frame::resample::resize;
use relens::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Rect, Size, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::patterns::chart;
use relens::picture::Tone;
use relens::pipeline::method;
use relens::rig::simulated::open;

use crate::appearance::Appearance;
use crate::made::Made;
use crate::view::{KEPT, Subject, View};
use crate::{Failure, seconds as processor_seconds};

/// Ink and paper of each chart, linear light; one more chart has a different pair in each quarter.
const INKS: [(&str, [[f32; 3]; 2]); 4] = [
    ("chart, black and white", [[10.0; 3], [240.0; 3]]),
    ("chart, blue and yellow", [[20.0, 30.0, 140.0], [235.0, 205.0, 40.0]]),
    ("chart, red and green", [[190.0, 30.0, 30.0], [40.0, 170.0, 60.0]]),
    ("chart, green without contrast", [[200.0, 110.0, 40.0], [50.0, 110.0, 210.0]]),
];

/// Number of charts, which come first among the [`scenes`].
pub(crate) const INKED: usize = INKS.len() + 1;

/// A PNG file of `codes`: red, green and blue of each pixel in turn.
pub(crate) fn png(size: Size, codes: &[u8]) -> Result<Vec<u8>, Failure> {
    let mut file = Vec::new();
    let (width, height) = (size.width as u32, size.height as u32);
    PngEncoder::new(&mut file).write_image(codes, width, height, ExtendedColorType::Rgb8)?;
    Ok(file)
}

/// Scenes as linear light: charts, the program's photographs, and those in the folder `pictures`.
pub(crate) fn scenes(
    size: Size,
    tone: &Tone,
    pictures: Option<&Path>,
) -> Result<Vec<(String, Frame<Work>)>, Failure> {
    let chart = chart(size);
    let inked = |[ink, paper]: [[f32; 3]; 2]| {
        Frame::from_fn(|c: Channel| {
            let (ink, paper) = (ink[c.index()], paper[c.index()]);
            chart.map(|v: f32| ink + (paper - ink) * (v - 10.0) / 230.0)
        })
    };
    let mut scenes: Vec<_> = INKS.map(|(name, inks)| (name.to_owned(), inked(inks))).into();
    let mixed = INKS.map(|(_, inks)| inked(inks));
    let quarter = |x: usize, y: usize| 2 * (2 * y / size.height) + 2 * x / size.width;
    let mixed = Frame::from_fn(|c: Channel| {
        Plane::from_fn(size, |x, y| mixed[quarter(x, y)].plane(c).at(x, y))
    });
    scenes.push(("chart, four pairs".to_owned(), mixed));
    let photographs = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];
    scenes.extend(photographs.map(|scene| (scene.name().to_owned(), scene.light(size))));
    let Some(folder) = pictures else { return Ok(scenes) };
    let mut files: Vec<_> =
        std::fs::read_dir(folder)?.map(|file| Ok(file?.path())).collect::<Result<_, Failure>>()?;
    files.sort();
    for file in files {
        let picture = image::open(&file)?.into_rgb8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let wide = (height * size.width / size.height).min(width);
        let part = Size::new(wide, wide * size.height / size.width);
        let rect = Rect { x: (width - wide) / 2, y: (height - part.height) / 2, size: part };
        let light = Frame::from_fn(|c| {
            let codes = Plane::from_fn(Size::new(width, height), |x, y| {
                picture.get_pixel(x as u32, y as u32).0[c.index()]
            });
            let part = tone.plane(c, &codes).crop(rect);
            resize(&part, size).map(|v: f32| v.clamp(0.0, FULL_SCALE))
        });
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        scenes.push((name, light));
    }
    Ok(scenes)
}

/// [`scenes`], then the laboratory's photographs.
pub(crate) fn with_kept(size: Size, tone: &Tone) -> Result<Vec<(String, Frame<Work>)>, Failure> {
    let mut scenes = scenes(size, tone, None)?;
    scenes.extend((0..KEPT.len()).map(|n| {
        let view = View { subject: Subject::Kept(n), quarter: None };
        let codes = view.codes(size);
        let light = Frame::from_fn(|c| {
            tone.plane(c, &codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
        });
        (view.name(), light)
    }));
    Ok(scenes)
}

/// Table and pictures on the simulated rig of `rig`.
pub(crate) fn run(rig: &RigFile, quick: bool, pictures: Option<&Path>) -> Result<Made, Failure> {
    let (mut devices, witness) = open(rig)?;
    let calibration = calibrate(&mut devices, rig, None, &mut to_the_end)?;
    let mut test_rig = TestRig::on(rig.clone(), devices, &calibration, processor_seconds)?;
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let head = [
        "scene",
        "method",
        "SSIM",
        "RGB dB",
        "C*ab",
        "99 %",
        "dark a*",
        "dark b*",
        "ΔE",
        "ΔE at edges",
        "processor s",
        "captures",
    ];
    let words = format!(
        "{}, {}: colours; SSIM of luminance; a* and b* of dark places less the scene's.",
        rig.name,
        rig.photo.size()
    );
    let (mut made, mut table) = (Made::default(), Table::new(words, &head));
    let own = rig.restore.method;
    let others = [MethodName::Digital, MethodName::Hybrid].into_iter();
    let others = others.filter(|&method| !quick && method != own);
    let methods: Vec<MethodName> = others.chain([own]).collect();
    for (n, (name, light)) in scenes(rig.photo.size(), &tone, pictures)?.into_iter().enumerate() {
        let photo = TestPhoto::taken(&witness, rig.photo.curve, &light, PHOTO_SEED + n as u64);
        let scene = Appearance::new(&tone, &witness.shaded(&light));
        let mut add = |method: &str, light: &Frame<Work>, cost: [String; 2]| {
            let appearance = Appearance::new(&tone, light);
            let found = appearance.scores(&scene);
            let scores = [
                found.ssim,
                found.rgb_db,
                found.chroma,
                found.chroma_99th,
                found.dark_cast[0],
                found.dark_cast[1],
                found.difference,
                found.edge_difference,
            ];
            let digits = [4, 2, 2, 1, 1, 1, 2, 2];
            let mut cells = vec![name.clone(), method.to_owned()];
            cells.extend(scores.iter().zip(digits).map(|(v, digits)| format!("{v:.digits$}")));
            cells.extend(cost);
            log::info!("{}", cells.join(" | "));
            table.row(cells);
            let picture = png(appearance.size(), &appearance.bytes())?;
            made.files.push((format!("{}-{method}.png", name.replace([' ', ','], "")), picture));
            Ok::<(), Failure>(())
        };
        add("scene", &witness.shaded(&light), ["".into(), "".into()])?;
        add("photo", &photo.light, ["".into(), "".into()])?;
        for &which in &methods {
            let solver = method(rig, which);
            let (solved, seconds) =
                test_rig.solve(&photo, Channels::Colour, &*solver, &mut |_, _| {})?;
            let cost = [format!("{seconds:.2}"), solved.captures.to_string()];
            add(which.name(), &solved.picture, cost)?;
        }
    }
    made.tables.push((format!("{}-colour", rig.name), table));
    Ok(made)
}
