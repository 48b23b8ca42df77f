//! Alternation of a picture's colours from pixel to pixel, beside that of its lightness.
//!
//! If the lens blurred a photo's channels differently than measured, for example out of focus, a
//! result can fit each channel with details that the others do not have: stripes and dots of blue
//! and yellow, which residuals and lightness hardly show. Real details as fine as pixels differ in
//! lightness more than in colour.

use rayon::prelude::*;

use super::distance::SAMPLED_EVERY;
use super::limits::FINE_COLOUR_SEEN;
use crate::frame::{Channel, Channels, Frame, Work};
use crate::picture::Lab;

/// Mean distance of pixels from the mean of the 3×3 around them, in CIE L\*a\*b\*.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FineColour {
    /// Distance in a\* and b\*.
    pub colour: f64,
    /// Distance in L\*.
    pub lightness: f64,
}

impl FineColour {
    /// Fine colour over fine lightness; 0 if the colour is not seen.
    pub(super) fn over_lightness(&self) -> f64 {
        if self.colour > FINE_COLOUR_SEEN { self.colour / self.lightness } else { 0.0 }
    }

    /// Fine colour of `picture`; zero for a grey one.
    pub(super) fn of(picture: &Frame<Work>, channels: Channels) -> FineColour {
        let size = picture.size();
        if channels != Channels::Colour || size.width < 3 || size.height < 3 {
            return FineColour::default();
        }
        let rows: Vec<usize> = (1..size.height - 1).step_by(SAMPLED_EVERY).collect();
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

    /// Steps of `brightness` with dots of `blue`, both in grey levels.
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
    fn dots_of_colour_outweigh_lightness_unless_that_is_as_fine() {
        let ratio = |brightness, blue| {
            FineColour::of(&dotted(brightness, blue), Channels::Colour).over_lightness()
        };
        assert!(ratio(10.0, 40.0) > 2.7 && ratio(120.0, 40.0) < 2.7);
        let grey = FineColour::of(&dotted(10.0, 40.0), Channels::Green);
        assert_eq!(grey, FineColour::default());
    }
}
