//! How much a picture's colours alternate from pixel to pixel, beside how much its lightness does.
//!
//! Of a photo whose colours the lens blurred otherwise than it was measured, as out of focus, a
//! result can meet each channel's data with details that the others do not have: stripes and dots
//! of blue and yellow. Photo and model agree, and lightness hardly shows it. But things that are as
//! fine as pixels differ in lightness more than in colour, and where they do not, nor did the
//! photo.

use rayon::prelude::*;

use crate::frame::{Channel, Channels, Frame, Work};
use crate::picture::Lab;

/// One row of so many is looked at, with those above and below.
const EVERY: usize = 6;
/// Colour that alternates by more is seen, in units of CIE L\*a\*b\*, and is wrong where it is
/// more than
const SEEN: f64 = 1.5;
/// so many times what lightness does. On the laboratory's group of limits healthy results have at
/// most 2.4 times, harmful ones past both limits 3.0 to 6.5 (`tests/tables/judging.md`).
const TIMES_LIGHTNESS: f64 = 2.7;
/// It is the method's where the reference solution has less than this share of it. Guess.
const SHARE_OF_REFERENCE: f64 = 0.5;

/// How far pixels are from the mean of the 3×3 around them in CIE L\*a\*b\*, means over a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FineColour {
    /// In a\* and b\*.
    colour: f64,
    /// In L\*.
    lightness: f64,
}

impl FineColour {
    /// Whether colours alternate where lightness does not.
    pub(super) fn is_dotted(self) -> bool {
        self.colour > SEEN && self.colour > TIMES_LIGHTNESS * self.lightness
    }

    /// Whether they do, and not in the `reference` solution.
    pub(super) fn harms(self, reference: FineColour) -> bool {
        self.is_dotted() && reference.colour < SHARE_OF_REFERENCE * self.colour
    }

    /// Of `picture`; nothing of a grey one.
    pub(super) fn of(picture: &Frame<Work>, channels: Channels) -> FineColour {
        let size = picture.size();
        if channels != Channels::Colour || size.width < 3 || size.height < 3 {
            return FineColour::default();
        }
        let rows: Vec<usize> = (1..size.height - 1).step_by(EVERY).collect();
        let of_row = |&y: &usize| {
            let lab = |y: usize| -> Vec<Lab> {
                let light = |x| Channel::ALL.map(|c| picture.plane(c).at(x, y));
                (0..size.width).map(|x| Lab::of_light(light(x))).collect()
            };
            let near = [y - 1, y, y + 1].map(lab);
            let sums = (1..size.width - 1).map(|x| {
                let around = || near.iter().flat_map(|row| &row[x - 1..=x + 1]);
                let off =
                    |of: fn(&Lab) -> f64| of(&near[1][x]) - around().map(of).sum::<f64>() / 9.0;
                [off(|lab| lab.a).hypot(off(|lab| lab.b)), off(|lab| lab.lightness).abs()]
            });
            sums.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d])
        };
        let sums: Vec<[f64; 2]> = rows.par_iter().map(of_row).collect();
        let count = (rows.len() * (size.width - 2)) as f64;
        let mean = |n: usize| sums.iter().map(|sum| sum[n]).sum::<f64>() / count;
        FineColour { colour: mean(0), lightness: mean(1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Plane, Size};

    /// Steps of brightness, and dots of blue of so many grey levels.
    fn dotted(brightness: f32, blue: f32) -> Frame<Work> {
        Frame::from_fn(|c| {
            let dots = if c == Channel::Blue { blue } else { 0.0 };
            Plane::from_fn(Size::new(60, 40), |x, y| {
                let step = if x % 4 < 2 { 0.0 } else { brightness };
                100.0 + step + if (x + y) % 2 == 0 { dots } else { -dots }
            })
        })
    }

    #[test]
    fn dots_of_colour_where_lightness_is_calm_are_wrong_unless_the_reference_has_them() {
        let of = |brightness, blue| FineColour::of(&dotted(brightness, blue), Channels::Colour);
        let reference = of(10.0, 1.0);
        assert!(of(10.0, 40.0).harms(reference), "{:?}", of(10.0, 40.0));
        assert!(!of(10.0, 40.0).harms(of(10.0, 30.0)), "the scene's");
        assert!(!of(10.0, 2.0).is_dotted(), "not seen: {:?}", of(10.0, 2.0));
        assert!(!of(120.0, 40.0).is_dotted(), "beside fine lightness: {:?}", of(120.0, 40.0));
        let grey = FineColour::of(&dotted(10.0, 40.0), Channels::Green);
        assert_eq!(grey, FineColour::default());
    }
}
