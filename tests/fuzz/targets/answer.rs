//! The answer of a worker that a file has taken over is a photo of the requested size, or is
//! refused.

#![no_main]

use libfuzzer_sys::fuzz_target;
use relens::frame::{Channels, Size};
use relens::picture::{encode, worker};

const ASKED: Size = Size::new(16, 12);

fuzz_target!(|bytes: &[u8]| {
    let Ok(photo) = worker::photo_of_answer("photo", bytes, ASKED) else { return };
    assert_eq!(photo.light.size(), ASKED);
    // The rest of the program can work with an accepted photo.
    let _ = encode("photo", &photo.light, &photo.manner, photo.channels == Channels::Green);
});
