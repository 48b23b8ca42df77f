//! Speed against accuracy: every method with several settings on the same scenes, and which of them
//! to choose.

use super::contestants::{self, Contestant, FILED, OUTSIDE};
use super::crops::{self, Crop};
use super::scenes::Scene;
use super::table::Table;
use super::test_rig::{Score, TestRig, TestRigError};

/// By what results are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// SSIM of what is scored.
    Ssim,
    /// Its PSNR, dB.
    Psnr,
    /// ΔE (CIEDE2000) at edges; less is better.
    EdgeDifference,
}

impl Measure {
    /// All of them.
    pub const ALL: [Measure; 3] = [Measure::Ssim, Measure::Psnr, Measure::EdgeDifference];

    /// Of a result and of its photo, the larger the better; `None` where it is not measured.
    pub fn of(self, score: &Score) -> Option<[f64; 2]> {
        match self {
            Measure::Ssim => Some([score.ssim, score.blurred_ssim]),
            Measure::Psnr => Some([score.psnr_db, score.blurred_psnr_db]),
            Measure::EdgeDifference => score.edge_differences.map(|both| both.map(|d| -d)),
        }
    }
}

/// A contestant's means over the photos.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The method's family.
    pub family: &'static str,
    /// Which of the family's lines it lies on; none where it is empty.
    pub line: String,
    /// What sets it apart in its family.
    pub setting: String,
    /// Whether it is the paper's own setting.
    pub printed: bool,
    /// Captures a photo.
    pub captures: f64,
    /// Seconds of those captures on the rig's clock.
    pub capture_seconds: f64,
    /// Seconds of computing, by the test rig's stopwatch.
    pub computing_seconds: f64,
    /// Mean SSIM.
    pub ssim: f64,
    /// Mean PSNR, dB.
    pub psnr_db: f64,
    /// Mean ΔE at edges, of photos in colour.
    pub edge_difference: Option<f64>,
}

impl Point {
    /// What a photo costs, seconds.
    pub fn seconds(&self) -> f64 {
        self.capture_seconds + self.computing_seconds
    }

    /// The same for each of a photo's `megapixels`.
    pub fn seconds_a_megapixel(&self, megapixels: f64) -> f64 {
        self.seconds() / megapixels
    }

    /// What it has of `measure`, the larger the better.
    pub fn by(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::Ssim => Some(self.ssim),
            Measure::Psnr => Some(self.psnr_db),
            Measure::EdgeDifference => self.edge_difference.map(|difference| -difference),
        }
    }

    /// Its method's name in the scores.
    pub fn name(&self) -> String {
        contestants::name(self.family, &self.setting)
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
    /// Mean ΔE at their edges, of photos in colour.
    pub photo_edge_difference: Option<f64>,
    /// Everything, photo by photo; without the pictures.
    pub scores: Vec<Score>,
    /// Small parts of the first photo of a scene, and of what became of it.
    pub crops: Vec<Crop>,
}

impl Trade {
    /// `contestant` on `takes` photos of each of `scenes` on `test_rig`; `each` is told of every
    /// score.
    ///
    /// # Errors
    /// When a scene cannot be shown, or the method fails.
    pub fn run(
        &mut self,
        test_rig: &mut TestRig,
        (scenes, takes): (&[Scene], u64),
        contestant: &Contestant,
        each: &mut dyn FnMut(&Score),
    ) -> Result<(), TestRigError> {
        let name = contestant.name();
        let mut scores = Vec::new();
        for &scene in scenes {
            for take in 0..takes.max(1) {
                let score = test_rig.score(scene, take, &name, &*contestant.method)?;
                each(&score);
                if take == 0 {
                    self.look(test_rig, &score)?;
                }
                scores.push(score.without_pictures());
            }
        }
        self.add(contestant, scores);
        Ok(())
    }

    /// Keeps a small part of the picture of `score`, and once of its scene and photo.
    fn look(&mut self, test_rig: &mut TestRig, score: &Score) -> Result<(), TestRigError> {
        let (scene, shown) = (score.scene, (test_rig.config().photo.curve, test_rig.channels()));
        if !crops::PARTS.iter().any(|(of, ..)| *of == scene) {
            return Ok(());
        }
        if !self.crops.iter().any(|crop| crop.scene == scene) {
            let photo = test_rig.photograph(scene, 0)?.light;
            self.crops.extend(Crop::of(scene, crops::SCENE, shown, &test_rig.truth(scene)));
            self.crops.extend(Crop::of(scene, crops::PHOTO, shown, &photo));
        }
        self.crops.extend(Crop::of(scene, &score.method, shown, &score.restored.picture));
        Ok(())
    }

