//! The paper's figures, measured on a simulated rig, drawn, and compared with the paper's
//! statements.
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
//! Figures 1 to 6 show the paper's apparatus and calibration, and give nothing to measure.

mod distances;
mod error_map;
mod iterations;
mod lenses;
mod mosaic;
mod patch_size;
mod regularisation;
mod stage;

use std::path::Path;

use relens::chart::drawing::Drawing;
use relens::chart::table::Table;
use relens::config::RigFile;
use relens::frame::Plane;

use crate::Failure;
use crate::made::{Made, write};

/// A measured value, and the paper's statement about it if there is one.
struct Finding {
    /// The paper's statement, or a dash.
    paper: &'static str,
    /// Quantity measured.
    what: String,
    /// Value found.
    found: String,
    /// Limit within which the paper's statement holds, and whether it does.
    held: Option<(String, bool)>,
}

impl Finding {
    /// The measurement of a statement of the paper.
    fn of(paper: &'static str, what: &str, found: String, allowed: &str, holds: bool) -> Finding {
        let held = Some((allowed.to_owned(), holds));
        Finding { paper, what: what.to_owned(), found, held }
    }

    /// A measured value about which the paper states nothing.
    fn beside(what: impl Into<String>, found: String) -> Finding {
        Finding { paper: "–", what: what.into(), found, held: None }
    }
}

/// A grey picture, 0..255.
struct Picture {
    /// Suffix of the figure's stem.
    suffix: &'static str,
    /// Caption.
    seen: String,
    picture: Plane,
}

/// A figure.
struct Figure {
    /// Number of the figure in the paper.
    number: u32,
    /// Stem of the names of the figure's files.
    stem: &'static str,
    /// Title.
    title: &'static str,
    findings: Vec<Finding>,
    /// Drawings, each with its suffix of the stem.
    drawings: Vec<(&'static str, Drawing)>,
    pictures: Vec<Picture>,
    /// Measured numbers.
    table: Table,
}

impl Figure {
    /// Number of the paper's statements that hold, in words.
    fn agreement(&self) -> String {
        let held = || self.findings.iter().filter_map(|finding| finding.held.as_ref());
        format!("{} of {}", held().filter(|(_, holds)| *holds).count(), held().count())
    }

    fn findings(&self) -> Table {
        let head = ["the paper says", "measured", "here", "allowed", "holds"];
        let mut table = Table::new(String::new(), &head);
        for Finding { paper, what, found, held } in &self.findings {
            let (allowed, holds) = match held {
                Some((allowed, holds)) => (allowed.as_str(), if *holds { "yes" } else { "no" }),
                None => ("", ""),
            };
            let cells = [*paper, what, found, allowed, holds];
            table.row(cells.map(str::to_owned).into());
        }
        table
    }

    fn made(&self) -> Made {
        let named = |suffix: &str| format!("{}{suffix}", self.stem);
        let drawings =
            self.drawings.iter().map(|(suffix, drawing)| (named(suffix), drawing.clone()));
        let pictures = self.pictures.iter().map(|p| (named(p.suffix), p.picture.clone()));
        Made {
            files: vec![(named(".csv"), self.table.csv().into_bytes())],
            drawings: drawings.collect(),
            pictures: pictures.collect(),
            ..Made::default()
        }
    }
}

/// Measures a figure on rigs derived from a simulated one with linear photos.
type Measure = fn(&RigFile) -> Result<Figure, Failure>;

const ALL: [Measure; 6] = [
    patch_size::measure,
    error_map::measure,
    distances::measure,
    regularisation::measure,
    iterations::measure,
    lenses::measure,
];

/// Measures all figures, and writes each into `folder` as soon as it is measured.
pub(crate) fn run(rig: &RigFile, folder: &Path) -> Result<Made, Failure> {
    let mut figures = Vec::new();
    for measure in ALL {
        let figure = measure(rig)?;
        log::info!("figure {}: {} statements hold", figure.number, figure.agreement());
        figure.made().write(folder)?;
        figures.push(figure);
        write(folder, "README.md", page(&figures, &rig.name).as_bytes())?;
    }
    Ok(Made::default())
}

/// Page of `figures` in Markdown.
fn page(figures: &[Figure], rig: &str) -> String {
    let mut out = format!(
        "# The paper's figures, measured again\n\nMade by `lab figures --rig {rig}.toml --out DIR` \
         (`tests/lab`) on rig {rig}: ray-traced lens, 8-bit panel and camera, scenes whose truth \
         is known; green channel, light 0..255. Sizes in pixels are given as the paper has them, \
         for a photo 1024 wide; the rig's own are smaller in proportion.\n\n\
         | figure | | statements of the paper that hold |\n|---|---|---|\n"
    );
    for figure in figures {
        let (number, title, agreement) = (figure.number, figure.title, figure.agreement());
        out += &format!("| [{number}](#figure-{number}) | {title} | {agreement} |\n");
    }
    for figure in figures {
        let (title, stem) = (figure.title, figure.stem);
        out += &format!("\n## Figure {}\n\n{title}.\n", figure.number);
        out += &figure.findings().markdown();
        for (suffix, _) in &figure.drawings {
            out += &format!("\n![{title}]({stem}{suffix}.svg)\n");
        }
        for Picture { suffix, seen, .. } in &figure.pictures {
            out += &format!("\n![{seen}]({stem}{suffix}.png)\n\n*{seen}*\n");
        }
        out += &format!("\n{}", figure.table.markdown());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The study's rig at half its size: 256×192.
    fn rig() -> RigFile {
        crate::sized::sized(&crate::rig("study.toml").unwrap(), 0.5)
    }

    fn cell(table: &Table, row: usize, column: &str) -> f64 {
        let at = table.head.iter().position(|&head| head == column).unwrap();
        table.rows[row][at].split('/').next().unwrap().parse().unwrap()
    }

    #[test]
    fn the_error_of_flip_fc_flip_is_small_in_the_centre() {
        let figure = error_map::measure(&rig()).unwrap();
        // The first column "mean" is the centre's; its rows are patches of 40, 80, 160 and 1024 px.
        let centre: Vec<f64> = (0..4).map(|row| cell(&figure.table, row, "mean")).collect();
        assert!(centre[1] > 0.0 && centre[1] < 2.0, "{centre:?}");
        assert_eq!(figure.pictures.len(), 2);
        let page = page(&[figure], "study");
        assert!(page.contains("figure-08-error-map.png") && page.contains("mean error"), "{page}");
    }

    #[test]
    fn the_loop_sharpens_without_noise_and_does_harm_with_it() {
        let figure = iterations::measure(&rig()).unwrap();
        let [quiet, noisy] =
            [0, 1].map(|row| cell(&figure.table, row, "11") - cell(&figure.table, row, "photo"));
        assert!(quiet > 0.03 && noisy < 0.0, "{quiet} {noisy}");
        assert_eq!(figure.agreement(), "1 of 2");
    }
}
