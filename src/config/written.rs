//! Parsing: checks each key and value by its declaration ([`keys`](super::keys)) and fills in
//! defaults and computed values.

use strsim::levenshtein;
use toml::Value;

use super::appliance::{DiskTable, Nights, RunTable};
use super::error::ConfigError;
use super::hardware::Hardware;
use super::keys::{Allowed, Key, KindKeys, LeftOut, TableKeys, kind_words, number, table};
use super::parts::{
    CalibrationTable, CameraTable, CanvasTable, Marks, PanelTable, PaperTable, PhotoTable, Restore,
};
use super::places::{Places, joined};
use super::simulation::{DisplayTable, Faults, LensTable, Pose, SensorTable, SimulationTable};

const NOT_HARDWARE: &str = "the rig is not made of hardware";
const NOT_SIMULATED: &str = "the rig is not simulated";
/// Deadline of a frame in exposures, where the file gives none. Guess.
const DEADLINE_EXPOSURES: f64 = 10.0;
/// Side of the paper's patches, pixels, for a photo [`PATCH_PHOTO_PX`] wide (§4.1).
const PATCH_PX: i64 = 80;
const PATCH_PHOTO_PX: i64 = 1024;

table! {
    /// The rig file.
    pub(super) struct RigTables {
        /// Name of the rig.
        rig: RigTable, Table(&RigTable::TABLE), Never;
        /// Photos.
        photo: PhotoTable, Table(&PhotoTable::TABLE), Means("{}");
        /// Display.
        panel: PanelTable, Table(&PanelTable::TABLE), Never;
        /// Sensor, and the photo's place on it.
        camera: CameraTable, Table(&CameraTable::TABLE), Never;
        /// Grid of the solver.
        canvas: CanvasTable, Table(&CanvasTable::TABLE), Means("{}");
        /// Frame marks.
        marks: Option<Marks>, Table(&Marks::TABLE),
            Says("frames are matched to pictures by time alone");
        /// Calibration.
        calibration: CalibrationTable, Table(&CalibrationTable::TABLE), Never;
        /// Restoration.
        restore: Restore, Table(&Restore::TABLE), Means("{}");
        /// Parameters of the method `paper`.
        paper: PaperTable, Table(&PaperTable::TABLE), Means("{}");
        /// Start of a restoration.
        run: RunTable, Table(&RunTable::TABLE), Means("{}");
        /// Restoration at night and drift monitoring.
        nights: Option<Nights>, Table(&Nights::TABLE),
            Says("photos are restored at any time and drift is not monitored");
        /// Disk space.
        disk: DiskTable, Table(&DiskTable::TABLE), Means("{}");
        /// Devices of a real rig.
        hardware: Option<Hardware>, Table(&Hardware::TABLE), Says(NOT_HARDWARE);
        /// Simulation as a whole.
        simulation: Option<SimulationTable>, Table(&SimulationTable::TABLE), Says(NOT_SIMULATED);
        /// Simulated lens.
        lens: Option<LensTable>, Table(&LensTable::TABLE), Says(NOT_SIMULATED);
        /// Pose of the simulated panel.
        pose: Option<Pose>, Table(&Pose::TABLE), Says(NOT_SIMULATED);
        /// Simulated display.
        display: Option<DisplayTable>, Table(&DisplayTable::TABLE), Says(NOT_SIMULATED);
        /// Simulated sensor.
        sensor: Option<SensorTable>, Table(&SensorTable::TABLE), Says(NOT_SIMULATED);
        /// Simulated faults.
        faults: Faults, Table(&Faults::TABLE), Means("{}");
    }
}

table! {
    /// Name of the rig. It is made of devices if the file has `[hardware]`, else simulated.
    pub(super) struct RigTable {
        /// Name in reports.
        name: String, Text, Never;
    }
}

/// Checks the table `found` at `path` by its declared keys and fills in defaults.
fn complete(
    places: &Places,
    path: &str,
    found: &mut toml::Table,
    declared: &TableKeys,
) -> Result<(), ConfigError> {
    let written = declared.keys.iter().filter(|key| key.is_written());
    let names: Vec<String> = written.map(Key::name).collect();
    if let Some(unknown) = found.keys().find(|name| !names.contains(name)) {
        let at = places.of(&joined(path, unknown));
        let what = format!("unknown key `{unknown}`; {}", nearest(unknown, &names));
        return Err(ConfigError::Invalid { at, what });
    }
    for key in declared.keys {
        let at = joined(path, &key.name());
        if !found.contains_key(&key.name()) {
            fill_in(places, path, found, key)?;
        }
        if let Some(value) = found.get_mut(&key.name()) {
            check_value(places, &at, value, &key.allowed)?;
        }
    }
    Ok(())
}

