//! Valid rig files, and the messages for invalid ones.

use super::keys::{Allowed, Key, KindKeys, LeftOut, TableKeys};
use super::places::joined;
use super::*;
use crate::frame::Size;

/// `small.toml`.
const SMALL: &str = BUILT_IN[2].1;

fn changed(from: &str, to: &str) -> Result<RigFile, ConfigError> {
    assert!(SMALL.contains(from), "the rig file has no `{from}`");
    parse(&SMALL.replacen(from, to, 1), "small.toml")
}

fn message(result: Result<RigFile, ConfigError>) -> String {
    result.expect_err("such a rig file is invalid").to_string()
}

#[test]
fn every_built_in_rig_file_is_valid() {
    for name in built_in_names() {
        let rig = match load(Path::new(name)) {
            Err(ConfigError::NoHardware(_)) if !cfg!(feature = "hardware") => continue,
            taken => taken.unwrap_or_else(|error| panic!("{error}")),
        };
        assert_eq!(format!("{}.toml", rig.name), name);
        assert_eq!(rig.warning(), None, "{name}");
    }
    assert_eq!(load(Path::new("small")).expect("without its ending").name, "small");
    let said = message(load(Path::new("smal.toml")));
    assert!(said.contains("small.toml") && said.contains("raspberry-pi-5.toml"), "{said}");
}

#[test]
fn an_exposure_that_is_no_whole_number_of_refreshes_gives_a_warning() {
    for (exposure, wanted) in [("0.05", "set it to 16.67"), ("60.0", "set it to 66.67")] {
        let rig = changed("exposure-ms = 50.0", &format!("exposure-ms = {exposure}"));
        let warning = rig.expect("it is valid").warning().expect("a warning");
        assert!(warning.contains(wanted), "{warning}");
    }
}

