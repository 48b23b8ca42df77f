//! The learned prior beside the program's, without captures, on nine photographs and a chart.

use relens::config::RigFile;
use relens::deconvolution::method::blocks::Blocks;
use relens::deconvolution::method::digital::Digital;

use super::{Learned, Rounds};
use crate::Failure;
use crate::made::Made;
use crate::pace::{Named, measured};

/// The best settings of one and of three rounds on astronaut and coffee, and the eight rounds of
/// the study that the network comes from.
const SETTINGS: [(&str, Rounds); 3] = [
    ("one round", Rounds { steps: 16, count: 1, over_noise: [20.0, 20.0], assumed: 0.15 }),
    ("three rounds", Rounds { steps: 16, count: 3, over_noise: [20.0, 6.0], assumed: 0.2 }),
    ("eight rounds", Rounds { steps: 4, count: 8, over_noise: [14.0, 2.6], assumed: 0.62 }),
];

/// Compares the priors; two photographs if `quick`.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let digital = |blocks: Option<u32>| {
        let blocks = blocks.map(|rounds| Blocks { rounds, model_error: [0.0; 3] });
        Box::new(Digital { blocks, ..Digital::default() })
    };
    let mut methods: Vec<Named> = vec![
        ("shrinkage".to_owned(), digital(None)),
        ("block matching".to_owned(), digital(Some(1))),
    ];
    for (name, rounds) in SETTINGS {
        methods.push((format!("learned, {name}"), Box::new(Learned::new(rounds))));
    }
    Ok(Made::table(format!("{}-learned", rig.name), measured(rig, &methods, quick)?))
}
