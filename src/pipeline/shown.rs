//! Photos of known scenes on the panel, by which results on a rig of devices are scored.

use super::Pipeline;
use crate::deconvolution::data_term;
use crate::deconvolution::lens_model::Beyond;
use crate::frame::{Frame, Work};
use crate::rig::RigError;
use crate::rig::exposure::Devices;

impl Pipeline {
    /// The photo that the camera of `rig` takes of `scene` (photo-sized, linear light 0..255) on
    /// its panel: linear light with blur, colour fringes and noise. Light and shading are the
    /// panel's, not those of a real scene.
    ///
    /// # Errors
    /// When the capture fails.
    pub fn photograph(
        &self,
        rig: &mut Devices,
        scene: &Frame<Work>,
    ) -> Result<Frame<Work>, RigError> {
        let margin_px = self.correction.layout().margin_px;
        let (canvas, rect) = data_term::canvas_of(scene.size(), margin_px);
        let placed = Frame::from_fn(|c| data_term::place_with_edges(scene.plane(c), canvas, rect));
        let exposed = rig.capture(&self.correction.show(&placed))?;
        let mut photo = self.correction.see(&exposed.counts).light.crop(rect);
        if self.beyond == Beyond::Dark {
            self.photo_side.put_dark_corner(&mut photo);
        }
        Ok(photo)
    }
}
