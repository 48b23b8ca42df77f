//! The ladder on scenes that call for different rungs: which one the box takes, and what the others
//! would have given.
//!
//! | rung | what is run for the table |
//! |---|---|
//! | 0 | nothing: the photo |
//! | 1 | the lens model with one function for the whole field, no capture |
//! | 2 | the lens model, no capture |
//! | 3 | the lens model and captures |
//!
//! The box takes rung 0, 2 or 3. Rung 1 is run to show what it would be worth: it would do for a
//! wall, a night sky and a small thing in the middle, and spare such photos part of two seconds of
//! computing. It is not built into the box.

pub mod scenes;

use std::sync::Arc;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::chart::Chart;
use super::table::Table;
use super::test_rig::{Stopwatch, TestRigError, display_luminance};
use crate::config::{self, Method};
use crate::deconvolution::quality::ssim;
use crate::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Work};
use crate::measurement::calibrate;
use crate::picture::Tone;
use crate::pipeline::{Pipeline, method};
use crate::rig::exposure::Rig;
use crate::rig::simulated::{Witness, open};
use scenes::{Varied, varied};

/// Seed of what is drawn and of the photos' noise.
const SEED: u64 = 20_261_121;
/// Noise of photos that no lens has seen, grey levels.
const NOISE_LEVELS: f32 = 1.0;

/// A scene on the ladder.
#[derive(Debug, Clone)]
pub struct LadderRow {
    /// The scene.
    pub name: &'static str,
    /// SSIM of the photo, and of what rungs 1, 2 and 3 make of it.
    pub ssim: [f64; 4],
    /// The rung that the box takes.
    pub taken: usize,
    /// SSIM of what the box delivers.
    pub delivered_ssim: f64,
    /// Captures that it cost.
    pub captures: usize,
    /// Seconds of computing.
    pub seconds: f64,
    /// Why that rung.
    pub why: String,
}

impl LadderRow {
    /// What the next larger rung would have gained over what was delivered; nothing above the last.
    pub fn next_gains(&self) -> Option<f64> {
        // From rung 0 the next one that the box has is 2.
        self.ssim.get((self.taken + 1).max(2)).map(|next| next - self.delivered_ssim)
    }
}

struct Ladder<'a> {
    config: &'a config::Rig,
    rig: Rig,
    witness: Witness,
    pipeline: Pipeline,
    one_function: Pipeline,
    tone: Tone,
}

/// Climbs the ladder on the simulated rig of `config`, scene by scene; tells each of them.
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a capture fails.
pub fn climb(
    config: &config::Rig,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&LadderRow),
) -> Result<Vec<LadderRow>, TestRigError> {
    let (mut rig, witness) = open(config)?;
    let calibration = calibrate(&mut rig, config, None, &mut |_| {})?;
    let mut one = calibration.clone();
    one.functions = one.functions.mean();
    let mut ladder = Ladder {
        pipeline: Pipeline::new(config, &calibration)?.timed_by(Arc::new(stopwatch)),
        one_function: Pipeline::new(config, &one)?,
        tone: Tone::of_curve(config.photo.curve, 8),
        config,
        rig,
        witness,
    };
    let mut climbs = Vec::new();
    for scene in varied(config.photo.size(), SEED) {
        let climb = ladder.climb(&scene)?;
        each(&climb);
        climbs.push(climb);
    }
    Ok(climbs)
}

/// The ladder as tables.
///
/// # Errors
/// As [`climb`].
pub fn chart(
    config: &config::Rig,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&LadderRow),
) -> Result<Chart, TestRigError> {
    let climbs = climb(config, stopwatch, each)?;
    let (gains, count) = climbs
        .iter()
        .filter_map(LadderRow::next_gains)
        .fold((0.0, 0), |(sum, n), gain| (sum + gain, n + 1));
    let mut table = Table::new(
        format!(
            "{}: the rung that each scene takes, and what the others would have given (SSIM, \
             luminance of display \
             values). The next larger rung would have gained {:+.4} on average (0.002 allowed).",
            config.name,
            gains / f64::from(count.max(1))
        ),
        &[
            "scene",
            "photo",
            "one function",
            "lens model",
            "and captures",
            "rung taken",
            "delivered",
            "next would gain",
            "captures",
            "computing s",
            "why",
        ],
    );
    for climb in &climbs {
        let mut cells = vec![climb.name.to_owned()];
        cells.extend(climb.ssim.map(|v| format!("{v:.4}")));
        cells.push(climb.taken.to_string());
        cells.push(format!("{:.4}", climb.delivered_ssim));
        cells.push(climb.next_gains().map_or("—".to_owned(), |gain| format!("{gain:+.4}")));
        cells.push(climb.captures.to_string());
        cells.push(format!("{:.2}", climb.seconds));
        cells.push(climb.why.clone());
        table.row(cells);
    }
    Ok(Chart { tables: vec![("ladder".to_owned(), table)], ..Chart::default() })
}

impl Ladder<'_> {
    fn climb(&mut self, scene: &Varied) -> Result<LadderRow, TestRigError> {
        let photo = self.photo(scene);
        let score = |tone: &Tone, light: &Frame<Work>| {
            let shown = |light: &Frame<Work>| match scene.channels {
                Channels::Green => tone.display(Channel::Green, light.plane(Channel::Green)),
                Channels::Colour => display_luminance(tone, light),
            };
            ssim(&shown(light), &shown(&scene.light))
        };
        let mut scores = [score(&self.tone, &photo), 0.0, 0.0, 0.0];
        let rungs = [(true, Method::Digital), (false, Method::Digital), (false, Method::Hybrid)];
        for (found, (one, which)) in scores[1..].iter_mut().zip(rungs) {
            let pipeline = if one { &self.one_function } else { &self.pipeline };
            let prepared = pipeline.prepare(&photo, scene.channels);
            let solver = method(self.config, which);
            let solved = pipeline.solve(&mut self.rig, &prepared, &*solver, &mut |_, _| {})?;
            *found = score(&self.tone, &solved.picture);
        }
        let prepared = self.pipeline.prepare(&photo, scene.channels);
        let solver = method(self.config, self.config.restore.method);
        let restoration =
            self.pipeline.restore(&mut self.rig, &prepared, &*solver, &mut |_, _| {})?;
        let outcome = restoration.outcome;
        Ok(LadderRow {
            name: scene.name,
            delivered_ssim: score(&self.tone, &outcome.picture),
            ssim: scores,
            taken: outcome.rung.number().into(),
            captures: outcome.captures,
            seconds: outcome.seconds - restoration.solved.map_or(0.0, |s| s.waited_seconds),
            why: outcome.reason,
        })
    }

    fn photo(&self, scene: &Varied) -> Frame<Work> {
        let codes = if scene.through_lens {
            self.witness.photograph(&scene.light, SEED)
        } else {
            let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
            let mut noisy = |v: f32| {
                let noise: f32 = StandardNormal.sample(&mut random);
                (v + NOISE_LEVELS * noise).clamp(0.0, FULL_SCALE)
            };
            Frame::from_fn(|c| {
                let plane: Plane =
                    Plane::from_fn(scene.light.size(), |x, y| noisy(scene.light.plane(c).at(x, y)));
                self.tone.display(c, &plane).map(|v: f32| v.round() as u8)
            })
        };
        Frame::from_fn(|c| self.tone.plane(c, codes.plane(c)))
    }
}
