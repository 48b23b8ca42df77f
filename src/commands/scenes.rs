//! The demo's scenes, in linear light and the rig's shape.

use relens::config::Curve;
use relens::frame::resample::resize;
use relens::frame::{Frame, Plane, Rect, Size, Work};
use relens::patterns::chart::chart;
use relens::picture::{Limits, Photo};

use super::Trouble;

/// Names and scenes: three photographs in the public domain, and the resolution chart the program draws.
pub(super) fn all(size: Size) -> Result<Vec<(&'static str, Frame<Work>)>, Trouble> {
    let files: [(&str, &[u8]); 3] = [
        ("astronaut.png", include_bytes!("../../tests/scenes/astronaut.png")),
        ("coffee.png", include_bytes!("../../tests/scenes/coffee.png")),
        ("rocket.jpg", include_bytes!("../../tests/scenes/rocket.jpg")),
    ];
    let mut scenes = Vec::new();
    for (name, bytes) in files {
        let photo =
            Photo::from_bytes(name, bytes, Curve::Srgb, &Limits::default()).map_err(|e| Trouble::of(&e))?;
        scenes.push((name, cut(&photo, size)));
    }
    let drawn = chart(size);
    scenes.push(("chart.png", Frame::from_fn(|_| drawn.clone())));
    Ok(scenes)
}

/// The largest part of the photo about its centre that has the shape of `size`, at that size.
pub(super) fn cut(photo: &Photo, size: Size) -> Frame<Work> {
    let have = photo.light.size();
    let wide = have.width * size.height > have.height * size.width;
    let part = match wide {
        true => Size::new((have.height * size.width / size.height).max(1), have.height),
        false => Size::new(have.width, (have.width * size.height / size.width).max(1)),
    };
    let rect = Rect { x: (have.width - part.width) / 2, y: (have.height - part.height) / 2, size: part };
    let grey = photo.channels.list().len() == 1;
    Frame::from_fn(|channel| {
        let source = if grey { relens::frame::Channel::Green } else { channel };
        let plane: Plane = resize(&photo.light.plane(source).crop(rect), size);
        plane.map(|v| v.clamp(0.0, relens::frame::FULL_SCALE))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_has_the_rigs_size_and_something_in_it() {
        for (name, scene) in all(Size::new(96, 72)).unwrap() {
            assert_eq!(scene.size(), Size::new(96, 72));
            assert!(scene.planes().iter().all(|p| p.rms() > 3.0), "{name}");
        }
    }
}
