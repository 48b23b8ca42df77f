//! Rig files that are taken, and what is said about those that are not.

use super::keys::{Allowed, Key, KindKeys, LeftOut, TableKeys};
use super::places::joined;
use super::*;

/// `small.toml`.
const SMALL: &str = BUILT_IN[2].1;

fn changed(from: &str, to: &str) -> Result<RigFile, ConfigError> {
    assert!(SMALL.contains(from), "the rig file has no `{from}`");
    parse(&SMALL.replacen(from, to, 1), "small.toml", Path::new(""))
}

fn message(result: Result<RigFile, ConfigError>) -> String {
    result.expect_err("such a rig file is not taken").to_string()
}

#[test]
fn every_built_in_rig_file_is_taken() {
    for name in built_in_names() {
        let rig = match load(Path::new(name)) {
            Err(ConfigError::NoHardware { .. }) if !cfg!(feature = "hardware") => continue,
            taken => taken.unwrap_or_else(|error| panic!("{error}")),
        };
        assert_eq!(format!("{}.toml", rig.name), name);
        assert_eq!(rig.doubts(), Vec::<String>::new(), "{name}");
    }
    assert_eq!(load(Path::new("small")).expect("without its ending").name, "small");
    let said = message(load(Path::new("smal.toml")));
    assert!(said.contains("small.toml") && said.contains("raspberry-pi-5.toml"), "{said}");
}

#[test]
fn an_exposure_that_is_no_number_of_refreshes_is_doubted() {
    for (exposure, wanted) in [("0.05", "set it to 16.67"), ("60.0", "set it to 66.67")] {
        let rig = changed("exposure-ms = 50.0", &format!("exposure-ms = {exposure}"));
        let doubts = rig.expect("it is taken").doubts().concat();
        assert!(doubts.contains(wanted), "{doubts}");
    }
}

#[test]
fn rounds_of_block_matching_are_the_file_s() {
    let rounds = |rig: Result<RigFile, ConfigError>| rig.expect("it is taken").numbers().rounds;
    assert_eq!(rounds(changed("[restore]", "[restore]")), 1);
    assert_eq!(rounds(changed("[restore]", "[restore]\nblock-rounds = 8")), 8);
}

#[test]
fn an_unknown_key_names_its_line_and_the_nearest_known_one() {
    let said = message(changed("settle-ms", "settel-ms"));
    assert!(
        said.contains("unknown key `settel-ms`; the nearest known one is `settle-ms`"),
        "{said}"
    );
    let line = SMALL.lines().position(|l| l.starts_with("settle-ms")).expect("it is there") + 1;
    assert!(said.starts_with(&format!("small.toml:{line}:")), "{said}");
    let said = message(changed("[pose]", "[poze]"));
    assert!(said.contains("`pose`"), "{said}");
}

#[test]
fn what_is_no_line_of_a_rig_file_is_told_without_the_parser_s_words() {
    for (to, wanted) in [
        ("exposure-ms = 50,0", "found `exposure-ms = 50,0"),
        ("exposure-ms = fifty", "found `exposure-ms = fifty"),
        ("exposure-ms = 99999999999999999999999", "found `exposure-ms = 9999"),
        ("exposure-ms = \"50", "found `exposure-ms = \"50"),
        ("exposure-ms = 50.0\nexposure-ms = 50.0", "found `exposure-ms` twice"),
    ] {
        let said = message(changed("exposure-ms = 50.0", to));
        assert!(said.starts_with("small.toml:") && said.contains(wanted), "{said}");
        assert!(said.contains("allowed"), "{said}");
        for word in ["expected", "i128", "literal"] {
            assert!(!said.contains(word), "{word}: {said}");
        }
    }
    let said = message(changed("glass = \"N-BK7\"", "glass = \"N-BK8\""));
    assert!(said.contains("found \"N-BK8\", allowed air, N-BK7, F2"), "{said}");
}

#[test]
fn a_missing_quantity_is_never_made_up() {
    let said = message(changed("refresh-hz = 60.0", ""));
    assert!(said.contains("missing key `refresh-hz`"), "{said}");
    let said = message(changed("pixel-pitch-um = 40.0", ""));
    assert!(
        said.contains("lens.pixel-pitch-um") && said.contains("no physical quantity"),
        "{said}"
    );
    let said = message(changed("[canvas]\nmargin-px", "[marks]\nfrom-edge-px"));
    assert!(said.contains("missing table `[canvas]`") && said.contains("grid"), "{said}");
}