#[test]
fn rounds_of_block_matching_are_read_from_the_file() {
    let rounds = |rig: Result<RigFile, ConfigError>| rig.expect("it is valid").restore.block_rounds;
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
fn errors_about_lines_that_are_not_toml_avoid_the_parser_s_words() {
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
    assert!(said.contains("found \"N-BK8\", allowed \"air\", \"N-BK7\", \"F2\""), "{said}");
}

#[test]
fn a_missing_quantity_is_an_error() {
    let said = message(changed("refresh-hz = 60.0", ""));
    assert!(said.contains("missing key `refresh-hz`"), "{said}");
    let said = message(changed("pixel-pitch-um = 40.0", ""));
    assert!(said.contains("`pixel-pitch-um` in [lens]"), "{said}");
    let (before, panel) = SMALL.split_once("[panel]").expect("it has a panel");
    let (_, after) = panel.split_once("[camera]").expect("it has a camera");
    let said = message(parse(&format!("{before}[camera]{after}"), "small.toml"));
    assert!(said.contains("missing table `[panel]`") && said.contains("Display"), "{said}");
}

#[test]
fn errors_name_line_key_and_values_in_the_file_s_words() {
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
    let truth = message(changed("[calibration]\n", "[calibration]\nlinearity = 1\n"));
    assert!(truth.contains("calibration.linearity: found 1, allowed true or false"), "{truth}");
    let surface = message(changed("thickness-mm = 9.0", "thickness-mm = -9.0"));
    assert!(surface.contains("lens.surface[1].thickness-mm: found -9.0"), "{surface}");
}

/// A table of the rig file, or several tables of the same kind.
struct Section {
    names: Vec<String>,
    known: &'static TableKeys,
    left_out: LeftOut,
    kind: Option<&'static KindKeys>,
}

/// Tables under their full names, in the file's order; tables of the same kind share a section.
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

/// `small.toml` with every default written out.
fn written_in_full() -> String {
    let mut whole: toml::Table = toml::from_str(SMALL).expect("it is TOML");
    for Section { names, known, .. } in sections() {
        for name in names {
            let mut at = &mut whole;
            if name.starts_with("hardware") || name.starts_with("lens.") {
                continue;
            }
            let optional = ["nights", "marks"].contains(&name.as_str());
            for part in name.split('.') {
                let entry = at.entry(part).or_insert_with(|| toml::Table::new().into());
                at = entry.as_table_mut().expect("a table");
            }
            for key in known.keys.iter().filter(|key| !optional && key.is_written()) {
                if let LeftOut::Means(text) = key.left_out {
                    at.entry(key.name()).or_insert(text.parse().expect("it is TOML"));
                }
            }
        }
    }
    for optional in ["nights", "marks"] {
        whole.remove(optional);
    }
    toml::to_string(&whole).expect("tables of plain values")
}

#[test]
fn a_default_written_and_a_default_left_out_are_the_same_rig() {
    let text = written_in_full();
    assert!(text.len() > SMALL.len() / 2 && text.contains("corrections-max"), "{text}");
    let full = parse(&text, "full.toml").unwrap_or_else(|error| panic!("{error}"));
    let short = load(Path::new("small.toml")).expect("built in");
    assert_eq!(full.identity, short.identity);
    assert_eq!(format!("{full:?}"), format!("{short:?}"));
    let other = changed("[calibration]", "[calibration]\npatterns = 5").expect("allowed");
    assert_ne!(other.identity, short.identity);
}

#[test]
fn identities_do_not_change() {
    for (name, identity) in [
        ("simulated.toml", 0xceb1_306b_f748_313d),
        ("ideal.toml", 0x1aa5_278b_f15e_00e1),
        ("study.toml", 0xedce_baad_9151_e92b),
        ("small.toml", 0x7816_9146_8a6e_b1ca),
        ("paper-synthetic.toml", 0xcf4c_a7e9_8fa3_113d),
        ("tests/vm/rigs/truth.toml", 0x0805_b8f3_4653_f342),
    ] {
        assert_eq!(load(Path::new(name)).expect(name).identity, identity, "{name}");
    }
}

#[test]
#[cfg(feature = "hardware")]
fn identities_of_rigs_of_devices_do_not_change() {
    for (name, identity) in [
        ("raspberry-pi-5.toml", 0x3214_3e1a_f2a7_bd98),
        ("raspberry-pi-5-gs.toml", 0xc321_2541_cc00_6971),
        ("genicam.toml", 0x361b_33bf_7b15_3938),
    ] {
        assert_eq!(load(Path::new(name)).expect(name).identity, identity, "{name}");
    }
}

#[test]
fn values_that_follow_from_others_are_computed() {
    let rig = |name: &str| load(Path::new(name)).expect(name);
    for (name, margin, place) in [
        ("ideal.toml", 20, (64, 64)),
        ("simulated.toml", 20, (64, 64)),
        ("small.toml", 8, (16, 16)),
        ("study.toml", 0, (0, 0)),
    ] {
        let rig = rig(name);
        assert_eq!(rig.canvas.margin_px, margin, "{name}");
        assert_eq!((rig.camera.photo_x_px, rig.camera.photo_y_px), place, "{name}");
        assert!((rig.camera.deadline_ms - 500.0).abs() < 1e-9, "{name}");
    }
    let lens = |name: &str| rig(name).simulation().expect(name).lens.clone();
    for (name, rows, stop, dark_corner) in [
        ("ideal.toml", 12, 1, true),
        ("small.toml", 12, 1, true),
        ("paper-synthetic.toml", 9, 0, false),
        ("study.toml", 24, 0, false),
    ] {
        let lens = lens(name);
        assert_eq!((lens.node_rows, lens.stop_at_surface), (rows, stop), "{name}");
        assert_eq!(lens.dark_corner, dark_corner, "{name}");
    }
    let whole = changed("width-px = 256\nheight-px = 192\n", "").expect("a valid file");
    assert_eq!(whole.photo.size(), Size::new(272, 208));
}

#[test]
fn the_paper_s_patches_follow_from_the_rig() {
    let paper = |name: &str| load(Path::new(name)).expect(name).paper;
    assert_eq!((paper("ideal.toml").patch_px, paper("ideal.toml").margin_px), (80, 20));
    assert_eq!((paper("small.toml").patch_px, paper("small.toml").margin_px), (20, 6));
    assert_eq!((paper("study.toml").patch_px, paper("study.toml").margin_px), (40, 10));
    assert_eq!(paper("paper-synthetic.toml").margin_px, 80);
}

/// A key's default as the reference page states it.
fn left_out(key: &Key) -> String {
    match key.left_out {
        LeftOut::Never => "no default".to_owned(),
        LeftOut::Means(text) => format!("`{text}`"),
        LeftOut::Says(words) => format!("left out: {words}"),
    }
}

/// Keys of all tables as Markdown.
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
        page += "| key | allowed | default | meaning |\n|---|---|---|---|\n";
        if let Some(kind) = kind {
            let word = kind.word;
            let left_out =
                if kind.is_default { format!("`\"{word}\"`") } else { "no default".into() };
            page += &format!("| `kind` | \"{word}\" | {left_out} | Kind. |\n");
        }
        let is_value = |key: &&Key| {
            !matches!(key.allowed, Allowed::Table(_) | Allowed::Tables(_) | Allowed::ByKind(_))
        };
        for key in known.keys.iter().filter(|key| is_value(key) && key.is_written()) {
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
fn the_page_of_keys_is_up_to_date() {
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
fn errors_of_rules_across_keys_name_found_and_allowed_values() {
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
fn the_words_for_the_focus_are_part_of_the_identity_and_fit_into_a_photo() {
    let focus = |words: &str| changed("bits = 10", &format!("bits = 10\nfocus = \"{words}\""));
    let same = load(Path::new("small.toml")).expect("built in");
    let said = focus("2.5 m, f/4").expect("a text");
    assert_eq!((same.camera.focus, said.camera.focus), (None, Some("2.5 m, f/4".to_owned())));
    assert_ne!(said.identity, same.identity);
    for wrong in ["", " near", "nä", &"x".repeat(81)] {
        let error = message(focus(wrong));
        assert!(error.contains("camera.focus") && error.contains("80 ASCII"), "{error}");
    }
}

#[test]
fn cameras_are_listed_by_parts_of_their_names() {
    let cameras = |list: &str| changed("[photo]", &format!("[photo]\ncameras = {list}"));
    assert_eq!(cameras("[\"imx296\", \"X\"]").expect("texts").photo.cameras, ["imx296", "X"]);
    for wrong in ["[]", "[\"\"]", "\"imx296\"", "[296]"] {
        let error = message(cameras(wrong));
        assert!(error.contains("photo.cameras") && error.contains("square brackets"), "{error}");
    }
}

#[test]
#[cfg(not(feature = "hardware"))]
fn a_hardware_rig_gets_one_clear_sentence() {
    let said = message(parse(BUILT_IN[4].1, "raspberry-pi-5.toml"));
    assert!(said.contains("--features hardware"), "{said}");
}

#[test]
fn the_identity_covers_what_a_calibration_depends_on_and_nothing_else() {
    let same = load(Path::new("small.toml")).expect("built in").identity;
    let identity = |from: &str, to: &str| changed(from, to).expect("allowed").identity;
    assert_eq!(identity("seed = 1", "seed = 2"), same);
    assert_eq!(identity("[pose]", "[paper]\nmargin-px = 5\n[pose]"), same);
    assert_eq!(identity("[pose]", "[faults]\nmissing = 0.1\n[pose]"), same);
    assert_eq!(identity("[photo]", "[photo]\ncameras = [\"imx296\"]"), same);
    assert_ne!(identity("rotation-deg = 0.35", "rotation-deg = 0.36"), same);
    assert_ne!(identity("bits = 10", "bits = 10\nphoto-x-px = 15"), same);
    assert_ne!(identity("gamma = [2.25", "gamma = [2.24"), same);
}

#[test]
fn invalid_text_is_refused_without_a_panic() {
    for text in ["", "[", "rig = 3", "[rig]\nname = 1", "\u{0}", "[rig]\nname = \"x\"\nother = 1"] {
        parse(text, "x.toml").expect_err("not a rig file");
    }
}

#[test]
#[cfg(feature = "hardware")]
fn a_pwm_channel_is_for_pulses_that_are_exposures() {
    let gs = include_str!("../../rig-config/raspberry-pi-5-gs.toml");
    let line = "kind = \"line\", chip = \"pinctrl-rp1\", line = \"GPIO17\", active = \"low\"";
    let pwm = "kind = \"pwm\", chip = \"1f00098000.pwm\", channel = 2, active = \"low\"";
    assert!(gs.contains(line));
    let text = gs.replace(line, pwm);
    let rig = parse(&text, "gs.toml").unwrap_or_else(|error| panic!("{error}"));
    let Kind::Hardware(hardware) = rig.kind else { panic!("it is hardware") };
    let (chip, active) = ("1f00098000.pwm".to_owned(), Level::Low);
    assert_eq!(hardware.trigger, TriggerDevice::Pwm(PwmChannel { chip, channel: 2, active }));
    let said = message(parse(&text.replace("\"pulse\"", "\"elsewhere\""), "gs.toml"));
    assert!(said.contains("hardware.trigger.kind: found pwm, allowed line"), "{said}");
    let said = message(parse(&text.replace("channel = 2", "channel = -1"), "gs.toml"));
    assert!(said.contains("channel") && said.contains("allowed 0 to 255"), "{said}");
}

#[test]
fn a_binned_camera_has_whole_binned_pixels() {
    let binned = |by: &str| changed("[camera]\n", &format!("[camera]\nbinning = {by}\n"));
    let (own, by_two) = (changed("[camera]", "[camera]").unwrap(), binned("2").unwrap());
    assert_eq!(by_two.photo_grid(), own.photo_grid());
    assert_eq!(by_two.photo.size(), Size::new(128, 96));
    assert_eq!(by_two.unbinned().photo_on_sensor(), own.photo_on_sensor());
    assert_ne!(by_two.identity, own.identity);
    assert_eq!(binned("1").unwrap().identity, own.identity);
    assert!(message(binned("3")).contains("camera.binning: found 3"));
    let odd = SMALL.replacen("[camera]", "[camera]\nbinning = 2", 1).replacen("= 288", "= 289", 1);
    let said = message(parse(&odd, "small.toml"));
    assert!(said.contains("camera.width-px: found 289, allowed a multiple of"), "{said}");
}
