//! The dot test of backward convolution on a calibrated rig, and what to say when it fails.

use std::fmt;

use super::Pipeline;
use crate::deconvolution::dot_test::{DotTest, Mismatch};
use crate::deconvolution::patches::PatchShape;
use crate::frame::Rect;
use crate::remedy::AnyFailure;
use crate::rig::exposure::Devices;

/// Difference past which backward convolution counts as broken: healthy rigs measure up to 0.015,
/// patches too small or too large 0.031 and more (tests/tables/README.md).
const DIFFERENCE_MAX: f64 = 0.025;

/// How a rig stood the dot test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackwardCheck {
    /// What was found.
    pub found: DotTest,
    shape: PatchShape,
    support_px: usize,
}

impl Pipeline {
    /// Tests the backward convolution of `rig` in [`crate::deconvolution::dot_test::CAPTURES`]
    /// captures.
    ///
    /// # Errors
    /// The failure of the capture that failed.
    pub fn check_backward(&self, rig: &mut Devices) -> Result<BackwardCheck, AnyFailure> {
        let layout = *self.correction.layout();
        let photo = Rect { x: layout.margin_px, y: layout.margin_px, size: layout.photo };
        let (shape, support_px) = (self.patches, self.model.functions().support_px);
        let found = DotTest::measure(&mut self.light_path(rig), &self.model, photo, shape)?;
        Ok(BackwardCheck { found, shape, support_px })
    }
}

impl BackwardCheck {
    /// What is wrong and what to do about it; nothing when all is well.
    pub fn complaint(&self) -> Option<String> {
        let Mismatch { channel, difference, .. } = self.found.worst();
        if self.found.worst().significant() <= DIFFERENCE_MAX {
            return None;
        }
        let PatchShape { patch_px, margin_px } = self.shape;
        let reach = self.support_px / 2;
        let advice = if difference < 0.0 && margin_px.min(patch_px / 2) < reach / 2 {
            format!(
                "patches of {patch_px} px with {margin_px} px around them lose light of a lens \
                 that reaches {reach} px: raise patch-px and margin-px"
            )
        } else {
            format!(
                "lower patch-px = {patch_px}, for the blur varies within a patch; if that does \
                 not help, light does not add up: let the panel warm up and calibrate again"
            )
        };
        Some(format!(
            "backward convolution is {:+.1} % off in {}, at most {:.1} % are allowed: {advice}",
            100.0 * difference,
            channel.name(),
            100.0 * DIFFERENCE_MAX
        ))
    }
}

impl fmt::Display for BackwardCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Mismatch { channel, difference, uncertainty } = self.found.worst();
        let (difference, uncertainty) = (100.0 * difference, 100.0 * uncertainty);
        write!(f, "{difference:+.2} ± {uncertainty:.2} % off the forward one in {}", channel.name())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config;
    use crate::pipeline::tests::small;
    use crate::rig::simulated;

    /// The small rig with patches of so many pixels.
    fn check(patch_px: usize) -> BackwardCheck {
        let mut config = config::load(Path::new("small.toml")).unwrap();
        let (mut rig, _) = simulated::open(&config).unwrap();
        config.paper.patch_px = patch_px;
        Pipeline::new(&config, small()).unwrap().check_backward(&mut rig).unwrap()
    }

    #[test]
    #[ignore = "a minute: the gate runs it"]
    fn the_small_rig_passes_with_its_patches_and_is_told_of_patches_smaller_than_its_blur() {
        let healthy = check(20);
        assert_eq!(healthy.complaint(), None, "{healthy}");
        let small = check(4);
        let words = small.complaint().unwrap_or_else(|| panic!("{small}"));
        assert!(words.contains("raise patch-px"), "{words}");
    }
}
