//! Known faults of dependencies: checks the lock files against RustSec's advisories. `cargo deny`
//! does the same (`.ci/long advisories`), but takes longer to build than the gate has time.

use std::path::Path;

use semver::{Version, VersionReq};

/// The TOML table between the fences at the start of an advisory.
fn table_of(advisory: &str) -> Option<toml::Table> {
    let (_, after) = advisory.split_once("```toml")?;
    toml::from_str(after.split_once("```")?.0).ok()
}

/// The advisory's id if it applies to `version`; `None` if not, or if it was withdrawn.
fn hits(advisory: &toml::Table, version: &Version) -> Option<String> {
    let about = advisory.get("advisory")?;
    if about.get("withdrawn").is_some() {
        return None;
    }
    let versions = advisory.get("versions");
    let well = ["patched", "unaffected"].into_iter().any(|kind| {
        let listed = versions.and_then(|of| of.get(kind)).and_then(toml::Value::as_array);
        let ranges = listed.into_iter().flatten().filter_map(toml::Value::as_str);
        ranges.filter_map(|range| VersionReq::parse(range).ok()).any(|of| of.matches(version))
    });
    (!well).then(|| about.get("id").and_then(toml::Value::as_str).unwrap_or("?").to_owned())
}

#[test]
#[ignore = "needs RELENS_ADVISORIES, a checkout of RustSec's advisory-db"]
fn no_crate_has_an_advisory() {
    let advisories = std::env::var("RELENS_ADVISORIES").unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    let deny: toml::Table = toml::from_str(&read(&root.join("deny.toml"))).unwrap();
    let ignored = deny["advisories"]["ignore"].as_array().unwrap();
    let ignored: Vec<&str> = ignored.iter().filter_map(|of| of.get("id")?.as_str()).collect();
    let (mut wrong, mut looked_at) = (Vec::new(), 0);
    for lock in ["Cargo.lock", "tests/fuzz/Cargo.lock"] {
        let lock: toml::Table = toml::from_str(&read(&root.join(lock))).unwrap();
        for package in lock["package"].as_array().unwrap() {
            let of = |key: &str| package[key].as_str().unwrap();
            let version = Version::parse(of("version")).unwrap();
            let folder = Path::new(&advisories).join("crates").join(of("name"));
            for entry in std::fs::read_dir(folder).into_iter().flatten() {
                let Some(table) = table_of(&read(&entry.unwrap().path())) else { continue };
                looked_at += 1;
                let id = hits(&table, &version).filter(|id| !ignored.contains(&id.as_str()));
                wrong.extend(id.map(|id| format!("{} {version}: {id}", of("name"))));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(looked_at > 5, "{looked_at} advisories in {advisories}");
}

#[test]
fn an_advisory_is_of_the_versions_it_does_not_name() {
    let text = "```toml\n[advisory]\nid = \"RUSTSEC-1\"\n[versions]\npatched = [\">= 1.2.3, < 2\", \
                \">= 2.0.1\"]\nunaffected = [\"< 1.0.0\"]\n```\n# Words\n";
    let table = table_of(text).unwrap();
    let hit = |version: &str| hits(&table, &Version::parse(version).unwrap()).is_some();
    assert!(hit("1.0.0") && hit("1.2.2") && hit("2.0.0"));
    assert!(!hit("0.9.9") && !hit("1.2.3") && !hit("1.9.0") && !hit("2.4.0"));
}
