//! Lines of the keys of a rig file, and error messages that name them.

use std::collections::BTreeMap;
use std::fmt::Display;

use toml::de::{DeTable, DeValue};

use super::error::ConfigError;

/// Characters shown of a line that cannot be parsed.
const SHOWN: usize = 60;
/// Description of the lines allowed.
const LINES: &str = "a table as [camera], or a key and its value as key = 1.5, key = \"words\", \
                     key = true or key = [1, 2]";

/// Name of a rig file and the lines of its keys.
pub(super) struct Places {
    pub(super) file: String,
    lines: BTreeMap<String, usize>,
}

impl Places {
    /// Lines of the keys in `text`, called `file` in messages.
    pub(super) fn find(text: &str, file: &str) -> Result<Places, ConfigError> {
        let mut places = Places { file: file.to_owned(), lines: BTreeMap::new() };
        let spanned = DeTable::parse(text).map_err(|error| places.not_toml(&error, text))?;
        places.note("", spanned.get_ref(), text);
        Ok(places)
    }

    /// File and line of `key`, or of its table.
    pub(super) fn of(&self, key: &str) -> String {
        let table = key.rsplit_once('.').map_or("", |(table, _)| table);
        match self.lines.get(key).or_else(|| self.lines.get(table)) {
            Some(line) => format!("{}:{line}", self.file),
            None => self.file.clone(),
        }
    }

    /// Error about the value of `key`.
    pub(super) fn broken(
        &self,
        key: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> ConfigError {
        let what = format!("{key}: found {found}, allowed {allowed}");
        ConfigError::Invalid { at: self.of(key), what }
    }

    fn note(&mut self, path: &str, table: &DeTable, text: &str) {
        for (key, value) in table.iter() {
            let path = joined(path, key.get_ref());
            let line = line_at(text, key.span().start);
            match value.get_ref() {
                DeValue::Table(inner) => self.note(&path, inner, text),
                DeValue::Array(all) => {
                    for (n, one) in all.iter().enumerate() {
                        if let DeValue::Table(inner) = one.get_ref() {
                            self.note(&format!("{path}[{n}]"), inner, text);
                        }
                    }
                }
                _ => {}
            }
            self.lines.insert(path, line);
        }
    }

    /// Returns the error about `key` unless `rule` holds.
    pub(super) fn hold(
        &self,
        rule: bool,
        key: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Result<(), ConfigError> {
        if rule { Ok(()) } else { Err(self.broken(key, found, allowed)) }
    }

    /// Error about the line of `text` that is not TOML.
    pub(super) fn not_toml(&self, error: &toml::de::Error, text: &str) -> ConfigError {
        let line = line_at(text, error.span().map_or(0, |span| span.start.min(text.len())));
        let at = format!("{}:{line}", self.file);
        let named = error.span().and_then(|span| text.get(span)).unwrap_or_default();
        // The parser's messages are written for programmers.
        if error.message().contains("duplicate key") {
            let what = format!("found `{named}` twice, allowed each key once in its table");
            return ConfigError::Invalid { at, what };
        }
        let written = text.lines().nth(line - 1).unwrap_or_default().trim();
        let found = match written.char_indices().nth(SHOWN) {
            Some((end, _)) => format!("`{} …`", &written[..end]),
            None => format!("`{written}`"),
        };
        ConfigError::Invalid { at, what: format!("found {found}, allowed {LINES}") }
    }
}

/// Number of the line of `text` with byte `at`.
fn line_at(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at].iter().filter(|&&byte| byte == b'\n').count()
}

/// Path of the key `name` in the table `path`.
pub(super) fn joined(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}
