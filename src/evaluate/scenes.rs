//! The scenes whose truth is known: three photographs in the public domain and the resolution chart.
//!
//! Origins: see `tests/scenes/README.md`.

use crate::frame::resample::resize;
use crate::frame::{Frame, Plane, Rect, Size, Work};
use crate::patterns::chart;
use crate::picture;

/// A scene to be photographed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// Portrait of an astronaut; NASA, public domain.
    Astronaut,
    /// A cup of coffee; CC0.
    Coffee,
    /// A rocket at night; SpaceX, CC0.
    Rocket,
    /// A resolution chart in the manner of ISO 12233, drawn by the program.
    Chart,
}

impl Scene {
    /// All of them.
    pub const ALL: [Scene; 4] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket, Scene::Chart];
    /// The two photographs of the study.
    pub const STUDY_PHOTOGRAPHS: [Scene; 2] = [Scene::Astronaut, Scene::Coffee];

    /// The word in tables and file names.
    pub const fn name(self) -> &'static str {
        match self {
            Scene::Astronaut => "astronaut",
            Scene::Coffee => "coffee",
            Scene::Rocket => "rocket",
            Scene::Chart => "chart",
        }
    }

    fn file(self) -> Option<&'static [u8]> {
        match self {
            Scene::Astronaut => Some(include_bytes!("../../tests/scenes/astronaut.png")),
            Scene::Coffee => Some(include_bytes!("../../tests/scenes/coffee.png")),
            Scene::Rocket => Some(include_bytes!("../../tests/scenes/rocket.jpg")),
            Scene::Chart => None,
        }
    }

    /// The scene in colour as code values 0..255 (no curve undone), cut to the shape of `size` about its
    /// centre and resized to it.
    pub fn codes(self, size: Size) -> Frame<Work> {
        let Some(file) = self.file() else {
            let chart = chart(size);
            return Frame::from_fn(|_| chart.clone());
        };
        let planes = picture::embedded(file);
        Frame::from_planes(planes.map(|plane| resize(&plane.crop(centred(plane.size(), size)), size)))
    }

    /// The scene in grey as code values 0..255 (Rec. 709 weights), as the study used it.
    pub fn grey(self, size: Size) -> Plane {
        let [red, green, blue] = self.codes(size).into_planes();
        let mut grey = Plane::zeros(size);
        grey.add_scaled(0.2125, &red);
        grey.add_scaled(0.7154, &green);
        grey.add_scaled(0.0721, &blue);
        grey
    }
}

/// The largest rectangle of the shape of `want` about the centre of `have`.
fn centred(have: Size, want: Size) -> Rect {
    let wide = have.width * want.height > have.height * want.width;
    let size = if wide {
        Size::new(have.height * want.width / want.height, have.height)
    } else {
        Size::new(have.width, have.width * want.height / want.width)
    };
    Rect { x: (have.width - size.width) / 2, y: (have.height - size.height) / 2, size }
}
