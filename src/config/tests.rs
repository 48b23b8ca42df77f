//! Rig files that are taken, and what is said about those that are not.

use super::*;

fn changed(from: &str, to: &str) -> Result<Rig, ConfigError> {
    let text = BUILT_IN[2].1;
    assert!(text.contains(from), "the rig file has no `{from}`");
    parse(&text.replacen(from, to, 1), "small.toml", Path::new(""))
}

fn message(result: Result<Rig, ConfigError>) -> String {
    result.expect_err("such a rig file is not taken").to_string()
}

#[test]
fn every_built_in_rig_file_is_taken() {
    for name in built_in_names() {
        let rig = load(Path::new(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(format!("{}.toml", rig.name), name);
    }
}

#[test]
fn an_unknown_key_names_its_line_and_the_nearest_known_one() {
    let said = message(changed("settle-ms", "settel-ms"));
    assert!(
        said.contains("unknown key `settel-ms`; the nearest known one is `settle-ms`"),
        "{said}"
    );
    let line =
        BUILT_IN[2].1.lines().position(|l| l.starts_with("settle-ms")).expect("it is there") + 1;
    assert!(said.starts_with(&format!("small.toml:{line}:")), "{said}");
    let said = message(changed("[pose]", "[poze]"));
    assert!(said.contains("`pose`"), "{said}");
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
}

#[test]
fn rules_across_fields_say_found_and_allowed() {
    let said = message(changed("margin-px = 8", "margin-px = 17"));
    assert!(said.contains("canvas.margin-px: found 17, allowed 0 to 16"), "{said}");
    let said = message(changed("geometry = \"checkerboard\"", "geometry = \"one-to-one\""));
    assert!(said.contains("480×270") && said.contains("288×224"), "{said}");
    let said = message(changed("bits = 10", "bits = 9"));
    assert!(said.contains("found 9, allowed 8, 10, 12 or 16"), "{said}");
    let said = message(changed("stale = 0.0", "stale = nan"));
    assert!(said.contains("faults.stale"), "{said}");
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
    assert_eq!(identity("iterations = 11", "iterations = 5"), same);
    assert_eq!(identity("missing = 0.0", "missing = 0.1"), same);
    assert_ne!(identity("rotation-deg = 0.35", "rotation-deg = 0.36"), same);
    assert_ne!(identity("photo-x-px = 16", "photo-x-px = 15"), same);
    assert_ne!(identity("gamma = [2.25", "gamma = [2.24"), same);
}

#[test]
fn a_measured_blur_takes_the_place_of_the_prescription() {
    let text = BUILT_IN[2].1;
    let (before, lens) = text.split_once("[lens]").expect("has a lens");
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
