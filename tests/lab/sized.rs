//! A rig with more or fewer pixels.

use relens::config::{Kind, RigFile};

/// `rig` with the same field on `times` as many pixels along each side; all lengths in pixels scale
/// with them.
pub(crate) fn sized(rig: &RigFile, times: f64) -> RigFile {
    let mut rig = rig.clone();
    let by = |px: usize| (px as f64 * times) as usize;
    if let Kind::Simulated(simulation) = &mut rig.kind {
        let lens = &mut simulation.lens;
        lens.pixel_pitch_um /= times;
        lens.support_px = by(lens.support_px) | 1;
        (lens.node_columns, lens.node_rows) = (by(lens.node_columns), by(lens.node_rows));
    }
    let (photo, panel, camera) = (&mut rig.photo, &mut rig.panel, &mut rig.camera);
    let lengths = [
        &mut photo.width_px,
        &mut photo.height_px,
        &mut panel.width_px,
        &mut panel.height_px,
        &mut camera.width_px,
        &mut camera.height_px,
        &mut camera.photo_x_px,
        &mut camera.photo_y_px,
        &mut rig.calibration.checker_square_px,
        &mut rig.paper.patch_px,
        &mut rig.paper.margin_px,
        &mut rig.canvas.margin_px,
    ];
    lengths.into_iter().for_each(|px| *px = by(*px));
    rig.calibration.function_support_px = by(rig.calibration.function_support_px) | 1;
    rig
}
