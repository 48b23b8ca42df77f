//! Display settings for measuring: full range, no scaling, identity gamma; each set and read back.
//!
//! Everything by which a television improves its picture is switched off as far as the kernel can.
//! A driver that does not hold a setting is refused.

use drm::control::{AtomicCommitFlags, Device as _, Mode, ResourceHandle, atomic::AtomicModeReq};
use drm::control::{connector, crtc, framebuffer, plane, property};

use super::RigError;
use super::kms_card::{Card, Properties, choice_value, commit_failed, failed};

/// Required value of a property, on drivers that have it.
enum Wanted {
    /// Word of an enumeration.
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
/// Properties of the CRTC.
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

/// A request under construction, with the property values to confirm afterwards.
struct Asked<'a> {
    request: &'a mut AtomicModeReq,
    checks: Vec<(&'static str, u64)>,
}

impl Asked<'_> {
    fn add<T: ResourceHandle>(
        &mut self,
        object: T,
        has: &Properties,
        wanted: &[(&'static str, Wanted)],
    ) {
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
                self.request.add_raw_property(object.into(), info.handle(), value);
                self.checks.push((name, value));
            }
        }
    }
}

/// Checks that the properties `has` hold their values.
///
/// # Errors
/// [`RigError::Refused`] for the first one that does not.
fn confirm(has: &Properties, checks: &[(&'static str, u64)]) -> Result<(), RigError> {
    for &(name, value) in checks {
        if let Some((_, found)) = has.get(name).filter(|&(_, found)| found != value) {
            return Err(RigError::Refused {
                device: "panel",
                found: format!("{name} reads back as {found} after it was set"),
                allowed: format!("{name} = {value}"),
            });
        }
    }
    Ok(())
}

/// Switches the pipe off; the next mode is then set even if it is the same.
///
/// # Errors
/// As of a refused commit.
pub(super) fn darken(card: &Card, pipe: Pipe) -> Result<(), RigError> {
    let active = card.properties(pipe.crtc)?.handle("ACTIVE")?;
    let mut request = AtomicModeReq::new();
    request.add_property(pipe.crtc, active, property::Value::Boolean(false));
    card.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request).map_err(commit_failed)
}

/// Shows `picture` on the pipe in `mode`, pixel for pixel, and reads every setting back.
///
/// # Errors
/// [`RigError::Refused`] when a setting does not hold; the driver's error when it refuses the mode.
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
    request.add_property(
        pipe.plane,
        on_plane.handle("FB_ID")?,
        property::Value::Framebuffer(Some(picture)),
    );
    let (width, height) = (u64::from(mode.size().0), u64::from(mode.size().1));
    // Source coordinates are 16.16 fixed point; equal source and target sizes avoid a scaler.
    let places = [("SRC_X", 0), ("SRC_Y", 0), ("SRC_W", width << 16), ("SRC_H", height << 16)];
    let targets = [("CRTC_X", 0), ("CRTC_Y", 0), ("CRTC_W", width), ("CRTC_H", height)];
    let mut geometry = Vec::new();
    for (name, value) in places.into_iter().chain(targets) {
        request.add_raw_property(pipe.plane.into(), on_plane.handle(name)?, value);
        geometry.push((name, value));
    }
    // A link that failed its training stays black until the mode is set with this word.
    if let Some((info, _)) = on_connector.get("link-status")
        && let Some(good) = choice_value(info, "Good")
    {
        request.add_raw_property(pipe.connector.into(), info.handle(), good);
    }
    let mut connector = Asked { request: &mut request, checks: Vec::new() };
    connector.add(pipe.connector, &on_connector, &CONNECTOR);
    let connector = connector.checks;
    let mut crtc = Asked { request: &mut request, checks: Vec::new() };
    crtc.add(pipe.crtc, &on_crtc, &CRTC);
    let crtc = crtc.checks;
    let mut plane = Asked { request: &mut request, checks: geometry };
    plane.add(pipe.plane, &on_plane, &PLANE);
    let plane = plane.checks;

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

/// [`light_up`] through the legacy interface: mode by `SETCRTC`, properties one by one, and a
/// straight gamma ramp where the driver has no property for it.
///
/// # Errors
/// As [`light_up`].
pub(super) fn light_up_legacy(
    card: &Card,
    pipe: Pipe,
    mode: &Mode,
    picture: framebuffer::Handle,
) -> Result<(), RigError> {
    card.set_crtc(pipe.crtc, Some(picture), (0, 0), &[pipe.connector], Some(*mode))
        .map_err(commit_failed)?;
    set_one_by_one(card, pipe.connector, &CONNECTOR)?;
    set_one_by_one(card, pipe.crtc, &CRTC)?;
    set_one_by_one(card, pipe.plane, &PLANE)?;
    if card.properties(pipe.crtc)?.get("GAMMA_LUT").is_some() {
        return Ok(());
    }
    let steps =
        card.get_crtc(pipe.crtc).map_err(failed("ask the gamma ramp"))?.gamma_length() as usize;
    if steps > 1 {
        let ramp: Vec<u16> = (0..steps).map(|n| (n * 65535 / (steps - 1)) as u16).collect();
        card.set_gamma(pipe.crtc, &ramp, &ramp, &ramp)
            .map_err(failed("straighten the gamma ramp"))?;
    }
    Ok(())
}

/// Sets those of the `wanted` properties that `object` has, and reads them back.
fn set_one_by_one<T: ResourceHandle>(
    card: &Card,
    object: T,
    wanted: &[(&'static str, Wanted)],
) -> Result<(), RigError> {
    let has = card.properties(object)?;
    let mut unused = AtomicModeReq::new();
    let mut asked = Asked { request: &mut unused, checks: Vec::new() };
    asked.add(object, &has, wanted);
    let checks = asked.checks;
    for &(name, value) in &checks {
        // Setting an unchanged value may cost a refresh or flicker.
        if has.get(name).is_some_and(|(_, found)| found != value) {
            card.set_property(object, has.handle(name)?, value)
                .map_err(failed("set a property"))?;
        }
    }
    confirm(&card.properties(object)?, &checks)
}
