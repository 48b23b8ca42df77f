//! A camera that runs free and stamps its first packet, on the virtual rig: frames show what was up
//! when their exposure began, and no mark says so.

use std::path::Path;

use relens::config::{self, CameraDevice, Kind, Stamps};
use relens::frame::Codes;
use relens::rig;

use super::{grey, middle};

/// Pictures shown.
const PICTURES: usize = 24;

/// How many of alternating dark and light pictures have a frame of the other, where stamps are read
/// as `stamps`; what was seen is printed.
fn wrong(stamps: Stamps) -> usize {
    let file = std::env::var("RELENS_FREE_RIG").expect("RELENS_FREE_RIG names the rig file");
    let mut config = config::load(Path::new(&file)).unwrap_or_else(|error| panic!("{error}"));
    let Kind::Hardware(hardware) = &mut config.kind else { panic!("a rig of devices") };
    let CameraDevice::V4l2(camera) = &mut hardware.camera;
    camera.stamps = stamps;
    let mut rig = rig::open_without_marks(&config).unwrap_or_else(|error| panic!("{error}"));
    let pictures: [Codes; 2] = [30, 210].map(|code| grey(&config, code));
    // What is dark and what is light: of frames that came long after their flip.
    let [dark, light] = pictures.each_ref().map(|picture| {
        (0..6).map(|_| middle(&rig.capture(picture).expect("a frame"))).last().expect("six")
    });
    assert!(light > dark + 50.0, "{dark} and {light}");
    let levels: Vec<f64> =
        (0..PICTURES).map(|n| middle(&rig.capture(&pictures[n % 2]).expect("a frame"))).collect();
    let is_wrong =
        |&(n, level): &(usize, &f64)| (level - [dark, light][n % 2]).abs() > 0.05 * (light - dark);
    let wrong = levels.iter().enumerate().filter(is_wrong).count();
    println!(
        "{stamps:?}: {wrong} of {PICTURES} wrong, {:.2} s a capture, rejected {:?}; {levels:.0?}",
        rig.seconds() / rig.captures() as f64,
        rig.rejected()
    );
    wrong
}

#[test]
#[ignore = "needs the virtual rig"]
fn free_running_no_frame_exposed_before_its_picture_was_up_is_taken() {
    assert_eq!(wrong(Stamps::FirstPacket), 0);
    // What uvcvideo says of its stamps; without care the above would not hold.
    assert!(wrong(Stamps::ExposureStart) > PICTURES / 8, "the camera never was in the way");
}
