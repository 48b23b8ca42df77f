//! What makes a display a measuring instrument: full range, no scaling, identity gamma; set, then
//! read back.
//!
//! A television is built to improve the picture. Whatever of that the kernel can switch off is
//! switched off here, and a driver that says one thing and does another is found out before any
//! photo is.

use drm::control::{AtomicCommitFlags, Device as _, Mode, ResourceHandle, atomic::AtomicModeReq};
use drm::control::{connector, crtc, framebuffer, plane, property};

use super::RigError;
use super::kms_card::{Card, Properties, choice_value, failed};

/// One property as it must be, where a driver has it.
enum Wanted {
    /// The word of an enumeration.
    Choice(&'static str),
    /// A number, clamped into the property's range.
    Number(u64),
    /// No table (blob id 0) where a table would bend the codes.
    NoTable,
}

/// On the connector. "Broadcast RGB" full: a limited range crushes the lowest and highest 16 codes.
/// "content type" Graphics tells a television to neither overscan nor sharpen.
const CONNECTOR: [(&str, Wanted); 9] = [
    ("Broadcast RGB", Wanted::Choice("Full")),
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
/// Rotation is a bit mask whose bit 0 is "rotate-0".
const PLANE: [(&str, Wanted); 2] =
    [("rotation", Wanted::Number(1)), ("alpha", Wanted::Number(0xffff))];

/// Which pipe of the display hardware shows our picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pipe {
    pub(super) connector: connector::Handle,
    pub(super) crtc: crtc::Handle,
    pub(super) plane: plane::Handle,
}

/// Settings asked for and still to be confirmed: object, property, value.
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

/// Whether every checked property of `has` holds its value.
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

/// Lights the pipe with `mode` and `picture`, pixel for pixel, and reads every setting back.
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
    // Source coordinates are 16.16 fixed point; source and target alike means no scaler in between.
    let places = [("SRC_X", 0), ("SRC_Y", 0), ("SRC_W", width << 16), ("SRC_H", height << 16)];
    let targets = [("CRTC_X", 0), ("CRTC_Y", 0), ("CRTC_W", width), ("CRTC_H", height)];
    let mut geometry = Vec::new();
    for (name, value) in places.into_iter().chain(targets) {
        request.add_raw_property(pipe.plane.into(), on_plane.handle(name)?, value);
        geometry.push((name, value));
    }
    // A link that failed its training stays black until the mode is set again with this word.
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
        // The kernel keeps its own reference while the mode is in use.
        let _ = card.destroy_property_blob(id);
    }
    outcome.map_err(super::kms_panel::commit_failed)?;
    confirm(&card.properties(pipe.connector)?, &connector)?;
    confirm(&card.properties(pipe.crtc)?, &crtc)?;
    confirm(&card.properties(pipe.plane)?, &plane)
}

/// The same through the legacy interface: mode by `SETCRTC`, properties one by one, a straight
/// gamma ramp where the driver does not tell of its table.
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
        .map_err(super::kms_panel::commit_failed)?;
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

/// Gives `object` the properties it has of `wanted`, and reads them back.
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
        // Setting what is set already may cost a refresh, or a flicker.
        if has.get(name).is_some_and(|(_, found)| found != value) {
            card.set_property(object, has.handle(name)?, value)
                .map_err(failed("set a property"))?;
        }
    }
    confirm(&card.properties(object)?, &checks)
}
