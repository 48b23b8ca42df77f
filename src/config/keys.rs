//! What a key of a rig file may be: said once, where its field is, for reading, checking, filling
//! in and `rig-config/README.md`.
//!
//! `table!` makes a struct and its [`TableKeys`] from one list, `words!` an enum and its words. A
//! field is followed by what is [`Allowed`] and by what it means to be [`LeftOut`]; its
//! documentation is the key's.

use toml::Value;

/// A table of the rig file.
#[derive(Debug)]
pub(super) struct TableKeys {
    /// What it is.
    #[cfg_attr(not(test), allow(dead_code))] // For rig-config/README.md.
    pub(super) about: &'static str,
    /// Its keys, and the tables in it.
    pub(super) keys: &'static [Key],
}

/// A key of a table, or a table within it.
#[derive(Debug)]
pub(super) struct Key {
    /// The field; the key has `-` for its `_`.
    pub(super) field: &'static str,
    /// What it is.
    pub(super) meaning: &'static str,
    pub(super) allowed: Allowed,
    pub(super) left_out: LeftOut,
}

impl Key {
    /// The name in rig files.
    pub(super) fn name(&self) -> String {
        self.field.replace('_', "-")
    }
}

/// What a key left out means.
#[derive(Debug, Clone, Copy)]
pub(super) enum LeftOut {
    /// An error: this is a quantity of the rig, or a decision of its builder.
    Never,
    /// This value, as TOML. `{}` for a table: its keys' defaults.
    Means(&'static str),
    /// No value; what happens then, in words.
    #[cfg_attr(not(test), allow(dead_code))] // For rig-config/README.md.
    Says(&'static str),
}

/// The keys that a table has when its key `kind` has that word.
#[derive(Debug)]
pub(super) struct KindKeys {
    pub(super) word: &'static str,
    pub(super) keys: &'static TableKeys,
    /// Whether a table without `kind` is of this one.
    pub(super) unless_said: bool,
}

/// A word of a rig file.
#[derive(Debug)]
pub(super) struct Word {
    pub(super) word: &'static str,
    #[cfg_attr(not(test), allow(dead_code))] // For rig-config/README.md.
    pub(super) meaning: &'static str,
}

/// What may stand for a value. Bounds belong to what is allowed.
#[derive(Debug)]
pub(super) enum Allowed {
    Whole(i64, i64),
    /// An odd one.
    Odd(i64, i64),
    /// A whole number of these.
    Of(&'static [i64]),
    Number(f64, f64),
    MoreThan(f64),
    /// `true` or `false`.
    Truth,
    Word(&'static [Word]),
    /// Any text in quotes; rules may ask more of it.
    Text,
    /// What the words say.
    Such(&'static str, fn(&Value) -> bool),
    Table(&'static TableKeys),
    /// Any number of such tables.
    Tables(&'static TableKeys),
    /// A table whose keys depend on its kind.
    ByKind(&'static [KindKeys]),
}

impl Allowed {
    /// What is allowed in place of `value`, when `value` is not.
    pub(super) fn instead_of(&self, value: &Value) -> Option<String> {
        let (kind, of_the_kind, allowed) = match self {
            Allowed::Whole(low, high) => {
                let whole = value.as_integer();
                let inside = whole.is_some_and(|found| (low..=high).contains(&&found));
                ("a whole number, ", whole.is_some(), inside)
            }
            Allowed::Odd(low, high) => {
                let odd = |found: i64| found % 2 == 1 && (low..=high).contains(&&found);
                ("", true, value.as_integer().is_some_and(odd))
            }
            Allowed::Of(these) => {
                ("", true, value.as_integer().is_some_and(|found| these.contains(&found)))
            }
            Allowed::Number(low, high) => {
                let inside = number(value).is_some_and(|found| (low..=high).contains(&&found));
                ("a number, ", number(value).is_some(), inside)
            }
            Allowed::MoreThan(low) => {
                let above = number(value).is_some_and(|found| found > *low);
                ("a number, ", number(value).is_some(), above)
            }
            Allowed::Truth => ("", true, value.is_bool()),
            Allowed::Word(words) => {
                let one = |found: &str| words.iter().any(|known| known.word == found);
                ("", true, value.as_str().is_some_and(one))
            }
            Allowed::Text => ("", true, value.is_str()),
            Allowed::Such(_, such) => ("", true, such(value)),
            Allowed::Table(_) | Allowed::Tables(_) | Allowed::ByKind(_) => ("", true, false),
        };
        (!allowed).then(|| format!("{}{self}", if of_the_kind { "" } else { kind }))
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
                f.write_str(&either(words.iter().map(|known| format!("\"{}\"", known.word))))
            }
            Allowed::Text => f.write_str("a text in quotes"),
            Allowed::Such(words, _) => f.write_str(words),
            Allowed::Table(_) | Allowed::ByKind(_) => f.write_str("a table"),
            Allowed::Tables(_) => f.write_str("tables, each under its name in double brackets"),
        }
    }
}

/// The words of `kinds`.
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

/// A number, whole or not.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// Whether `value` is a list of `count` numbers in `low..=high`.
pub(super) fn numbers(value: &Value, count: usize, low: f64, high: f64) -> bool {
    let inside = |one| number(one).is_some_and(|found| (low..=high).contains(&found));
    value.as_array().is_some_and(|all| all.len() == count && all.iter().all(inside))
}

/// A struct that is read from a table of the rig file, and [`TableKeys`] as its `TABLE`. `@[…]`
/// stands for an attribute.
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

/// An enum whose variants are words of the rig file. `@[…]` stands for an attribute.
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

            /// All of them.
            #[allow(dead_code)]
            $vis const ALL: [$name; $name::WORDS.len()] = [$($name::$variant),*];

            /// The word in rig files.
            #[allow(dead_code)]
            $vis const fn name(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }
        }
    };
}

pub(super) use {table, words};
