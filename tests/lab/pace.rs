//! Time and quality of the rig's own method on photographs and a chart: raw, developed by the
//! camera, and as a JPEG.

use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::chart::test_rig::PHOTO_SEED;
use relens::config::RigFile;
use relens::deconvolution::method::Method;
use relens::frame::{Channels, Frame, Work};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{PhotoData, method};

use crate::harness::Harness;
use crate::jpeg_coder::{Quality, coded};
use crate::made::Made;
use crate::view::{KEPT, Subject, View};
use crate::{Failure, seconds};

/// Quality of the JPEGs, chroma at half the width and height.
const JPEG_QUALITY: u32 = 90;

const SCENES: [Scene; 3] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket];

/// A method under its name in the table.
pub(crate) type Named = (String, Box<dyn Method>);

/// Restores photos of each photograph and of a chart by the rig's own method and scores them;
/// `quick` takes two photographs.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let own: Box<dyn Method> = method(rig, rig.restore.method);
    let table = measured(rig, &[(own.name().to_owned(), own)], quick)?;
    Ok(Made::table(format!("{}-pace", rig.name), table))
}

/// Restores photos of each photograph and of a chart by each of `methods` and scores them; `quick`
/// takes two photographs.
pub(crate) fn measured(rig: &RigFile, methods: &[Named], quick: bool) -> Result<Table, Failure> {
    let (mut harness, _) = Harness::open(rig.clone())?;
    let (size, tone) = (rig.photo.size(), Tone::of_curve(rig.photo.curve, 8));
    let photographs = SCENES.into_iter().map(Subject::Of).chain((0..KEPT.len()).map(Subject::Kept));
    let subjects = photographs.chain([Subject::Of(Scene::Chart)]);
    let head = [
        "photo",
        "data, method",
        "s/MP",
        "photo: SSIM",
        "dB",
        "ΔE",
        "result: SSIM",
        "dB",
        "ΔE",
        "captures",
    ];
    let words = format!(
        "{}, {size}: processor seconds per megapixel without the simulator, luminance SSIM and \
         PSNR, ΔE at edges.",
        rig.name
    );
    let mut table = Table::new(words, &head);
    for (n, subject) in subjects.enumerate().take(if quick { 2 } else { usize::MAX }) {
        let codes = View { subject, quarter: None }.codes(size);
        let light = Frame::from_fn(|c| {
            tone.plane(c, &codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
        });
        let (truth, seed) = (harness.truth(&light), PHOTO_SEED + n as u64);
        let codes = harness.witness.photograph(&light, seed);
        let developed: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
        let taken = harness.photograph(&light, seed)?;
        let quality = Quality { quality: JPEG_QUALITY, pixels: (2, 2) };
        let file = coded(&codes, quality);
        let limits = Limits::default();
        let jpeg = Photo::from_bytes("photo.jpg", &file, rig.photo.curve, &limits)?;
        let kinds = [
            ("raw", taken.raw.map(|raw| PhotoData::raw(&taken.light, raw))),
            ("developed", Some(PhotoData::developed(&developed, Channels::Colour))),
            ("JPEG", Some(PhotoData::from(&jpeg))),
        ];
        let contests =
            kinds.iter().flat_map(|(kind, data)| methods.iter().map(move |m| (kind, data, m)));
        for (kind, data, (name, method)) in contests {
            let Some(data) = *data else { continue };
            let (pipeline, devices) = harness.test_rig.parts();
            let begun = seconds();
            let prepared = pipeline.prepare(data);
            let solved = pipeline.solve(devices, &prepared, &**method, &mut |_, _| {})?;
            let seconds = seconds() - begun - solved.waited_seconds;
            let before = harness.test_rig.quality(data.light, &truth);
            let after = harness.test_rig.quality(&solved.picture, &truth);
            let mut row = vec![subject.name().to_owned(), format!("{kind}, {name}")];
            row.push(format!("{:.2}", seconds * 1e6 / size.area() as f64));
            for quality in [before, after] {
                row.push(format!("{:.4}", quality.ssim));
                row.push(format!("{:.2}", quality.psnr_db));
                row.push(format!("{:.2}", quality.edge_difference.unwrap_or(f64::NAN)));
            }
            row.push(solved.captures.to_string());
            log::info!("{}", row.join(" "));
            table.row(row);
        }
    }
    Ok(table)
}
