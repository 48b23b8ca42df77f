//! Lateral colour as part of the functions, measured with a panel whose colours lie side by side.

use relens::calibration::lens_blur::centroid;
use relens::config::{self, Subpixels};
use relens::frame::Channel;
use relens::rig::simulated::{self, Light};

use crate::{load, measured};

/// Error of the lateral colour of red and blue, pixels: mean distance of the centroids of their
/// measured functions from green's, minus the lens's true distance.
fn aside_px(config: &config::RigFile) -> [[f64; 2]; 2] {
    let (_, witness) = simulated::open(config).expect("a simulated rig");
    let functions = measured(config).unwrap().functions;
    let photo = config.photo_on_sensor();
    let place = |n: usize, count: usize, first: usize, side: usize| {
        first as f64 + (n as f64 + 0.5) * side as f64 / count as f64 - 0.5
    };
    [Channel::Red, Channel::Blue].map(|c| {
        let (mut sum, count) = ([0.0; 2], (functions.rows * functions.columns) as f64);
        for row in 0..functions.rows {
            for column in 0..functions.columns {
                let [found, green] = [c, Channel::Green]
                    .map(|c| centroid(functions.function(c, row, column), functions.support_px));
                let at = [
                    place(column, functions.columns, photo.x, photo.size.width),
                    place(row, functions.rows, photo.y, photo.size.height),
                ];
                let [lens, lens_green] = [c, Channel::Green].map(|c| {
                    let taps = witness.function(Light::Panel, c, at);
                    let (x, y) = centroid(taps.data(), taps.width());
                    [x, y]
                });
                sum[0] += (found.0 - green.0 - lens[0] + lens_green[0]) / count;
                sum[1] += (found.1 - green.1 - lens[1] + lens_green[1]) / count;
            }
        }
        sum
    })
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_panel_s_stripes_are_no_lateral_colour() {
    let config = load("truthful.toml");
    assert_eq!(config.panel.subpixels, Subpixels::Rgb);
    // A third of a panel pixel, the distance between its colours, is 0.29 sensor pixels.
    let aside = aside_px(&config);
    println!("{aside:.3?}");
    assert!(aside.iter().flatten().all(|px| px.abs() < 0.1), "{aside:?}");
}
