//! What `relens check` reads of the board besides the devices: the monitor's description, and a
//! report to send along.

use std::fmt::Write;
use std::path::Path;

/// Words of the kernel's command line in a report; others may hold addresses and identities.
const CMDLINE: [&str; 6] = ["video=", "drm", "consoleblank", "imx296", "usbcore", "cma="];

const FILES: [&str; 5] = [
    "proc/version",
    "proc/device-tree/model",
    "etc/debian_version",
    "sys/module/imx296/parameters/trigger_mode",
    "sys/module/uvcvideo/version",
];

/// Fault of the stored monitor description that the running kernel's command line names for
/// `connector` (`drm.edid_firmware`), with files under `root`. Without a monitor the kernel needs
/// that description before the disk is mounted.
pub(super) fn edid_fault(root: &Path, connector: &str) -> Option<String> {
    let cmdline = std::fs::read_to_string(root.join("proc/cmdline")).unwrap_or_default();
    let words = cmdline.split_whitespace().filter_map(|word| word.split_once("edid_firmware="));
    let own = |entry: &str| match entry.split_once(':') {
        Some((one, file)) => (one == connector).then(|| file.to_owned()),
        None => Some(entry.to_owned()),
    };
    let file = words.flat_map(|(_, list)| list.split(',')).filter_map(own).next_back()?;
    let Ok(stored) = std::fs::read(root.join("lib/firmware").join(&file)) else {
        return Some(format!(
            "the kernel's command line names /lib/firmware/{file}, which cannot be read: store the \
             monitor's description there (hardware.md, The board)"
        ));
    };
    let cards = std::fs::read_dir(root.join("sys/class/drm")).into_iter().flatten().flatten();
    let is_own = |name: &str| name.split_once('-').is_some_and(|(_, socket)| socket == connector);
    let mut used = cards
        .filter(|card| card.file_name().to_str().is_some_and(is_own))
        .filter_map(|card| std::fs::read(card.path().join("edid")).ok());
    if used.any(|edid| edid == stored) {
        return None;
    }
    Some(format!(
        "the kernel does not use /lib/firmware/{file} for {connector}: it has to be in the \
         initramfs (hardware.md, The board), or auto_initramfs=0 in config.txt"
    ))
}

/// Describes the board: versions, devices, properties and controls, without serial numbers.
pub(super) fn describe(root: &Path) -> String {
    let mut text = format!("relens {}\n", env!("CARGO_PKG_VERSION"));
    for file in FILES {
        let found = std::fs::read_to_string(root.join(file)).unwrap_or_default();
        let found = found.trim_end_matches(['\0', '\n']);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "/{file}: {}", if found.is_empty() { "none" } else { found });
    }
    let cmdline = std::fs::read_to_string(root.join("proc/cmdline")).unwrap_or_default();
    let known = cmdline.split_whitespace().filter(|w| CMDLINE.iter().any(|c| w.starts_with(c)));
    let _ = writeln!(text, "/proc/cmdline: {}", known.collect::<Vec<_>>().join(" "));
    #[cfg(feature = "hardware")]
    text.push_str(&relens::rig::hardware::describe());
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board(cmdline: &str, stored: Option<&[u8]>) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        let put = |path: &str, bytes: &[u8]| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, bytes).expect("it is written");
        };
        put("proc/cmdline", cmdline.as_bytes());
        put("sys/class/drm/card1-HDMI-A-1/edid", b"monitor one");
        put("sys/class/drm/card1-HDMI-A-2/edid", b"");
        stored.into_iter().for_each(|bytes| put("lib/firmware/edid/panel.bin", bytes));
        root
    }

    #[test]
    fn a_stored_description_that_the_kernel_does_not_use_is_a_fault() {
        let of = "consoleblank=0 drm.edid_firmware=HDMI-A-1:edid/panel.bin root=PARTUUID=8a-02";
        let other = "drm.edid_firmware=HDMI-A-2:edid/panel.bin";
        for (cmdline, stored, words) in [
            ("consoleblank=0", None, None),
            (other, None, None),
            (of, None, Some("which cannot be read")),
            (of, Some(&b"monitor one"[..]), None),
            (of, Some(&b"monitor two"[..]), Some("initramfs")),
        ] {
            let root = board(cmdline, stored);
            match (edid_fault(root.path(), "HDMI-A-1"), words) {
                (None, None) => {}
                (Some(fault), Some(words)) => assert!(fault.contains(words), "{fault}"),
                (fault, _) => panic!("{cmdline}: {fault:?}"),
            }
        }
    }

    #[test]
    fn a_report_has_versions_and_no_identities() {
        let root = board("drm.edid_firmware=x root=PARTUUID=8a-02 smsc95xx.macaddr=2c:cf", None);
        let report = describe(root.path());
        assert!(report.contains("cmdline: drm.edid_firmware=x\n"), "{report}");
        assert!(report.contains("trigger_mode: none"), "{report}");
        assert!(!report.contains("8a-02") && !report.contains("2c:cf"), "{report}");
    }
}
