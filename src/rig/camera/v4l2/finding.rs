//! Search for a video node, and its errors.

use std::path::{Path, PathBuf};

#[cfg(test)]
pub(super) use super::tests::kernel::root;

use super::kernel::Node;
use crate::config::MediaGraph;
use crate::rig::RigError;
use crate::rig::camera::memory::gone;

/// Video nodes searched for a card name.
const NODES_MAX: usize = 64;

/// Stable name of a camera; node numbers change on replugging.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CameraName {
    /// Link of udev, such as `/dev/v4l/by-id/usb-…-video-index0`.
    Link(PathBuf),
    /// Unique card name of the driver (`v4l2-ctl --info`).
    Card(String),
    /// Capture node of a media graph, which is set up first.
    Graph(MediaGraph),
}

/// Folder that holds `dev` and `sys`.
#[cfg(not(test))]
pub(super) fn root() -> PathBuf {
    PathBuf::from("/")
}

/// Error of a video node; EBUSY means that another program streams from it.
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
        let Ok(node) = Node::open(&root().join(format!("dev/video{number}"))) else {
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
