//! Speed against accuracy: every method with several settings on the same scenes, and which of them
//! to choose.

use super::contestants::{Contestant, FILED, OUTSIDE};
use super::scenes::Scene;
use super::table::Table;
use super::test_rig::{Score, TestRig, TestRigError};

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

impl Trade {
    /// `contestant` on `scenes` on `test_rig`; `each` is told of every score.
    ///
    /// # Errors
    /// When a scene cannot be shown, or the method fails.
    pub fn run(
        &mut self,
        test_rig: &mut TestRig,
        scenes: &[Scene],
        contestant: &Contestant,
        each: &mut dyn FnMut(&Score),
    ) -> Result<(), TestRigError> {
        let name = contestant.name();
        let mut scores = Vec::new();
        for &scene in scenes {
            let score = test_rig.score(scene, &name, &*contestant.method)?;
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
        let front = self.front_of(&|point| point.family != OUTSIDE && is_no_worse(point));
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

/// The scores as a table.
pub fn scores_table(caption: String, scores: &[Score]) -> Table {
    let head = [
        "scene",
        "method",
        "captures",
        "capture s",
        "computing s",
        "photo SSIM/dB",
        "SSIM",
        "PSNR dB",
        "gain SSIM",
        "gain dB",
        "certificate",
    ];
    let mut table = Table::new(caption, &head);
    for s in scores {
        let certificate = s.restored.solution.certificate.ratio();
        let harm = if s.ssim < s.blurred_ssim { " (below the photo)" } else { "" };
        table.row(vec![
            s.scene.name().to_owned(),
            s.method.clone(),
            s.restored.captures.to_string(),
            format!("{:.1}", s.restored.capture_seconds),
            format!("{:.2}", s.computing_seconds),
            format!("{:.4}/{:.2}", s.blurred_ssim, s.blurred_psnr_db),
            format!("{:.4}", s.ssim),
            format!("{:.2}", s.psnr_db),
            format!("{:+.4}{harm}", s.ssim - s.blurred_ssim),
            format!("{:+.2}", s.psnr_db - s.blurred_psnr_db),
            certificate.map_or("–".to_owned(), |r| format!("{r:.2}")),
        ]);
    }
    table
}

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
    /// dropped that bring in half a decibel.
    pub const BALANCED: Within = Within { ssim: 0.002, psnr_db: 0.0 };
    /// For `fast`. Guess: a difference seen only side by side.
    pub const FAST: Within = Within { ssim: 0.01, psnr_db: 1.0 };
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
        outside.points.push(Point { family: OUTSIDE, ..point(0.5, 0.95) });
        assert_eq!((outside.front(), outside.operating_point(Within::NOTHING)), (vec![4], Some(0)));
    }
}
