//! Gain of captures where the measured lens is wrong, by limit on captures and number of steps.

use relens::chart::axes::{Axes, ValueScale};
use relens::chart::contestants::Contestant;
use relens::chart::drawing::{Anchor, Colour, Drawing, HARM, INK, Stroke};
use relens::chart::marks::Outline;
use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::chart::test_rig::Score;
use relens::chart::trade::{Point, Trade};
use relens::config::{MethodName, RigFile};
use relens::pipeline::Setting;

use crate::change::{Change, DECENTRED, NOTHING, SCENE_AT, SMEARED, VEIL_MISSED};
use crate::csv::cells_of_csv;
use crate::harness::{Harness, calibration};
use crate::made::Made;
use crate::{Failure, report};

/// Faults and their strengths; the first is none.
pub(crate) const WRONG: [(&Change, f64); 5] =
    [(&NOTHING, 0.0), (&VEIL_MISSED, 10.0), (&SMEARED, 15.0), (&DECENTRED, 10.0), (&SCENE_AT, 4.4)];

/// Three photographs and a page of print.
const SCENES: [Scene; 4] = [Scene::Astronaut, Scene::Coffee, Scene::Rocket, Scene::Page];

/// Columns of the stored rows.
const HEAD: [&str; 9] = [
    "fault",
    "captures at most",
    "steps",
    "captures",
    "processor s",
    "SSIM",
    "PSNR dB",
    "photo SSIM",
    "photo PSNR dB",
];

/// A line of the chart: captures at most, its colour and mark.
struct Line {
    captures_max: &'static str,
    words: &'static str,
    colour: Colour,
    outline: Outline,
}

const LINES: [Line; 4] = [
    line("0", "no capture", Colour(0x2f, 0x8f, 0xd0), Outline::Polygon(24)),
    line("1", "1 capture", Colour(0x00, 0x59, 0x9c), Outline::Polygon(4)),
    line("2", "2 captures", Colour(0xc2, 0x4e, 0x00), Outline::Polygon(3)),
    line("4", "4 captures", Colour(0x7b, 0x3a, 0x9e), Outline::Turned(4)),
];

const fn line(
    captures_max: &'static str,
    words: &'static str,
    colour: Colour,
    outline: Outline,
) -> Line {
    Line { captures_max, words, colour, outline }
}

/// Means over the scenes of one setting under one fault.
struct Row {
    what: String,
    captures_max: String,
    steps: String,
    captures: f64,
    seconds: f64,
    ssim: f64,
    psnr_db: f64,
    photo_ssim: f64,
    photo_psnr_db: f64,
}

impl Row {
    /// The means of `point`, whose line is the limit on captures and whose setting is the steps.
    fn new(what: &str, point: &Point) -> Row {
        Row {
            what: what.to_owned(),
            captures_max: point.line.clone(),
            steps: point.setting.clone(),
            captures: point.mean(|s| s.captures as f64),
            seconds: point.computing_seconds(),
            ssim: point.ssim(),
            psnr_db: point.psnr_db(),
            photo_ssim: point.mean(|s| s.photo.ssim),
            photo_psnr_db: point.mean(|s| s.photo.psnr_db),
        }
    }

    fn cells(&self) -> Vec<String> {
        let mut cells = vec![self.what.clone(), self.captures_max.clone(), self.steps.clone()];
        cells.extend([format!("{:.1}", self.captures), format!("{:.2}", self.seconds)]);
        for (ssim, db) in [(self.ssim, self.psnr_db), (self.photo_ssim, self.photo_psnr_db)] {
            cells.extend([format!("{ssim:.4}"), format!("{db:.2}")]);
        }
        cells
    }

    fn of_cells(cells: &[String]) -> Option<Row> {
        let number = |n: usize| cells.get(n)?.parse::<f64>().ok();
        Some(Row {
            what: cells.first()?.clone(),
            captures_max: cells.get(1)?.clone(),
            steps: cells.get(2)?.clone(),
            captures: number(3)?,
            seconds: number(4)?,
            ssim: number(5)?,
            psnr_db: number(6)?,
            photo_ssim: number(7)?,
            photo_psnr_db: number(8)?,
        })
    }

