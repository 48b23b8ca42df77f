//! Refractive indices of glasses by the Sellmeier equation.

/// Sellmeier coefficients: n² − 1 = Σ B·λ²/(λ² − C), λ in µm.
struct Glass {
    name: &'static str,
    b: [f64; 3],
    c: [f64; 3],
}

/// Data sheets of Schott (optical glass catalogue); Malitson 1965 for fused silica.
const CATALOGUE: [Glass; 4] = [
    Glass {
        name: "N-BK7",
        b: [1.039_612_12, 0.231_792_344, 1.010_469_45],
        c: [0.006_000_698_67, 0.020_017_914_4, 103.560_653],
    },
    Glass {
        name: "F2",
        b: [1.345_333_59, 0.209_073_176, 0.937_357_162],
        c: [0.009_977_438_71, 0.047_045_076_7, 111.886_764],
    },
    Glass {
        name: "N-SF11",
        b: [1.737_596_95, 0.313_747_346, 1.898_781_01],
        c: [0.013_188_707, 0.062_306_814_2, 155.236_29],
    },
    Glass {
        name: "fused-silica",
        b: [0.696_166_3, 0.407_942_6, 0.897_479_4],
        c: [0.004_679_148_26, 0.013_512_063_1, 97.934_002_5],
    },
];

/// Names of the known glasses, and `air`.
pub(super) fn names() -> String {
    let glasses: Vec<&str> = CATALOGUE.iter().map(|glass| glass.name).collect();
    format!("air, {}", glasses.join(", "))
}

/// Refractive index of the glass `name` at `wavelength_nm`, with air as 1; `None` for an unknown
/// glass.
pub(super) fn index(name: &str, wavelength_nm: f64) -> Option<f64> {
    if name == "air" {
        return Some(1.0);
    }
    let glass = CATALOGUE.iter().find(|glass| glass.name == name)?;
    let square = (wavelength_nm / 1000.0).powi(2);
    let sum: f64 = glass.b.iter().zip(glass.c).map(|(b, c)| b * square / (square - c)).sum();
    Some((1.0 + sum).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rig_files_allow_the_glasses_of_the_catalogue() {
        let known = crate::config::GLASSES.map(|name| index(name, 550.0).is_some());
        assert!(known.iter().all(|&known| known) && known.len() == CATALOGUE.len() + 1);
    }

    #[test]
    fn indices_at_the_helium_d_line_are_the_catalogue_s() {
        // n_d at 587.56 nm in the data sheets.
        for (name, printed) in
            [("N-BK7", 1.51680), ("F2", 1.62004), ("N-SF11", 1.78472), ("fused-silica", 1.45846)]
        {
            let computed = index(name, 587.56).expect("in the catalogue");
            assert!((computed - printed).abs() < 1e-5, "{name}: {computed}");
        }
        assert!(index("bottle", 500.0).is_none());
    }
}