/// Inserts the default of `key`, which the table `found` at `path` lacks.
fn fill_in(
    places: &Places,
    path: &str,
    found: &mut toml::Table,
    key: &Key,
) -> Result<(), ConfigError> {
    match key.left_out {
        LeftOut::Says(_) => Ok(()),
        LeftOut::Means(text) => {
            let value = text.parse().map_err(|error| places.not_toml(&error, text))?;
            found.insert(key.name(), value);
            Ok(())
        }
        LeftOut::Never => {
            let at = joined(path, &key.name());
            let what = match key.allowed {
                Allowed::Table(_) | Allowed::ByKind(_) => format!("table `[{at}]`"),
                _ => format!("key `{}` in [{path}]", key.name()),
            };
            let meaning = key.meaning.trim();
            let what = format!("missing {what}, which has no default: {meaning}");
            Err(ConfigError::Invalid { at: places.of(&at), what })
        }
    }
}

/// Checks the value at `at`, and a table's keys in turn.
fn check_value(
    places: &Places,
    at: &str,
    value: &mut Value,
    allowed: &Allowed,
) -> Result<(), ConfigError> {
    match (allowed, value) {
        (Allowed::Table(inner), Value::Table(table)) => complete(places, at, table, inner),
        (Allowed::ByKind(kinds), Value::Table(table)) => complete_kind(places, at, table, kinds),
        (Allowed::Tables(inner), Value::Array(all)) => {
            all.iter_mut().enumerate().try_for_each(|(n, one)| match one {
                Value::Table(table) => complete(places, &format!("{at}[{n}]"), table, inner),
                other => Err(places.broken(at, other, allowed)),
            })
        }
        (allowed, value) => match allowed.instead_of(value) {
            Some(instead) => Err(places.broken(at, value, instead)),
            None => Ok(()),
        },
    }
}

/// [`complete`] for a table whose keys depend on its `kind`.
fn complete_kind(
    places: &Places,
    path: &str,
    found: &mut toml::Table,
    kinds: &[KindKeys],
) -> Result<(), ConfigError> {
    let word = found.remove("kind");
    let is_kind = |kind: &&KindKeys| match &word {
        Some(word) => word.as_str() == Some(kind.word),
        None => kind.is_default,
    };
    let Some(kind) = kinds.iter().find(is_kind) else {
        let found = word.map_or("nothing".to_owned(), |word| word.to_string());
        return Err(places.broken(&joined(path, "kind"), found, kind_words(kinds)));
    };
    complete(places, path, found, kind.keys)?;
    found.insert("kind".to_owned(), kind.word.into());
    Ok(())
}

/// A hint that names the nearest of `names` to `key`, or lists them all.
fn nearest(key: &str, names: &[String]) -> String {
    match names.iter().min_by_key(|name| levenshtein(key, name)) {
        Some(name) if levenshtein(key, name) <= key.len().max(name.len()) / 2 => {
            format!("the nearest known one is `{name}`")
        }
        _ => format!("known here are {}", names.join(", ")),
    }
}

/// Parses `text`, called `file` in messages.
pub(super) fn read(text: &str, file: &str) -> Result<(RigTables, Places), ConfigError> {
    let places = Places::find(text, file)?;
    let mut whole: toml::Table =
        toml::from_str(text).map_err(|error| places.not_toml(&error, text))?;
    complete(&places, "", &mut whole, &RigTables::TABLE)?;
    derive(&mut whole);
    // Every key was checked, so a failure here is a bug.
    let tables = Value::Table(whole).try_into().map_err(|error| places.not_toml(&error, text))?;
    Ok((tables, places))
}

/// Fills in the values that follow from other keys.
fn derive(whole: &mut toml::Table) {
    let radius_px = whole_of(whole, "calibration", "function-support-px") / 2;
    set_if_missing(whole, "canvas", "margin-px", radius_px.into());
    set_if_missing(whole, "paper", "margin-px", radius_px.into());
    let by = whole_of(whole, "camera", "binning").max(1);
    let margin_px = by * whole_of(whole, "canvas", "margin-px");
    for (size, place) in [("width-px", "photo-x-px"), ("height-px", "photo-y-px")] {
        let sensor_px = whole_of(whole, "camera", size);
        let photo_px = (sensor_px - 2 * margin_px).max(0);
        set_if_missing(whole, "photo", size, photo_px.into());
        let margin_px = (sensor_px - whole_of(whole, "photo", size)).max(0) / 2;
        set_if_missing(whole, "camera", place, (margin_px / by * by).into());
    }
    let exposure = whole.get("camera").and_then(|camera| camera.get("exposure-ms"));
    let exposure_ms = exposure.and_then(number).unwrap_or_default();
    set_if_missing(whole, "camera", "deadline-ms", (DEADLINE_EXPOSURES * exposure_ms).into());
    let patch_px = whole_of(whole, "photo", "width-px") / by * PATCH_PX / PATCH_PHOTO_PX;
    set_if_missing(whole, "paper", "patch-px", patch_px.clamp(4, PATCH_PX).into());
}

fn whole_of(whole: &toml::Table, table: &str, key: &str) -> i64 {
    let value = whole.get(table).and_then(|table| table.get(key));
    value.and_then(Value::as_integer).unwrap_or_default()
}

/// Sets `key` of `table` if the table exists and lacks the key.
fn set_if_missing(whole: &mut toml::Table, table: &str, key: &str, value: Value) {
    if let Some(Value::Table(table)) = whole.get_mut(table) {
        table.entry(key).or_insert(value);
    }
}
