//! The house rules, read from the source: layers, circles, headers, sizes, names, comments.

mod advisories;
mod dependencies;
mod distances;
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Maximum length of a file, lines.
const LINES_MAX: usize = 500;

/// Maximum length of a line, columns, comments included.
const COLUMNS_MAX: usize = 100;

/// Module that reads the kernel's folder of USB devices.
const USB: &str = "rig/camera/genicam/usb";

/// Module that drives a PWM channel, whose only interface is the kernel's files.
const PWM: &str = "rig/pwm_trigger";

/// Modules that may touch files.
const FILES_ALLOWED: &[&str] =
    &["disk/", "calibration/store", "picture/", "config/", "daemon/", "commands/", USB, PWM];

fn source_files(folder: &str) -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    let mut folders: Vec<PathBuf> = vec![root.join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
                let text = fs::read_to_string(&path).unwrap_or_default();
                assert!(!text.is_empty(), "{name} cannot be read or is empty");
                found.push((name, text));
            }
        }
    }
    assert!(!found.is_empty(), "{folder} holds sources");
    found.sort();
    found
}

/// Top-level module of the file `name`; `None` outside `src`.
fn module(name: &str) -> Option<&str> {
    let inside = name.strip_prefix("src/")?;
    Some(inside.split(['/', '.']).next().unwrap_or(inside))
}

/// Modules and their layers, as the table in src/lib.rs draws them. A module may use lower layers
/// and itself.
fn layers() -> BTreeMap<String, usize> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs"))
        .unwrap_or_default();
    let mut layers = BTreeMap::new();
    for line in text.lines() {
        let mut cells = line.strip_prefix("//! |").into_iter().flat_map(|row| row.split('|'));
        let (Some(Ok(layer)), Some(modules)) =
            (cells.next().map(|n| n.trim().parse()), cells.next())
        else {
            continue;
        };
        for module in modules.split("[`").skip(1) {
            let module = module.split('`').next().unwrap_or_default().to_owned();
            assert!(
                layers.insert(module.clone(), layer).is_none(),
                "src/lib.rs draws {module} twice"
            );
        }
    }
    layers
}

/// The first word after each `crate::` outside comments, also of each part of `crate::{a, b::c}`.
fn crate_uses(text: &str) -> BTreeSet<String> {
    let code: String =
        text.lines().map(|line| format!("{}\n", line.split("//").next().unwrap_or(""))).collect();
    let mut uses = BTreeSet::new();
    for after in code.split("crate::").skip(1) {
        let word = |s: &str| {
            s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
        };
        match after.strip_prefix('{') {
            None => {
                uses.insert(word(after));
            }
            Some(list) => {
                let (mut depth, mut start) = (0usize, true);
                for (i, c) in list.char_indices() {
                    match c {
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        '{' => depth += 1,
                        ',' if depth == 0 => start = true,
                        c if start && !c.is_whitespace() => {
                            uses.insert(word(&list[i..]));
                            start = false;
                        }
                        _ => {}
                    }
                }
            }
        }
    }
    uses
}

#[test]
fn the_reader_of_imports_reads_lists() {
    let found = crate_uses(
        "use crate::{rig::{A, B}, frame};\nlet x = crate::remedy::y(); // crate::daemon",
    );
    assert_eq!(found, BTreeSet::from(["rig", "frame", "remedy"].map(String::from)));
}

#[test]
fn imports_go_strictly_down() {
    let layers = layers();
    let layer = |module: &str| layers.get(module).copied();
    let mut seen = 0;
    for (name, text) in source_files("src") {
        let Some(own) = module(&name) else { continue };
        if matches!(own, "lib" | "main" | "commands") {
            continue;
        }
        let at = layer(own)
            .unwrap_or_else(|| panic!("{name}: the module `{own}` is in no layer of src/lib.rs"));
        for used in crate_uses(&text) {
            let Some(below) = layer(&used) else {
                panic!("{name}: crate::{used} is in no layer of src/lib.rs");
            };
            assert!(used == own || below < at, "{name} (layer {at}) uses {used} (layer {below})");
            seen += usize::from(used != own);
        }
    }
    assert!(seen > 20, "the reader finds imports: {seen}");
}

