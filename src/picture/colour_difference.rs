//! Perceived colour: CIELAB of sRGB codes, and the colour difference CIEDE2000.

use super::tone;
use crate::config::Curve;

/// A colour of CIELAB under D65: lightness 0..100, then green to red and blue to yellow.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)] // The names describe them.
pub struct Lab {
    pub lightness: f64,
    pub a: f64,
    pub b: f64,
}

impl Lab {
    /// The colour of sRGB codes 0..255 (IEC 61966-2-1; CIE 15:2004 for L*a*b*).
    pub fn of_srgb(codes: [f32; 3]) -> Lab {
        Lab::of(codes.map(|code| tone::light(Curve::Srgb, f64::from(code) / 255.0)))
    }

    /// The colour of linear light 0..255 with sRGB's primaries; light outside the range is clipped.
    pub(crate) fn of_light(light: [f32; 3]) -> Lab {
        Lab::of(light.map(|light| f64::from(light.clamp(0.0, 255.0)) / 255.0))
    }

    /// The colour of red, green and blue light 0..1.
    fn of([r, g, b]: [f64; 3]) -> Lab {
        // Each row of the standard's matrix is divided by its sum, so that grey codes are grey.
        let over_white = |[x, y, z]: [f64; 3]| (x * r + y * g + z * b) / (x + y + z);
        let root = |t: f64| match t > (6.0f64 / 29.0).powi(3) {
            true => t.cbrt(),
            false => t * (29.0f64 / 6.0).powi(2) / 3.0 + 4.0 / 29.0,
        };
        let x = root(over_white([0.4124, 0.3576, 0.1805]));
        let y = root(over_white([0.2126, 0.7152, 0.0722]));
        let z = root(over_white([0.0193, 0.1192, 0.9505]));
        Lab { lightness: 116.0 * y - 16.0, a: 500.0 * (x - y), b: 200.0 * (y - z) }
    }

    /// C*ab, the distance from grey.
    pub fn chroma(self) -> f64 {
        self.a.hypot(self.b)
    }

    /// ΔE00; 1 is about just noticeable (Sharma, Wu & Dalal 2005, "The CIEDE2000
    /// color-difference formula", with all weights 1).
    pub fn difference(self, other: Lab) -> f64 {
        let to_seventh = |c: f64| (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt();
        let grey = 0.5 * (1.0 - to_seventh(0.5 * (self.chroma() + other.chroma())));
        let polar = |colour: Lab| {
            let a = (1.0 + grey) * colour.a;
            (a.hypot(colour.b), colour.b.atan2(a).to_degrees().rem_euclid(360.0))
        };
        let ((c1, h1), (c2, h2)) = (polar(self), polar(other));
        let coloured = c1 * c2 != 0.0;
        let turn = if coloured { (h2 - h1 + 180.0).rem_euclid(360.0) - 180.0 } else { 0.0 };
        let hue = if coloured { h1 + 0.5 * turn } else { h1 + h2 };
        let (lightness, chroma) = (0.5 * (self.lightness + other.lightness), 0.5 * (c1 + c2));
        let cosine = |times: f64, from: f64| (times * hue - from).to_radians().cos();
        let t = 1.0 - 0.17 * cosine(1.0, 30.0) + 0.24 * cosine(2.0, 0.0) + 0.32 * cosine(3.0, -6.0)
            - 0.20 * cosine(4.0, 63.0);
        let from_middle = (lightness - 50.0).powi(2);
        let by_lightness = (other.lightness - self.lightness)
            / (1.0 + 0.015 * from_middle / (20.0 + from_middle).sqrt());
        let by_chroma = (c2 - c1) / (1.0 + 0.045 * chroma);
        let by_hue =
            2.0 * (c1 * c2).sqrt() * (0.5 * turn).to_radians().sin() / (1.0 + 0.015 * chroma * t);
        let blue = ((hue.rem_euclid(360.0) - 275.0) / 25.0).powi(2);
        let turned = -(60.0 * (-blue).exp()).to_radians().sin() * 2.0 * to_seventh(chroma);
        let squares = by_lightness.powi(2) + by_chroma.powi(2) + by_hue.powi(2);
        (squares + turned * by_chroma * by_hue).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs and differences of Sharma et al.'s table 1.
    const PAIRS: [([f64; 3], [f64; 3], f64); 22] = [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
        ([50.0, 2.8361, -74.0200], [50.0, 0.0, -82.7485], 3.4412),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, 2.49, -0.0010], [50.0, -2.49, 0.0009], 7.1792),
        ([50.0, 2.49, -0.0010], [50.0, -2.49, 0.0011], 7.2195),
        ([50.0, -0.0010, 2.49], [50.0, 0.0009, -2.49], 4.8045),
        ([50.0, -0.0010, 2.49], [50.0, 0.0011, -2.49], 4.7461),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
        ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
        ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
        ([63.0109, -31.0961, -5.8663], [62.8187, -29.7946, -4.0864], 1.2630),
        ([61.2901, 3.7196, -5.3901], [61.4292, 2.2480, -4.9620], 1.8731),
        ([35.0831, -44.1164, 3.7933], [35.0232, -40.0716, 1.5901], 1.8645),
        ([22.7233, 20.0904, -46.6940], [23.0331, 14.9730, -42.5619], 2.0373),
        ([36.4612, 47.8580, 18.3852], [36.2715, 50.5065, 21.2231], 1.4146),
        ([90.8027, -2.0831, 1.4410], [91.1528, -1.6435, 0.0447], 1.4441),
        ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
    ];

    #[test]
    fn differences_are_as_published() {
        let lab = |[lightness, a, b]: [f64; 3]| Lab { lightness, a, b };
        for (one, other, want) in PAIRS {
            for found in [lab(one).difference(lab(other)), lab(other).difference(lab(one))] {
                assert!((found - want).abs() < 1e-4, "{one:?} {other:?}: {found}, {want}");
            }
        }
    }

    #[test]
    fn grey_and_srgb_s_red_have_their_known_colours() {
        for code in [0.0, 7.0, 128.0, 255.0] {
            assert!(Lab::of_srgb([code; 3]).chroma() < 1e-6, "{code}");
        }
        assert!((Lab::of_srgb([255.0; 3]).lightness - 100.0).abs() < 1e-9);
        let red = Lab::of_srgb([255.0, 0.0, 0.0]);
        let near = |found: f64, want: f64| (found - want).abs() < 0.05;
        assert!(near(red.lightness, 53.24) && near(red.a, 80.09) && near(red.b, 67.20), "{red:?}");
    }
}
