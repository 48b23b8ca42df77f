//! Speed and accuracy of methods on known scenes, on any rig (`relens chart`), and the choice of a
//! rig's operating point from the same scores.

pub mod appearance;
pub mod axes;
pub mod contestants;
pub mod drawing;
mod drawn;
pub mod labels;
pub mod marks;
pub mod operating_point;
pub mod scatter;
pub mod scenes;
pub mod table;
pub mod test_rig;
pub mod trade;

use crate::config::RigFile;
use contestants::{Contestant, contestants};
use drawing::Drawing;
use scenes::Scene;
use table::Table;
use test_rig::{Score, TestRig, TestRigError};
use trade::{BALANCED, BEST, FAST, Measure, Trade};

/// Number of photos of each scene, which differ in their noise.
const TAKES: u64 = 3;

/// Contestants, and the number of photos, of one chart.
pub struct ChartPlan {
    /// Settings of methods, the rig file's own first.
    pub contestants: Vec<Contestant>,
    /// Number of photos of each scene.
    pub takes: u64,
}

impl ChartPlan {
    /// Plans the chart of `rig`, with one photo of each scene if `quick`, or on real devices, whose
    /// noise has no seed.
    pub fn new(rig: &RigFile, quick: bool) -> ChartPlan {
        let takes = if quick || rig.simulation().is_none() { 1 } else { TAKES };
        ChartPlan { contestants: contestants(rig), takes }
    }

    /// Number of restorations.
    pub fn restorations(&self) -> usize {
        self.contestants.len() * Scene::CHARTED.len() * self.takes as usize
    }

    /// Scores every contestant on `test_rig`; `each` gets the contestant's name and the score.
    ///
    /// # Errors
    /// When a scene cannot be shown, or a method fails.
    pub fn run(
        &self,
        test_rig: &mut TestRig,
        each: &mut dyn FnMut(&str, &Score),
    ) -> Result<Trade, TestRigError> {
        let mut trade = Trade::default();
        for contestant in &self.contestants {
            trade.run(test_rig, &Scene::CHARTED, self.takes, contestant, each)?;
        }
        Ok(trade)
    }
}

/// A chart: its drawing and its tables.
#[derive(Debug)]
pub struct Chart {
    /// Stem of the file names of drawing and summary.
    pub stem: String,
    /// Drawing of speed against accuracy.
    pub drawing: Drawing,
    /// Table with a row for each point.
    pub summary: Table,
    /// Table with a row for each photo and point.
    pub scores: Table,
}

impl Chart {
    /// Draws `trade`, measured on `rig`; `notes` follow the caption of drawing and summary.
    pub fn new(rig: &RigFile, trade: &Trade, notes: &[String]) -> Chart {
        let megapixels = rig.photo.size().area() as f64 / 1e6;
        let photos = photos(rig, trade);
        let mut below = vec![photos.clone()];
        below.extend_from_slice(notes);
        let title = format!("Speed against accuracy, rig {}", rig.name);
        Chart {
            stem: format!("{}-speed-accuracy", rig.name),
            drawing: scatter::draw(trade, &title, megapixels, &below),
            summary: trade.table(caption(rig, trade, &photos, notes), megapixels),
            scores: trade.score_table(format!("Rig {}, photo by photo.", rig.name)),
        }
    }
}

fn photos(rig: &RigFile, trade: &Trade) -> String {
    let scores = trade.points.first().map_or(&[][..], |point| &point.scores);
    let takes = scores.iter().map(|score| score.take + 1).max().unwrap_or(1);
    let mut scenes: Vec<&str> = scores.iter().map(|score| score.scene.name()).collect();
    scenes.dedup();
    let photos = if takes == 1 { "one photo".to_owned() } else { format!("{takes} photos") };
    format!("{photos} each of {}, {}", scenes.join(", "), rig.photo.size())
}

fn caption(rig: &RigFile, trade: &Trade, photos: &str, notes: &[String]) -> String {
    let chosen = |name: &str, keeps| {
        let point = trade.operating_point(keeps).map(|n| &trade.points[n]);
        point.map_or(String::new(), |p| {
            let (seconds, ssim, db) = (p.seconds(), p.ssim(), p.psnr_db());
            format!(" {name}: {} ({seconds:.2} s, {ssim:.4}/{db:.2} dB).", p.name())
        })
    };
    let points = [("Fast", FAST), ("Balanced", BALANCED), ("Best", BEST)]
        .map(|(name, keeps)| chosen(name, keeps))
        .concat();
    let [ssim, db] =
        [Measure::Ssim, Measure::Psnr].map(|measure| trade.photo(measure).unwrap_or_default());
    format!(
        "Rig {}; {photos}, untouched {ssim:.4}/{db:.2} dB.{points} These are the fastest settings \
         that keep 90, 98 and 100 % of the largest gain (*share*: mean over SSIM, PSNR and ΔE at \
         edges). {}",
        rig.name,
        notes.join(" ")
    )
}