    fn gain_db(&self) -> f64 {
        self.psnr_db - self.photo_psnr_db
    }
}

/// The lens model alone and with captures, each with several numbers of steps.
fn contestants(rig: &RigFile) -> Vec<Contestant> {
    let mut all = Vec::new();
    for (steps, correction_steps) in [(4, 2), (8, 2), (16, 4), (32, 8)] {
        for captures_max in [0, 1, 2, 4] {
            let method = if captures_max == 0 { MethodName::Digital } else { MethodName::Hybrid };
            let filed = Setting::as_filed(rig, method);
            let setting = Setting { steps, correction_steps, captures_max, ..filed };
            all.push(Contestant {
                line: captures_max.to_string(),
                setting: steps.to_string(),
                ..Contestant::of_setting(rig, &setting)
            });
        }
    }
    all
}

/// Measures every fault on the simulated rig of `rig`; `quick` takes two scenes.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let scenes = if quick { &SCENES[..2] } else { &SCENES };
    let mut rows: Vec<Row> = Vec::new();
    for (change, strength) in WRONG {
        let calibration = calibration(&change.filed(rig, strength))?;
        let mut harness = Harness::changed(rig, &calibration, change, strength)?;
        let mut trade = Trade::default();
        for contestant in contestants(rig) {
            let score = |&scene: &Scene| -> Result<Score, Failure> {
                let score = harness.score(scene, &*contestant.method)?;
                report(&contestant.name(), &score);
                Ok(score)
            };
            trade.add(&contestant, scenes.iter().map(score).collect::<Result<_, _>>()?);
        }
        let what = change.words(strength);
        rows.extend(trade.points.iter().map(|point| Row::new(&what, point)));
    }
    Ok(made(rig, &rows))
}

/// Draws stored rows.
pub(crate) fn redrawn(rig: &RigFile, rows: &str) -> Result<Made, Failure> {
    let rows = cells_of_csv(rows).into_iter().skip(1);
    let rows: Option<Vec<Row>> = rows.map(|cells| Row::of_cells(&cells)).collect();
    Ok(made(rig, &rows.ok_or("a row of the file is none of wrong-models")?))
}

fn made(rig: &RigFile, rows: &[Row]) -> Made {
    let stem = format!("{}-wrong-models", rig.name);
    let caption = format!("Gain of captures where the measured lens is wrong, rig {}.", rig.name);
    let mut all = Table::new(caption, &HEAD);
    rows.iter().for_each(|row| all.row(row.cells()));
    Made {
        tables: vec![(stem.clone(), summary(rig, rows)), (format!("{stem}-rows"), all)],
        drawings: vec![(stem, draw(rig, rows))],
        ..Made::default()
    }
}

/// The faults of `rows` in their order.
fn faults(rows: &[Row]) -> Vec<&str> {
    let mut faults: Vec<&str> = rows.iter().map(|row| row.what.as_str()).collect();
    faults.dedup();
    faults
}

/// Table of the settings with 16 steps.
fn summary(rig: &RigFile, rows: &[Row]) -> Table {
    let caption = format!(
        "Where the measured lens is wrong, rig {}: SSIM/dB of the photo, of the lens model alone \
         (16 steps), and with captures (4 steps for each correction); gain of two captures.",
        rig.name
    );
    let head = ["fault", "photo", "no capture", "1 capture", "2", "4", "gain of light"];
    let mut table = Table::new(caption, &head);
    for what in faults(rows) {
        let of = |captures: &str| {
            let is =
                |row: &&Row| row.what == what && row.steps == "16" && row.captures_max == captures;
            rows.iter().find(is)
        };
        let found: Option<Vec<&Row>> = LINES.iter().map(|line| of(line.captures_max)).collect();
        let Some(found) = found else { continue };
        let both = |ssim: f64, db: f64| format!("{ssim:.4}/{db:.2}");
        let (alone, two) = (found[0], found[2]);
        let mut cells = vec![what.to_owned(), both(alone.photo_ssim, alone.photo_psnr_db)];
        cells.extend(found.iter().map(|row| both(row.ssim, row.psnr_db)));
        let (ssim, db) = (two.ssim - alone.ssim, two.psnr_db - alone.psnr_db);
        cells.push(format!("{ssim:+.4}/{db:+.2}"));
        table.row(cells);
    }
    table
}

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 62.0;
const DOWN: [f64; 2] = [102.0, 372.0];
const BETWEEN: f64 = 14.0;

