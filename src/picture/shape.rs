//! Whether a photo has the rig's shape, and bringing one of another size onto the rig's grid.

use crate::frame::{Plane, Size};

/// Whether two sizes have one shape, up to the rounding of a side to whole pixels.
pub(super) fn same_shape(found: Size, allowed: Size) -> bool {
    let (fw, fh) = (found.width as i128, found.height as i128);
    let (aw, ah) = (allowed.width as i128, allowed.height as i128);
    // The height of `allowed`'s shape at `found`'s width is fw·ah/aw; half a pixel off is rounding.
    2 * (fw * ah - fh * aw).abs() <= aw.max(ah)
}

/// `plane` at another size, in linear light.
pub(super) fn resample(plane: &Plane, size: Size) -> Plane {
    let rows = along_rows(plane, size.width);
    transpose(&along_rows(&transpose(&rows), size.height))
}

/// Catmull–Rom along each row, widened by the scale when shrinking so that nothing aliases.
fn along_rows(plane: &Plane, width: usize) -> Plane {
    let scale = plane.width() as f64 / width as f64;
    let reach = scale.max(1.0);
    let taps: Vec<(usize, Vec<f32>)> = (0..width)
        .map(|x| {
            let centre = (x as f64 + 0.5) * scale - 0.5;
            let from = (centre - 2.0 * reach).ceil().max(0.0) as usize;
            let to = ((centre + 2.0 * reach).floor() as usize).min(plane.width() - 1);
            let weights: Vec<f64> = (from..=to).map(|i| catmull_rom((i as f64 - centre) / reach)).collect();
            let sum: f64 = weights.iter().sum();
            (from, weights.iter().map(|w| (w / sum) as f32).collect())
        })
        .collect();
    Plane::from_fn(Size::new(width, plane.height()), |x, y| {
        let (from, weights) = &taps[x];
        plane.row(y)[*from..].iter().zip(weights).map(|(v, w)| v * w).sum()
    })
}

/// Keys' cubic with a = −½ (IEEE Trans. ASSP 29, 1981, eq. 4).
fn catmull_rom(t: f64) -> f64 {
    let t = t.abs();
    match t {
        _ if t < 1.0 => (1.5 * t - 2.5) * t * t + 1.0,
        _ if t < 2.0 => ((-0.5 * t + 2.5) * t - 4.0) * t + 2.0,
        _ => 0.0,
    }
}

fn transpose(plane: &Plane) -> Plane {
    Plane::from_fn(Size::new(plane.height(), plane.width()), |x, y| plane.at(y, x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shape_allows_rounding_and_nothing_more() {
        let rig = Size::new(1024, 768);
        for same in [Size::new(1024, 768), Size::new(4000, 3000), Size::new(641, 481), Size::new(333, 250)] {
            assert!(same_shape(same, rig), "{same}");
        }
        for other in
            [Size::new(768, 1024), Size::new(1024, 766), Size::new(4000, 2250), Size::new(1024, 1024)]
        {
            assert!(!same_shape(other, rig), "{other}");
        }
    }

    #[test]
    fn a_ramp_stays_a_ramp_at_any_size() {
        let ramp = Plane::from_fn(Size::new(80, 60), |x, y| x as f32 + 2.0 * y as f32);
        for size in [Size::new(40, 30), Size::new(160, 120), Size::new(53, 40)] {
            let out = resample(&ramp, size);
            let (sx, sy) = (80.0 / size.width as f32, 60.0 / size.height as f32);
            for (x, y) in [(size.width / 2, size.height / 2), (size.width / 3, size.height / 3)] {
                let want = ((x as f32 + 0.5) * sx - 0.5) + 2.0 * ((y as f32 + 0.5) * sy - 0.5);
                assert!((out.at(x, y) - want).abs() < 1e-3 * want, "{size}: {} for {want}", out.at(x, y));
            }
        }
    }

    #[test]
    fn shrinking_does_not_alias() {
        let stripes = Plane::from_fn(Size::new(96, 12), |x, _| if x % 2 == 0 { 0.0 } else { 200.0 });
        let small = resample(&stripes, Size::new(32, 4));
        assert!(small.row(2)[4..28].iter().all(|v| (v - 100.0).abs() < 4.0), "{:?}", small.row(2));
    }
}
