//! Set-up of the media graph of a board's camera: links and formats of the rig file are set and
//! read back whenever the camera is opened, since other programs (`rpicam-apps`) change them.

mod graph;
mod kernel;

use std::path::{Path, PathBuf};

use rustix::fs::{makedev, stat};

use self::graph::{Entity, Graph, refused};
use self::kernel::{ENABLED, MediaDevice, PadSetting, link_end, pad_format, set_pad_format, wish};
use super::finding::{busy_or, gone};
use super::kernel::Node;

use crate::config::{MediaGraph, PadFormat, bus_format, bus_format_name};
use crate::frame::Size;
use crate::rig::RigError;

/// Media devices searched.
const MEDIA_MAX: usize = 32;
/// Device nodes searched per kind.
const NODES_MAX: usize = 256;

/// Nodes of a configured graph.
pub(super) struct SetUp {
    /// Capture node.
    pub(super) capture: Node,
    /// Node of the sensor's controls, if that is another one.
    pub(super) sensor: Option<Node>,
}

/// Sets links and formats for pictures of `size`.
///
/// # Errors
/// [`RigError::Gone`] without such a media device, [`RigError::Held`] while another program streams
/// through it, [`RigError::Refused`] if an entity or link is missing, or a link or pad refuses its
/// setting.
pub(super) fn set_up(wanted: &MediaGraph, size: Size) -> Result<SetUp, RigError> {
    let (device, graph) = find(wanted)?;
    for link in &wanted.link {
        let way = graph.way(&link.from, &link.to)?;
        if way.is_on() == link.on {
            continue;
        }
        let refusal = |cause: &str| {
            let state = if link.on { "enabled" } else { "disabled" };
            refused(format!("link from {} to {} {state}", link.from, link.to), cause.to_owned())
        };
        if way.is_fixed() {
            return Err(refusal("no change, since the link is immutable"));
        }
        let [from, to] = [way.from, way.to].map(|end| link_end(end.entity, end.pad));
        let flags = (way.flags & !ENABLED) | if link.on { ENABLED } else { 0 };
        device.set_link(from, to, flags).map_err(
            |source| match rustix::io::Errno::from_io_error(&source) {
                Some(rustix::io::Errno::BUSY) => busy_or(source, "set a link of its media graph"),
                _ => refusal(&format!("other links (the driver reports: {source})")),
            },
        )?;
    }
    for format in &wanted.format {
        settle_pad(&graph, format, size)?;
    }
    // A later pad may have changed an earlier one.
    for format in &wanted.format {
        let (entity, pad) = graph.pad(&format.pad)?;
        let found = pad_format(&open(entity)?, pad)
            .map_err(|source| busy_or(source, "read a format of its media graph"))?;
        compare(format, size, &found)?;
    }
    let sensor = wanted.sensor.as_deref().map(|name| open(graph.entity(name)?)).transpose()?;
    let capture = graph.entity(&wanted.capture)?;
    let node = open(capture)?;
    match node.identity() {
        Ok(identity) if identity.streams_pictures => Ok(SetUp { capture: node, sensor }),
        _ => Err(refused(
            format!("{:?} takes no pictures", capture.name),
            "the entity of a capture node".to_owned(),
        )),
    }
}

/// Finds the media device of the driver whose graph has all named entities.
fn find(wanted: &MediaGraph) -> Result<(MediaDevice, Graph), RigError> {
    let (mut others, mut refusal, mut found) = (Vec::new(), None, None);
    for number in 0..MEDIA_MAX {
        let path = format!("/dev/media{number}");
        let device = match MediaDevice::open(Path::new(&path)) {
            Ok(device) => device,
            Err(cause) => {
                if cause.kind() != std::io::ErrorKind::NotFound {
                    others.push(format!("{path}, which cannot be opened ({cause})"));
                }
                continue;
            }
        };
        let Ok(driver) = device.driver() else { continue };
        if driver != wanted.driver {
            others.push(format!("{driver:?}"));
            continue;
        }
        let objects = device.objects().map_err(|cause| gone(format!("{path}: {cause}")))?;
        let graph = Graph::of(&objects);
        match wanted.entities().try_for_each(|name| graph.entity(name).map(|_| ())) {
            Ok(()) if found.is_some() => {
                return Err(refused(
                    format!("two media devices of {driver:?} with these entities"),
                    "one; name the sensor with its bus address".to_owned(),
                ));
            }
            Ok(()) => found = Some((device, graph)),
            Err(missing) => refusal = refusal.or(Some(missing)),
        }
    }
    let there = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
    let none = || gone(format!("no media device of driver {:?}; there: {there}", wanted.driver));
    found.ok_or_else(|| refusal.unwrap_or_else(none))
}

/// Opens the device node of an entity.
fn open(entity: &Entity) -> Result<Node, RigError> {
    let path = entity.node.and_then(|(major, minor)| {
        let names = ["/dev/video", "/dev/v4l-subdev"];
        let mut paths =
            names.iter().flat_map(|name| (0..NODES_MAX).map(move |n| format!("{name}{n}")));
        let is_it = |path: &String| {
            stat(path.as_str()).is_ok_and(|found| found.st_rdev == makedev(major, minor))
        };
        paths.find(is_it).map(PathBuf::from)
    });
    let path = path.ok_or_else(|| {
        refused(
            format!("{:?} has no device node", entity.name),
            "an entity with one (`media-ctl --print-topology`)".to_owned(),
        )
    })?;
    Node::open(&path).map_err(|cause| gone(format!("{}: {cause}", path.display())))
}

fn settle_pad(graph: &Graph, format: &PadFormat, size: Size) -> Result<(), RigError> {
    let (entity, pad) = graph.pad(&format.pad)?;
    let code = bus_format(&format.code).unwrap_or_default();
    let wanted = wish(pad, (size.width as u32, size.height as u32), code);
    let settled = set_pad_format(&open(entity)?, wanted).map_err(|source| {
        match rustix::io::Errno::from_io_error(&source) {
            Some(rustix::io::Errno::INVAL) => {
                refused(format!("{} at {}", format.code, format.pad), "another pad".to_owned())
            }
            _ => busy_or(source, "take a format in its media graph"),
        }
    })?;
    compare(format, size, &settled)
}

/// Checks the format of a pad.
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
