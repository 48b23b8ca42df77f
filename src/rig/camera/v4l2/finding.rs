//! Search for a video node, and its errors.

use std::path::Path;

#[cfg(test)]
pub(super) use super::tests::kernel::root;

use rustix::io::Errno;

use super::kernel::Node;
use super::request::is;
use crate::rig::RigError;
use crate::rig::camera::memory::{gone, refused};
use crate::rig::device::listed;

/// Number of video nodes searched.
const NODES_MAX: usize = 64;

/// Folder that holds `dev` and `sys`.
#[cfg(not(test))]
pub(super) fn root() -> std::path::PathBuf {
    "/".into()
}

/// Error of a video node; EBUSY means that another program streams from it.
pub(super) fn busy_or(source: std::io::Error, doing: &'static str) -> RigError {
    if is(&source, Errno::BUSY) {
        return RigError::held("camera", "another program streams from it");
    }
    RigError::Failed { device: "camera", doing, source }
}

/// Opens the node at `path`.
pub(super) fn open(path: &Path) -> Result<Node, RigError> {
    Node::open(path).map_err(|cause| gone(format!("{}: {cause}", path.display())))
}

/// All video nodes that can be opened, by name.
pub(super) fn nodes() -> impl Iterator<Item = (String, Node)> {
    let names = (0..NODES_MAX).map(|number| format!("video{number}"));
    let opened = |name: &String| Node::open(&root().join("dev").join(name)).ok();
    names.filter_map(move |name| opened(&name).map(|node| (name, node)))
}

pub(super) fn by_link(path: &Path) -> Result<Node, RigError> {
    let node = open(path)?;
    match node.identity() {
        Ok(identity) if identity.streams_pictures => Ok(node),
        _ => Err(refused(
            format!("{} takes no pictures", path.display()),
            "a capture node (usually the one ending in video-index0)",
        )),
    }
}

pub(super) fn by_card(wanted: &str) -> Result<Node, RigError> {
    let mut others = Vec::new();
    let mut found = None;
    for (_, node) in nodes() {
        let Ok(identity) = node.identity() else { continue };
        if !identity.streams_pictures {
            continue;
        }
        if identity.card != *wanted {
            others.push(format!("{:?}", identity.card));
        } else if found.replace(node).is_some() {
            return Err(refused(
                format!("two cameras called {wanted:?}"),
                "one, or its link under /dev/v4l/by-id or by-path",
            ));
        }
    }
    let there = listed(&others);
    found.ok_or_else(|| gone(format!("no camera is called {wanted:?}; there: {there}")))
}
