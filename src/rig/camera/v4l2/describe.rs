//! Description of a board's media graphs and video nodes, for reports, without bus addresses and
//! serial numbers.

use std::fmt::{Result, Write};

use super::finding::root;
use super::kernel::Node;
use super::media;

/// Video nodes described.
const NODES_MAX: usize = 64;

/// Writes graphs, formats and controls of all cameras to `text`.
pub fn describe(text: &mut impl Write) -> Result {
    media::describe(text)?;
    for number in 0..NODES_MAX {
        let path = root().join(format!("dev/video{number}"));
        let Ok(node) = Node::open(&path) else { continue };
        let Ok(identity) = node.identity() else { continue };
        writeln!(text, "video{number}: {:?} of {}", identity.card, identity.driver)?;
        let formats = node.formats();
        let formats = formats.iter().map(|code| String::from_utf8_lossy(code));
        writeln!(text, "  formats {}", formats.collect::<Vec<_>>().join(" "))?;
        describe_controls(&node, text)?;
    }
    Ok(())
}

/// Writes values and ranges of all controls of `node`.
pub(super) fn describe_controls(node: &Node, text: &mut impl Write) -> Result {
    for control in node.controls() {
        let value = node.control(control.id).map_or("?".to_owned(), |value| value.to_string());
        let (name, least, most) = (control.name, control.minimum, control.maximum);
        writeln!(text, "  {name} = {value} ({least} to {most}, default {})", control.default)?;
    }
    Ok(())
}
