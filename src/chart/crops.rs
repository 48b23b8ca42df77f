//! Small parts of scenes, photos and results, to be looked at beside the numbers.

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};

use super::scenes::Scene;
use crate::config::Curve;
use crate::frame::{Channel, Channels, Frame, Rect, Size, Work};
use crate::picture::Tone;

/// What is cut out of which scene, and about which place: shares of width and height.
pub const PARTS: [(Scene, &str, [f64; 2]); 2] =
    [(Scene::Astronaut, "an eye", [0.394, 0.096]), (Scene::Page, "print", [0.11, 0.105])];
/// Its width and height, shares of the photo's.
const SHARE: f64 = 3.0 / 32.0;

/// A part of a picture as it is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Crop {
    /// Which scene it is of.
    pub scene: Scene,
    /// Of what: a method with its setting, or [`SCENE`], or [`PHOTO`].
    pub of: String,
    size: Size,
    /// Red, green and blue of one pixel after the other.
    codes: Vec<u8>,
}

/// The name of the scene itself among crops.
pub const SCENE: &str = "the scene";
/// The name of the untouched photo among crops.
pub const PHOTO: &str = "the photo";

impl Crop {
    /// The part of `light` that is shown of `scene`, by `curve`; grey where `channels` are green
    /// alone. None of a scene of which nothing is.
    pub fn of(
        scene: Scene,
        of: &str,
        (curve, channels): (Curve, Channels),
        light: &Frame<Work>,
    ) -> Option<Crop> {
        let (.., at) = PARTS.iter().find(|(from, ..)| *from == scene)?;
        let whole = light.size();
        let side = |side: usize| ((SHARE * side as f64).round() as usize).max(1);
        let size = Size::new(side(whole.width), side(whole.height));
        let from = |share: f64, whole: usize, part: usize| {
            ((share * whole as f64) as usize).saturating_sub(part / 2).min(whole - part)
        };
        let x = from(at[0], whole.width, size.width);
        let y = from(at[1], whole.height, size.height);
        let tone = Tone::of_curve(curve, 8);
        let planes = Channel::ALL.map(|c| {
            let c = if channels == Channels::Green { Channel::Green } else { c };
            tone.display(c, &light.plane(c).crop(Rect { x, y, size }))
        });
        let [r, g, b] = planes.each_ref().map(|plane| plane.data());
        let pixels = r.iter().zip(g).zip(b);
        let codes = pixels.flat_map(|((&r, &g), &b)| [r, g, b].map(|v| v.round() as u8)).collect();
        Some(Crop { scene, of: of.to_owned(), size, codes })
    }

    /// As a PNG file.
    pub fn png(&self) -> Vec<u8> {
        let (mut bytes, Size { width, height }) = (Cursor::new(Vec::new()), self.size);
        let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
        let size = [width as u32, height as u32];
        // A few hundred pixels in memory.
        encoder
            .write_image(&self.codes, size[0], size[1], ExtendedColorType::Rgb8)
            .expect("codes of that size");
        bytes.into_inner()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Plane;

    #[test]
    fn an_eye_is_cut_out_where_it_is_and_nothing_of_scenes_that_show_nothing() {
        let size = Size::new(256, 192);
        let light = Frame::from_fn(|c| {
            Plane::from_fn(size, |x, y| if c == Channel::Red { x as f32 } else { y as f32 })
        });
        let shown = (Curve::Linear, Channels::Colour);
        let crop = Crop::of(Scene::Astronaut, SCENE, shown, &light).unwrap();
        assert_eq!((crop.size, crop.codes.len()), (Size::new(24, 18), 3 * 24 * 18));
        assert_eq!(crop.codes[..3], [88, 9, 9]);
        let read = image::load_from_memory(&crop.png()).unwrap().into_rgb8();
        assert_eq!(read.into_raw(), crop.codes);
        assert_eq!(Crop::of(Scene::Leaves, SCENE, shown, &light), None);
        let grey = Crop::of(Scene::Astronaut, SCENE, (Curve::Linear, Channels::Green), &light);
        assert_eq!(grey.unwrap().codes[..3], [9, 9, 9]);
    }
}
