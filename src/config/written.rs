//! The rig file as written: each key is known, each value is allowed by itself, and what is left
//! out is filled in. The keys say how ([`keys`](super::keys)).

use toml::Value;

use super::appliance::{DiskTable, Keep, Nights, RunTable};
use super::error::ConfigError;
use super::hardware::Hardware;
use super::keys::{Allowed, KindKeys, LeftOut, TableKeys, kind_words, table, words};
use super::parts::{
    CalibrationTable, CameraTable, CanvasTable, Marks, PanelTable, PaperTable, PhotoTable, Restore,
};
use super::places::{Places, joined};
use super::simulation::{DisplayTable, Faults, LensTable, Pose, SensorTable, SimulationTable};

const REAL: &str = "it is not a rig of real devices";
const NOT_REAL: &str = "it is not a simulated rig";

table! {
    /// The rig file.
    pub(super) struct RigTables {
        /// What the rig is.
        rig: RigTable, Table(&RigTable::TABLE), Never;
        /// The customer's photos.
        photo: PhotoTable, Table(&PhotoTable::TABLE), Never;
        /// The display.
        panel: PanelTable, Table(&PanelTable::TABLE), Never;
        /// The sensor, and where the photo lies on it.
        camera: CameraTable, Table(&CameraTable::TABLE), Never;
        /// The grid the solver works on.
        canvas: CanvasTable, Table(&CanvasTable::TABLE), Never;
        /// Where the frame marks are.
        marks: Option<Marks>, Table(&Marks::TABLE), Says("a frame is trusted by its time alone");
        /// How the rig is measured.
        calibration: CalibrationTable, Table(&CalibrationTable::TABLE), Never;
        /// How photos are restored.
        restore: Restore, Table(&Restore::TABLE), Means("{}");
        /// The paper's own parameters.
        paper: PaperTable, Table(&PaperTable::TABLE), Means("{}");
        /// Who says when photos are restored.
        run: RunTable, Table(&RunTable::TABLE), Means("{}");
        /// When photos are restored, and how drift is watched.
        nights: Option<Nights>, Table(&Nights::TABLE),
            Says("photos are restored at any time, and no drift is watched");
        /// What is asked of the disk.
        disk: DiskTable, Table(&DiskTable::TABLE), Means("{}");
        /// How long results and originals are kept.
        keep: Option<Keep>, Table(&Keep::TABLE), Says("everything is kept for ever");
        /// The devices of a real rig.
        hardware: Option<Hardware>, Table(&Hardware::TABLE), Says(REAL);
        /// What a simulated rig is simulated with.
        simulation: Option<SimulationTable>, Table(&SimulationTable::TABLE), Says(NOT_REAL);
        /// The simulated lens.
        lens: Option<LensTable>, Table(&LensTable::TABLE), Says(NOT_REAL);
        /// Where the simulated panel stands.
        pose: Option<Pose>, Table(&Pose::TABLE), Says(NOT_REAL);
        /// The simulated display's physics.
        display: Option<DisplayTable>, Table(&DisplayTable::TABLE), Says(NOT_REAL);
        /// The simulated sensor's physics.
        sensor: Option<SensorTable>, Table(&SensorTable::TABLE), Says(NOT_REAL);
        /// How often things go wrong in the simulation.
        faults: Faults, Table(&Faults::TABLE), Means("{}");
    }
}

table! {
    /// What the rig is.
    pub(super) struct RigTable {
        /// Its name, for reports.
        name: String, Text, Never;
        /// What it is made of.
        kind: KindWord, Word(KindWord::WORDS), Never;
    }
}

words! {
    /// What a rig is made of.
    pub(super) enum KindWord {
        /// Physics by computing.
        Simulated = "simulated",
        /// Devices.
        Hardware = "hardware",
    }
}

