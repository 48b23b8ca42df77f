//! A lens model on pixels binned by two.

use super::{LensFunctions, LensModel, LensModelError};
use crate::frame::{Channel, Size};

impl LensModel {
    /// The lens from scenes of squares of two by two pixels to the means over such squares.
    ///
    /// # Errors
    /// When a side of the canvas is odd.
    pub fn binned(&self) -> Result<LensModel, LensModelError> {
        let Size { width, height } = self.canvas;
        if !width.is_multiple_of(2) || !height.is_multiple_of(2) {
            return Err(LensModelError(format!(
                "has a canvas of {}; even sides can be binned",
                self.canvas
            )));
        }
        let margin = self.field.x.div_ceil(2);
        let photo = Size::new(width / 2 - 2 * margin, height / 2 - 2 * margin);
        let mut model = LensModel::new(photo, margin, &self.functions.binned())?;
        for (binned, own) in model.broad.iter_mut().zip(&self.broad) {
            *binned = own.as_ref().and_then(|broad| broad.binned(model.canvas));
        }
        Ok(model)
    }
}

impl LensFunctions {
    fn binned(&self) -> LensFunctions {
        let own = self.support_px;
        let reach = (own / 2).div_ceil(2);
        let taps = Channel::ALL.map(|c| {
            let functions = self.taps[c.index()].chunks_exact(own * own);
            functions.flat_map(|function| binned_function(function, own, reach)).collect()
        });
        LensFunctions { support_px: 2 * reach + 1, taps, ..*self }
    }
}

/// The taps of `function`, whose support is `own` pixels wide, between squares up to `reach`
/// squares apart: a pixel of one square and a pixel of the other are −1 to 1 pixels more or less
/// apart, once, twice and once along each axis.
fn binned_function(function: &[f32], own: usize, reach: usize) -> Vec<f32> {
    const PAIRS: [(isize, f32); 3] = [(-1, 0.25), (0, 0.5), (1, 0.25)];
    let (centre, side, reach) = ((own / 2) as isize, own as isize, reach as isize);
    let tap = |x: isize, y: isize| {
        let (x, y) = (x + centre, y + centre);
        let is_inside = (0..side).contains(&x) && (0..side).contains(&y);
        if is_inside { function[(y * side + x) as usize] } else { 0.0 }
    };
    let mut taps = Vec::new();
    for down in -reach..=reach {
        for right in -reach..=reach {
            let row = |(dy, weight): (isize, f32)| {
                let along = PAIRS.map(|(dx, weight)| weight * tap(2 * right + dx, 2 * down + dy));
                weight * along.iter().sum::<f32>()
            };
            taps.push(4.0 * PAIRS.map(row).iter().sum::<f32>());
        }
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::{Beyond, Halo};
    use crate::frame::Plane;
    use crate::frame::binning::bin;

    #[test]
    fn the_binned_lens_is_the_mean_of_the_lens_over_squares() {
        let taps: Vec<f32> = (0..49).map(|t| ((t * 37) % 11) as f32 / 245.0).collect();
        let taps = [(); 3].map(|()| taps.clone());
        let functions = LensFunctions { rows: 1, columns: 1, support_px: 7, taps };
        let halo = |_| vec![Halo { radius_px: 24.0, share: 0.1 }];
        let model = LensModel::new(Size::new(88, 72), 4, &functions).unwrap();
        let model = model.with_broad_light(&Channel::ALL.map(halo), Beyond::Dark).unwrap();
        let binned = model.binned().unwrap();
        let scene = Plane::from_fn(binned.canvas(), |x, y| ((x * 31 + y * 17) % 101) as f32);
        let squares = Plane::from_fn(model.canvas(), |x, y| scene.at(x / 2, y / 2));
        let (mut seen, mut own) = (Plane::zeros(scene.size()), squares.clone());
        binned.forward(Channel::Green, &scene, &mut seen);
        model.forward(Channel::Green, &squares, &mut own);
        seen.add_scaled(-1.0, &bin(&own, 2));
        assert!(seen.rms() < 0.05, "{}", seen.rms());
        let odd = LensModel::new(Size::new(87, 72), 4, &functions).unwrap();
        assert!(odd.binned().is_err(), "an odd width");
    }
}