    /// Takes the `scores` of `contestant`, one a photo, under its name; of the same photos as those
    /// of all others.
    pub fn add(&mut self, contestant: &Contestant, scores: Vec<Score>) {
        let mean =
            |of: &dyn Fn(&Score) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
        let coloured = scores.iter().all(|s| s.edge_differences.is_some());
        let edges =
            |n: usize| coloured.then(|| mean(&|s| s.edge_differences.map_or(0.0, |d| d[n])));
        self.points.push(Point {
            family: contestant.family,
            line: contestant.line.clone(),
            setting: contestant.setting.clone(),
            printed: contestant.printed,
            captures: mean(&|s| s.restored.captures as f64),
            capture_seconds: mean(&|s| s.restored.capture_seconds),
            computing_seconds: mean(&|s| s.computing_seconds),
            ssim: mean(&|s| s.ssim),
            psnr_db: mean(&|s| s.psnr_db),
            edge_difference: edges(0),
        });
        (self.photo_ssim, self.photo_psnr_db) =
            (mean(&|s| s.blurred_ssim), mean(&|s| s.blurred_psnr_db));
        self.photo_edge_difference = edges(1);
        self.scores.extend(scores);
    }

    /// What the untouched photos have of `measure`, the larger the better.
    pub fn photo_by(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::Ssim => Some(self.photo_ssim),
            Measure::Psnr => Some(self.photo_psnr_db),
            Measure::EdgeDifference => self.photo_edge_difference.map(|difference| -difference),
        }
    }

    /// How far single photos stray from what `point` gains on average over what the rig file has,
    /// by `measure`: one standard deviation. `None` of fewer than six photos.
    pub fn spread(&self, point: &Point, measure: Measure) -> Option<f64> {
        let filed = self.points.iter().find(|point| point.family == FILED)?;
        let of = |point: &Point| -> Vec<f64> {
            let name = point.name();
            let own = self.scores.iter().filter(|score| score.method == name);
            own.filter_map(|score| Some(measure.of(score)?[0])).collect()
        };
        let (own, filed) = (of(point), of(filed));
        if own.len() != filed.len() || own.len() < 6 {
            return None;
        }
        let gains: Vec<f64> = own.iter().zip(filed).map(|(a, b)| a - b).collect();
        let mean = gains.iter().sum::<f64>() / gains.len() as f64;
        let squares: f64 = gains.iter().map(|gain| (gain - mean).powi(2)).sum();
        Some((squares / (gains.len() - 1) as f64).sqrt())
    }

    /// Which points no other beats in both seconds and `measure`, fastest first.
    pub fn front(&self, measure: Measure) -> Vec<usize> {
        self.front_of(&|_| true, &|point| point.by(measure).unwrap_or(f64::NEG_INFINITY))
    }

    /// Which of the points that `are` no other of these beats by their `worth`, fastest first.
    fn front_of(&self, are: &dyn Fn(&Point) -> bool, worth: &dyn Fn(&Point) -> f64) -> Vec<usize> {
        let mut order: Vec<usize> =
            (0..self.points.len()).filter(|&n| are(&self.points[n])).collect();
        order.sort_by(|&a, &b| {
            let (a, b) = (&self.points[a], &self.points[b]);
            a.seconds().total_cmp(&b.seconds()).then(worth(b).total_cmp(&worth(a)))
        });
        let mut best = f64::NEG_INFINITY;
        order.retain(|&n| {
            let better = worth(&self.points[n]) > best;
            best = best.max(worth(&self.points[n]));
            better
        });
        order
    }

    /// What `point` gains over the photos, as a share of the most that any gains: the mean of the
    /// measures there are.
    pub fn share(&self, point: &Point) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for measure in Measure::ALL {
            let Some((own, photo)) = point.by(measure).zip(self.photo_by(measure)) else {
                continue;
            };
            let all = self.points.iter().filter(|point| point.family != OUTSIDE);
            let best = all.filter_map(|point| point.by(measure)).fold(photo, f64::max);
            if best > photo {
                (sum, count) = (sum + (own - photo) / (best - photo), count + 1);
            }
        }
        sum / f64::from(count.max(1))
    }

    /// The point to choose: the cheapest that keeps this share of the most that any gains, by SSIM,
    /// PSNR and ΔE together. A peer from outside is no choice.
    pub fn operating_point(&self, keeps: f64) -> Option<usize> {
        let worth = |point: &Point| self.share(point);
        let front = self.front_of(&|point| point.family != OUTSIDE, &worth);
        let best = worth(&self.points[*front.last()?]);
        front.into_iter().find(|&n| worth(&self.points[n]) >= keeps * best)
    }

    /// The points as a table, of photos of so many `megapixels`.
    pub fn table(&self, caption: String, megapixels: f64) -> Table {
        let head = [
            "method",
            "setting",
            "captures",
            "capture s",
            "processor s",
            "seconds",
            "s a megapixel",
            "SSIM",
            "PSNR dB",
            "ΔE at edges",
            "gain SSIM",
            "gain dB",
            "gain ΔE",
            "share",
            "front",
        ];
        let mut table = Table::new(caption, &head);
        let signs = ["SSIM", "dB", "ΔE"];
        let fronts = Measure::ALL.map(|measure| match self.photo_by(measure) {
            Some(_) => self.front(measure),
            None => Vec::new(),
        });
        for (n, point) in self.points.iter().enumerate() {
            let harm = if point.ssim < self.photo_ssim { " (below the photo)" } else { "" };
            table.row(vec![
                point.family.to_owned(),
                point.setting.clone(),
                format!("{:.1}", point.captures),
                format!("{:.2}", point.capture_seconds),
                format!("{:.2}", point.computing_seconds),
                format!("{:.2}", point.seconds()),
                format!("{:.2}", point.seconds_a_megapixel(megapixels)),
                format!("{:.4}", point.ssim),
                format!("{:.2}", point.psnr_db),
                point.edge_difference.map_or("–".to_owned(), |d| format!("{d:.2}")),
                format!("{:+.4}{harm}", point.ssim - self.photo_ssim),
                format!("{:+.2}", point.psnr_db - self.photo_psnr_db),
                point
                    .edge_difference
                    .zip(self.photo_edge_difference)
                    .map_or("–".to_owned(), |(own, photo)| format!("{:+.2}", own - photo)),
                format!("{:.3}", self.share(point)),
                (signs.iter().zip(&fronts).filter(|(_, front)| front.contains(&n)))
                    .map(|(sign, _)| *sign)
                    .collect::<Vec<_>>()
                    .join(", "),
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
        "processor s",
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

/// What the operating points keep of the most that any setting gains. Guesses: of a gain of 0.1
/// SSIM, 0.01 is a difference seen only side by side, and 0.002 none.
pub const FAST: f64 = 0.9;
/// For `balanced`.
pub const BALANCED: f64 = 0.98;
/// For `best`.
pub const BEST: f64 = 1.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, ssim: f64) -> Point {
        Point {
            family: "x",
            line: String::new(),
            setting: String::new(),
            printed: false,
            captures: 0.0,
            capture_seconds: 0.5 * seconds,
            computing_seconds: 0.5 * seconds,
            ssim,
            psnr_db: 100.0 * (ssim - 0.8),
            edge_difference: None,
        }
    }

    #[test]
    fn the_front_holds_what_nothing_beats_in_both_and_the_choice_is_its_cheapest_within_the_limit()
    {
        let points =
            vec![point(3.0, 0.940), point(1.0, 0.900), point(2.0, 0.890), point(2.5, 0.9385)];
        let trade = Trade { points, photo_ssim: 0.8, ..Trade::default() };
        assert_eq!(trade.front(Measure::Ssim), vec![1, 3, 0]);
        let chosen = [BEST, BALANCED, FAST, 0.7].map(|keeps| trade.operating_point(keeps));
        assert_eq!(chosen, [Some(0), Some(3), Some(3), Some(1)]);
        assert_eq!(Trade::default().operating_point(FAST), None);
        let mut outside = trade;
        outside.points.push(Point { family: OUTSIDE, ..point(0.5, 0.95) });
        assert_eq!(outside.front(Measure::Ssim), vec![4]);
        assert_eq!(outside.operating_point(BEST), Some(0));
    }

    #[test]
    fn a_setting_is_chosen_by_all_that_is_measured() {
        // As good by SSIM, and worse by half of what there is to gain in dB and in ΔE.
        let coloured = |ssim, psnr_db, difference| Point {
            psnr_db,
            edge_difference: Some(difference),
            ..point(2.0, ssim)
        };
        let points = vec![coloured(0.9, 30.0, 4.0), coloured(0.9, 25.0, 7.0)];
        let photo = Trade { photo_ssim: 0.8, photo_psnr_db: 20.0, ..Trade::default() };
        let trade = Trade { points, photo_edge_difference: Some(10.0), ..photo };
        let shares: Vec<f64> = trade.points.iter().map(|point| trade.share(point)).collect();
        assert!((shares[0] - 1.0).abs() < 1e-9 && (shares[1] - 2.0 / 3.0).abs() < 1e-9);
        assert_eq!(trade.operating_point(FAST), Some(0));
    }
}