#[test]
fn every_module_is_in_a_layer_and_the_witness_stays_independent() {
    let layers = layers();
    let text =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    for line in text.lines().filter_map(|line| line.strip_prefix("pub mod ")) {
        let module = line.trim_end_matches(';');
        assert!(layers.contains_key(module), "src/lib.rs draws no layer with {module}");
    }
    // These make the simulator an independent witness, whatever else the table says.
    assert_eq!((layers["frame"], layers["remedy"]), (0, 0));
    assert!(layers["deconvolution"] < layers["rig"] && layers["rig"] == layers["calibration"]);
    for (name, text) in source_files("src/rig") {
        for used in crate_uses(&text) {
            assert!(
                !["deconvolution", "calibration"].contains(&used.as_str()),
                "{name} uses {used}"
            );
        }
    }
}

#[test]
fn every_file_opens_with_what_it_is_and_is_short() {
    for (name, text) in source_files("src").into_iter().chain(source_files("tests")) {
        assert!(text.starts_with("//! "), "{name} does not open with //!");
        let lines = text.lines().count();
        assert!(lines <= LINES_MAX, "{name} has {lines} lines, allowed {LINES_MAX}");
    }
}

#[test]
fn no_file_has_a_name_that_says_nothing() {
    for (name, _) in source_files("src") {
        for bad in ["util", "common", "manager", "helper", "misc"] {
            assert!(!name.contains(bad), "{name} is named {bad}");
        }
    }
}

#[test]
fn nothing_is_left_to_do_and_no_path_of_a_machine_is_in_the_tree() {
    // Built from pieces, so that this file does not contain them.
    let forbidden = [
        ["todo", "!("],
        ["unimplemented", "!("],
        ["/wo", "rk/"],
        ["/ro", "ot/"],
        ["/ho", "me/"],
        ["..", "/shared"],
    ]
    .map(|pieces| pieces.concat());
    for (name, text) in source_files("src").into_iter().chain(source_files("tests")) {
        for word in &forbidden {
            assert!(!text.contains(word.as_str()), "{name} holds {word}");
        }
    }
}

#[test]
fn no_page_holds_both_sides_of_a_merge() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in [".", "rig-config", "systemd", "tests", "tests/tables", "tests/scenes"] {
        for entry in fs::read_dir(root.join(folder)).unwrap().flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|extension| extension == "md") {
                let text = fs::read_to_string(&path).unwrap();
                let torn = text.lines().find(|line| {
                    ["<<<<<<< ", ">>>>>>> "].iter().any(|mark| line.starts_with(mark))
                });
                assert_eq!(torn, None, "{}", path.display());
            }
        }
    }
}

#[test]
fn files_time_and_chance_come_in_where_they_may() {
    for (name, text) in source_files("src") {
        let inside = name.trim_start_matches("src/");
        let tests = text.find("#[cfg(test)]").unwrap_or(text.len());
        let code: String =
            text[..tests].lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        let is_test = inside.ends_with("tests.rs") || inside.contains("/tests/");
        if is_test {
            continue;
        }
        if !FILES_ALLOWED.iter().any(|allowed| inside.starts_with(allowed)) {
            for word in ["std::fs::", "use std::fs;", "File::open", "OpenOptions"] {
                assert!(!code.contains(word), "{name} touches files: {word}");
            }
        }
        if !inside.starts_with("commands/") && !inside.starts_with("rig/") {
            for word in ["Instant::now", "SystemTime::now", "thread::sleep"] {
                assert!(
                    !code.contains(word),
                    "{name} reads or waits on a clock of its own: {word}"
                );
            }
        }
        for word in ["thread_rng", "rand::rng()", "from_os_rng"] {
            assert!(!code.contains(word), "{name} holds {word}");
        }
        // `mul_add` may be a library call; `multiply_add` checks that the processor has it.
        if inside != "frame/instructions.rs" {
            assert!(!code.contains(".mul_add("), "{name} holds .mul_add(");
        }
    }
}

