//! Known scenes: three photographs in the public domain, and drawings.
//!
//! Origins: see `tests/scenes/README.md`.

use super::drawn;
use crate::config::Curve;
use crate::frame::resample::resize;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Rect, Size, Work};
use crate::patterns::chart;
use crate::picture::{self, Tone};

/// A known scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// Portrait of an astronaut; NASA, public domain.
    Astronaut,
    /// A cup of coffee; CC0.
    Coffee,
    /// A rocket at night; SpaceX, CC0.
    Rocket,
    /// A resolution chart in the manner of ISO 12233, drawn.
    Chart,
    /// A page of print, drawn.
    Page,
    /// Overlapping leaves, drawn.
    Leaves,
}

const LEAVES_SEED: u64 = 20_261_124;

impl Scene {
    /// The photographs and the resolution chart.
    pub const ALL: [Scene; 4] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket, Scene::Chart];
    /// The scenes of a rig's chart.
    pub const CHARTED: [Scene; 6] =
        [Scene::Astronaut, Scene::Coffee, Scene::Rocket, Scene::Chart, Scene::Page, Scene::Leaves];
    /// The two photographs of the study.
    pub const STUDY_PHOTOGRAPHS: [Scene; 2] = [Scene::Astronaut, Scene::Coffee];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        self.file_name().split('.').next().unwrap_or_default()
    }

    /// File name of the scene; a drawn scene has one, too.
    pub const fn file_name(self) -> &'static str {
        self.file().0
    }

    /// File name and contents; a drawn scene has a name but no contents.
    const fn file(self) -> (&'static str, Option<&'static [u8]>) {
        match self {
            Scene::Astronaut => {
                ("astronaut.png", Some(include_bytes!("../../tests/scenes/astronaut.png")))
            }
            Scene::Coffee => ("coffee.png", Some(include_bytes!("../../tests/scenes/coffee.png"))),
            Scene::Rocket => ("rocket.jpg", Some(include_bytes!("../../tests/scenes/rocket.jpg"))),
            Scene::Chart => ("chart.png", None),
            Scene::Page => ("page.png", None),
            Scene::Leaves => ("leaves.png", None),
        }
    }

    fn drawn(self, size: Size) -> Frame<Work> {
        let grey = |plane: Plane| Frame::from_fn(|_| plane.clone());
        match self {
            Scene::Page => grey(drawn::page(size)),
            Scene::Leaves => drawn::leaves(size, LEAVES_SEED),
            _ => grey(chart(size)),
        }
    }

    /// Code values 0..255 in colour, cut to the shape of `size` about the centre and resized.
    pub fn codes(self, size: Size) -> Frame<Work> {
        let (_, Some(file)) = self.file() else { return self.drawn(size) };
        let planes = picture::embedded(file);
        Frame::from_planes(
            planes.map(|plane| resize(&plane.crop(centred(plane.size(), size)), size)),
        )
    }

    /// Linear light 0..255 in colour, cut to the shape of `size` and resized as light.
    pub fn light(self, size: Size) -> Frame<Work> {
        let (_, Some(file)) = self.file() else { return self.codes(size) };
        let tone = Tone::of_curve(Curve::Srgb, 8);
        let codes = Frame::<Work>::from_planes(picture::embedded(file));
        cut(&Frame::from_fn(|c| tone.plane(c, &codes.plane(c).map(|code: f32| code as u8))), size)
    }

    /// Grey code values 0..255 (Rec. 709 weights), resized bilinearly as in the study.
    pub fn grey(self, size: Size) -> Plane {
        let (_, Some(file)) = self.file() else {
            return self.drawn(size).plane(Channel::Green).clone();
        };
        let planes = picture::embedded(file);
        let planes = planes.map(|p| bilinear(&p.crop(centred(p.size(), size)), size));
        let mut grey = Plane::zeros(size);
        for (plane, weight) in planes.iter().zip([0.2125, 0.7154, 0.0721]) {
            grey.add_scaled(weight, plane);
        }
        grey
    }
}

/// The largest part of `light` about its centre with the shape of `size`, resized to it.
pub fn cut(light: &Frame<Work>, size: Size) -> Frame<Work> {
    let part = centred(light.size(), size);
    Frame::from_fn(|c| {
        resize(&light.plane(c).crop(part), size).map(|v: f32| v.clamp(0.0, FULL_SCALE))
    })
}

/// `plane` at `size` by bilinear interpolation between pixel centres, edges repeated.
fn bilinear(plane: &Plane, size: Size) -> Plane {
    let place = |at: usize, from: usize, to: usize| {
        let centre = (at as f32 + 0.5) * from as f32 / to as f32 - 0.5;
        let low = centre.floor().clamp(0.0, (from - 1) as f32);
        (low as usize, (low as usize + 1).min(from - 1), (centre - low).clamp(0.0, 1.0))
    };
    Plane::from_fn(size, |x, y| {
        let (left, right, u) = place(x, plane.width(), size.width);
        let (above, below, v) = place(y, plane.height(), size.height);
        let row = |y: usize| plane.at(left, y) * (1.0 - u) + plane.at(right, y) * u;
        row(above) * (1.0 - v) + row(below) * v
    })
}

/// The largest rectangle with the shape of `want` about the centre of `have`.
fn centred(have: Size, want: Size) -> Rect {
    let wide = have.width * want.height > have.height * want.width;
    let size = if wide {
        Size::new((have.height * want.width / want.height).max(1), have.height)
    } else {
        Size::new(have.width, (have.width * want.height / want.width).max(1))
    };
    Rect { x: (have.width - size.width) / 2, y: (have.height - size.height) / 2, size }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_has_its_size_and_contrast() {
        for scene in Scene::CHARTED {
            let light = scene.light(Size::new(96, 72));
            assert_eq!(light.size(), Size::new(96, 72));
            assert!(light.planes().iter().all(|p| p.rms() > 3.0), "{}", scene.name());
        }
    }
}
