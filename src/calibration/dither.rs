//! Error diffusion of fractional codes, so that the lens, whose blur covers several panel pixels,
//! sees the intended light without steps.

/// Error diffusion by Floyd and Steinberg (Proc. SID 17, 1976), row by row. Errors are in codes:
/// neighbouring pixels have nearly the same slope of the response curve, so light is preserved too.
#[derive(Debug, Clone)]
pub struct Diffusion {
    /// Error from the row above, with one element more at each end.
    from_above: Vec<f32>,
    below: Vec<f32>,
}

impl Diffusion {
    /// Starts with rows of `width` pixels and no error.
    pub fn new(width: usize) -> Diffusion {
        Diffusion { from_above: vec![0.0; width + 2], below: vec![0.0; width + 2] }
    }

    /// Rounds the next row of fractional codes `wanted`, clamped to 0..=255, into `codes`.
    pub fn row(&mut self, wanted: &[f32], codes: &mut [u8]) {
        self.below.fill(0.0);
        let mut ahead = 0.0f32;
        for (x, (&wanted, code)) in wanted.iter().zip(codes).enumerate() {
            let with_error = wanted + ahead + self.from_above[x + 1];
            let whole = (with_error + 0.5).clamp(0.0, 255.5) as i32;
            *code = whole as u8;
            let error = with_error - whole as f32;
            ahead = error * (7.0 / 16.0);
            self.below[x] += error * (3.0 / 16.0);
            self.below[x + 1] += error * (5.0 / 16.0);
            self.below[x + 2] += error * (1.0 / 16.0);
        }
        std::mem::swap(&mut self.from_above, &mut self.below);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_pixels_keep_the_mean() {
        let (width, height) = (64, 64);
        let mut diffusion = Diffusion::new(width);
        let mut codes = vec![vec![0u8; width]; height];
        for row in &mut codes {
            diffusion.row(&vec![100.3; width], row);
        }
        assert!(codes.iter().flatten().all(|&c| c == 100 || c == 101));
        for block in 0..4 {
            let part = |r: &Vec<u8>| {
                r[16 * block..16 * block + 16].iter().map(|&c| f64::from(c)).sum::<f64>()
            };
            let mean = codes[16..48].iter().map(part).sum::<f64>() / 512.0;
            assert!((mean - 100.3).abs() < 0.03, "{mean}");
        }
    }

    #[test]
    fn whole_codes_are_unchanged_including_the_ends() {
        let mut diffusion = Diffusion::new(4);
        let mut codes = [9u8; 4];
        diffusion.row(&[0.0, 255.0, 17.0, 128.0], &mut codes);
        assert_eq!(codes, [0, 255, 17, 128]);
    }
}
