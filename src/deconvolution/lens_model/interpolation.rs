//! Linear interpolation between functions along one axis of the canvas.

/// Indices and weights of the two functions at each pixel along one axis.
#[derive(Debug, Clone)]
pub(super) struct Interpolation {
    /// Lower function of each pixel.
    pub(super) lower: Vec<usize>,
    /// Upper function of each pixel; equal to `lower` from the last centre on.
    pub(super) upper: Vec<usize>,
    /// Weight of the upper function, 0..=1.
    pub(super) weight: Vec<f32>,
}

impl Interpolation {
    /// Interpolation over `photo_px` pixels and `margin_px` more on either side, between
    /// `functions` functions.
    pub(super) fn new(photo_px: usize, margin_px: usize, functions: usize) -> Self {
        let canvas_px = photo_px + 2 * margin_px;
        let spacing = photo_px as f64 / functions as f64;
        let last = functions - 1;
        let mut made = Interpolation {
            lower: Vec::with_capacity(canvas_px),
            upper: Vec::with_capacity(canvas_px),
            weight: Vec::with_capacity(canvas_px),
        };
        for pixel in 0..canvas_px {
            // Position in units of functions: 0 at the first centre, `last` at the last one.
            let place =
                ((pixel as f64 - margin_px as f64 + 0.5) / spacing - 0.5).clamp(0.0, last as f64);
            let lower = place.floor() as usize;
            made.lower.push(lower);
            made.upper.push((lower + 1).min(last));
            made.weight.push((place - lower as f64) as f32);
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_are_evenly_spread_and_the_outermost_functions_extend_to_the_edge() {
        let along = Interpolation::new(8, 2, 2); // centres at 1.5 and 5.5 of the photo
        assert_eq!(along.weight[0], 0.0);
        assert_eq!(along.weight[3], 0.0);
        assert_eq!(along.weight[4], 0.125);
        assert_eq!(along.weight[7], 0.875);
        assert_eq!((along.lower[11], along.upper[11], along.weight[11]), (1, 1, 0.0));
    }

    #[test]
    fn a_single_function_is_constant() {
        let along = Interpolation::new(5, 0, 1);
        assert!(along.lower.iter().chain(&along.upper).all(|&n| n == 0));
        assert!(along.weight.iter().all(|&w| w == 0.0));
    }
}
