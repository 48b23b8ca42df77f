//! A small synthetic calibration for tests.

use super::geometric::Map;
use super::surface::{Domain, Surface};
use super::{
    Calibration, CameraCurve, CrossChannel, Geometry, Noise, OperatorNorms, ResponseCurve,
    ResponsePattern,
};
use crate::deconvolution::lens_model::{Halo, LensFunctions};
use crate::frame::Size;

/// A photo of 40×30 with a margin of 4, shown enlarged by 1.25 and shifted; curves of power two,
/// some mixing, and a dark corner towards the right.
pub(crate) fn calibration() -> Calibration {
    let canvas = Domain { left: -4.0, top: -4.0, right: 43.0, bottom: 33.0 };
    let panel = Domain { left: 2.0, top: 2.0, right: 60.75, bottom: 48.25 };
    let geometry = Geometry {
        work_to_panel: Map {
            x: Surface::plane(canvas, 7.0, 1.25, 0.0),
            y: Surface::plane(canvas, 7.0, 0.0, 1.25),
        },
        panel_to_work: Map {
            x: Surface::plane(panel, -5.6, 0.8, 0.0),
            y: Surface::plane(panel, -5.6, 0.0, 0.8),
        },
    };
    let curve = || {
        let table: Vec<f32> =
            (0..256).map(|c| 0.1 * c as f32 + 0.9 / 255.0 * (c * c) as f32).collect();
        ResponseCurve::try_from(table).unwrap()
    };
    let noise = Noise { at_black: 0.04, per_level: 0.008 };
    Calibration {
        rig: 0x1234_5678_9abc_def0,
        generation: 7,
        photo: Size::new(40, 30),
        margin_px: 4,
        geometry,
        dark_corner: [1.0, 1.1, 0.9].map(|d| Surface::plane(canvas, d, -0.005, 0.0)),
        cross_channel: CrossChannel { c: [[1.0, 0.1, 0.02], [0.07, 1.0, 0.11], [0.01, 0.15, 1.0]] },
        camera_curve: CameraCurve::straight(),
        curves: [curve(), curve(), curve()],
        black: [64.0, 65.0, 66.0].map(|b| Surface::constant(canvas, b)),
        counts_per_level: [3.0, 3.2, 2.9],
        pattern: ResponsePattern::default(),
        noise: [noise; 3],
        functions: LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 1,
            taps: [vec![1.0], vec![1.0], vec![1.0]],
        },
        broad: std::array::from_fn(|n| vec![Halo { radius_px: 9.0 + n as f32, share: 0.02 }]),
        norms: OperatorNorms::uniform(4, 1.0),
        at_sites: Some(OperatorNorms::uniform(4, 1.0)),
        focuses: Vec::new(),
        norm_squared_seen: 1.0,
        operator_error: [1.0; 3],
        captures: 30,
    }
}
