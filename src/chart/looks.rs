//! A picture as people see it, and how far it is from the scene's: brightness, colour, edges.

use crate::deconvolution::quality::ssim;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::picture::{Lab, Tone};

/// A picture as it is scored.
#[derive(Debug, Clone)]
pub struct Looks {
    codes: [Plane; 3],
    colours: Vec<Lab>,
    luminance: Plane,
}

/// How a picture looks beside its scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LooksScores {
    /// SSIM of luminance.
    pub ssim: f64,
    /// PSNR of the codes of all channels, dB.
    pub rgb_db: f64,
    /// Mean C*ab of the picture.
    pub chroma: f64,
    /// 99th percentile of C*ab of the picture.
    pub chroma_99th: f64,
    /// Mean ΔE (CIEDE2000).
    pub difference: f64,
    /// Mean ΔE of the tenth of the pixels where the scene's luminance changes most.
    pub edge_difference: f64,
}

impl Looks {
    /// Of linear light, by the curve of `tone`.
    pub fn of(tone: &Tone, light: &Frame<Work>) -> Looks {
        let codes = Channel::ALL.map(|c| tone.display(c, light.plane(c)));
        let [r, g, b] = codes.each_ref().map(|plane| plane.data());
        let pixels = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| Lab::of_srgb([r, g, b]));
        Looks { colours: pixels.collect(), luminance: display_luminance(tone, light), codes }
    }

    /// Its size.
    pub fn size(&self) -> Size {
        self.luminance.size()
    }

    /// Its codes, red, green and blue of one pixel after the other.
    pub fn bytes(&self) -> Vec<u8> {
        let [r, g, b] = self.codes.each_ref().map(|plane| plane.data());
        let pixels = r.iter().zip(g).zip(b);
        pixels.flat_map(|((&r, &g), &b)| [r, g, b].map(|v| v.round() as u8)).collect()
    }

    /// Beside those of the scene.
    ///
    /// # Panics
    /// When the two differ in size, which is a bug of the caller.
    pub fn scores(&self, scene: &Looks) -> LooksScores {
        let squares = |(a, b): (&Plane, &Plane)| -> f64 {
            a.data().iter().zip(b.data()).map(|(a, b)| f64::from(a - b).powi(2)).sum()
        };
        let total: f64 = self.codes.iter().zip(&scene.codes).map(squares).sum();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let mut chroma: Vec<f64> = self.colours.iter().map(|colour| colour.chroma()).collect();
        chroma.sort_by(f64::total_cmp);
        let pairs = self.colours.iter().zip(&scene.colours);
        let differences: Vec<f64> = pairs.map(|(a, b)| a.difference(*b)).collect();
        let changes = changes(&scene.luminance);
        let mut sorted = changes.clone();
        sorted.sort_by(f32::total_cmp);
        let steep = sorted[sorted.len() * 9 / 10];
        let at_edges = differences.iter().zip(&changes).filter(|(_, change)| **change >= steep);
        let at_edges: Vec<f64> = at_edges.map(|(difference, _)| *difference).collect();
        let power = total / (3 * self.colours.len()) as f64;
        LooksScores {
            ssim: ssim(&self.luminance, &scene.luminance),
            rgb_db: 10.0 * (f64::from(FULL_SCALE).powi(2) / power).log10(),
            chroma: mean(&chroma),
            chroma_99th: chroma[chroma.len() * 99 / 100],
            difference: mean(&differences),
            edge_difference: mean(&at_edges),
        }
    }
}

/// Length of the central differences of each pixel.
fn changes(plane: &Plane) -> Vec<f32> {
    let size = plane.size();
    let of = |x: usize, y: usize| {
        let (right, below) = ((x + 1).min(size.width - 1), (y + 1).min(size.height - 1));
        let across = plane.at(right, y) - plane.at(x.saturating_sub(1), y);
        across.hypot(plane.at(x, below) - plane.at(x, y.saturating_sub(1)))
    };
    Plane::from_fn(size, of).into_vec()
}

/// Luminance of display values 0..255: the codes' sum by the weights of Rec. 709, as screens show
/// it.
pub fn display_luminance(tone: &Tone, light: &Frame<Work>) -> Plane {
    let mut sum = Plane::zeros(light.size());
    for (c, weight) in Channel::ALL.into_iter().zip([0.2126, 0.7152, 0.0722]) {
        sum.add_scaled(weight, &tone.display(c, light.plane(c)));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Curve;

    #[test]
    fn a_coloured_rim_is_seen_at_the_edge_and_nothing_is_seen_of_the_scene_itself() {
        let tone = Tone::of_curve(Curve::Srgb, 8);
        let stripes = |shift: usize| {
            let light = |x: usize| if ((x + shift) / 10).is_multiple_of(2) { 20.0 } else { 180.0 };
            Plane::from_fn(Size::new(40, 30), |x, _| light(x))
        };
        let scene: Frame<Work> = Frame::from_fn(|_| stripes(0));
        let rimmed = Frame::from_fn(|c| stripes(usize::from(c == Channel::Red)));
        let scene = Looks::of(&tone, &scene);
        let same = scene.scores(&scene);
        assert_eq!((same.difference, same.edge_difference, same.ssim), (0.0, 0.0, 1.0));
        let found = Looks::of(&tone, &rimmed).scores(&scene);
        assert!(found.edge_difference > 3.0 * found.difference && found.chroma_99th > 30.0);
    }
}
