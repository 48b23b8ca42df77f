//! What a camera costs that codes its frames as JPEG: the same rig with frames as they are and
//! coded in the qualities of webcams, calibrated and restored through them.

use std::path::Path;

use relens::chart::looks::Looks;
use relens::chart::table::Table;
use relens::chart::test_rig::PHOTO_SEED;
use relens::config::{Curve, Kind, MethodName, RigFile};
use relens::frame::{Channels, Frame, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{PhotoData, Pipeline, method};
use relens::rig::simulated::jpeg_coder::{Quality, coded};
use relens::rig::simulated::open;

use crate::Failure;
use crate::colour::{INKED, scenes};
use crate::made::Made;

/// As libjpeg counts; first none.
const QUALITIES: [Option<u32>; 6] = [None, Some(98), Some(95), Some(90), Some(80), Some(60)];

/// Webcams count to 255; black as the rig's, scaled from 10 bits.
const BITS: u8 = 8;
const BLACK_COUNTS: f64 = 16.0;

/// `rig` with a webcam's frames.
fn with_frames(rig: &RigFile, quality: Option<u32>) -> RigFile {
    let mut rig = rig.clone();
    rig.camera.bits = BITS;
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.black_level_counts = BLACK_COUNTS;
        simulation.sensor.mosaic = None;
        simulation.sensor.jpeg_quality = quality;
    }
    rig
}

/// Sums of SSIM and RGB dB over scenes.
#[derive(Default, Clone, Copy)]
struct Sum([f64; 2]);

impl Sum {
    fn add(&mut self, picture: &Frame<Work>, tone: &Tone, scene: &Looks) {
        let found = Looks::of(tone, picture).scores(scene);
        self.0[0] += found.ssim;
        self.0[1] += found.rgb_db;
    }

    fn cells(self, count: usize) -> [String; 2] {
        let n = count.max(1) as f64;
        [format!("{:.4}", self.0[0] / n), format!("{:.2}", self.0[1] / n)]
    }
}

/// The table on the simulated rig of `rig`.
pub(crate) fn run(rig: &RigFile, quick: bool, pictures: Option<&Path>) -> Result<Made, Failure> {
    let words = format!("{}, {}: means over the scenes.", rig.name, rig.photo.size());
    let head = ["frames", "method", "photo", "SSIM: photo", "result", "RGB dB: photo", "result"];
    let mut table = Table::new(words, &head);
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let mut scenes = scenes(rig.photo.size(), &tone, pictures)?;
    // Photographs; a chart has hardly anything that coding keeps.
    scenes.drain(..INKED);
    let methods: &[MethodName] =
        if quick { &[MethodName::Hybrid] } else { &[MethodName::Digital, MethodName::Hybrid] };
    for quality in QUALITIES {
        let rig = with_frames(rig, quality);
        let chroma = (2, 1);
        let how = quality.map(|quality| Quality { quality, pixels: chroma });
        let frames = how.map_or_else(|| "not coded".to_owned(), Quality::name);
        let (mut devices, witness) = open(&rig)?;
        let calibration = match calibrate(&mut devices, &rig, None, &mut to_the_end) {
            Ok(calibration) => calibration,
            Err(error) => {
                table.row(vec![frames, format!("refused: {error}")]);
                continue;
            }
        };
        let pipeline = Pipeline::new(&rig, &calibration)?;
        for &which in methods {
            let solver = method(&rig, which);
            // Photos not coded, and coded as the frames are.
            let mut sums = [[Sum::default(); 2]; 2];
            for (n, (name, light)) in scenes.iter().enumerate() {
                let codes = witness.photograph(light, PHOTO_SEED + n as u64);
                let scene = Looks::of(&tone, &witness.shaded(light));
                let plain: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
                let prepared = pipeline.prepare(PhotoData::developed(&plain, Channels::Colour));
                let solved = pipeline.solve(&mut devices, &prepared, &*solver, &mut |_, _| {})?;
                sums[0][0].add(&plain, &tone, &scene);
                sums[0][1].add(&solved.picture, &tone, &scene);
                let Some(how) = how else { continue };
                let file = coded(&codes, how);
                let photo = Photo::from_bytes("photo.jpg", &file, Curve::Srgb, &Limits::default())?;
                let prepared = pipeline.prepare(&photo);
                let solved = pipeline.solve(&mut devices, &prepared, &*solver, &mut |_, _| {})?;
                sums[1][0].add(&photo.light, &tone, &scene);
                sums[1][1].add(&solved.picture, &tone, &scene);
                log::info!("{frames} {} {name}", which.name());
            }
            for (photo, [before, after]) in ["not coded", "coded alike"].into_iter().zip(sums) {
                if how.is_none() && photo != "not coded" {
                    continue;
                }
                let ([ssim, db], [ssim_after, db_after]) =
                    (before.cells(scenes.len()), after.cells(scenes.len()));
                let cells = [which.name(), photo].map(str::to_owned);
                let mut row = vec![frames.clone()];
                row.extend(cells);
                row.extend([ssim, ssim_after, db, db_after]);
                table.row(row);
            }
        }
    }
    Ok(Made { tables: vec![(format!("{}-mjpeg", rig.name), table)], ..Made::default() })
}
