//! Speed against accuracy: settings of methods on the same photos, and the choice among them.

use super::contestants::{Contestant, name};
use super::scenes::Scene;
use super::table::Table;
use super::test_rig::{PictureQuality, Score, TestRig, TestRigError};
use crate::config::MethodName;

/// Measure of a result's quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// SSIM of the scored plane.
    Ssim,
    /// PSNR of the scored plane, dB.
    Psnr,
    /// ΔE (CIEDE2000) at edges; less is better.
    EdgeDifference,
}

impl Measure {
    /// All measures.
    pub const ALL: [Measure; 3] = [Measure::Ssim, Measure::Psnr, Measure::EdgeDifference];

    /// Value of this measure in `quality`, larger is better; `None` if it was not measured.
    pub fn of(self, quality: &PictureQuality) -> Option<f64> {
        match self {
            Measure::Ssim => Some(quality.ssim),
            Measure::Psnr => Some(quality.psnr_db),
            Measure::EdgeDifference => quality.edge_difference.map(|difference| -difference),
        }
    }
}

/// Scores of one contestant, one per photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Family of methods.
    pub family: String,
    /// Line of the chart within the family.
    pub line: String,
    /// Setting on that line.
    pub setting: String,
    /// Whether this is the rig file's setting.
    pub is_filed: bool,
    /// Scores, at least one.
    pub scores: Vec<Score>,
}

impl Point {
    /// Mean of `number` over the photos.
    pub fn mean(&self, number: impl Fn(&Score) -> f64) -> f64 {
        self.scores.iter().map(number).sum::<f64>() / self.scores.len() as f64
    }

    /// Mean seconds per photo, for captures and computing.
    pub fn seconds(&self) -> f64 {
        self.mean(|s| s.capture_seconds) + self.computing_seconds()
    }

    /// Mean seconds of computing per photo.
    pub fn computing_seconds(&self) -> f64 {
        self.mean(|s| s.computing_seconds)
    }

    /// Mean of `measure` over the results, larger is better.
    pub fn result(&self, measure: Measure) -> Option<f64> {
        self.mean_of(measure, |score| &score.result)
    }

    /// Mean of `measure` over the untouched photos, larger is better.
    pub fn photo(&self, measure: Measure) -> Option<f64> {
        self.mean_of(measure, |score| &score.photo)
    }

    fn mean_of(&self, measure: Measure, quality: fn(&Score) -> &PictureQuality) -> Option<f64> {
        let sum: Option<f64> = self.scores.iter().map(|score| measure.of(quality(score))).sum();
        sum.map(|sum| sum / self.scores.len() as f64)
    }

    /// Mean SSIM of the results.
    pub fn ssim(&self) -> f64 {
        self.mean(|s| s.result.ssim)
    }

    /// Mean PSNR of the results, dB.
    pub fn psnr_db(&self) -> f64 {
        self.mean(|s| s.result.psnr_db)
    }

    /// Name in tables and logs.
    pub fn name(&self) -> String {
        name(&[&self.family, &self.line, &self.setting])
    }

    /// Whether a rig file can select the method of this point.
    fn is_choice(&self) -> bool {
        MethodName::ALL.into_iter().any(|method| method.name() == self.family)
    }
}

/// Measured points, all of the same photos.
#[derive(Debug, Default)]
pub struct Trade {
    /// Points, one per contestant.
    pub points: Vec<Point>,
}

impl Trade {
    /// Restores `takes` photos of each of `scenes` on `test_rig` with `contestant`; `each` gets the
    /// contestant's name and every score.
    ///
    /// # Errors
    /// When a scene cannot be shown, or the method fails.
    pub fn run(
        &mut self,
        test_rig: &mut TestRig,
        scenes: &[Scene],
        takes: u64,
        contestant: &Contestant,
        each: &mut dyn FnMut(&str, &Score),
    ) -> Result<(), TestRigError> {
        let mut scores = Vec::new();
        for &scene in scenes {
            for take in 0..takes.max(1) {
                let score = test_rig.score(scene, take, &*contestant.method)?;
                each(&contestant.name(), &score);
                scores.push(score);
            }
        }
        self.add(contestant, scores);
        Ok(())
    }

    /// Adds the `scores` of `contestant`, at least one.
    pub fn add(&mut self, contestant: &Contestant, scores: Vec<Score>) {
        let Contestant { family, line, setting, is_filed, .. } = contestant;
        let [family, line, setting] = [family, line, setting].map(String::clone);
        self.points.push(Point { family, line, setting, is_filed: *is_filed, scores });
    }

