//! Lateral colour measured with a panel whose colours lie side by side.

use relens::calibration::Layout;
use relens::calibration::photo_side::PhotoSide;
use relens::config::{self, Subpixels};
use relens::frame::{Channel, Frame, Plane, Rect, Size};
use relens::rig::simulated::{self, Light};

use crate::{load, measured};

/// Displacements of red and blue against green, pixels, of a white disc through the lens, its
/// colours lined up by what was
/// measured of a panel with `subpixels`. The discs are in the middle and near two corners.
fn rims_px(config: &config::RigFile, subpixels: Subpixels) -> Vec<[f64; 2]> {
    const SIDE: usize = 48;
    let (_, witness) = simulated::open(config).expect("a simulated rig");
    let (canvas, photo) = (config.canvas_size(), config.photo.size());
    let calibration = measured(config).unwrap();
    let photo_side = PhotoSide::new(&calibration, &Layout { subpixels, ..Layout::of(config) });
    let mut rims = Vec::new();
    for from_middle in [-0.3, 0.0, 0.3] {
        let middle = [(canvas.width, photo.width), (canvas.height, photo.height)]
            .map(|(canvas, photo)| canvas as f64 / 2.0 + from_middle * photo as f64);
        let disc = Plane::from_fn(canvas, |x, y| {
            let [dx, dy] = [x as f64 - middle[0], y as f64 - middle[1]];
            (200.0 * (-(dx * dx + dy * dy) / 18.0).exp()) as f32
        });
        let seen = witness.forward(&Frame::from_planes([&disc; 3].map(Plane::clone)), Light::Panel);
        let seen = photo_side.line_up_colours(&seen, [0.0; 2]);
        let centroid = |c: Channel| {
            let [left, top] = middle.map(|v| v as usize - SIDE / 2);
            let place = Rect { x: left, y: top, size: Size::new(SIDE, SIDE) };
            let part = seen.plane(c).crop(place);
            let (mut sum, mut moment) = (0.0, [0.0; 2]);
            for y in 0..SIDE {
                for (x, &v) in part.row(y).iter().enumerate() {
                    let v = f64::from(v);
                    sum += v;
                    moment = [moment[0] + v * x as f64, moment[1] + v * y as f64];
                }
            }
            moment.map(|moment| moment / sum)
        };
        let green = centroid(Channel::Green);
        for c in [Channel::Red, Channel::Blue] {
            let other = centroid(c);
            rims.push([other[0] - green[0], other[1] - green[1]]);
        }
    }
    rims
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_panel_s_stripes_are_no_lateral_colour() {
    let config = load("truthful.toml");
    let rims = rims_px(&config, config.panel.subpixels);
    assert!(rims.iter().flatten().all(|px| px.abs() < 0.1), "{rims:?}");
    // A third of a panel pixel on the sensor.
    let third = 0.86 / 3.0;
    let rims = rims_px(&config, Subpixels::Whole);
    let off = |rim: &[f64; 2]| (rim[0].abs() - third).abs().max(rim[1].abs());
    assert!(rims.iter().all(|rim| off(rim) < 0.1), "{rims:?}");
}
