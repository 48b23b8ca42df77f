//! Choice of a camera by its names, and the kernel's permissions and memory for it.

use std::fs::{create_dir_all, write};

use super::super::finding::Found;
use super::super::usb;
use super::*;

fn found(model: &str, serial: &str) -> Found {
    let word = str::to_owned;
    let (vendor, protocol) = (word("Basler"), word("USB3Vision"));
    Found {
        id: format!("Basler-{serial}"),
        vendor,
        model: word(model),
        serial: word(serial),
        protocol,
    }
}

/// A device that the rig file names by model, serial number or both.
fn named(model: Option<&str>, serial: Option<&str>) -> GenicamDevice {
    let GenicamSettings { mut device, .. } = settings("Mono8", 8);
    device.vendor = None;
    (device.model, device.serial) = (model.map(str::to_owned), serial.map(str::to_owned));
    device
}

#[test]
fn the_only_camera_of_a_name_is_taken_and_two_are_refused() {
    let all = || vec![found("ace", "1"), found("ace", "2"), found("boost", "3")];
    let chosen = |device| choose(all(), &device);
    assert_eq!(chosen(named(Some("boost"), None)).map(|one| one.serial).ok(), Some("3".into()));
    assert_eq!(chosen(named(Some("ace"), Some("2"))).map(|one| one.serial).ok(), Some("2".into()));
    let said = chosen(named(Some("ace"), None)).expect_err("there are two").to_string();
    assert!(said.contains("2 cameras called \"ace\"") && said.contains("serial"), "{said}");
    let said = chosen(named(Some("ace"), Some("3"))).expect_err("it is a boost").to_string();
    assert!(said.contains("\"ace\" \"3\"") && said.contains("\"Basler\" \"boost\""), "{said}");
}

/// A folder like the kernel's, with a USB3 Vision camera at 2-1 and a webcam.
fn kernel() -> tempfile::TempDir {
    let root = tempfile::tempdir().expect("a folder");
    let devices = root.path().join("sys/bus/usb/devices");
    let files = [
        ("2-1/busnum", "2\n"),
        ("2-1/devnum", "7\n"),
        ("2-1:1.0/bInterfaceClass", "ef\n"),
        ("2-1:1.0/bInterfaceSubClass", "05\n"),
        ("1-1/busnum", "1\n"),
        ("1-1/devnum", "4\n"),
        ("1-1:1.0/bInterfaceClass", "0e\n"),
        ("1-1:1.0/bInterfaceSubClass", "05\n"),
    ];
    for (name, text) in files {
        let path = devices.join(name);
        create_dir_all(path.parent().expect("a folder")).expect("a folder");
        write(path, text).expect("a file");
    }
    root
}

#[test]
fn a_usb_camera_that_the_user_may_not_open_is_named_with_its_node() {
    let root = kernel();
    let said = usb::refuse_forbidden(root.path()).expect_err("there is no node").to_string();
    assert!(said.contains("dev/bus/usb/002/007") && said.contains("70-relens.rules"), "{said}");
    let node = root.path().join("dev/bus/usb/002/007");
    create_dir_all(node.parent().expect("a folder")).expect("a folder");
    write(node, "").expect("a file");
    assert!(usb::refuse_forbidden(root.path()).is_ok(), "the webcam is not of USB3 Vision");
    assert!(usb::refuse_forbidden(Path::new("/nowhere")).is_ok());
}

#[test]
fn a_stream_that_usb_has_no_memory_for_is_refused() {
    let root = kernel();
    let folder = root.path().join("sys/module/usbcore/parameters");
    create_dir_all(&folder).expect("a folder");
    for (granted_mb, frame_bytes, is_enough) in
        [("16", 4_000_000, true), ("16", 5_000_000, false), ("0", 50_000_000, true)]
    {
        write(folder.join("usbfs_memory_mb"), format!("{granted_mb}\n")).expect("a file");
        let outcome = usb::check_memory(root.path(), 4, frame_bytes);
        assert_eq!(outcome.is_ok(), is_enough, "{granted_mb} {frame_bytes}");
        if let Err(error) = outcome {
            let said = error.to_string();
            assert!(said.contains("20 or more") && said.contains("usbfs_memory_mb=128"), "{said}");
        }
    }
}