/// Draws a panel for each fault, side by side over one axis of gain.
fn draw(rig: &RigFile, rows: &[Row]) -> Drawing {
    let mut sheet = Drawing::light_and_dark(WIDTH, DOWN[1] + 62.0);
    let title = format!("Gain over the photo where the measured lens is wrong, rig {}", rig.name);
    sheet.words(&title, [LEFT, 26.0], Anchor::Start, 17.0);
    for (n, line) in LINES.iter().enumerate() {
        let x = LEFT + 6.0 + 130.0 * n as f64;
        let stroke = Stroke::new(line.colour, 1.4);
        sheet.line(&[[x - 6.0, 48.0], [x + 18.0, 48.0]], stroke);
        sheet.outline(&line.outline.corners([x + 6.0, 48.0], 4.5), Some(line.colour), stroke, "");
        sheet.words_in(line.colour, line.words, [x + 25.0, 52.0], Anchor::Start, 13.0);
    }
    let faults = faults(rows);
    let ends = |of: &dyn Fn(&Row) -> f64| {
        let values = rows.iter().map(of);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
    };
    let ([least, most], gains) = (ends(&|row| row.seconds), ends(&Row::gain_db));
    let width = (WIDTH - 16.0 - LEFT) / faults.len().max(1) as f64;
    for (n, what) in faults.iter().enumerate() {
        let left = LEFT + n as f64 * width;
        let axes = Axes {
            across: [left, left + width - BETWEEN],
            down: DOWN,
            seconds: [0.8 * least.max(1e-3), 1.25 * most],
            values: [gains[0].min(0.0) - 0.4, gains[1] + 0.4],
            scale: ValueScale::Linear,
        };
        axes.draw(&mut sheet, n == 0);
        for (line, words) in what.split(", ").enumerate() {
            let y = DOWN[0] - 20.0 + 14.0 * line as f64;
            sheet.words(words, [left + 2.0, y], Anchor::Start, 12.0);
        }
        let zero = axes.y(0.0);
        sheet.line(&[[left, zero], [axes.across[1], zero]], Stroke::new(HARM, 1.0).dashed());
        let own: Vec<&Row> = rows.iter().filter(|row| row.what == *what).collect();
        LINES.iter().for_each(|line| draw_line(&mut sheet, &axes, line, &own));
    }
    let middle = (LEFT + WIDTH) / 2.0;
    let words = "processor seconds a photo (logarithmic); along each line 4, 8, 16 and 32 steps";
    sheet.words(words, [middle, DOWN[1] + 38.0], Anchor::Middle, 13.0);
    sheet.words_upwards("gain over the photo, dB", [20.0, (DOWN[0] + DOWN[1]) / 2.0], 13.0);
    sheet
}

fn draw_line(sheet: &mut Drawing, axes: &Axes, line: &Line, rows: &[&Row]) {
    let is_own = |row: &&&Row| row.captures_max == line.captures_max;
    let mut own: Vec<&&Row> = rows.iter().filter(is_own).collect();
    own.sort_by_key(|row| row.steps.parse::<u32>().unwrap_or(0));
    let places: Vec<[f64; 2]> =
        own.iter().map(|row| [axes.x(row.seconds), axes.y(row.gain_db())]).collect();
    sheet.line(&places, Stroke::new(line.colour, 1.4));
    for (row, &place) in own.iter().zip(&places) {
        let (captures, gain) = (row.captures, row.gain_db());
        let tip = format!("{} steps, {captures:.1} captures: {gain:+.2} dB", row.steps);
        let outline = line.outline.corners(place, 4.0);
        sheet.outline(&outline, Some(line.colour), Stroke::new(INK, 0.4), &tip);
    }
}