    /// Mean of `measure` over the untouched photos, larger is better.
    pub fn photo(&self, measure: Measure) -> Option<f64> {
        self.points.first()?.photo(measure)
    }

    /// Standard deviation, over the photos, of the gain of `point` over the rig file's setting.
    /// `None` with fewer than three photos.
    pub fn spread(&self, point: &Point, measure: Measure) -> Option<f64> {
        let filed = self.points.iter().find(|point| point.is_filed)?;
        let pairs = point.scores.iter().zip(&filed.scores);
        let gain = |(own, filed): (&Score, &Score)| {
            Some(measure.of(&own.result)? - measure.of(&filed.result)?)
        };
        let gains: Vec<f64> = pairs.map(gain).collect::<Option<_>>()?;
        if gains.len() < 3 {
            return None;
        }
        let mean = gains.iter().sum::<f64>() / gains.len() as f64;
        let squares: f64 = gains.iter().map(|gain| (gain - mean).powi(2)).sum();
        Some((squares / (gains.len() - 1) as f64).sqrt())
    }

    /// Indices of the `points` that no other beats in both `seconds` and `worth`, fastest first.
    pub fn front(
        points: &[Point],
        seconds: impl Fn(&Point) -> f64,
        worth: impl Fn(&Point) -> f64,
    ) -> Vec<usize> {
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by(|&a, &b| {
            let (a, b) = (&points[a], &points[b]);
            seconds(a).total_cmp(&seconds(b)).then(worth(b).total_cmp(&worth(a)))
        });
        let mut best = f64::NEG_INFINITY;
        order.retain(|&n| {
            let better = worth(&points[n]) > best;
            best = best.max(worth(&points[n]));
            better
        });
        order
    }

    /// Gain of `point` over the untouched photos as a share of the largest gain; the mean over the
    /// measures available.
    pub fn share(&self, point: &Point) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for measure in Measure::ALL {
            let Some((own, photo)) = point.result(measure).zip(self.photo(measure)) else {
                continue;
            };
            let all = self.points.iter().filter(|point| point.is_choice());
            let best = all.filter_map(|point| point.result(measure)).fold(photo, f64::max);
            if best > photo {
                (sum, count) = (sum + (own - photo) / (best - photo), count + 1);
            }
        }
        sum / f64::from(count.max(1))
    }

    /// Index of the point to choose: the fastest that keeps the share `keeps` of the largest gain;
    /// `None` if no point gains.
    pub fn operating_point(&self, keeps: f64) -> Option<usize> {
        let worth = |point: &Point| match point.is_choice() {
            true => self.share(point),
            false => f64::NEG_INFINITY,
        };
        let front = Trade::front(&self.points, Point::seconds, worth);
        let best = worth(&self.points[*front.last()?]);
        if best <= 0.0 {
            return None;
        }
        front.into_iter().find(|&n| worth(&self.points[n]) >= keeps * best)
    }

    /// Table of the points, for photos of `megapixels`.
    pub fn table(&self, caption: String, megapixels: f64) -> Table {
        let edges = Measure::EdgeDifference;
        let row = |point: &Point| {
            let gain = |measure| Some(point.result(measure)? - self.photo(measure)?);
            let harm = match gain(Measure::Ssim) {
                Some(..0.0) => " (below the photo)",
                _ => "",
            };
            let filed = if point.is_filed { "as filed" } else { "" };
            let or_dash = |cell: Option<String>| cell.unwrap_or("–".to_owned());
            vec![
                ("method", point.family.clone()),
                ("setting", name(&[&point.line, &point.setting, filed])),
                ("captures", format!("{:.1}", point.mean(|s| s.captures as f64))),
                ("capture s", format!("{:.2}", point.mean(|s| s.capture_seconds))),
                ("processor s", format!("{:.2}", point.computing_seconds())),
                ("s a megapixel", format!("{:.2}", point.seconds() / megapixels)),
                ("SSIM", format!("{:.4}", point.ssim())),
                ("PSNR dB", format!("{:.2}", point.psnr_db())),
                ("ΔE at edges", or_dash(point.result(edges).map(|worth| format!("{:.2}", -worth)))),
                ("gain SSIM", or_dash(gain(Measure::Ssim).map(|by| format!("{by:+.4}{harm}")))),
                ("gain dB", or_dash(gain(Measure::Psnr).map(|by| format!("{by:+.2}")))),
                ("gain ΔE", or_dash(gain(edges).map(|by| format!("{:+.2}", -by)))),
                ("share", format!("{:.3}", self.share(point))),
            ]
        };
        Table::of_rows(caption, self.points.iter().map(row))
    }

    /// Table of all scores; written as CSV, it contains all that a chart is drawn from.
    pub fn score_table(&self, caption: String) -> Table {
        let scores = self.points.iter().flat_map(|p| p.scores.iter().map(move |s| (p, s)));
        let row = |(point, s): (&Point, &Score)| {
            let ssim = |of: &PictureQuality| format!("{:.5}", of.ssim);
            let psnr = |of: &PictureQuality| format!("{:.3}", of.psnr_db);
            let edges = |of: &PictureQuality| {
                of.edge_difference.map_or(String::new(), |difference| format!("{difference:.3}"))
            };
            let certificate = s.certificate.map_or(String::new(), |ratio| format!("{ratio:.2}"));
            vec![
                ("method", point.family.clone()),
                ("line", point.line.clone()),
                ("setting", point.setting.clone()),
                ("filed", point.is_filed.to_string()),
                ("scene", s.scene.name().to_owned()),
                ("take", s.take.to_string()),
                ("captures", s.captures.to_string()),
                ("capture s", format!("{:.3}", s.capture_seconds)),
                ("processor s", format!("{:.3}", s.computing_seconds)),
                ("SSIM", ssim(&s.result)),
                ("PSNR dB", psnr(&s.result)),
                ("ΔE at edges", edges(&s.result)),
                ("photo SSIM", ssim(&s.photo)),
                ("photo PSNR dB", psnr(&s.photo)),
                ("photo ΔE at edges", edges(&s.photo)),
                ("certificate", certificate),
            ]
        };
        Table::of_rows(caption, scores.map(row))
    }
}

