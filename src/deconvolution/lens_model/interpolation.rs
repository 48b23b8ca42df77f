//! Linear interpolation between functions along one axis of the canvas.

/// Indices and weights of the two functions at each pixel along one axis.
#[derive(Debug, Clone)]
pub(super) struct Interpolation {
    /// Lower and upper function of each pixel, the same beyond the outermost centres.
    pub(super) functions: Vec<[usize; 2]>,
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
            functions: Vec::with_capacity(canvas_px),
            weight: Vec::with_capacity(canvas_px),
        };
        for pixel in 0..canvas_px {
            // Position in units of functions: 0 at the first centre, `last` at the last one.
            let place =
                ((pixel as f64 - margin_px as f64 + 0.5) / spacing - 0.5).clamp(0.0, last as f64);
            let lower = place.floor() as usize;
            let upper = if place > 0.0 { (lower + 1).min(last) } else { lower };
            made.functions.push([lower, upper]);
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
        assert_eq!((along.functions[0], along.functions[11]), ([0, 0], [1, 1]));
        assert_eq!(along.weight[11], 0.0);
    }

    #[test]
    fn a_single_function_is_constant() {
        let along = Interpolation::new(5, 0, 1);
        assert!(along.functions.iter().all(|&functions| functions == [0, 0]));
        assert!(along.weight.iter().all(|&w| w == 0.0));
    }
}
