//! Licences, sources and bans of dependencies, as stated in `deny.toml`. `cargo deny` reads that
//! file, too (`.ci/long advisories`); this test needs only cargo.

// A failed unwrap is a failed test, also in the functions the tests share.
#![allow(clippy::unwrap_used)]

use std::collections::HashSet;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// Whether an SPDX `expression` can be met with the `allowed` licences. `/` is an old way to write
/// OR; AND binds tighter than OR.
fn is_met(expression: &str, allowed: &HashSet<String>) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let (met, rest) = any(&words, allowed);
    met && rest.is_empty()
}

fn any<'a, 'w>(words: &'w [&'a str], allowed: &HashSet<String>) -> (bool, &'w [&'a str]) {
    let (mut met, mut rest) = all(words, allowed);
    while let ["OR", after @ ..] = rest {
        let (more, after) = all(after, allowed);
        (met, rest) = (met || more, after);
    }
    (met, rest)
}

fn all<'a, 'w>(words: &'w [&'a str], allowed: &HashSet<String>) -> (bool, &'w [&'a str]) {
    let (mut met, mut rest) = one(words, allowed);
    while let ["AND", after @ ..] = rest {
        let (more, after) = one(after, allowed);
        (met, rest) = (met && more, after);
    }
    (met, rest)
}

fn one<'a, 'w>(words: &'w [&'a str], allowed: &HashSet<String>) -> (bool, &'w [&'a str]) {
    match words {
        ["(", inner @ ..] => match any(inner, allowed) {
            (met, [")", rest @ ..]) => (met, rest),
            (_, rest) => (false, rest),
        },
        [licence, "WITH", exception, rest @ ..] => {
            (allowed.contains(&format!("{licence} WITH {exception}")), rest)
        }
        [licence, rest @ ..] => (allowed.contains(*licence), rest),
        [] => (false, &[]),
    }
}

fn words_of(
    value: Option<&toml::Value>,
    of: impl Fn(&toml::Value) -> Option<&str>,
) -> HashSet<String> {
    let list = value.and_then(toml::Value::as_array).unwrap();
    list.iter().map(|value| of(value).unwrap().to_owned()).collect()
}

#[test]
fn each_has_an_allowed_licence_comes_from_crates_io_and_is_not_banned() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let deny: toml::Table =
        toml::from_str(&std::fs::read_to_string(root.join("deny.toml")).unwrap()).unwrap();
    let licences = words_of(deny["licenses"].get("allow"), toml::Value::as_str);
    let banned = words_of(deny["bans"].get("deny"), |ban| ban.get("crate")?.as_str());
    let asked = ["metadata", "--locked", "--format-version", "1", "--all-features"];
    let host = ["--filter-platform", "x86_64-unknown-linux-gnu"];
    let said =
        Command::new(env!("CARGO")).args(asked).args(host).current_dir(root).output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    let tree: Value = serde_json::from_slice(&said.stdout).unwrap();
    let of = |value: &Value, key: &str| value[key].as_str().map(str::to_owned);
    let nodes = tree["resolve"]["nodes"].as_array().unwrap();
    let used: HashSet<String> = nodes.iter().filter_map(|node| of(node, "id")).collect();
    let mut wrong = Vec::new();
    let mut looked_at = 0;
    for package in tree["packages"].as_array().unwrap() {
        let (id, name) = (of(package, "id").unwrap(), of(package, "name").unwrap());
        if !used.contains(&id) {
            continue;
        }
        looked_at += 1;
        if banned.contains(&name) {
            wrong.push(format!("{name} is banned"));
        }
        let licence = of(package, "license").unwrap_or_default();
        if !is_met(&licence, &licences) {
            wrong.push(format!("{name} has the licence {licence:?}, allowed are {licences:?}"));
        }
        let source = of(package, "source");
        if name != "relens" && source.as_deref() != Some(CRATES_IO) {
            wrong.push(format!("{name} comes from {source:?}, allowed is {CRATES_IO}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(looked_at > 50, "cargo named {looked_at} packages");
}

#[test]
fn a_licence_expression_is_read_as_spdx_says() {
    let allowed: HashSet<String> =
        ["MIT", "Apache-2.0 WITH LLVM-exception"].map(str::to_owned).into();
    for good in [
        "MIT",
        "GPL-3.0 OR MIT",
        "GPL-3.0/MIT",
        "(MIT OR GPL-3.0) AND MIT",
        "Apache-2.0 WITH LLVM-exception",
        "GPL-3.0 AND GPL-2.0 OR MIT",
    ] {
        assert!(is_met(good, &allowed), "{good}");
    }
    for bad in ["", "GPL-3.0", "MIT AND GPL-3.0", "Apache-2.0", "(MIT OR GPL-3.0", "MIT GPL-3.0"] {
        assert!(!is_met(bad, &allowed), "{bad}");
    }
}
