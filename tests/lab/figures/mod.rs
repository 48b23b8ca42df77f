//! The paper's figures, regenerated: each is measured on a simulated rig, drawn, and compared in
//! words with what the paper says of its own.
//!
//! | figure | what | file |
//! |---|---|---|
//! | 7 | patch size of flip–FC–flip | [`patch_size`] |
//! | 8 | where flip–FC–flip errs | [`error_map`] |
//! | 9 | photo and rig at different distances | [`distances`] |
//! | 10 | λ against noise variance | [`regularisation`] |
//! | 11 | the first iterations | [`iterations`] |
//! | 12 | three lenses | [`lenses`] |
//!
//! Figures 1 to 6 show the paper's apparatus and calibration; there is nothing in them to measure
//! again.

mod distances;
mod error_map;
mod iterations;
mod lenses;
mod mosaic;
mod page;
mod patch_size;
mod regularisation;
mod stage;

pub use page::page;

use super::drawing::Drawing;
use super::table::Table;
use super::test_rig::{Stopwatch, TestRigError};
use crate::config;
use crate::frame::Plane;

/// Whether a measured figure says what the paper's says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Agreement {
    /// All that the paper says of it holds here.
    Agrees,
    /// Some of it holds.
    InPart,
    /// None of it holds.
    Differs,
}

impl Agreement {
    /// From how many of the paper's statements held.
    fn of(held: &[bool]) -> Agreement {
        match held.iter().filter(|&&h| h).count() {
            n if n == held.len() => Agreement::Agrees,
            0 => Agreement::Differs,
            _ => Agreement::InPart,
        }
    }

    /// The words for the page.
    pub const fn words(self) -> &'static str {
        match self {
            Agreement::Agrees => "Agrees with the paper.",
            Agreement::InPart => "Agrees with the paper in part.",
            Agreement::Differs => "Does not agree with the paper.",
        }
    }
}

/// A figure made again.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Its number in the paper.
    pub number: u32,
    /// What its files' names begin with.
    pub stem: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// Whether the paper's statements hold.
    pub agreement: Agreement,
    /// One paragraph from the measured numbers.
    pub text: String,
    /// Line drawings: what is added to the stem.
    pub drawings: Vec<(&'static str, Drawing)>,
    /// Grey pictures, codes 0..255: what is added to the stem, what is to be seen, the picture.
    pub pictures: Vec<(&'static str, String, Plane)>,
    /// The numbers.
    pub table: Table,
}

/// What measures a figure on rigs made from the simulated one given, whose photos must be linear as
/// the study's.
pub type Measure = fn(&config::Rig, Stopwatch) -> Result<Figure, TestRigError>;

/// All figures: what each is, and what measures it.
pub const ALL: [(&str, Measure); 6] = [
    ("figure 7, patch size", patch_size::measure),
    ("figure 8, error map", error_map::measure),
    ("figure 9, distances", distances::measure),
    ("figure 10, λ against noise", regularisation::measure),
    ("figure 11, first iterations", iterations::measure),
    ("figure 12, three lenses", lenses::measure),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::OnceLock;
    use std::time::Instant;

    fn seconds() -> f64 {
        static BEGUN: OnceLock<Instant> = OnceLock::new();
        BEGUN.get_or_init(Instant::now).elapsed().as_secs_f64()
    }

    /// The study's rig at half its size: 256×192.
    fn rig() -> config::Rig {
        stage::half(&config::load(Path::new("study.toml")).unwrap())
    }

    fn cell(table: &Table, row: usize, column: &str) -> f64 {
        let at = table.head.iter().position(|&head| head == column).unwrap();
        table.rows[row][at].split('/').next().unwrap().parse().unwrap()
    }

    #[test]
    fn the_error_of_flip_fc_flip_is_small_in_the_centre() {
        let figure = error_map::measure(&rig(), seconds).unwrap();
        // The first "mean" is the centre's: 40, 80, 160 and 1024 px.
        let centre: Vec<f64> = (0..4).map(|row| cell(&figure.table, row, "mean")).collect();
        assert!(centre[1] > 0.0 && centre[1] < 2.0, "{centre:?}");
        assert_eq!(figure.pictures.len(), 2);
        let page = page(&[figure], "study", "relens");
        assert!(
            page.contains("figure-08-error-map.png")
                && page.contains("grey levels of 255 in the centre")
        );
    }

    #[test]
    fn the_loop_sharpens_without_noise_and_does_harm_with_it() {
        let figure = iterations::measure(&rig(), seconds).unwrap();
        let [quiet, noisy] =
            [0, 1].map(|row| cell(&figure.table, row, "11") - cell(&figure.table, row, "photo"));
        assert!(quiet > 0.03 && noisy < 0.0, "{quiet} {noisy}");
        assert_eq!(figure.agreement, Agreement::InPart);
    }

    #[test]
    fn agreement_is_of_all_some_or_none() {
        assert_eq!(Agreement::of(&[true, true]), Agreement::Agrees);
        assert_eq!(Agreement::of(&[true, false]), Agreement::InPart);
        assert_eq!(Agreement::of(&[false, false]), Agreement::Differs);
    }
}
