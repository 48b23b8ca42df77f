//! Speed against accuracy: every method with several settings on the same scenes, and which of them
//! to choose.

use super::peers;
use super::scenes::Scene;
use super::table::Table;
use super::test_rig::{Score, Stopwatch, TestRig, TestRigError};
use crate::config::{self, Curve};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::Strength;
use crate::deconvolution::method::averaging::Averaged;
use crate::deconvolution::method::digital::{Colours, Digital};
use crate::deconvolution::method::paper::{Backward, Paper};
use crate::deconvolution::method::residual::Residual;
use crate::deconvolution::method::richardson_lucy::RichardsonLucy;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::deconvolution::method::unmatched::Unmatched;
use crate::deconvolution::method::wiener::Wiener;
use crate::deconvolution::patches::PatchShape;
use crate::frame::Channel;
use crate::pipeline::{Setting, counted, digital, hybrid, method, paper};

/// A method with one setting.
pub struct Contestant {
    /// The method's family: its colour in the chart.
    pub family: &'static str,
    /// What sets it apart in its family.
    pub setting: String,
    /// The method.
    pub method: Box<dyn Method + Send + Sync>,
    /// Whether it is the paper's own setting, marked in the chart.
    pub printed: bool,
}

/// A contestant's means over the scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The method's family.
    pub family: &'static str,
    /// What sets it apart in its family.
    pub setting: String,
    /// Whether it is the paper's own setting.
    pub printed: bool,
    /// Captures a photo.
    pub captures: f64,
    /// Seconds of those captures on the rig's clock.
    pub capture_seconds: f64,
    /// Seconds of computing.
    pub computing_seconds: f64,
    /// Mean SSIM.
    pub ssim: f64,
    /// Mean PSNR, dB.
    pub psnr_db: f64,
}

impl Point {
    /// What a photo costs, seconds.
    pub fn seconds(&self) -> f64 {
        self.capture_seconds + self.computing_seconds
    }
}

/// What was measured: every score, and the means.
#[derive(Debug, Default)]
pub struct Trade {
    /// The means, a point each.
    pub points: Vec<Point>,
    /// Mean SSIM of the untouched photos: the floor.
    pub photo_ssim: f64,
    /// Mean PSNR of the untouched photos, dB.
    pub photo_psnr_db: f64,
    /// Everything, scene by scene.
    pub scores: Vec<Score>,
}

/// Runs every contestant on `scenes` on the rig of `rig`, and the model-based ones also with fewer
/// functions; `peers` are rows of programs from outside, see [`peers`].
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a method fails.
pub fn measure(
    rig: &config::Rig,
    quick: bool,
    scenes: &[Scene],
    peers: Option<&str>,
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(&Score),
) -> Result<Trade, TestRigError> {
    let mut trade = Trade::default();
    let mut test_rig = TestRig::open(rig.clone(), stopwatch)?;
    let mut outside = Vec::new();
    if let Some(rows) = peers {
        let mut photos = Vec::new();
        for &scene in scenes {
            photos.push((scene, test_rig.take_grey(scene)?.1.plane(Channel::Green).clone()));
        }
        outside = peers::read(rows, &photos)?;
    }
    trade.run_all(&mut test_rig, quick, scenes, each)?;
    if !quick {
        for (columns, rows) in [(1, 1), (4, 3)] {
            let mut fewer = rig.clone();
            (fewer.calibration.function_columns, fewer.calibration.function_rows) = (columns, rows);
            let mut test_rig = TestRig::open(fewer, stopwatch)?;
            let setting = counted(columns * rows, "function");
            for (family, method) in [
                ("digital", Box::new(digital(rig)) as Box<dyn Method + Send + Sync>),
                ("hybrid", Box::new(hybrid(rig))),
            ] {
                let contestant =
                    Contestant { family, setting: setting.clone(), method, printed: false };
                trade.run(&mut test_rig, scenes, &contestant, each)?;
            }
        }
    }
    trade.points.extend(outside);
    Ok(trade)
}

