//! What a worker answers that a file has taken over: it is a photo of the size asked for, or
//! refused.

#![no_main]

use libfuzzer_sys::fuzz_target;
use relens::frame::{Channels, Size};
use relens::picture::{encode, worker};

const ASKED: Size = Size::new(16, 12);

fuzz_target!(|bytes: &[u8]| {
    let Ok(photo) = worker::photo_of_answer("photo", bytes, ASKED) else { return };
    assert_eq!(photo.light.size(), ASKED);
    // A photo that was believed is one that the rest can do its work with.
    let _ = encode("photo", &photo.light, &photo.manner, photo.channels == Channels::Green);
});
