//! How a video node is found, and what is said when it is not there or somebody has it.

use std::path::{Path, PathBuf};

use super::kernel::Node;
use crate::config::MediaGraph;
use crate::rig::RigError;

/// Video nodes looked at when a camera is found by its card's name.
const NODES_MAX: usize = 64;

/// How a camera is found; never by its number, which changes with every plug.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CameraName {
    /// A link that udev keeps, such as `/dev/v4l/by-id/usb-…-video-index0`.
    Link(PathBuf),
    /// The card's name as the driver gives it (`v4l2-ctl --info`); must be the only one of that
    /// name.
    Card(String),
    /// What the media graph ends in, which is set up first.
    Graph(MediaGraph),
}

pub(super) fn gone(what: String) -> RigError {
    RigError::Gone { device: "camera", what }
}

/// EBUSY is the kernel's word for "another program streams from it".
pub(super) fn busy_or(source: std::io::Error, doing: &'static str) -> RigError {
    if rustix::io::Errno::from_io_error(&source) == Some(rustix::io::Errno::BUSY) {
        let what = "another program streams from it".to_owned();
        return RigError::Held { device: "camera", what };
    }
    RigError::Failed { device: "camera", doing, source }
}

pub(super) fn by_link(path: &Path) -> Result<Node, RigError> {
    let node = Node::open(path).map_err(|cause| gone(format!("{}: {cause}", path.display())))?;
    match node.identity() {
        Ok(identity) if identity.streams_pictures => Ok(node),
        _ => Err(RigError::Refused {
            device: "camera",
            found: format!("{} takes no pictures", path.display()),
            allowed: "a capture node (usually the one ending in video-index0)".to_owned(),
        }),
    }
}

pub(super) fn by_card(wanted: &str) -> Result<Node, RigError> {
    let mut others = Vec::new();
    let mut found = None;
    for number in 0..NODES_MAX {
        let Ok(node) = Node::open(Path::new(&format!("/dev/video{number}"))) else {
            continue;
        };
        let Ok(identity) = node.identity() else { continue };
        if !identity.streams_pictures {
            continue;
        }
        if identity.card != *wanted {
            others.push(format!("{:?}", identity.card));
        } else if found.replace(node).is_some() {
            return Err(RigError::Refused {
                device: "camera",
                found: format!("two cameras called {wanted:?}"),
                allowed: "one, or its link under /dev/v4l/by-id or by-path".to_owned(),
            });
        }
    }
    let there = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
    found.ok_or_else(|| gone(format!("no camera is called {wanted:?}; there: {there}")))
}
