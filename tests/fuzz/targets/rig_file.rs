//! A rig file: refused with a message, or a consistent rig.

#![no_main]

use std::path::Path;

use libfuzzer_sys::{Corpus, fuzz_target};
use relens::config;

fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Ok(text) = std::str::from_utf8(bytes) else { return Corpus::Reject };
    // Where the files are that the program's own rig files name.
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../rig-config"));
    match config::parse(text, "rig.toml", folder) {
        Ok(rig) => {
            let (canvas, sensor) = (rig.canvas_on_sensor(), rig.camera.size());
            assert!(
                canvas.x + canvas.size.width <= sensor.width
                    && canvas.y + canvas.size.height <= sensor.height
            );
            let photo = rig.photo_on_canvas();
            assert!(photo.x + photo.size.width <= canvas.size.width && photo.size.area() > 0);
            let again = config::parse(text, "rig.toml", folder).expect("what was taken once");
            assert_eq!(again.identity, rig.identity);
        }
        Err(error) => assert!(!relens::remedy::full_message(&error).is_empty()),
    }
    Corpus::Keep
});
