//! A customer's file as the worker reads it: bytes to linear light, fitted to the rig's grid, and
//! encoded again. What is taken is light with values, and what is written of it is read back at the
//! same size.

#![no_main]

use libfuzzer_sys::fuzz_target;
use relens::config::Curve;
use relens::frame::{Channels, Frame, Size, Work};
use relens::picture::{Limits, Photo, encode};

const RIG: Size = Size::new(64, 48);
const LIMITS: Limits =
    Limits { bytes_max: 1 << 20, pixels_max: 1 << 16, decoder_bytes_max: 16 << 20 };

/// The program catches a decoder's panic and refuses the file; a panic of its own is a bug.
fn forgive_decoders() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |about| {
        if !about.location().is_some_and(|at| at.file().contains("/registry/src/")) {
            hook(about);
        }
    }));
}

fn all_finite(light: &Frame<Work>) -> bool {
    light.planes().iter().all(|plane| plane.data().iter().all(|level| level.is_finite()))
}

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    let Ok(photo) = Photo::from_bytes("photo", bytes, Curve::Srgb, &LIMITS) else { return };
    assert!(all_finite(&photo.light));
    let grey = photo.channels == Channels::Green;
    if let Ok(written) = encode("photo", &photo.light, &photo.manner, grey) {
        // What the photo carried may take more room than it had in there.
        let room = Limits { bytes_max: 1 << 24, ..LIMITS };
        let back = Photo::from_bytes("photo", &written, Curve::Srgb, &room).expect("a result that \
         can be read");
        let (one, other) = (back.stored, photo.stored);
        assert!(one == other || (one.width, one.height) == (other.height, other.width), "{one} of \
         {other}");
    }
    if let Ok(fitted) = photo.fit(RIG) {
        assert_eq!(fitted.light.size(), RIG);
        assert!(all_finite(&fitted.light));
    }
});
