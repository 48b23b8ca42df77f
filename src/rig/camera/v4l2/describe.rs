//! Description of a board's media graphs and video nodes, for reports, without bus addresses and
//! serial numbers.

use std::fmt::{Result, Write};

use super::finding::nodes;
use super::kernel::Node;
use super::media;

/// Writes graphs, formats and controls of all cameras to `text`.
pub fn describe(text: &mut impl Write) -> Result {
    media::describe(text)?;
    for (name, node) in nodes() {
        let Ok(identity) = node.identity() else { continue };
        writeln!(text, "{name}: {:?} of {}", identity.card, identity.driver)?;
        writeln!(text, "  formats {}", node.formats().join(" "))?;
        describe_controls(&node, text)?;
    }
    Ok(())
}

pub(super) fn describe_controls(node: &Node, text: &mut impl Write) -> Result {
    for control in node.controls() {
        let value = node.control(control.id).map_or("?".to_owned(), |value| value.to_string());
        let (name, least, most) = (control.name, control.minimum, control.maximum);
        writeln!(text, "  {name} = {value} ({least} to {most}, default {})", control.default)?;
    }
    Ok(())
}
