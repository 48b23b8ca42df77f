//! Display settings for measuring, each set and read back: full range, no scaling, identity gamma.
//!
//! Everything by which a television enhances its picture is switched off, as far as the kernel can.
//! A driver that does not keep a setting is refused.

use drm::control::{AtomicCommitFlags, Device as _, Mode, ResourceHandle, atomic::AtomicModeReq};
use drm::control::{connector, crtc, framebuffer, plane, property};

use super::RigError;
use super::kms_card::{Card, Properties, choice_value, commit_failed, failed};

/// Required value of a property, on drivers that have it.
enum Wanted {
    Choice(&'static str),
    /// Number, clamped to the property's range.
    Number(u64),
    /// No lookup table (blob id 0).
    NoTable,
}

/// Properties of the connector. A limited "Broadcast RGB" range merges the lowest and highest 16
/// codes. The "content type" Graphics keeps a television from overscanning and sharpening.
const CONNECTOR: [(&str, Wanted); 10] = [
    ("Broadcast RGB", Wanted::Choice("Full")),
    ("Output format", Wanted::Choice("RGB")),
    ("Colorspace", Wanted::Choice("Default")),
    ("content type", Wanted::Choice("Graphics")),
    ("scaling mode", Wanted::Choice("None")),
    ("max bpc", Wanted::Number(8)),
    ("left margin", Wanted::Number(0)),
    ("right margin", Wanted::Number(0)),
    ("top margin", Wanted::Number(0)),
    ("bottom margin", Wanted::Number(0)),
];
const CRTC: [(&str, Wanted); 4] = [
    ("GAMMA_LUT", Wanted::NoTable),
    ("DEGAMMA_LUT", Wanted::NoTable),
    ("CTM", Wanted::NoTable),
    ("VRR_ENABLED", Wanted::Number(0)),
];
/// Properties of the plane. Rotation is a bit mask whose bit 0 is "rotate-0".
const PLANE: [(&str, Wanted); 2] =
    [("rotation", Wanted::Number(1)), ("alpha", Wanted::Number(0xffff))];

/// Pipe of the display hardware.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pipe {
    pub(super) connector: connector::Handle,
    pub(super) crtc: crtc::Handle,
    pub(super) plane: plane::Handle,
}

/// Adds to `request` those of the `wanted` properties that `object` has; returns the values to
/// confirm afterwards.
fn ask<T: ResourceHandle>(
    request: &mut AtomicModeReq,
    object: T,
    has: &Properties,
    wanted: &[(&'static str, Wanted)],
) -> Vec<(&'static str, u64)> {
    let mut checks = Vec::new();
    for (name, want) in wanted {
        let Some((info, _)) = has.get(name) else { continue };
        let value = match want {
            Wanted::Choice(word) => choice_value(info, word),
            Wanted::NoTable => Some(0),
            Wanted::Number(number) => Some(match info.value_type() {
                property::ValueType::UnsignedRange(low, high) => (*number).clamp(*low, *high),
                _ => *number,
            }),
        };
        if let (Some(value), true) = (value, info.mutable()) {
            request.add_raw_property(object.into(), info.handle(), value);
            checks.push((*name, value));
        }
    }
    checks
}

/// Checks that the properties in `checks` read back with their values.
fn confirm(has: &Properties, checks: &[(&'static str, u64)]) -> Result<(), RigError> {
    for &(name, value) in checks {
        if let Some((_, found)) = has.get(name).filter(|&(_, found)| found != value) {
            let found = format!("{name} reads back as {found} after it was set");
            return Err(RigError::refused("panel", found, format!("{name} = {value}")));
        }
    }
    Ok(())
}

/// Switches the pipe off; the next mode is then set even if it is the same.
pub(super) fn darken(card: &Card, pipe: Pipe) -> Result<(), RigError> {
    let active = card.properties(pipe.crtc)?.handle("ACTIVE")?;
    let mut request = AtomicModeReq::new();
    request.add_property(pipe.crtc, active, property::Value::Boolean(false));
    card.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request).map_err(commit_failed)
}

/// Shows `picture` on the pipe in `mode`, pixel for pixel, and reads every setting back.
pub(super) fn light_up(
    card: &Card,
    pipe: Pipe,
    mode: &Mode,
    picture: framebuffer::Handle,
) -> Result<(), RigError> {
    let on_connector = card.properties(pipe.connector)?;
    let on_crtc = card.properties(pipe.crtc)?;
    let on_plane = card.properties(pipe.plane)?;
    let mut request = AtomicModeReq::new();
    let blob = card.create_property_blob(mode).map_err(failed("describe the mode"))?;
    let crtc = property::Value::CRTC(Some(pipe.crtc));
    request.add_property(pipe.connector, on_connector.handle("CRTC_ID")?, crtc);
    request.add_property(pipe.crtc, on_crtc.handle("MODE_ID")?, blob);
    request.add_property(pipe.crtc, on_crtc.handle("ACTIVE")?, property::Value::Boolean(true));
    request.add_property(pipe.plane, on_plane.handle("CRTC_ID")?, crtc);
    let shown = property::Value::Framebuffer(Some(picture));
    request.add_property(pipe.plane, on_plane.handle("FB_ID")?, shown);
    let (width, height) = (u64::from(mode.size().0), u64::from(mode.size().1));
    // Source coordinates are 16.16 fixed point; equal source and target sizes avoid a scaler.
    let places = [("SRC_X", 0), ("SRC_Y", 0), ("SRC_W", width << 16), ("SRC_H", height << 16)];
    let targets = [("CRTC_X", 0), ("CRTC_Y", 0), ("CRTC_W", width), ("CRTC_H", height)];
    let mut geometry = Vec::new();
    for (name, value) in places.into_iter().chain(targets) {
        request.add_raw_property(pipe.plane.into(), on_plane.handle(name)?, value);
        geometry.push((name, value));
    }
    // A link that failed its training stays black until the mode is set with this value.
    if let Some((info, _)) = on_connector.get("link-status")
        && let Some(good) = choice_value(info, "Good")
    {
        request.add_raw_property(pipe.connector.into(), info.handle(), good);
    }
    let connector = ask(&mut request, pipe.connector, &on_connector, &CONNECTOR);
    let crtc = ask(&mut request, pipe.crtc, &on_crtc, &CRTC);
    let mut plane = ask(&mut request, pipe.plane, &on_plane, &PLANE);
    plane.extend(geometry);

    let outcome = card.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request);
    if let property::Value::Blob(id) = blob {
        // The kernel holds its own reference while the mode is in use.
        let _ = card.destroy_property_blob(id);
    }
    outcome.map_err(commit_failed)?;
    confirm(&card.properties(pipe.connector)?, &connector)?;
    confirm(&card.properties(pipe.crtc)?, &crtc)?;
    confirm(&card.properties(pipe.plane)?, &plane)
}
