//! Set-up of the media graph of a board's camera: links and formats of the rig file are set and
//! read back whenever the camera is opened, since other programs (`rpicam-apps`) change them.

mod graph;
mod kernel;

use std::collections::BTreeMap;
use std::fmt::Write;

use rustix::fs::readlink;
use rustix::io::Errno;

use self::graph::{Entity, Graph, Way, refused};
use self::kernel::{ENABLED, MediaDevice, PadSetting, link_end, pad_format, set_pad_format, wish};
use super::controls::settle_orientation;
use super::describe::describe_controls;
use super::finding::{self, busy_or, root};
use super::kernel::Node;
use super::request::is;
use crate::rig::camera::memory::gone;
use crate::rig::device::listed;

use crate::config::{MediaGraph, MediaLink, PadFormat, bus_format, bus_format_name};
use crate::frame::Size;
use crate::rig::RigError;

const MEDIA_MAX: usize = 32;

/// Nodes of a configured graph.
pub(super) struct SetUp {
    pub(super) capture: Node,
    /// Node of the sensor's controls, if that is not the capture node.
    pub(super) sensor: Option<Node>,
}

/// Sets links, the sensor's orientation, and formats for pictures of `size`, in this order, since a
/// sensor's format may depend on its flips. Disables all other links that can be changed: rp1-cfe
/// delivers no frame until every node with an enabled link streams, and `rpicam-apps` leave such
/// links behind. `controls` are the rig file's.
///
/// # Errors
/// [`RigError::Gone`] without such a media device, [`RigError::Held`] while another program streams
/// through it, [`RigError::Refused`] if an entity or link is missing, or a link or pad refuses its
/// setting.
pub(super) fn set_up(
    wanted: &MediaGraph,
    size: Size,
    controls: &BTreeMap<String, i32>,
) -> Result<SetUp, RigError> {
    let (device, graph) = find(wanted)?;
    set_links(&device, &graph, &wanted.link)?;
    let sensor = wanted.sensor.as_deref().map(|name| open(graph.entity(name)?)).transpose()?;
    let capture = graph.entity(&wanted.capture)?;
    let node = open(capture)?;
    settle_orientation(sensor.as_ref().unwrap_or(&node), controls)?;
    let mut before = None;
    for format in &wanted.format {
        before = Some(settle_pad(&graph, format, size, before)?);
    }
    // Setting a later pad may have changed an earlier one.
    for format in &wanted.format {
        let (entity, pad) = graph.pad(&format.pad)?;
        let found = pad_format(&open(entity)?, pad)
            .map_err(|source| busy_or(source, "read a format of its media graph"))?;
        compare(format, size, &found)?;
    }
    match node.identity() {
        Ok(identity) if identity.streams_pictures => Ok(SetUp { capture: node, sensor }),
        _ => Err(refused(
            format!("{:?} takes no pictures", capture.name),
            "the entity of a capture node",
        )),
    }
}

/// Disables the links that are not `wanted`, then sets the others.
fn set_links(device: &MediaDevice, graph: &Graph, wanted: &[MediaLink]) -> Result<(), RigError> {
    let mut changes = Vec::new();
    for link in wanted {
        changes.push((graph.way(&link.from, &link.to)?, link.on));
    }
    let is_listed = |way: &Way| changes.iter().any(|(one, _)| one == way);
    let others = graph.ways.iter().filter(|way| !way.is_fixed() && !is_listed(way));
    let mut all: Vec<(Way, bool)> = others.map(|way| (*way, false)).collect();
    all.extend(changes);
    // A pad may allow only one enabled link, so links are disabled first.
    all.sort_by_key(|&(_, on)| on);
    for (way, on) in all.into_iter().filter(|(way, on)| way.is_on() != *on) {
        let refusal = |cause: &str| {
            let state = if on { "enabled" } else { "disabled" };
            refused(format!("link from {} {state}", graph.spelled(&way)), cause)
        };
        if way.is_fixed() {
            return Err(refusal("no change, since the link is immutable"));
        }
        let [from, to] = [way.from, way.to].map(|end| link_end(end.entity, end.pad));
        let flags = (way.flags & !ENABLED) | if on { ENABLED } else { 0 };
        device.set_link(from, to, flags).map_err(|source| match is(&source, Errno::BUSY) {
            true => busy_or(source, "set a link of its media graph"),
            false => refusal(&format!("a link that the driver accepts (it reports: {source})")),
        })?;
    }
    Ok(())
}