#[test]
fn what_is_wrong_is_said_in_the_file_s_words_with_its_line() {
    let line = |key: &str| {
        let at = SMALL.lines().position(|line| line.starts_with(key)).expect("it is there") + 1;
        format!("small.toml:{at}: ")
    };
    for (key, from, to, wanted) in [
        (
            "exposure-ms",
            "exposure-ms = 50.0",
            "exposure-ms = \"ten\"",
            "camera.exposure-ms: found \"ten\", allowed a number, 0.001 to 60000",
        ),
        (
            "exposure-ms",
            "exposure-ms = 50.0",
            "exposure-ms = 0",
            "camera.exposure-ms: found 0, allowed 0.001 to 60000",
        ),
        (
            "curve",
            "curve = \"srgb\"",
            "curve = \"rgb\"",
            "photo.curve: found \"rgb\", allowed \"srgb\" or \"linear\"",
        ),
        (
            "checker-square-px",
            "checker-square-px = 20",
            "checker-square-px = 20.5",
            "calibration.checker-square-px: found 20.5, allowed a whole number, 4 to 400",
        ),
        (
            "dark-corner",
            "dark-corner = true",
            "dark-corner = 1",
            "lens.dark-corner: found 1, allowed true or false",
        ),
        (
            "gamma",
            "gamma = [2.25, 2.2, 2.15]",
            "gamma = [2.25, 2.2]",
            "display.gamma: found [2.25, 2.2], allowed three numbers, 0.2 to 5",
        ),
        (
            "read-noise-levels",
            "read-noise-levels = 0.2",
            "read-noise-levels = -0.1",
            "sensor.read-noise-levels: found -0.1, allowed 0 to 255",
        ),
        (
            "red-nm",
            "red-nm = [[605.0, 0.6]",
            "red-nm = [[60.5, 0.6]",
            "display.primaries.red-nm: found [[60.5, 0.6]",
        ),
    ] {
        let said = message(changed(from, to));
        assert!(said.contains(wanted), "{said}");
        assert!(said.starts_with(&line(key)), "{said}");
        for foreign in ["f64", "usize", "variant", "struct", "field", "invalid type"] {
            assert!(!said.contains(foreign), "{said}");
        }
    }
    let table = message(changed("[rig]\n", "run = 8\n[rig]\n"));
    assert!(table.contains("run: found 8, allowed a table"), "{table}");
    let surface = message(changed("thickness-mm = 9.0", "thickness-mm = -9.0"));
    assert!(surface.contains("lens.surface[1].thickness-mm: found -9.0"), "{surface}");
}

/// A table, or several of one kind.
struct Section {
    names: Vec<String>,
    known: &'static TableKeys,
    left_out: LeftOut,
    kind: Option<&'static KindKeys>,
}

/// Every table with its whole name, in the file's order; tables of one kind stand together.
fn sections() -> Vec<Section> {
    fn collect(name: String, one: &'static TableKeys, left_out: LeftOut, all: &mut Vec<Section>) {
        if one.keys.iter().any(|key| !matches!(key.allowed, Allowed::Table(_) | Allowed::ByKind(_)))
        {
            match all.iter_mut().find(|seen| seen.known.about == one.about) {
                Some(seen) => seen.names.push(name.clone()),
                None => all.push(Section {
                    names: vec![name.clone()],
                    known: one,
                    left_out,
                    kind: None,
                }),
            }
        }
        for key in one.keys {
            let (name, left_out) = (joined(&name, &key.name()), key.left_out);
            match key.allowed {
                Allowed::Table(inner) | Allowed::Tables(inner) => {
                    collect(name, inner, left_out, all);
                }
                Allowed::ByKind(kinds) => {
                    for kind in kinds {
                        all.push(Section {
                            names: vec![name.clone()],
                            known: kind.keys,
                            left_out,
                            kind: Some(kind),
                        });
                        for key in kind.keys.keys {
                            if let Allowed::Table(inner) | Allowed::Tables(inner) = key.allowed {
                                collect(joined(&name, &key.name()), inner, key.left_out, all);
                            }
                        }
                    }
                }
                _ => {}
            }
        }
    }
    let mut all = Vec::new();
    const WHOLE: &TableKeys = &written::RigTables::TABLE;
    collect(String::new(), WHOLE, LeftOut::Never, &mut all);
    all
}

