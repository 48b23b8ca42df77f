//! Keys of a rig file, each declared once for parsing, validation, defaults and
//! `rig-config/README.md`.
//!
//! `table!` declares a struct and its [`TableKeys`], `words!` an enum and its words. A field is
//! followed by its [`Allowed`] values and its meaning when [`LeftOut`]; its doc comment documents
//! the key. A field that is [`Allowed::Fixed`] is not a key: it is constant or computed from keys.

use toml::Value;

/// A table of the rig file.
#[derive(Debug)]
pub(super) struct TableKeys {
    /// Summary for `rig-config/README.md`.
    #[cfg_attr(not(test), allow(dead_code))]
    pub(super) about: &'static str,
    /// Keys and nested tables.
    pub(super) keys: &'static [Key],
}

/// A key of a table, or a nested table.
#[derive(Debug)]
pub(super) struct Key {
    /// Field name; the key has `-` for `_`.
    pub(super) field: &'static str,
    /// Documentation of the field.
    pub(super) meaning: &'static str,
    pub(super) allowed: Allowed,
    pub(super) left_out: LeftOut,
}

impl Key {
    /// Name in rig files.
    pub(super) fn name(&self) -> String {
        self.field.replace('_', "-")
    }

    /// Whether a rig file may contain it.
    pub(super) fn is_written(&self) -> bool {
        !matches!(self.allowed, Allowed::Fixed)
    }
}

