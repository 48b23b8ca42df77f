//! Search for a camera of USB3 Vision or GigE Vision, and its errors.
#![allow(unsafe_code)] // The library's list of cameras.

use std::ffi::{CStr, c_char, c_uint};
use std::fmt::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use aravis::{DeviceError, glib};
use aravis_sys as sys;

use super::usb::refuse_forbidden;
use crate::config::GenicamDevice;
use crate::rig::RigError;
use crate::rig::camera::memory::{gone, refused};
use crate::rig::device::listed;

/// A camera that answered the search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Found {
    /// Name by which the library opens it.
    pub(super) id: String,
    pub(super) vendor: String,
    pub(super) model: String,
    pub(super) serial: String,
    /// `USB3Vision`, `GigEVision` or `Fake`.
    pub(super) protocol: String,
}

/// Lists the cameras on USB and the local networks, which takes a second.
pub(super) fn list() -> Vec<Found> {
    static LISTING: Mutex<()> = Mutex::new(());
    let _alone = LISTING.lock().unwrap_or_else(PoisonError::into_inner);
    // SAFETY: no arguments; only this function changes the list, one call at a time.
    let count = unsafe {
        sys::arv_update_device_list();
        sys::arv_get_n_devices()
    };
    let text = |get: unsafe extern "C" fn(c_uint) -> *const c_char, index| {
        // SAFETY: the index is within the list, which stays as it is while `_alone` is held; the
        // text is null or terminated, and copied here.
        unsafe {
            let text = get(index);
            if text.is_null() { None } else { Some(CStr::from_ptr(text)) }
        }
        .map_or_else(String::new, |text| text.to_string_lossy().into_owned())
    };
    let describe = |index| Found {
        id: text(sys::arv_get_device_id, index),
        vendor: text(sys::arv_get_device_vendor, index),
        model: text(sys::arv_get_device_model, index),
        serial: text(sys::arv_get_device_serial_nbr, index),
        protocol: text(sys::arv_get_device_protocol, index),
    };
    (0..count).map(describe).collect()
}

/// Chooses the only camera of `all` that matches the names in the rig file.
///
/// # Errors
/// [`RigError::Gone`] if none matches, [`RigError::Refused`] if several match, or if none does and
/// this user may not open a USB3 Vision camera.
pub(super) fn choose(all: Vec<Found>, wanted: &GenicamDevice) -> Result<Found, RigError> {
    let fits = |name: &Option<String>, found: &str| name.as_ref().is_none_or(|one| one == found);
    let (mut fitting, others): (Vec<Found>, Vec<Found>) = all.into_iter().partition(|one| {
        fits(&wanted.vendor, &one.vendor)
            && fits(&wanted.model, &one.model)
            && fits(&wanted.serial, &one.serial)
    });
    let names = [&wanted.vendor, &wanted.model, &wanted.serial].into_iter().flatten();
    let wanted = names.map(|name| format!("{name:?}")).collect::<Vec<_>>().join(" ");
    match (fitting.pop(), fitting.is_empty()) {
        (Some(found), true) => Ok(found),
        (Some(_), false) => Err(refused(
            format!("{} cameras called {wanted}", fitting.len() + 1),
            "one: write its serial number into hardware.camera.serial",
        )),
        (None, _) => {
            refuse_forbidden(Path::new("/"))?;
            let names = others.iter().map(|one| format!("{:?} {:?}", one.vendor, one.model));
            let there = listed(&names.collect::<Vec<_>>());
            Err(gone(format!("no USB3 or GigE Vision camera is called {wanted}; there: {there}")))
        }
    }
}

/// Writes the answering cameras to `text`, without serial numbers.
pub fn describe(text: &mut impl Write) -> std::fmt::Result {
    for Found { vendor, model, protocol, .. } in list() {
        writeln!(text, "genicam: {vendor:?} {model:?} by {protocol}")?;
    }
    Ok(())
}

/// Error of a call to the camera.
pub(super) fn failed(error: &glib::Error, doing: &'static str) -> RigError {
    let what = error.message().to_owned();
    match error.kind::<DeviceError>() {
        Some(DeviceError::NotController) => RigError::held("camera", what),
        Some(DeviceError::NotConnected | DeviceError::NotFound | DeviceError::Timeout) => {
            gone(what)
        }
        _ => RigError::Failed { device: "camera", doing, source: std::io::Error::other(what) },
    }
}
