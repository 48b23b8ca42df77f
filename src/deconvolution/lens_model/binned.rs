//! A lens model on pixels binned by two.

use super::{LensFunctions, LensModel, LensModelError};
use crate::frame::{Channel, Size};

/// Columns and rows, each 0 or 1, of pixels within a square of two by two.
pub type SquarePlaces = Vec<(usize, usize)>;

impl LensModel {
    /// The lens from scenes of squares of two by two pixels to the means over the `places` of each
    /// channel in every square. `margin_px` is that of this model's canvas.
    ///
    /// # Errors
    /// When a side of the canvas is odd.
    pub fn binned(
        &self,
        margin_px: usize,
        places: &[SquarePlaces; 3],
    ) -> Result<LensModel, LensModelError> {
        let Size { width, height } = self.canvas;
        if !width.is_multiple_of(2) || !height.is_multiple_of(2) {
            return Err(LensModelError(format!(
                "has a canvas of {}; even sides can be binned",
                self.canvas
            )));
        }
        let margin = margin_px.div_ceil(2);
        let photo = Size::new(width / 2 - 2 * margin, height / 2 - 2 * margin);
        let mut model = LensModel::new(photo, margin, &self.functions.binned(places))?;
        for (binned, own) in model.broad.iter_mut().zip(&self.broad) {
            *binned = own.as_ref().and_then(|broad| broad.binned(model.canvas));
        }
        Ok(model)
    }
}

impl LensFunctions {
    fn binned(&self, places: &[SquarePlaces; 3]) -> LensFunctions {
        let own = self.support_px;
        let reach = (own / 2).div_ceil(2);
        let support_px = 2 * reach + 1;
        let taps = Channel::ALL.map(|c| {
            let functions = self.taps[c.index()].chunks_exact(own * own);
            let one = |function| binned_function(function, own, reach, &places[c.index()]);
            functions.flat_map(one).collect()
        });
        LensFunctions { support_px, taps, ..*self }
    }
}

/// The taps of `function`, whose support is `own` pixels wide, from a square to the mean over
/// `places` of each square up to `reach` squares away.
fn binned_function(function: &[f32], own: usize, reach: usize, places: &SquarePlaces) -> Vec<f32> {
    let centre = (own / 2) as isize;
    let tap = |x: isize, y: isize| {
        let (x, y) = (x + centre, y + centre);
        let side = 0..own as isize;
        if side.contains(&x) && side.contains(&y) {
            function[y as usize * own + x as usize]
        } else {
            0.0
        }
    };
    let reach = reach as isize;
    let mut taps = Vec::with_capacity(own * own);
    for down in -reach..=reach {
        for right in -reach..=reach {
            let from_square = |&(column, row): &(usize, usize)| {
                let (x, y) = (2 * right + column as isize, 2 * down + row as isize);
                tap(x, y) + tap(x - 1, y) + tap(x, y - 1) + tap(x - 1, y - 1)
            };
            taps.push(places.iter().map(from_square).sum::<f32>() / places.len() as f32);
        }
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::{Beyond, Halo};
    use crate::frame::{Mosaic, Plane};

    /// K of squares of pixels, averaged over places, is the binned K of the squares.
    #[test]
    fn the_binned_lens_is_the_mean_of_the_lens_over_places() {
        let taps: Vec<f32> = (0..49).map(|t| ((t * 37) % 11) as f32 / 245.0).collect();
        let functions = LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 7,
            taps: [(); 3].map(|()| taps.clone()),
        };
        let halo = |_| vec![Halo { radius_px: 24.0, share: 0.1 }];
        let model = LensModel::new(Size::new(88, 72), 4, &functions).unwrap();
        let model = model.with_broad_light(&Channel::ALL.map(halo), Beyond::Dark).unwrap();
        let all = vec![(0, 0), (1, 0), (0, 1), (1, 1)];
        let own = |c: Channel| {
            let all = all.clone().into_iter();
            all.filter(|&(x, y)| Mosaic::Gbrg.colour_at(x, y) == c).collect()
        };
        for places in [[(); 3].map(|()| all.clone()), Channel::ALL.map(own)] {
            let binned = model.binned(4, &places).unwrap();
            let scene = Plane::from_fn(binned.canvas(), |x, y| ((x * 31 + y * 17) % 101) as f32);
            let squares = Plane::from_fn(model.canvas(), |x, y| scene.at(x / 2, y / 2));
            for c in Channel::ALL {
                let (mut seen, mut fine) = (Plane::zeros(scene.size()), squares.clone());
                binned.forward(c, &scene, &mut seen);
                model.forward(c, &squares, &mut fine);
                let places = &places[c.index()];
                let mean = Plane::from_fn(scene.size(), |x, y| {
                    let at = places.iter().map(|(u, v)| fine.at(2 * x + u, 2 * y + v));
                    at.sum::<f32>() / places.len() as f32
                });
                seen.add_scaled(-1.0, &mean);
                assert!(seen.rms() < 0.05, "{c:?} {places:?}: {}", seen.rms());
            }
        }
        let odd = LensModel::new(Size::new(87, 72), 4, &functions).unwrap();
        assert!(odd.binned(4, &[(); 3].map(|()| all.clone())).is_err(), "an odd width");
    }
}
