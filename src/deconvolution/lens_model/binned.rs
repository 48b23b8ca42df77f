//! A lens model on pixels binned by two.

use super::{LensFunctions, LensModel, LensModelError};
use crate::frame::{Channel, Size, SquarePlace};

impl LensModel {
    /// The lens model on pixels binned by two. It maps a binned scene, which stands for its bicubic
    /// enlargement, to data that are weighted means of the light at each channel's `places` in a
    /// square.
    ///
    /// # Errors
    /// When a side of the canvas is odd.
    pub fn binned(&self, places: &[Vec<SquarePlace>; 3]) -> Result<LensModel, LensModelError> {
        let Size { width, height } = self.canvas;
        if !width.is_multiple_of(2) || !height.is_multiple_of(2) {
            return Err(LensModelError(format!(
                "has a canvas of {}; binning by two needs even sides",
                self.canvas
            )));
        }
        let margin = self.field.x.div_ceil(2);
        let photo = Size::new(width / 2 - 2 * margin, height / 2 - 2 * margin);
        let mut model = LensModel::new(photo, margin, &self.functions.binned(places))?;
        for (binned, own) in model.broad.iter_mut().zip(&self.broad) {
            *binned = own.as_ref().and_then(|broad| broad.binned(model.canvas));
        }
        Ok(model)
    }
}

impl LensFunctions {
    fn binned(&self, places: &[Vec<SquarePlace>; 3]) -> LensFunctions {
        let own = self.support_px;
        // Sum of three reaches: of the function, the enlarging kernel and an interpolated pixel's
        // sites.
        let reach = (own / 2 + 5) / 2;
        let taps = Channel::ALL.map(|c| {
            let functions = self.taps[c.index()].chunks_exact(own * own);
            let places = &places[c.index()];
            functions.flat_map(|function| binned_function(function, own, reach, places)).collect()
        });
        LensFunctions { support_px: 2 * reach + 1, taps, ..*self }
    }
}

/// Keys' cubic kernel that spreads a square at columns 0 and 1 over columns −3 to 4
/// ([`resize`](crate::frame::resample::resize)).
const ENLARGED: [f32; 8] = [
    -0.023_437_5,
    -0.070_312_5,
    0.226_562_5,
    0.867_187_5,
    0.867_187_5,
    0.226_562_5,
    -0.070_312_5,
    -0.023_437_5,
];

/// Taps of `function` (support `own` pixels wide) between binned pixels: from squares up to `reach`
/// squares away to the `places` of a square.
fn binned_function(function: &[f32], own: usize, reach: usize, places: &[SquarePlace]) -> Vec<f32> {
    // The light of one enlarged square through the lens.
    let wide = own + ENLARGED.len() - 1;
    let (mut along_x, mut seen) = (vec![0.0; own * wide], vec![0.0; wide * wide]);
    for (row, from) in along_x.chunks_exact_mut(wide).zip(function.chunks_exact(own)) {
        for (x, tap) in from.iter().enumerate() {
            row[x..].iter_mut().zip(ENLARGED).for_each(|(sum, weight)| *sum += weight * tap);
        }
    }
    for (y, from) in along_x.chunks_exact(wide).enumerate() {
        for (n, weight) in ENLARGED.into_iter().enumerate() {
            let row = seen[(y + n) * wide..].iter_mut().zip(from);
            row.for_each(|(sum, tap)| *sum += weight * tap);
        }
    }
    // Offset of the square's first pixel in `seen`.
    let (before, reach) = ((own / 2 + 3) as isize, reach as isize);
    let at = |x: isize, y: isize| {
        let (x, y) = (x + before, y + before);
        let is_inside = (0..wide as isize).contains(&x) && (0..wide as isize).contains(&y);
        if is_inside { seen[y as usize * wide + x as usize] } else { 0.0 }
    };
    let mut taps = Vec::new();
    for down in -reach..=reach {
        for right in -reach..=reach {
            let light = |p: &SquarePlace| p.share * at(2 * right + p.x, 2 * down + p.y);
            taps.push(places.iter().map(light).sum());
        }
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::{Beyond, Halo};
    use crate::frame::resample::resize;
    use crate::frame::{Mosaic, Plane};

    #[test]
    fn the_binned_lens_sees_an_enlarged_scene_at_the_places_of_squares() {
        let taps: Vec<f32> = (0..49).map(|t| ((t * 37) % 11) as f32 / 245.0).collect();
        let taps = [(); 3].map(|()| taps.clone());
        let functions = LensFunctions { rows: 1, columns: 1, support_px: 7, taps };
        let halo = |_| vec![Halo { radius_px: 24.0, share: 0.1 }];
        let model = LensModel::new(Size::new(88, 72), 4, &functions).unwrap();
        let model = model.with_broad_light(&Channel::ALL.map(halo), Beyond::Dark).unwrap();
        let kinds = [
            Channel::each(|_| SquarePlace::pixels()),
            Channel::each(|c| SquarePlace::sites(Mosaic::Gbrg, c)),
            Channel::each(|c| SquarePlace::interpolated(Mosaic::Gbrg, c)),
        ];
        for places in kinds {
            let binned = model.binned(&places).unwrap();
            let scene = Plane::from_fn(binned.canvas(), |x, y| ((x * 31 + y * 17) % 101) as f32);
            let enlarged = resize(&scene, model.canvas());
            for c in Channel::ALL {
                let (mut seen, mut own) = (Plane::zeros(scene.size()), enlarged.clone());
                binned.forward(c, &scene, &mut seen);
                model.forward(c, &enlarged, &mut own);
                // Compares away from the border, whose pixels the enlargement repeats.
                for y in 5..scene.height() - 5 {
                    for x in 5..scene.width() - 5 {
                        let at = |p: &SquarePlace| {
                            let [x, y] = [2 * x as isize + p.x, 2 * y as isize + p.y];
                            p.share * own.at(x as usize, y as usize)
                        };
                        let expected: f32 = places[c.index()].iter().map(at).sum();
                        let off = (seen.at(x, y) - expected).abs();
                        assert!(off < 0.05, "{c:?} at {x}, {y}: {off}, {places:?}");
                    }
                }
            }
        }
        let odd = LensModel::new(Size::new(87, 72), 4, &functions).unwrap();
        assert!(odd.binned(&Channel::each(|_| SquarePlace::pixels())).is_err(), "an odd width");
    }
}