/// Share of the largest gain that operating point `fast` keeps. Guess, as for `balanced`: of a gain
/// of 0.1 SSIM, a loss of 0.01 is seen only side by side, and one of 0.002 not at all.
pub const FAST: f64 = 0.9;
/// Share of the largest gain that operating point `balanced` keeps.
pub const BALANCED: f64 = 0.98;
/// Share of the largest gain that operating point `best` keeps.
pub const BEST: f64 = 1.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, ssim: f64) -> Point {
        let quality = |ssim: f64| PictureQuality {
            ssim,
            psnr_db: 100.0 * (ssim - 0.8),
            edge_difference: None,
        };
        let score = Score {
            scene: Scene::Chart,
            take: 0,
            captures: 1,
            capture_seconds: 0.5 * seconds,
            computing_seconds: 0.5 * seconds,
            certificate: None,
            result: quality(ssim),
            photo: quality(0.8),
        };
        Point {
            family: "hybrid".to_owned(),
            line: String::new(),
            setting: String::new(),
            is_filed: false,
            scores: vec![score],
        }
    }

    #[test]
    fn the_choice_is_the_fastest_point_of_the_front_that_keeps_enough() {
        let points =
            vec![point(3.0, 0.940), point(1.0, 0.900), point(2.0, 0.890), point(2.5, 0.9385)];
        let mut trade = Trade { points };
        assert_eq!(Trade::front(&trade.points, Point::seconds, Point::ssim), vec![1, 3, 0]);
        let chosen = [BEST, BALANCED, FAST, 0.7].map(|keeps| trade.operating_point(keeps));
        assert_eq!(chosen, [Some(0), Some(3), Some(3), Some(1)]);
        assert_eq!(Trade::default().operating_point(FAST), None);
        let no_gain = Trade { points: vec![point(1.0, 0.8), point(0.5, 0.7)] };
        assert_eq!(no_gain.operating_point(FAST), None);
        trade.points.push(Point { family: "another program".to_owned(), ..point(0.5, 0.95) });
        assert_eq!(Trade::front(&trade.points, Point::seconds, Point::ssim), vec![4]);
        assert_eq!(trade.operating_point(BEST), Some(0));
    }

    #[test]
    fn a_choice_counts_ssim_psnr_and_colour_alike() {
        // Both have the same SSIM; the second gains half as much in dB and in ΔE.
        let coloured = |psnr_db, difference| {
            let mut point = point(2.0, 0.9);
            let quality =
                |db, d| PictureQuality { ssim: 0.9, psnr_db: db, edge_difference: Some(d) };
            point.scores[0].result = quality(psnr_db, difference);
            point.scores[0].photo = PictureQuality { ssim: 0.8, ..quality(20.0, 10.0) };
            point
        };
        let trade = Trade { points: vec![coloured(30.0, 4.0), coloured(25.0, 7.0)] };
        let shares: Vec<f64> = trade.points.iter().map(|point| trade.share(point)).collect();
        assert!((shares[0] - 1.0).abs() < 1e-9 && (shares[1] - 2.0 / 3.0).abs() < 1e-9);
        assert_eq!(trade.operating_point(FAST), Some(0));
    }
}
