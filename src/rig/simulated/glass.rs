//! Refractive indices of glasses by the Sellmeier equation.

use crate::config::Glass;

/// Refractive index at `wavelength_nm` relative to air. The Sellmeier coefficients are from data
/// sheets of Schott (optical glass catalogue) and, for fused silica, from Malitson 1965.
pub(super) fn index(glass: Glass, wavelength_nm: f64) -> f64 {
    // n² − 1 = Σ B·λ²/(λ² − C), λ in µm.
    let (b, c) = match glass {
        Glass::Air => return 1.0,
        Glass::NBk7 => (
            [1.039_612_12, 0.231_792_344, 1.010_469_45],
            [0.006_000_698_67, 0.020_017_914_4, 103.560_653],
        ),
        Glass::F2 => (
            [1.345_333_59, 0.209_073_176, 0.937_357_162],
            [0.009_977_438_71, 0.047_045_076_7, 111.886_764],
        ),
        Glass::FusedSilica => (
            [0.696_166_3, 0.407_942_6, 0.897_479_4],
            [0.004_679_148_26, 0.013_512_063_1, 97.934_002_5],
        ),
    };
    let square = (wavelength_nm / 1000.0).powi(2);
    let sum: f64 = b.iter().zip(c).map(|(b, c)| b * square / (square - c)).sum();
    (1.0 + sum).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_at_the_helium_d_line_are_the_catalogue_s() {
        // n_d at 587.56 nm in the data sheets.
        for (glass, printed) in
            [(Glass::NBk7, 1.51680), (Glass::F2, 1.62004), (Glass::FusedSilica, 1.45846)]
        {
            let computed = index(glass, 587.56);
            assert!((computed - printed).abs() < 1e-5, "{glass:?}: {computed}");
        }
    }
}