#[test]
fn the_reader_of_imports_finds_circles_however_they_are_written() {
    let circles = |files: &[(&str, &str)]| imports::House::read(files.iter().copied()).circles(2);
    let ring = |a: &str, b: &str, c: &str| {
        circles(&[
            ("src/lib.rs", "pub mod a; pub mod b; pub mod c;"),
            ("src/a.rs", &format!("pub struct A; {a}")),
            ("src/b.rs", &format!("pub struct B; {b}")),
            ("src/c/mod.rs", &format!("mod d; pub use d::{{D, E as F}}; {c}")),
            ("src/c/d.rs", "pub struct D; pub struct E; fn f(_: crate::a::A) {}"),
        ])
    };
    let whole = vec![["src/a.rs", "src/b.rs", "src/c/d.rs"].map(String::from).to_vec()];
    assert_eq!(ring("use crate::b::B;", "use super::c::{self, D};", ""), whole);
    assert_eq!(ring("use super::{b::{B as X}};", "fn f(_: crate::c::F) {}", ""), whole);
    assert_eq!(
        ring("use crate::b; fn f(_: b::B) {}", "use crate::c::*; fn f(_: D) {}", "").len(),
        0
    );
    // Two files may use each other; names in comments, strings and tests are not uses.
    assert_eq!(ring("use crate::b::B;", "use crate::a::A; // crate::c::D", "").len(), 0);
    assert_eq!(ring("use crate::b::B;", "const X: &str = \"crate::c::D\";", "").len(), 0);
    assert_eq!(
        ring("use crate::b::B;", "#[cfg(test)]\nmod tests { use crate::c::D; }", "").len(),
        0
    );
    // Re-exporting a name does not use it; using a re-exported name does.
    assert_eq!(ring("use crate::c::g;", "", "pub fn g() {}").len(), 0);
    let through = vec![["src/a.rs", "src/c/d.rs", "src/c/mod.rs"].map(String::from).to_vec()];
    assert_eq!(ring("use crate::c::g;", "", "pub fn g(_: D) {}"), through);
}

#[test]
fn no_circle_of_imports_has_more_than_two_files() {
    let sources = source_files("src");
    let house =
        imports::House::read(sources.iter().map(|(name, text)| (name.as_str(), text.as_str())));
    let used = house.used();
    assert!(used.len() > 500, "the reader finds imports: {}", used.len());
    let circles = house.circles(2);
    for (from, to) in &used {
        if circles.iter().any(|circle| [from, to].iter().all(|f| circle.iter().any(|c| c == *f))) {
            println!("{from} uses {to}");
        }
    }
    let files = circles.into_iter().flatten().collect();
    none("circles of imports", files);
}

/// Checks that nothing breaks `rule`.
fn none(rule: &str, found: BTreeSet<String>) {
    assert!(found.is_empty(), "{rule}: {found:?}");
}

#[test]
fn no_line_is_longer_than_100_columns() {
    let mut found = BTreeSet::new();
    for (name, text) in source_files("src").into_iter().chain(source_files("tests")) {
        for (i, line) in text.lines().enumerate() {
            if line.chars().count() > COLUMNS_MAX {
                println!("{name}:{} has {} columns", i + 1, line.chars().count());
                found.insert(name.clone());
            }
        }
    }
    none("lines of more than 100 columns", found);
}

#[test]
fn no_type_name_is_defined_twice() {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, text) in source_files("src") {
        for line in text.lines() {
            let bare = line.trim_start();
            let associated = bare.starts_with("type ") && bare.len() < line.len();
            let bare = bare.strip_prefix("pub").unwrap_or(bare);
            let bare = match bare.split_once(") ") {
                Some((scope, rest)) if scope.starts_with('(') => rest,
                _ => bare.trim_start(),
            };
            let kinds = ["struct ", "enum ", "trait ", "union ", "type "];
            let rest = bare.strip_prefix("unsafe ").unwrap_or(bare);
            let Some(rest) = kinds.iter().find_map(|kind| rest.strip_prefix(kind)) else {
                continue;
            };
            let word: String = rest.chars().take_while(|c| c.is_alphanumeric()).collect();
            // A macro's `$name` is not a name.
            if !associated && !word.is_empty() {
                places.entry(word).or_default().push(name.clone());
            }
        }
    }
    assert!(places.len() > 200, "the reader finds types: {}", places.len());
    places.retain(|_, files| files.len() > 1);
    for (word, files) in &places {
        println!("{word}: {}", files.join(", "));
    }
    none("types of one name", places.into_keys().collect());
}

#[test]
fn comments_hold_no_dates() {
    let dated = |comment: &str| {
        comment.as_bytes().windows(10).any(|w| {
            w.starts_with(b"20")
                && w.iter().enumerate().all(|(i, &c)| match i {
                    4 | 7 => c == b'-',
                    _ => c.is_ascii_digit(),
                })
        })
    };
    assert!(dated("set on 2026-11-21.") && !dated("2026 11 21, 20-11-2026"));
    let mut found = BTreeSet::new();
    for (name, text) in source_files("src") {
        for (i, line) in text.lines().enumerate() {
            if line.split_once("//").is_some_and(|(_, comment)| dated(comment)) {
                println!("{name}:{}: {}", i + 1, line.trim());
                found.insert(name.clone());
            }
        }
    }
    none("dates in comments", found);
}
