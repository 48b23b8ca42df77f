//! Colour planes of a Bayer mosaic by bilinear interpolation.
//!
//! The interpolation is linear and uniform, so that the measured lens model includes it; one that
//! follows edges would depend on the picture.

use crate::frame::{Channel, Counts, Mosaic, Plane};

/// Fills the three planes of `counts` from the sites `raw`: a channel's own sites unchanged, others
/// with the rounded mean of its sites among the eight neighbours (fewer at the border).
pub fn interpolate(raw: &Plane<u16>, mosaic: Mosaic, counts: &mut Counts) {
    // A frame of one row or column lacks whole channels, which stay black.
    let mean = |near: &[u16]| {
        let (sum, sites) = (near.iter().map(|&v| u32::from(v)).sum::<u32>(), near.len() as u32);
        (sum + sites / 2).checked_div(sites).unwrap_or(0) as u16
    };
    for channel in Channel::ALL {
        let plane = counts.plane_mut(channel);
        (0..raw.height()).for_each(|y| mosaic.fill_row(channel, raw, y, plane.row_mut(y), mean));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    /// Reference without tables: mean of the channel's nearest sites within one pixel.
    fn plain(raw: &Plane<u16>, mosaic: Mosaic, channel: Channel, x: usize, y: usize) -> u16 {
        for distance in 0..3i32 {
            let (mut sum, mut sites) = (0u32, 0u32);
            for dy in -1..=1i32 {
                for dx in -1..=1i32 {
                    let (column, row) = (x as i32 + dx, y as i32 + dy);
                    let inside = (0..raw.width() as i32).contains(&column)
                        && (0..raw.height() as i32).contains(&row);
                    // A place outside the frame has the colour of the place two pixels further in.
                    let colour = mosaic.colour_at((column + 2) as usize, (row + 2) as usize);
                    if dx.abs() + dy.abs() == distance && colour == channel && inside {
                        sum += u32::from(raw.at(column as usize, row as usize));
                        sites += 1;
                    }
                }
            }
            if let Some(mean) = (sum + sites / 2).checked_div(sites) {
                return mean as u16;
            }
        }
        0
    }

    #[test]
    fn interpolation_is_the_mean_of_the_nearest_sites() {
        for size in [Size::new(9, 7), Size::new(8, 6), Size::new(2, 2)] {
            let raw =
                Plane::from_fn(size, |x, y| ((x * 977 + y * 3571 + x * y * 31) % 4096) as u16);
            for mosaic in Mosaic::ALL {
                let mut counts = Counts::zeros(size);
                interpolate(&raw, mosaic, &mut counts);
                for channel in Channel::ALL {
                    for y in 0..size.height {
                        for x in 0..size.width {
                            let want = plain(&raw, mosaic, channel, x, y);
                            assert_eq!(
                                counts.plane(channel).at(x, y),
                                want,
                                "{mosaic:?} {channel:?} at {x},{y} of {size}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_grey_field_stays_grey() {
        let raw = Plane::filled(Size::new(10, 8), 1023u16);
        for mosaic in Mosaic::ALL {
            let mut counts = Counts::zeros(raw.size());
            interpolate(&raw, mosaic, &mut counts);
            assert!(counts.planes().iter().all(|p| p.data().iter().all(|&v| v == 1023)));
        }
    }
}
