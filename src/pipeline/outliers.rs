//! Outliers: parts of a photo that no scene gives through the lens, such as a date stamp, a
//! reflection or a retouched place. They are delivered as they were, with a soft edge.

use crate::deconvolution::smoothing::mean_around;
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};

/// Pixels over which result and photo blend on each side of an edge.
const BLEND_PX: usize = 2;
/// Maximum number of areas shown separately; more are shown as one.
const AREAS_MOST: usize = 8;

/// The outliers of a photo.
#[derive(Debug, Clone)]
pub struct Outliers {
    /// Weight of the photo in the result, photo-sized, 0..1.
    pub weight: Plane,
}

impl Outliers {
    /// The outliers that are set in `mask`, photo-sized.
    pub(super) fn of(mask: &Plane<bool>) -> Outliers {
        Outliers { weight: mean_around(&mask.map(|is: bool| f32::from(u8::from(is))), BLEND_PX) }
    }

    /// Share of the photo's pixels that are delivered as they were.
    pub fn share(&self) -> f64 {
        self.weight.mean()
    }

    /// Sentence for the user.
    pub fn note(&self) -> String {
        format!(
            "{:.1} % of the photo cannot have come through this lens, such as a date stamp, a \
             reflection or a retouched place; these parts are unchanged",
            100.0 * self.share()
        )
    }

    /// Puts the outliers of `photo` into `picture`, both photo-sized.
    pub(super) fn put_back(&self, picture: &mut Frame<Work>, photo: &Frame<Work>) {
        for c in Channel::ALL {
            let pixels = picture.plane_mut(c).data_mut().iter_mut();
            let pixels = pixels.zip(photo.plane(c).data()).zip(self.weight.data());
            pixels.for_each(|((picture, photo), weight)| *picture += weight * (photo - *picture));
        }
    }
}

/// Bounding boxes, pixels, of the connected areas where `weight` (of any size, 0..1) is above one
/// half; a single box around all if there are more than eight.
pub fn areas(weight: &Plane) -> Vec<Rect> {
    let all = connected(&weight.map(|w: f32| w > 0.5));
    let boxes = all.iter().map(|places| {
        let at = places.iter().map(|&(x, y)| Rect { x, y, size: Size::new(1, 1) });
        at.reduce(around)
    });
    match all.len() > AREAS_MOST {
        true => boxes.flatten().reduce(around).into_iter().collect(),
        false => boxes.flatten().collect(),
    }
}

/// The connected areas that are set in `mask`, each as the coordinates of its pixels.
pub(super) fn connected(mask: &Plane<bool>) -> Vec<Vec<(usize, usize)>> {
    let Size { width, height } = mask.size();
    let mut open = mask.clone();
    let mut found = Vec::new();
    for start in (0..width * height).map(|i| (i % width, i / width)) {
        let (mut next, mut area) = (vec![start], Vec::new());
        while let Some((x, y)) = next.pop() {
            if open.at(x, y) {
                open.set(x, y, false);
                area.push((x, y));
                let right_below = [(x + 1, y), (x, y + 1)];
                let left_above = [(x.wrapping_sub(1), y), (x, y.wrapping_sub(1))];
                let beside = right_below.into_iter().chain(left_above);
                next.extend(beside.filter(|&(x, y)| x < width && y < height));
            }
        }
        if !area.is_empty() {
            found.push(area);
        }
    }
    found
}

/// The bounding box of two rectangles.
fn around(a: Rect, b: Rect) -> Rect {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let right = (a.x + a.size.width).max(b.x + b.size.width);
    let bottom = (a.y + a.size.height).max(b.y + b.size.height);
    Rect { x, y, size: Size::new(right - x, bottom - y) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_areas_are_shown_as_one() {
        let weight = |count: usize| {
            Plane::from_fn(Size::new(40, 9), |x, y| match x % 2 == 1 && x < 2 * count && y == 4 {
                true => 1.0,
                false => 0.0,
            })
        };
        assert_eq!(areas(&weight(AREAS_MOST)).len(), AREAS_MOST);
        let all = Rect { x: 1, y: 4, size: Size::new(2 * AREAS_MOST + 1, 1) };
        assert_eq!(areas(&weight(AREAS_MOST + 1)), [all]);
    }
}