/// Holds `found`, the table at `path`, against what `known` says of its keys, and fills in
/// what is left out.
fn complete(
    places: &Places,
    path: &str,
    found: &mut toml::Table,
    known: &TableKeys,
) -> Result<(), ConfigError> {
    for (alias, name) in [("glare-radius", "glare-radius-px")] {
        if path == "lens" && !found.contains_key(name) {
            let value = found.remove(alias);
            found.extend(value.map(|value| (name.to_owned(), value)));
        }
    }
    let names: Vec<String> = known.keys.iter().map(|key| key.name()).collect();
    if let Some(unknown) = found.keys().find(|name| !names.contains(name)) {
        let at = places.of(&joined(path, unknown));
        return Err(ConfigError::UnknownKey {
            at,
            key: unknown.clone(),
            nearest: nearest(unknown, &names),
        });
    }
    for (key, name) in known.keys.iter().zip(names) {
        let at = joined(path, &name);
        if !found.contains_key(&name) {
            match key.left_out {
                LeftOut::Says(_) => continue,
                LeftOut::Means(text) => {
                    let value = text.parse().map_err(|error| places.not_toml(&error, text))?;
                    found.insert(name.clone(), value);
                }
                LeftOut::Never => {
                    let what = match key.allowed {
                        Allowed::Table(_) | Allowed::ByKind(_) => format!("table `[{at}]`"),
                        _ => format!("key `{name}` in [{path}]"),
                    };
                    let meaning = key.meaning.trim().to_owned();
                    return Err(ConfigError::Missing { at: places.of(&at), what, meaning });
                }
            }
        }
        let Some(value) = found.get_mut(&name) else { continue };
        match (&key.allowed, value) {
            (Allowed::Table(inner), Value::Table(table)) => complete(places, &at, table, inner)?,
            (Allowed::ByKind(kinds), Value::Table(table)) => of_kind(places, &at, table, kinds)?,
            (Allowed::Tables(inner), Value::Array(all)) => {
                for (n, one) in all.iter_mut().enumerate() {
                    match one {
                        Value::Table(table) => {
                            complete(places, &format!("{at}[{n}]"), table, inner)?;
                        }
                        other => return Err(places.broken(&at, other, &key.allowed)),
                    }
                }
            }
            (allowed, value) => {
                if let Some(instead) = allowed.instead_of(value) {
                    return Err(places.broken(&at, value, instead));
                }
            }
        }
    }
    Ok(())
}

/// [`complete`] for a table whose keys depend on its kind, which is filled in as well.
fn of_kind(
    places: &Places,
    path: &str,
    found: &mut toml::Table,
    kinds: &[KindKeys],
) -> Result<(), ConfigError> {
    let said = found.remove("kind");
    let kind = match &said {
        Some(word) => kinds.iter().find(|kind| Some(kind.word) == word.as_str()),
        None => kinds.iter().find(|kind| kind.unless_said),
    };
    let at = joined(path, "kind");
    let Some(kind) = kind else {
        let found = said.map_or("nothing".to_owned(), |word| word.to_string());
        return Err(places.broken(&at, found, kind_words(kinds)));
    };
    complete(places, path, found, kind.keys)?;
    found.insert("kind".to_owned(), kind.word.into());
    Ok(())
}

/// The nearest of `names` to `key`, or all of them, in words.
fn nearest(key: &str, names: &[String]) -> String {
    match names.iter().min_by_key(|name| edit_distance(key, name)) {
        Some(name) if edit_distance(key, name) <= key.len().max(name.len()) / 2 => {
            format!("the nearest known one is `{name}`")
        }
        _ => format!("known here are {}", names.join(", ")),
    }
}

/// Reads `text`, called `file` in messages.
pub(super) fn read(text: &str, file: &str) -> Result<(RigTables, Places), ConfigError> {
    let places = Places::find(text, file)?;
    let mut whole: toml::Table =
        toml::from_str(text).map_err(|error| places.not_toml(&error, text))?;
    complete(&places, "", &mut whole, &RigTables::TABLE)?;
    derive(&mut whole);
    // The keys have been checked one by one: what is left to say is a mistake of this program's.
    let tables = Value::Table(whole).try_into().map_err(|error| places.not_toml(&error, text))?;
    Ok((tables, places))
}

/// Fills in what follows from other keys.
fn derive(whole: &mut toml::Table) {
    let number = |table: &str, key: &str| {
        whole.get(table).and_then(|table| table.get(key)).and_then(Value::as_integer).unwrap_or(0)
    };
    let patch = (number("photo", "width-px") * 80 / 1024).max(4);
    let margin = number("calibration", "function-support-px") / 2;
    if let Some(Value::Table(paper)) = whole.get_mut("paper") {
        paper.entry("patch-px").or_insert(Value::Integer(patch));
        paper.entry("margin-px").or_insert(Value::Integer(margin));
    }
}

/// Edit distance (Levenshtein 1966) between two words, for naming the nearest known one.
pub fn edit_distance(a: &str, b: &str) -> usize {
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
    use super::edit_distance;

    #[test]
    fn distances_count_edits() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("settle-ms", "settle-ms"), 0);
    }
}
