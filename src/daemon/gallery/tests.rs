//! The morning after four thousand photos: the pages are written, and a real browser shows them.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use super::*;
use crate::daemon::{Certificate, Outcome};
use crate::frame::Size;
use crate::nights::pilot::Drift;

fn report(n: u64) -> Report {
    let name = format!("photo {n:04}.jpg");
    Report {
        photo: name.clone(),
        result: name.clone(),
        result_address: super::super::report::address(name.as_ref()),
        outcome: if n % 7 == 0 { Outcome::Untouched } else { Outcome::Restored },
        rig: "small".into(),
        method: "hybrid".into(),
        rung: 3,
        rung_reason: "the certificate says that the model missed something".into(),
        captures: 2,
        seconds: 6.5,
        certificate: Some(Certificate { residual_grey_levels: 1.1, floor_grey_levels: 1.0 }),
        meaning: None,
        size: Size::new(256, 192),
        stored: Size::new(256, 192),
        curve: "sRGB".into(),
        grey: false,
        turned: None,
        notes: vec![],
        iterations: vec![],
        finished_unix_s: 1_700_000_000 + 7 * n,
        before: "gallery/a-before.jpg".into(),
        after: "gallery/a-after.jpg".into(),
        ..blank()
    }
}
