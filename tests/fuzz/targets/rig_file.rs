//! A rig file is refused with a message, or gives a consistent rig.

#![no_main]

use libfuzzer_sys::{Corpus, fuzz_target};
use relens::config;

fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Ok(text) = std::str::from_utf8(bytes) else { return Corpus::Reject };
    match config::parse(text, "rig.toml") {
        Ok(rig) => {
            let (canvas, sensor) = (rig.canvas_on_sensor(), rig.camera.size());
            assert!(
                canvas.x + canvas.size.width <= sensor.width
                    && canvas.y + canvas.size.height <= sensor.height
            );
            let photo = rig.photo_on_canvas();
            assert!(photo.x + photo.size.width <= canvas.size.width && photo.size.area() > 0);
            let again = config::parse(text, "rig.toml").expect("what was taken once");
            assert_eq!(again.identity, rig.identity);
        }
        Err(error) => assert!(!relens::remedy::full_message(&error).is_empty()),
    }
    Corpus::Keep
});
