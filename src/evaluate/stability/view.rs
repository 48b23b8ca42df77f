//! Scenes and parts of them: more content than there are pictures.

use crate::evaluate::scenes::Scene;
use crate::frame::{Frame, Size, Work};

/// A scene, or a quarter of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// The scene.
    pub scene: Scene,
    /// Which quarter of it, 0..4 row by row; `None` for the whole.
    pub quarter: Option<usize>,
}

impl View {
    /// All of a scene.
    pub const fn whole(scene: Scene) -> View {
        View { scene, quarter: None }
    }

    /// Quarter `n` of a scene, 0..4.
    pub const fn quarter(scene: Scene, n: usize) -> View {
        View { scene, quarter: Some(n) }
    }

    /// The words in tables.
    pub fn name(self) -> String {
        match self.quarter {
            None => self.scene.name().to_owned(),
            Some(n) => format!("{}, quarter {}", self.scene.name(), n + 1),
        }
    }

    /// A number of its own, for seeds.
    pub fn number(self) -> u64 {
        8 * self.scene as u64 + self.quarter.map_or(0, |n| n as u64 + 1)
    }

    /// Code values 0..255 at `size`.
    pub fn codes(self, size: Size) -> Frame<Work> {
        let Some(n) = self.quarter else { return self.scene.codes(size) };
        let wide = self.scene.codes(Size::new(2 * size.width, 2 * size.height));
        wide.crop(crate::frame::Rect { x: n % 2 * size.width, y: n / 2 * size.height, size })
    }
}