/// `small.toml` with every default written into it.
fn said_in_full() -> String {
    let mut whole: toml::Table = toml::from_str(SMALL).expect("it is TOML");
    for Section { names, known, .. } in sections() {
        for name in names {
            let mut at = &mut whole;
            if name.starts_with("hardware") || name.starts_with("lens.") {
                continue;
            }
            let optional = ["nights", "keep", "marks"].contains(&name.as_str());
            for part in name.split('.') {
                let entry = at.entry(part).or_insert_with(|| toml::Table::new().into());
                at = entry.as_table_mut().expect("a table");
            }
            for key in known.keys.iter().filter(|_| !optional) {
                if let LeftOut::Means(text) = key.left_out {
                    at.entry(key.name()).or_insert(text.parse().expect("it is TOML"));
                }
            }
        }
    }
    for optional in ["nights", "keep", "marks"] {
        whole.remove(optional);
    }
    toml::to_string(&whole).expect("tables of plain values")
}

#[test]
fn a_default_said_and_a_default_left_out_are_the_same_rig() {
    let text = said_in_full();
    assert!(text.len() > SMALL.len() / 2 && text.contains("corrections-max"), "{text}");
    let full = parse(&text, "full.toml", Path::new("")).unwrap_or_else(|error| panic!("{error}"));
    let short = load(Path::new("small.toml")).expect("built in");
    assert_eq!(full.identity, short.identity);
    assert_eq!(format!("{full:?}"), format!("{short:?}"));
    let other = changed("[calibration]", "[calibration]\npatterns = 5").expect("allowed");
    assert_ne!(other.identity, short.identity);
}

#[test]
fn calibrations_from_before_defaults_stay_good() {
    for (name, identity) in [
        ("simulated.toml", 0x9fde_aa6a_b7bf_b9d7),
        ("ideal.toml", 0x9e12_f317_cba6_7b36),
        ("study.toml", 0x8570_706e_d3db_35f6),
        ("small.toml", 0xd94c_2a41_c826_05bf),
        ("paper-synthetic.toml", 0x257d_d879_10d2_3cba),
        ("tests/vm/rigs/truth.toml", 0x2024_52e9_2684_2b01),
    ] {
        assert_eq!(load(Path::new(name)).expect(name).identity, identity, "{name}");
    }
}

#[test]
fn the_paper_s_patches_follow_from_the_rig() {
    let paper = |name: &str| load(Path::new(name)).expect(name).paper;
    assert_eq!((paper("ideal.toml").patch_px, paper("ideal.toml").margin_px), (80, 20));
    assert_eq!((paper("small.toml").patch_px, paper("small.toml").margin_px), (20, 6));
    assert_eq!((paper("study.toml").patch_px, paper("study.toml").margin_px), (40, 10));
    assert_eq!(paper("paper-synthetic.toml").margin_px, 80);
}

/// What a key left out means, for the page.
fn left_out(key: &Key) -> String {
    match key.left_out {
        LeftOut::Never => "no default".to_owned(),
        LeftOut::Means(text) => format!("`{text}`"),
        LeftOut::Says(words) => format!("left out: {words}"),
    }
}

/// The keys of all tables as Markdown.
fn reference() -> String {
    let mut page = String::new();
    let plain = |text: &str| text.trim().replace('|', "\\|");
    for Section { names, known, left_out: table, kind } in sections() {
        let names: Vec<String> = names.iter().map(|name| format!("`[{name}]`")).collect();
        let table = match table {
            LeftOut::Says(words) => format!(" Left out: {words}."),
            LeftOut::Means(_) => " May be left out.".to_owned(),
            LeftOut::Never => String::new(),
        };
        page += &format!("\n### {}\n\n{}{table}\n\n", names.join(", "), known.about.trim());
        page += "| key | allowed | default | what it is |\n|---|---|---|---|\n";
        if let Some(kind) = kind {
            let default = if kind.unless_said { "this" } else { "no default" };
            page +=
                &format!("| `kind` | \"{}\" | {default} | Whose keys these are. |\n", kind.word);
        }
        let is_value = |key: &&Key| {
            !matches!(key.allowed, Allowed::Table(_) | Allowed::Tables(_) | Allowed::ByKind(_))
        };
        for key in known.keys.iter().filter(is_value) {
            let mut meaning = plain(key.meaning);
            if let Allowed::Word(words) = key.allowed {
                for word in words {
                    meaning += &format!("<br>`\"{}\"`: {}", word.word, plain(word.meaning));
                }
            }
            let allowed = plain(&key.allowed.to_string());
            page += &format!("| `{}` | {allowed} | {} | {meaning} |\n", key.name(), left_out(key));
        }
    }
    page
}

#[test]
fn the_page_of_keys_is_as_the_code_is() {
    const HEADING: &str = "## Every key\n";
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig-config/README.md");
    let page = std::fs::read_to_string(&path).expect("the page");
    let (head, keys) = page.split_once(HEADING).expect("its heading");
    let wanted = reference();
    if std::env::var_os("RELENS_WRITE_PAGES").is_some() {
        std::fs::write(&path, format!("{head}{HEADING}{wanted}")).expect("a page to write to");
    } else {
        assert!(keys == wanted, "keys changed: RELENS_WRITE_PAGES=1 cargo test --lib page_of_keys");
    }
}

