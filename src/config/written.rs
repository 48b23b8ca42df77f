//! The rig file as written, and what to say when it cannot be read as one.

use serde::Deserialize;

use super::ConfigError;
use super::appliance::{Disk, Keep, Nights, Run, Share};
use super::hardware::Hardware;
use super::parts::{Calibration, Camera, Canvas, Marks, Panel, Paper, Photo, Restore};
use super::simulation::{Display, Faults, LensGeometry, Pose, Sensor, Surface, Surround, Unrest};

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Written {
    pub(super) rig: RigTable,
    pub(super) photo: Photo,
    pub(super) panel: Panel,
    pub(super) camera: Camera,
    pub(super) canvas: Canvas,
    pub(super) marks: Option<Marks>,
    pub(super) calibration: Calibration,
    pub(super) restore: Restore,
    pub(super) paper: Paper,
    pub(super) run: Option<Run>,
    pub(super) nights: Option<Nights>,
    pub(super) disk: Option<Disk>,
    pub(super) keep: Option<Keep>,
    pub(super) share: Option<Share>,
    pub(super) simulation: Option<SimulationTable>,
    pub(super) lens: Option<LensTable>,
    pub(super) pose: Option<Pose>,
    pub(super) display: Option<Display>,
    pub(super) sensor: Option<Sensor>,
    pub(super) faults: Option<Faults>,
    pub(super) hardware: Option<Hardware>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct RigTable {
    pub(super) name: String,
    pub(super) kind: KindWord,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum KindWord {
    Simulated,
    Hardware,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct SimulationTable {
    pub(super) seed: u64,
    pub(super) surround: Surround,
    #[serde(default)]
    pub(super) unrest: Unrest,
}

/// `[lens]`: either `blur` or all of the prescription; which of them is checked afterwards.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct LensTable {
    pub(super) blur: Option<String>,
    pub(super) surface: Option<Vec<Surface>>,
    pub(super) stop_at_surface: Option<usize>,
    pub(super) stop_diameter_mm: Option<f64>,
    pub(super) object_distance_mm: Option<f64>,
    pub(super) focus_distance_mm: Option<f64>,
    pub(super) scene_distance_mm: Option<f64>,
    pub(super) pixel_pitch_um: Option<f64>,
    pub(super) support_px: Option<usize>,
    pub(super) node_columns: Option<usize>,
    pub(super) node_rows: Option<usize>,
    pub(super) geometry: Option<LensGeometry>,
    pub(super) dark_corner: Option<bool>,
    pub(super) axis_offset_px: Option<[f64; 2]>,
    pub(super) glare_share: f32,
    #[serde(alias = "glare-radius")]
    pub(super) glare_radius_px: f32,
}

/// Reads `text`, called `file` in messages.
pub(super) fn read(text: &str, file: &str) -> Result<Written, ConfigError> {
    toml::from_str(text).map_err(|error| explain(text, file, &error))
}

/// The parser's error in our words: with the line, and with the nearest known key for an unknown
/// one.
fn explain(text: &str, file: &str, error: &toml::de::Error) -> ConfigError {
    let start = error.span().map_or(0, |span| span.start.min(text.len()));
    let line = 1 + text.as_bytes()[..start].iter().filter(|&&byte| byte == b'\n').count();
    let what = error.message();
    // serde words it "unknown field `found`, expected one of `a`, `b`"; a test holds us to that.
    if what.starts_with("unknown field") {
        let mut quoted = what.split('`').skip(1).step_by(2);
        let key = quoted.next().unwrap_or_default().to_owned();
        let known: Vec<&str> = quoted.collect();
        let nearest =
            known.iter().min_by_key(|known| distance(&key, known)).copied().unwrap_or_default();
        let nearest = if distance(&key, nearest) <= key.len().max(nearest.len()) / 2 {
            format!("the nearest known one is `{nearest}`")
        } else {
            format!("known here are {}", known.join(", "))
        };
        return ConfigError::UnknownKey { file: file.to_owned(), line, key, nearest };
    }
    ConfigError::Text { file: file.to_owned(), line, what: what.replace("field", "key") }
}

/// Edit distance (Levenshtein 1966) between two words, for naming the nearest known one.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &y) in b.iter().enumerate() {
            let change = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::distance;

    #[test]
    fn distances_count_edits() {
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("settle-ms", "settle-ms"), 0);
    }
}