impl Trade {
    /// Every contestant on `scenes`, on the rig that `stand` is on.
    pub(super) fn run_all(
        &mut self,
        test_rig: &mut TestRig,
        quick: bool,
        scenes: &[Scene],
        each: &mut dyn FnMut(&Score),
    ) -> Result<(), TestRigError> {
        let rig = test_rig.config().clone();
        contestants(&rig, quick)
            .iter()
            .try_for_each(|contestant| self.run(test_rig, scenes, contestant, each))
    }

    /// One contestant on `scenes`.
    pub(super) fn run(
        &mut self,
        test_rig: &mut TestRig,
        scenes: &[Scene],
        contestant: &Contestant,
        each: &mut dyn FnMut(&Score),
    ) -> Result<(), TestRigError> {
        let name = format!("{}, {}", contestant.family, contestant.setting);
        let mut scores = Vec::new();
        for &scene in scenes {
            let score = match test_rig.config().photo.curve {
                Curve::Linear => test_rig.score_grey(scene, &name, &*contestant.method)?,
                Curve::Srgb => test_rig.score_colour(scene, &name, &*contestant.method)?,
            };
            each(&score);
            scores.push(score);
        }
        let mean =
            |of: &dyn Fn(&Score) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
        self.points.push(Point {
            family: contestant.family,
            setting: contestant.setting.clone(),
            printed: contestant.printed,
            captures: mean(&|s| s.restored.captures as f64),
            capture_seconds: mean(&|s| s.restored.capture_seconds),
            computing_seconds: mean(&|s| s.computing_seconds),
            ssim: mean(&|s| s.ssim),
            psnr_db: mean(&|s| s.psnr_db),
        });
        (self.photo_ssim, self.photo_psnr_db) =
            (mean(&|s| s.blurred_ssim), mean(&|s| s.blurred_psnr_db));
        self.scores.extend(scores);
        Ok(())
    }

    /// Which points no other beats in both seconds and SSIM, fastest first.
    pub fn front(&self) -> Vec<usize> {
        self.front_of(&|_| true)
    }

    /// Which of the points that `are` no other of these beats, fastest first.
    fn front_of(&self, are: &dyn Fn(&Point) -> bool) -> Vec<usize> {
        let mut order: Vec<usize> =
            (0..self.points.len()).filter(|&n| are(&self.points[n])).collect();
        order.sort_by(|&a, &b| {
            let (a, b) = (&self.points[a], &self.points[b]);
            a.seconds().total_cmp(&b.seconds()).then(b.ssim.total_cmp(&a.ssim))
        });
        let mut best = f64::NEG_INFINITY;
        order.retain(|&n| {
            let better = self.points[n].ssim > best;
            best = best.max(self.points[n].ssim);
            better
        });
        order
    }

    /// The point to choose: the one of best SSIM; or, when it may be `within` of the best, the
    /// cheapest such of all that neither cost more nor have less PSNR than what the rig file has. A
    /// peer from outside is no choice.
    pub fn operating_point(&self, within: Within) -> Option<usize> {
        let filed = self.points.iter().find(|point| point.family == FILED);
        let filed = filed.filter(|_| within != Within::NOTHING);
        let is_no_worse = |point: &Point| {
            filed.is_none_or(|filed| {
                point.seconds() <= filed.seconds()
                    && point.psnr_db >= filed.psnr_db - within.psnr_db
            })
        };
        let front = self.front_of(&|point| point.family != peers::FAMILY && is_no_worse(point));
        let best = self.points[*front.last()?].ssim;
        front.into_iter().find(|&n| self.points[n].ssim >= best - within.ssim)
    }

    /// The points as a table.
    pub fn table(&self, caption: String) -> Table {
        let head = [
            "method",
            "setting",
            "captures",
            "capture s",
            "computing s",
            "seconds",
            "SSIM",
            "PSNR dB",
            "gain SSIM",
            "gain dB",
            "front",
        ];
        let mut table = Table::new(caption, &head);
        let front = self.front();
        for (n, point) in self.points.iter().enumerate() {
            let harm = if point.ssim < self.photo_ssim { " (below the photo)" } else { "" };
            table.row(vec![
                point.family.to_owned(),
                point.setting.clone(),
                format!("{:.1}", point.captures),
                format!("{:.2}", point.capture_seconds),
                format!("{:.2}", point.computing_seconds),
                format!("{:.2}", point.seconds()),
                format!("{:.4}", point.ssim),
                format!("{:.2}", point.psnr_db),
                format!("{:+.4}{harm}", point.ssim - self.photo_ssim),
                format!("{:+.2}", point.psnr_db - self.photo_psnr_db),
                if front.contains(&n) { "yes" } else { "" }.to_owned(),
            ]);
        }
        table
    }
}

