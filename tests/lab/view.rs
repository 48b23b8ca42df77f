//! Scenes and parts of them: more content than there are pictures.

use relens::chart::scenes::Scene;
use relens::frame::{Frame, Rect, Size, Work};

/// A scene, or a quarter of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct View {
    /// The scene.
    pub(crate) scene: Scene,
    /// Which quarter of it, 0..4 row by row; `None` for the whole.
    pub(crate) quarter: Option<usize>,
}

impl View {
    /// All of a scene.
    #[cfg(test)]
    pub(crate) const fn whole(scene: Scene) -> View {
        View { scene, quarter: None }
    }

    /// Quarter `n` of a scene, 0..4.
    pub(crate) const fn quarter(scene: Scene, n: usize) -> View {
        View { scene, quarter: Some(n) }
    }

    /// The words in tables.
    pub(crate) fn name(self) -> String {
        match self.quarter {
            None => self.scene.name().to_owned(),
            Some(n) => format!("{}, quarter {}", self.scene.name(), n + 1),
        }
    }

    /// A number of its own, for seeds.
    pub(crate) fn number(self) -> u64 {
        8 * self.scene as u64 + self.quarter.map_or(0, |n| n as u64 + 1)
    }

    /// Code values 0..255 at `size`.
    pub(crate) fn codes(self, size: Size) -> Frame<Work> {
        let Some(n) = self.quarter else { return self.scene.codes(size) };
        let wide = self.scene.codes(Size::new(2 * size.width, 2 * size.height));
        wide.crop(Rect { x: n % 2 * size.width, y: n / 2 * size.height, size })
    }
}
