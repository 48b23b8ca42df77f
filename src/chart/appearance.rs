//! Pictures as people see them: luminance of display values, colour differences at edges.

use crate::frame::{Channel, Frame, Plane, Work};
use crate::picture::{Lab, Tone};

/// Luminance of display values, 0..255: the sum of the codes with the weights of Rec. 709.
pub fn display_luminance(tone: &Tone, light: &Frame<Work>) -> Plane {
    let mut sum = Plane::zeros(light.size());
    for (c, weight) in Channel::ALL.into_iter().zip([0.2126, 0.7152, 0.0722]) {
        sum.add_scaled(weight, &tone.display(c, light.plane(c)));
    }
    sum
}

/// CIELAB colours of display values, row by row.
pub fn lab_colours(tone: &Tone, light: &Frame<Work>) -> Vec<Lab> {
    let codes = Channel::ALL.map(|c| tone.display(c, light.plane(c)));
    let [r, g, b] = codes.each_ref().map(|plane| plane.data());
    r.iter().zip(g).zip(b).map(|((&r, &g), &b)| Lab::of_srgb([r, g, b])).collect()
}

/// Mean ΔE (CIEDE2000) between `picture` and `scene` at the scene's [`edges`].
pub fn edge_difference(tone: &Tone, picture: &Frame<Work>, scene: &Frame<Work>) -> f64 {
    let pairs = lab_colours(tone, picture).into_iter().zip(lab_colours(tone, scene));
    let edges = edges(&display_luminance(tone, scene));
    let at_edges = pairs.zip(&edges).filter(|(_, is_edge)| **is_edge);
    let differences: Vec<f64> = at_edges.map(|((a, b), _)| a.difference(b)).collect();
    differences.iter().sum::<f64>() / differences.len().max(1) as f64
}

/// Marks the tenth of the pixels with the steepest central differences of `luminance`.
pub fn edges(luminance: &Plane) -> Vec<bool> {
    let size = luminance.size();
    let slope = |x: usize, y: usize| {
        let (right, below) = ((x + 1).min(size.width - 1), (y + 1).min(size.height - 1));
        let across = luminance.at(right, y) - luminance.at(x.saturating_sub(1), y);
        across.hypot(luminance.at(x, below) - luminance.at(x, y.saturating_sub(1)))
    };
    let slopes: Vec<f32> = Plane::from_fn(size, slope).into_vec();
    let mut sorted = slopes.clone();
    sorted.sort_by(f32::total_cmp);
    let steep = sorted[sorted.len() * 9 / 10];
    slopes.into_iter().map(|slope| slope >= steep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Curve;
    use crate::frame::Size;

    #[test]
    fn a_coloured_rim_shows_at_edges() {
        let tone = Tone::of_curve(Curve::Srgb, 8);
        let stripes = |shift: usize| {
            let light = |x: usize| if ((x + shift) / 10).is_multiple_of(2) { 20.0 } else { 180.0 };
            Plane::from_fn(Size::new(40, 30), |x, _| light(x))
        };
        let scene: Frame<Work> = Frame::from_fn(|_| stripes(0));
        let rimmed = Frame::from_fn(|c| stripes(usize::from(c == Channel::Red)));
        assert_eq!(edge_difference(&tone, &scene, &scene), 0.0);
        assert!(edge_difference(&tone, &rimmed, &scene) > 10.0);
    }
}
