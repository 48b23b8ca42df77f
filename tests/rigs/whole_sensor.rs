//! A rig whose photo covers the sensor except a rim for the lens functions, and whose frames are
//! identified by vanishing marks: captures contain neither the marks nor their glare, so the rows
//! of the marks are like any others.

use relens::chart::scenes::Scene;
use relens::config;
use relens::deconvolution::quality::psnr;
use relens::frame::{Channel, Frame, Plane, RawSites, Rect, Size, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::pipeline::{PhotoData, Pipeline, hybrid};
use relens::rig::frame_mark::MarkPlace;
use relens::rig::simulated;

/// Number of rows at the photo's upper edge that are covered by the marks and their black
/// surroundings, down to row 18 of the sensor.
const HIDDEN_PX: usize = 10;

/// `truthful.toml` with marks in the photo.
fn rig() -> config::RigFile {
    let mut text = include_str!("../../rig-config/truthful.toml").to_owned();
    for (from, to) in [
        ("width-px = 256", "width-px = 272"),
        ("height-px = 192", "height-px = 208"),
        (
            "[calibration]",
            "[marks]\nfrom-edge-px = 3\nheight-px = 9\nvanish = true\n\n[calibration]",
        ),
        ("response-flats = 100", "response-flats = 40"),
        // The scene is at the panel's distance, so that the certificate depends on the marks alone.
        ("scene-distance-mm = 3800.0", "scene-distance-mm = 4000.0"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    config::parse(&text, "whole-sensor.toml").unwrap()
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn marks_cost_no_part_of_the_photo() {
    let rig = rig();
    let (mut devices, witness) = simulated::open(&rig).unwrap();
    devices.find_marks(MarkPlace::of(&rig).unwrap()).unwrap();
    let calibration = calibrate(&mut devices, &rig, None, &mut to_the_end).unwrap();
    let pipeline = Pipeline::new(&rig, &calibration).unwrap();
    let size = rig.photo.size();
    let scene = Scene::Coffee.light(size);
    let raw = witness.photograph_raw(&scene, 5).unwrap();
    let (black, gain) = (witness.black_level_counts(), witness.counts_per_level());
    let sites = raw.sites.map(|count| ((f64::from(count) - black) / gain) as f32);
    let photo: Frame<Work> = raw.mosaic.interpolated(&sites);
    let properties = RawSites::new(raw.mosaic, gain as f32);
    let prepared = pipeline.prepare(PhotoData::raw(&photo, properties));
    let restored =
        pipeline.restore(&mut devices, &prepared, &hybrid(&rig), &mut |_, _| {}).unwrap();
    let truth = witness.shaded(&scene);
    let solved = restored.solved.unwrap();
    let ratio = solved.solution.certificate.ratio();
    // The gain at the marks is like that in the middle.
    let gain = |y: usize, height: usize| {
        let place = Rect { x: 0, y, size: Size::new(size.width, height) };
        let db = |picture: &Frame<Work>| {
            let channel_db = |c: Channel| {
                let part = |plane: &Plane| plane.crop(place);
                psnr(&part(picture.plane(c)), &part(truth.plane(c)))
            };
            Channel::ALL.map(channel_db).iter().sum::<f64>() / 3.0
        };
        db(&solved.picture) - db(&photo)
    };
    let upper = gain(0, HIDDEN_PX);
    let lower = gain(size.height - HIDDEN_PX, HIDDEN_PX);
    let middle = gain(size.height / 4, size.height / 2);
    println!(
        "certificate {ratio:?}, gain {upper:.2} and {lower:.2} dB where marks stood, {middle:.2} \
         in the middle; {:?}",
        restored.outcome.verdict
    );
    assert!(ratio.unwrap() < 1.4, "{ratio:?}");
    assert!(upper.min(lower) > 0.7 * middle && middle > 2.0, "{upper} {lower} {middle}");
}
