//! The dot test of backward convolution on a calibrated rig, and the advice where it fails.

use std::fmt;

use super::Pipeline;
use crate::deconvolution::dot_test::{DotTest, Mismatch};
use crate::deconvolution::method::About;
use crate::deconvolution::patches::PatchShape;
use crate::frame::Rect;
use crate::remedy::AnyFailure;
use crate::rig::exposure::Devices;

/// Difference past which backward convolution counts as broken: healthy rigs measure up to 0.015,
/// patches too small or too large 0.031 and more (tests/tables/README.md).
const DIFFERENCE_MAX: f64 = 0.025;

/// The result of the dot test on a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackwardCheck {
    /// The measured differences.
    pub found: DotTest,
    shape: PatchShape,
    support_px: usize,
}

impl Pipeline {
    /// Tests the backward convolution of `rig` in [`crate::deconvolution::dot_test::CAPTURES`]
    /// captures; `None` if the method has none by light, as `about` states.
    ///
    /// # Errors
    /// The failure of a capture.
    pub fn check_backward(
        &self,
        rig: &mut Devices,
        about: &About,
    ) -> Result<Option<BackwardCheck>, AnyFailure> {
        if !about.by_patches {
            return Ok(None);
        }
        let layout = *self.correction.layout();
        let photo = Rect { x: layout.margin_px, y: layout.margin_px, size: layout.photo };
        let (shape, support_px) = (self.patches, self.model.functions().support_px);
        let found = DotTest::measure(&mut self.light_path(rig), &self.model, photo, shape)?;
        Ok(Some(BackwardCheck { found, shape, support_px }))
    }
}

impl BackwardCheck {
    /// The fault and its remedy; `None` without a fault.
    pub fn complaint(&self) -> Option<String> {
        let Mismatch { channel, difference, .. } = self.found.worst();
        if self.found.worst().significant() <= DIFFERENCE_MAX {
            return None;
        }
        let PatchShape { patch_px, margin_px } = self.shape;
        let reach = self.support_px / 2;
        let advice = if difference < 0.0 && margin_px.min(patch_px / 2) < reach / 2 {
            format!(
                "patches of {patch_px} px with margins of {margin_px} px lose light, for the blur \
                 reaches {reach} px: raise patch-px and margin-px"
            )
        } else {
            format!(
                "lower patch-px = {patch_px}, for the blur varies within a patch; if that does \
                 not help, the panel's light changes: let it warm up and calibrate again"
            )
        };
        Some(format!(
            "backward convolution differs by {:+.1} % in {}, allowed {:.1} %: {advice}",
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
        write!(f, "{difference:+.2} ± {uncertainty:.2} % from the adjoint in {}", channel.name())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::{self, MethodName};
    use crate::pipeline::Setting;
    use crate::pipeline::tests::small;
    use crate::rig::simulated;

    /// The check of the small rig by `method`, with patches of `patch_px`.
    fn check(method: MethodName, patch_px: usize) -> Option<BackwardCheck> {
        let mut config = config::load(Path::new("small.toml")).unwrap();
        let (mut rig, _) = simulated::open(&config).unwrap();
        config.paper.patch_px = patch_px;
        let method = Setting::as_filed(&config, method).method(&config);
        let pipeline = Pipeline::new(&config, small()).unwrap();
        pipeline.check_backward(&mut rig, method.about()).unwrap()
    }

    #[test]
    fn a_method_without_patches_is_not_tested() {
        assert_eq!(check(MethodName::Hybrid, 4), None);
    }

    #[test]
    #[ignore = "a minute: the gate runs it"]
    fn patches_smaller_than_the_blur_are_reported() {
        let healthy = check(MethodName::Paper, 20).unwrap();
        assert_eq!(healthy.complaint(), None, "{healthy}");
        let small = check(MethodName::Paper, 4).unwrap();
        let words = small.complaint().unwrap_or_else(|| panic!("{small}"));
        assert!(words.contains("raise patch-px"), "{words}");
    }
}