#[test]
fn rules_across_fields_say_found_and_allowed() {
    let said = message(changed("margin-px = 8", "margin-px = 17"));
    assert!(said.contains("canvas.margin-px: found 17, allowed 0 to 16"), "{said}");
    let said = message(changed("[calibration]", "[calibration]\ngeometry = \"one-to-one\""));
    assert!(said.contains("480×270") && said.contains("288×224"), "{said}");
    let said = message(changed("bits = 10", "bits = 9"));
    assert!(said.contains("found 9, allowed 8, 10, 12 or 16"), "{said}");
    let said = message(changed("[pose]", "[faults]\nstale = nan\n[pose]"));
    assert!(said.contains("faults.stale"), "{said}");
}

#[test]
fn another_focus_is_another_rig_and_its_words_can_be_written_into_a_photo() {
    let focus = |words: &str| changed("bits = 10", &format!("bits = 10\nfocus = \"{words}\""));
    let same = load(Path::new("small.toml")).expect("built in");
    let said = focus("2.5 m, f/4").expect("a text");
    assert_eq!((same.camera.focus, said.camera.focus), (None, Some("2.5 m, f/4".to_owned())));
    assert_ne!(said.identity, same.identity);
    for wrong in ["", " near", "nä", &"x".repeat(81)] {
        let told = message(focus(wrong));
        assert!(told.contains("camera.focus") && told.contains("80 ASCII"), "{told}");
    }
}

#[test]
fn glare_radius_has_its_contract_name_too() {
    let rig = changed("glare-radius-px", "glare-radius").expect("an alias of the same key");
    assert!((rig.simulation().expect("simulated").lens.glare().radius_px - 15.0).abs() < 1e-6);
}

#[test]
#[cfg(not(feature = "hardware"))]
fn a_hardware_rig_gets_one_clear_sentence() {
    let said = message(changed("kind = \"simulated\"", "kind = \"hardware\""));
    assert!(said.contains("--features hardware"), "{said}");
}

#[test]
fn identity_follows_what_a_calibration_depends_on_and_nothing_else() {
    let same = load(Path::new("small.toml")).expect("built in").identity;
    let identity = |from: &str, to: &str| changed(from, to).expect("allowed").identity;
    assert_eq!(identity("seed = 1", "seed = 2"), same);
    assert_eq!(identity("[pose]", "[paper]\niterations = 5\n[pose]"), same);
    assert_eq!(identity("[pose]", "[faults]\nmissing = 0.1\n[pose]"), same);
    assert_ne!(identity("rotation-deg = 0.35", "rotation-deg = 0.36"), same);
    assert_ne!(identity("photo-x-px = 16", "photo-x-px = 15"), same);
    assert_ne!(identity("gamma = [2.25", "gamma = [2.24"), same);
}

#[test]
fn a_measured_blur_takes_the_place_of_the_prescription() {
    let (before, lens) = SMALL.split_once("[lens]").expect("has a lens");
    let (_, after) = lens.split_once("[pose]").expect("has a pose");
    let flat = after
        .replace("tilt-x-deg = 0.6", "tilt-x-deg = 0.0")
        .replace("tilt-y-deg = -0.9", "tilt-y-deg = 0.0");
    let blur = |after: &str, file: &str| {
        let lens =
            format!("[lens]\nblur = \"{file}\"\nglare-share = 0.0\nglare-radius-px = 10.0\n");
        parse(&format!("{before}{lens}[pose]{after}"), "x.toml", Path::new("tests/golden"))
    };
    let rig = blur(&flat, "psf_grid.npy").expect("a grid of functions that sum to 1");
    let Some(Lens::Measured(grid, _)) = rig.simulation().map(|s| &s.lens) else {
        panic!("not measured")
    };
    assert_eq!((grid.rows, grid.columns, grid.support_px), (6, 8, 21));
    assert!(message(blur(after, "psf_grid.npy")).contains("perspective"));
    assert!(message(blur(&flat, "ssim_b.npy")).contains("[rows, columns, 3, k, k]"));
    assert!(message(blur(&flat, "no.npy")).contains("lens.blur"));
}

#[test]
fn rubbish_is_refused_and_never_panics() {
    for text in
        ["", "[", "rig = 3", "[rig]\nname = 1", "\u{0}", "[rig]\nkind = \"other\"\nname = \"x\""]
    {
        parse(text, "x.toml", Path::new("")).expect_err("not a rig file");
    }
}
