//! Scenes, and quarters of scenes, which give more content from few pictures.

use relens::chart::scenes::{Scene, cut};
use relens::frame::{Frame, Rect, Size, Work};
use relens::picture::embedded;

/// A scene before the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Subject {
    /// One of the program's scenes.
    Of(Scene),
    /// A photograph of the laboratory: an index into [`KEPT`].
    Kept(usize),
}

/// The laboratory's own photographs; origins in `tests/scenes/README.md`.
pub(crate) const KEPT: [(&str, &[u8]); 6] = [
    ("cat", include_bytes!("../scenes/cat.jpg")),
    ("retina", include_bytes!("../scenes/retina.jpg")),
    ("galaxies", include_bytes!("../scenes/galaxies.jpg")),
    ("bricks", include_bytes!("../scenes/bricks.jpg")),
    ("raccoon", include_bytes!("../scenes/raccoon.jpg")),
    ("admiral", include_bytes!("../scenes/admiral.jpg")),
];

impl Subject {
    /// Name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Subject::Of(scene) => scene.name(),
            Subject::Kept(n) => KEPT[n].0,
        }
    }

    const fn number(self) -> u64 {
        match self {
            Subject::Of(scene) => scene as u64,
            Subject::Kept(n) => (Scene::CHARTED.len() + n) as u64,
        }
    }

    pub(crate) fn codes(self, size: Size) -> Frame<Work> {
        match self {
            Subject::Of(scene) => scene.codes(size),
            Subject::Kept(n) => cut(&Frame::from_planes(embedded(KEPT[n].1)), size),
        }
    }
}

/// A scene, or a quarter of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct View {
    /// The scene.
    pub(crate) subject: Subject,
    /// Quarter of the scene, 0..4 row by row; `None` for the whole.
    pub(crate) quarter: Option<usize>,
}

impl View {
    /// A whole scene.
    #[cfg(test)]
    pub(crate) const fn whole(scene: Scene) -> View {
        View { subject: Subject::Of(scene), quarter: None }
    }

    /// Quarter `n` of a scene, 0..4.
    pub(crate) const fn quarter(scene: Scene, n: usize) -> View {
        View { subject: Subject::Of(scene), quarter: Some(n) }
    }

    /// Name in tables.
    pub(crate) fn name(self) -> String {
        match self.quarter {
            None => self.subject.name().to_owned(),
            Some(n) => format!("{}, quarter {}", self.subject.name(), n + 1),
        }
    }

    /// A unique number, for seeds.
    pub(crate) fn number(self) -> u64 {
        8 * self.subject.number() + self.quarter.map_or(0, |n| n as u64 + 1)
    }

    /// Code values 0..255 at `size`.
    pub(crate) fn codes(self, size: Size) -> Frame<Work> {
        let Some(n) = self.quarter else { return self.subject.codes(size) };
        let wide = self.subject.codes(Size::new(2 * size.width, 2 * size.height));
        wide.crop(Rect { x: n % 2 * size.width, y: n / 2 * size.height, size })
    }
}