/// The family of what the rig file has.
pub const FILED: &str = "as filed";

/// How much worse an operating point may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Within {
    /// SSIM below the best.
    pub ssim: f64,
    /// PSNR below what the rig file's own setting has, dB.
    pub psnr_db: f64,
}

impl Within {
    /// It must be the best, whatever it costs.
    pub const NOTHING: Within = Within { ssim: 0.0, psnr_db: 0.0 };
    /// For `balanced`. Less SSIM means nothing, says the study; by SSIM alone captures would be
    /// dropped that bring in half a decibel (block matching on study.toml, 2026-11-22).
    pub const BALANCED: Within = Within { ssim: 0.002, psnr_db: 0.0 };
    /// For `fast`. Guess: a difference seen only side by side.
    pub const FAST: Within = Within { ssim: 0.01, psnr_db: 1.0 };
}

/// All that are tried on `rig`; fewer when it must be `quick`.
pub(super) fn contestants(rig: &config::Rig, quick: bool) -> Vec<Contestant> {
    let mut all = Vec::new();
    let mut add = |family, setting: String, printed, method: Box<dyn Method + Send + Sync>| {
        all.push(Contestant { family, setting, method, printed });
    };
    let printed = paper(rig);
    let iterations: &[u32] = if quick { &[3, 11] } else { &[1, 2, 3, 5, 8, 11, 16] };
    for &n in iterations {
        let setting = counted(n as usize, "iteration");
        add(
            "paper",
            setting,
            n == printed.iterations,
            Box::new(Paper { iterations: n, ..printed }),
        );
    }
    if !quick {
        for patch_px in [rig.paper.patch_px / 2, rig.paper.patch_px * 2] {
            let backward = Backward::Light(PatchShape { patch_px, margin_px: rig.paper.margin_px });
            let setting = format!("patch {patch_px} px");
            add("paper", setting, false, Box::new(Paper { backward, ..printed }));
        }
        let averaged = Averaged { method: Box::new(printed), times: 4 };
        add("paper", "each capture 4 times".to_owned(), false, Box::new(averaged));
    }
    let strength = digital(rig).strength;
    let (levels, cycle_spun) = (rig.restore.levels, rig.restore.cycle_spun);
    let residual_strength = Strength { at_one_grey_level: 3.0 * strength.at_one_grey_level };
    let patches = PatchShape { patch_px: rig.paper.patch_px, margin_px: rig.paper.margin_px };
    for &iterations in if quick { &[5u32][..] } else { &[1, 2, 3, 5, 8] } {
        let residual =
            Residual { iterations, strength: residual_strength, patches, levels, cycle_spun };
        add("residual", counted(iterations as usize, "iteration"), false, Box::new(residual));
    }
    for &iterations in if quick { &[11u32][..] } else { &[3, 6, 11, 20] } {
        let unmatched = Unmatched { iterations, strength, levels, cycle_spun };
        add("unmatched", format!("{iterations} captures"), false, Box::new(unmatched));
    }
    for steps in [2, 4, 8, 16, 32, 64] {
        add(
            "digital",
            format!("{steps} steps"),
            false,
            Box::new(Digital { steps, ..digital(rig) }),
        );
    }
    add(
        "digital",
        "not spun".to_owned(),
        false,
        Box::new(Digital { cycle_spun: false, ..digital(rig) }),
    );
    if rig.photo.curve == Curve::Srgb {
        let apart = Digital { colours: Colours::Apart, ..digital(rig) };
        add("digital", "colours apart".to_owned(), false, Box::new(apart));
    }
    for (captures_max, steps, correction_steps) in
        [(1, 4, 4), (2, 8, 6), (1, 16, 10), (2, 16, 10), (4, 16, 10), (2, 32, 20), (4, 64, 30)]
    {
        let filed = Setting::as_filed(rig, config::Method::Hybrid);
        let set = Setting { captures_max, steps, correction_steps, ..filed };
        add("hybrid", set.numbers(), false, set.method(rig));
    }
    let averaged = Averaged { method: Box::new(hybrid(rig)), times: 4 };
    add("hybrid", "each capture 4 times".to_owned(), false, Box::new(averaged));
    let matched = Setting::as_filed(rig, config::Method::BlockMatching);
    let rounds = if quick { vec![1, 8] } else { vec![1, 2, 4, 8, 12, 16] };
    let mut with_blocks =
        |set: Setting| add(set.method.name(), set.numbers(), false, set.method(rig));
    rounds.iter().for_each(|&rounds| with_blocks(Setting { rounds, captures_max: 0, ..matched }));
    for (rounds, captures_max) in [(1, 1), (1, 2), (2, 1), (2, 2), (4, 2), (8, 1), (8, 2), (12, 2)]
    {
        with_blocks(Setting { rounds, captures_max, ..matched });
    }
    for (steps, correction_steps) in [(4, 2), (8, 4)] {
        with_blocks(Setting { steps, correction_steps, rounds: 1, captures_max: 1, ..matched });
    }
    for noise_to_signal in [0.003, 0.01, 0.03] {
        let setting = format!("noise to signal {noise_to_signal}");
        add("wiener", setting, false, Box::new(Wiener { noise_to_signal }));
    }
    for &steps in if quick { &[20u32][..] } else { &[5, 10, 20, 40] } {
        add("richardson-lucy", format!("{steps} steps"), false, Box::new(RichardsonLucy { steps }));
    }
    for &(steps, at_one_grey_level) in if quick {
        &[(40u32, 0.3f32)][..]
    } else {
        &[(20, 0.3), (40, 0.3), (40, 0.15), (40, 0.6), (80, 0.3)]
    } {
        let setting = format!("{steps} steps, strength {at_one_grey_level}");
        let variation = TotalVariation { steps, strength: Strength { at_one_grey_level } };
        add("total-variation", setting, false, Box::new(variation));
    }
    let named = method(rig, rig.restore.method);
    add(FILED, named.name().to_owned(), false, named);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, ssim: f64) -> Point {
        Point {
            family: "x",
            setting: String::new(),
            printed: false,
            captures: 0.0,
            capture_seconds: 0.5 * seconds,
            computing_seconds: 0.5 * seconds,
            ssim,
            psnr_db: 0.0,
        }
    }

    #[test]
    fn the_front_holds_what_nothing_beats_in_both_and_the_choice_is_its_cheapest_within_the_limit()
    {
        let points =
            vec![point(3.0, 0.940), point(1.0, 0.900), point(2.0, 0.890), point(2.5, 0.9385)];
        let trade = Trade { points, ..Trade::default() };
        assert_eq!(trade.front(), vec![1, 3, 0]);
        let within = |ssim| Within { ssim, psnr_db: 0.5 };
        assert_eq!(trade.operating_point(Within::NOTHING), Some(0));
        assert_eq!(trade.operating_point(within(0.002)), Some(3));
        assert_eq!(trade.operating_point(within(0.05)), Some(1));
        assert_eq!(Trade::default().operating_point(within(0.1)), None);
        let mut slow = Trade { points: trade.points.clone(), ..Trade::default() };
        slow.points.extend([point(30.0, 0.96), Point { family: FILED, ..point(3.0, 0.939) }]);
        let chosen = [Within::NOTHING, within(0.002)].map(|within| slow.operating_point(within));
        assert_eq!(chosen, [Some(4), Some(3)]);
        // What is as good by SSIM and worse by a decibel than what the rig file has is no choice,
        // unless it may be.
        slow.points[3].psnr_db = -1.0;
        assert_eq!(slow.operating_point(within(0.002)), Some(0));
        assert_eq!(slow.operating_point(Within { ssim: 0.002, psnr_db: 1.0 }), Some(3));
        let mut outside = trade;
        outside.points.push(Point { family: peers::FAMILY, ..point(0.5, 0.95) });
        assert_eq!((outside.front(), outside.operating_point(Within::NOTHING)), (vec![4], Some(0)));
    }
}
