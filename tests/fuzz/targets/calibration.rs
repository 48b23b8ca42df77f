//! A calibration slot, as it is and with its length and checksum corrected, so that its payload is
//! parsed. An accepted calibration can be used.

#![no_main]

use std::fs;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use relens::calibration::{Correction, Layout, store};
use relens::config::Subpixels;
use relens::frame::{Channel, Frame, Plane, Size, Work};

/// The rig and the photo that `tests/fuzz/seeds.rs` calibrates.
const RIG: u64 = 7;
const LAYOUT: Layout = Layout {
    mosaic: None,
    panel: Size::new(64, 50),
    subpixels: Subpixels::Whole,
    sensor: Size::new(60, 50),
    photo: Size::new(40, 30),
    photo_x_px: 10,
    photo_y_px: 10,
    margin_px: 4,
    saturated: 1023,
};

/// Folder of the slots.
static FOLDER: LazyLock<tempfile::TempDir> =
    LazyLock::new(|| tempfile::tempdir().expect("a folder"));

fn put_to_work(slot: &[u8]) {
    let folder = FOLDER.path();
    fs::write(folder.join("calibration-a.slot"), slot).expect("room for a slot");
    let Ok(calibration) = store::load(folder, RIG) else { return };
    store::save(folder, &calibration).expect("room for another");
    let kept = store::load(folder, RIG).expect("what was just kept");
    assert_eq!(kept.generation, calibration.generation);
    fs::remove_file(folder.join("calibration-b.slot")).expect("what was just kept");
    let Ok(correction) = Correction::new(&calibration, LAYOUT) else { return };
    let shown: Frame<Work> = Frame::from_fn(|_| Plane::filled(LAYOUT.canvas(), 100.0));
    let _ = correction.show(&shown);
    let _ = correction.see(&Frame::from_fn(|_| Plane::filled(LAYOUT.sensor, 700)));
    let Ok(model) = calibration.lens_model() else { return };
    let mut seen = Plane::zeros(LAYOUT.canvas());
    model.forward(Channel::Green, shown.plane(Channel::Green), &mut seen);
}

fuzz_target!(|bytes: &[u8]| {
    put_to_work(bytes);
    // Header of 28 bytes with the payload's length at the end; a checksum of 4.
    if bytes.len() > 32 {
        let mut slot = bytes.to_vec();
        let end = slot.len() - 4;
        slot[24..28].copy_from_slice(&((end - 28) as u32).to_le_bytes());
        let sum = crc32fast::hash(&slot[..end]);
        slot[end..].copy_from_slice(&sum.to_le_bytes());
        put_to_work(&slot);
    }
});
