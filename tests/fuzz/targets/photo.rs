//! A photo file as the worker reads it: decoded to linear light, fitted to the rig's grid, and
//! encoded again. All light is finite, and the result is read back at the same size.

#![no_main]

use libfuzzer_sys::fuzz_target;
use relens::config::Curve;
use relens::frame::{Channels, Frame, Size, Work};
use relens::picture::{Limits, Photo, encode};

const RIG: Size = Size::new(64, 48);
const LIMITS: Limits =
    Limits { bytes_max: 1 << 20, pixels_max: 1 << 16, decoder_bytes_max: 16 << 20, grid: None };

/// Ignores panics of decoders, which the program catches; panics of its own code are bugs.
fn ignore_decoder_panics() {
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

fuzz_target!(init: ignore_decoder_panics(), |bytes: &[u8]| {
    let Ok(photo) = Photo::from_bytes("photo", bytes, Curve::Srgb, &LIMITS) else { return };
    assert!(all_finite(&photo.light));
    let grey = photo.channels == Channels::Green;
    if let Ok(written) = encode("photo", &photo.light, &photo.manner, grey) {
        // Metadata may take more room than in the photo.
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