/// Writes the graphs of all media devices: links, formats of pads, and controls of subdevices.
pub(super) fn describe(text: &mut impl Write) -> std::fmt::Result {
    for number in 0..MEDIA_MAX {
        let Ok(device) = MediaDevice::open(&root().join(format!("dev/media{number}"))) else {
            continue;
        };
        let (Ok(driver), Ok(objects)) = (device.driver(), device.objects()) else { continue };
        let graph = Graph::of(&objects);
        writeln!(text, "media{number}: {driver}")?;
        for way in &graph.ways {
            let state = if way.is_on() { "on" } else { "off" };
            let fixed = if way.is_fixed() { ", immutable" } else { "" };
            writeln!(text, "  {}: {state}{fixed}", graph.spelled(way))?;
        }
        for entity in &graph.entities {
            let Ok(node) = open(entity) else { continue };
            writeln!(text, " {}", entity.name)?;
            for pad in graph.pads(entity) {
                if let Ok(PadSetting { width, height, code, colours, .. }) = pad_format(&node, pad)
                {
                    let code = bus_format_name(code);
                    writeln!(text, "  pad {pad}: {code} of {width}×{height}, colours {colours}")?;
                }
            }
            describe_controls(&node, text)?;
        }
    }
    Ok(())
}

/// Finds the media device of the driver whose graph has all named entities.
fn find(wanted: &MediaGraph) -> Result<(MediaDevice, Graph), RigError> {
    let (mut others, mut refusal, mut found) = (Vec::new(), None, None);
    for number in 0..MEDIA_MAX {
        let path = root().join(format!("dev/media{number}"));
        let device = match MediaDevice::open(&path) {
            Ok(device) => device,
            Err(cause) => {
                if cause.kind() != std::io::ErrorKind::NotFound {
                    others.push(format!("{}, which cannot be opened ({cause})", path.display()));
                }
                continue;
            }
        };
        let Ok(driver) = device.driver() else { continue };
        if driver != wanted.driver {
            others.push(format!("{driver:?}"));
            continue;
        }
        let objects =
            device.objects().map_err(|cause| gone(format!("{}: {cause}", path.display())))?;
        let graph = Graph::of(&objects);
        match wanted.entities().try_for_each(|name| graph.entity(name).map(|_| ())) {
            Ok(()) if found.is_some() => {
                return Err(refused(
                    format!("two media devices of {driver:?} with these entities"),
                    "one; name the sensor with its bus address",
                ));
            }
            Ok(()) => found = Some((device, graph)),
            Err(missing) => refusal = refusal.or(Some(missing)),
        }
    }
    let there = listed(&others);
    let none = || gone(format!("no media device of driver {:?}; there: {there}", wanted.driver));
    found.ok_or_else(|| refusal.unwrap_or_else(none))
}

fn open(entity: &Entity) -> Result<Node, RigError> {
    let path = entity.node.and_then(|(major, minor)| {
        // A symbolic link to the device's folder, which is named like the node.
        let folder = readlink(root().join(format!("sys/dev/char/{major}:{minor}")), Vec::new());
        let folder = folder.ok()?.into_string().ok()?;
        Some(root().join("dev").join(folder.rsplit('/').next()?))
    });
    let path = path.ok_or_else(|| {
        refused(
            format!("{:?} has no device node", entity.name),
            "an entity with one (`media-ctl --print-topology`)",
        )
    })?;
    finding::open(&path)
}

/// Sets the format of a pad, with the colour fields of the pad `before` it.
fn settle_pad(
    graph: &Graph,
    format: &PadFormat,
    size: Size,
    before: Option<PadSetting>,
) -> Result<PadSetting, RigError> {
    let (entity, pad) = graph.pad(&format.pad)?;
    let code = bus_format(&format.code).unwrap_or_default();
    let wanted = wish(pad, (size.width as u32, size.height as u32), code, before);
    let settled = set_pad_format(&open(entity)?, wanted);
    let settled = settled.map_err(|source| match is(&source, Errno::INVAL) {
        true => refused(format!("{} at {}", format.code, format.pad), "another pad"),
        false => busy_or(source, "take a format in its media graph"),
    })?;
    compare(format, size, &settled)?;
    Ok(settled)
}

fn compare(format: &PadFormat, size: Size, found: &PadSetting) -> Result<(), RigError> {
    let PadSetting { width, height, code, .. } = *found;
    let same = (width as usize, height as usize) == (size.width, size.height)
        && Some(code) == bus_format(&format.code);
    if same {
        return Ok(());
    }
    Err(refused(
        format!("{} of {size} at {}", format.code, format.pad),
        format!("the driver's choice, {} of {width}×{height}", bus_format_name(code)),
    ))
}