/// Meaning of a key that a file leaves out.
#[derive(Debug, Clone, Copy)]
pub(super) enum LeftOut {
    /// An error: the key is a quantity of the rig or a decision of its builder.
    Never,
    /// A default value, as TOML; `{}` for a table of defaults.
    Means(&'static str),
    /// No value, or a computed one; described in words for `rig-config/README.md`.
    #[cfg_attr(not(test), allow(dead_code))]
    Says(&'static str),
}

/// Keys of a table whose `kind` is `word`.
#[derive(Debug)]
pub(super) struct KindKeys {
    pub(super) word: &'static str,
    pub(super) keys: &'static TableKeys,
    /// Whether a table without `kind` is of this kind.
    pub(super) is_default: bool,
}

/// A word allowed as a value.
#[derive(Debug)]
pub(super) struct Word {
    pub(super) word: &'static str,
    /// Documentation for `rig-config/README.md`.
    #[cfg_attr(not(test), allow(dead_code))]
    pub(super) meaning: &'static str,
}

/// Values a key may have; bounds are inclusive.
#[derive(Debug)]
pub(super) enum Allowed {
    /// Nothing: the field is no key of the file.
    Fixed,
    Whole(i64, i64),
    /// An odd whole number.
    Odd(i64, i64),
    /// One of these whole numbers.
    Of(&'static [i64]),
    Number(f64, f64),
    MoreThan(f64),
    /// `true` or `false`.
    Truth,
    Word(&'static [Word]),
    /// Any text; rules across keys may restrict it.
    Text,
    /// Values accepted by the predicate, which the words describe.
    Such(&'static str, fn(&Value) -> bool),
    Table(&'static TableKeys),
    /// An array of tables.
    Tables(&'static TableKeys),
    /// A table whose keys depend on its `kind`.
    ByKind(&'static [KindKeys]),
}

impl Allowed {
    /// Description of the allowed values if `value` is not one of them.
    pub(super) fn instead_of(&self, value: &Value) -> Option<String> {
        let whole = value.as_integer();
        let kind = match self {
            Allowed::Whole(..) if whole.is_none() => "a whole number, ",
            Allowed::Number(..) | Allowed::MoreThan(_) if number(value).is_none() => "a number, ",
            _ => "",
        };
        let is_allowed = match self {
            Allowed::Whole(low, high) => whole.is_some_and(|found| (low..=high).contains(&&found)),
            Allowed::Odd(low, high) => {
                whole.is_some_and(|found| found % 2 == 1 && (low..=high).contains(&&found))
            }
            Allowed::Of(these) => whole.is_some_and(|found| these.contains(&found)),
            Allowed::Number(low, high) => {
                number(value).is_some_and(|found| (low..=high).contains(&&found))
            }
            Allowed::MoreThan(low) => number(value).is_some_and(|found| found > *low),
            Allowed::Truth => value.is_bool(),
            Allowed::Word(words) => {
                value.as_str().is_some_and(|found| words.iter().any(|one| one.word == found))
            }
            Allowed::Text => value.is_str(),
            Allowed::Such(_, accepts) => accepts(value),
            Allowed::Fixed => true,
            Allowed::Table(_) | Allowed::Tables(_) | Allowed::ByKind(_) => false,
        };
        (!is_allowed).then(|| format!("{kind}{self}"))
    }
}

impl std::fmt::Display for Allowed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Allowed::Whole(low, i64::MAX) => write!(f, "{low} or more"),
            Allowed::Whole(low, high) => write!(f, "{low} to {high}"),
            Allowed::Odd(low, high) => write!(f, "an odd number, {low} to {high}"),
            Allowed::Of(these) => f.write_str(&either(these.iter().map(i64::to_string))),
            Allowed::Number(low, high) => write!(f, "{low} to {high}"),
            Allowed::MoreThan(low) => write!(f, "more than {low}"),
            Allowed::Truth => f.write_str("true or false"),
            Allowed::Word(words) => {
                f.write_str(&either(words.iter().map(|one| format!("\"{}\"", one.word))))
            }
            Allowed::Fixed => f.write_str("nothing"),
            Allowed::Text => f.write_str("a text in quotes"),
            Allowed::Such(words, _) => f.write_str(words),
            Allowed::Table(_) | Allowed::ByKind(_) => f.write_str("a table"),
            Allowed::Tables(_) => f.write_str("tables, each under its name in double brackets"),
        }
    }
}

/// The words of `kinds`, quoted.
pub(super) fn kind_words(kinds: &[KindKeys]) -> String {
    either(kinds.iter().map(|kind| format!("\"{}\"", kind.word)))
}

/// `a, b or c`.
fn either(all: impl Iterator<Item = String>) -> String {
    let all: Vec<String> = all.collect();
    match all.split_last() {
        Some((last, first)) if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => all.concat(),
    }
}

/// A number, whole or fractional.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// Whether `value` is an array of `count` numbers within `low..=high`.
pub(super) fn numbers(value: &Value, count: usize, low: f64, high: f64) -> bool {
    let inside = |one| number(one).is_some_and(|found| (low..=high).contains(&found));
    value.as_array().is_some_and(|all| all.len() == count && all.iter().all(inside))
}

/// A struct parsed from a table of the rig file, with its [`TableKeys`] as `TABLE`. `@[…]` is an
/// attribute.
macro_rules! table {
    ($(#[doc = $about:literal])* $(@[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[doc = $doc:literal])* $(@[$inner:meta])*
            $field:ident: $type:ty, $allowed:expr, $left_out:expr;)*
    }) => {
        $(#[doc = $about])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(rename_all = "kebab-case", deny_unknown_fields)]
        $(#[$meta])*
        $vis struct $name { $($(#[doc = $doc])* $(#[$inner])* $vis $field: $type,)* }

        impl $name {
            pub(super) const TABLE: $crate::config::keys::TableKeys = {
                #[allow(unused_imports)]
                use $crate::config::keys::{Allowed::*, LeftOut::*};
                $crate::config::keys::TableKeys {
                    about: concat!($($about),*),
                    keys: &[$($crate::config::keys::Key {
                        field: stringify!($field),
                        meaning: concat!($($doc),*),
                        allowed: $allowed,
                        left_out: $left_out,
                    }),*],
                }
            };
        }
    };
}

/// An enum whose variants are words of the rig file. `@[…]` is an attribute.
macro_rules! words {
    ($(#[doc = $about:literal])* $(@[$meta:meta])* $vis:vis enum $name:ident {
        $($(#[doc = $doc:literal])* $(@[$inner:meta])* $variant:ident = $word:literal,)*
    }) => {
        $(#[doc = $about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        $(#[$meta])*
        $vis enum $name {
            $($(#[doc = $doc])* $(#[$inner])* #[serde(rename = $word)] $variant,)*
        }

        impl $name {
            pub(super) const WORDS: &'static [$crate::config::keys::Word] =
                &[$($crate::config::keys::Word { word: $word, meaning: concat!($($doc),*) }),*];

            /// All variants.
            #[allow(dead_code)]
            $vis const ALL: [$name; $name::WORDS.len()] = [$($name::$variant),*];

            /// Word in rig files.
            #[allow(dead_code)]
            $vis const fn name(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }
        }
    };
}

pub(super) use {table, words};
