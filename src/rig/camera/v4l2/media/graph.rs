//! A media graph with lookup by name.

use super::super::kernel::text;
use super::kernel::{ENABLED, IMMUTABLE, INTERFACE_LINK, Objects, PAD_LINK};
use crate::config::entity_and_pad;
use crate::rig::RigError;
use crate::rig::camera::memory;

/// A node of the graph between sensor and memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entity {
    pub(super) id: u32,
    pub(super) name: String,
    /// Major and minor number of its device node, if any.
    pub(super) node: Option<(u32, u32)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PadPlace {
    pub(super) entity: u32,
    pub(super) pad: u32,
}

/// A link between pads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Way {
    pub(super) from: PadPlace,
    pub(super) to: PadPlace,
    pub(super) flags: u32,
}

impl Way {
    pub(super) fn is_on(&self) -> bool {
        self.flags & ENABLED != 0
    }

    pub(super) fn is_fixed(&self) -> bool {
        self.flags & IMMUTABLE != 0
    }
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Graph {
    pub(super) entities: Vec<Entity>,
    pub(super) ways: Vec<Way>,
}

pub(super) fn refused(found: String, allowed: impl Into<String>) -> RigError {
    memory::refused(format!("media graph: {found}"), allowed)
}

impl Graph {
    pub(super) fn of(objects: &Objects) -> Graph {
        let node = |entity: u32| {
            let links = objects.links.iter().filter(|link| link.kind() == INTERFACE_LINK);
            let mut own = links.filter(|link| link.sink == entity).map(|link| link.source);
            let interface =
                own.find_map(|id| objects.interfaces.iter().find(|interface| interface.id == id))?;
            Some((interface.major, interface.minor))
        };
        let pad = |id: u32| {
            let pad = objects.pads.iter().find(|pad| pad.id == id)?;
            Some(PadPlace { entity: pad.entity, pad: pad.index })
        };
        let entities = objects.entities.iter();
        let entities = entities.map(|e| Entity { id: e.id, name: text(&e.name), node: node(e.id) });
        let links = objects.links.iter().filter(|link| link.kind() == PAD_LINK);
        let ways = links.filter_map(|link| {
            let (from, to) = (pad(link.source)?, pad(link.sink)?);
            Some(Way { from, to, flags: link.flags })
        });
        Graph { entities: entities.collect(), ways: ways.collect() }
    }

    /// The entity `name`, with or without its bus address.
    pub(super) fn entity(&self, name: &str) -> Result<&Entity, RigError> {
        if let Some(entity) = self.entities.iter().find(|entity| entity.name == name) {
            return Ok(entity);
        }
        let up_to_its_address = |entity: &&Entity| {
            let (before, address) = entity.name.rsplit_once(' ').unwrap_or(("", ""));
            before == name && address.contains('-')
        };
        let quoted = |entity: &Entity| format!("{:?}", entity.name);
        let alike: Vec<&Entity> = self.entities.iter().filter(up_to_its_address).collect();
        match alike[..] {
            [only] => Ok(only),
            [] => {
                let there: Vec<String> = self.entities.iter().map(quoted).collect();
                Err(refused(format!("no entity {name:?}"), there.join(", ")))
            }
            _ => {
                let there: Vec<String> = alike.iter().copied().map(quoted).collect();
                Err(refused(format!("{} entities {name:?}", alike.len()), there.join(" or ")))
            }
        }
    }

    /// Parses a pad of a rig file.
    pub(super) fn pad(&self, text: &str) -> Result<(&Entity, u32), RigError> {
        let (name, pad) = entity_and_pad(text)
            .ok_or_else(|| refused(format!("pad {text:?}"), "an entity, : and a number"))?;
        Ok((self.entity(name)?, pad))
    }

    /// The link between two pads of a rig file.
    pub(super) fn way(&self, from: &str, to: &str) -> Result<Way, RigError> {
        let place = |(entity, pad): (&Entity, u32)| PadPlace { entity: entity.id, pad };
        let (source, sink) = (place(self.pad(from)?), place(self.pad(to)?));
        let between = self.ways.iter().find(|way| way.from == source && way.to == sink);
        between.copied().ok_or_else(|| {
            let near =
                |way: &&Way| way.from.entity == source.entity || way.to.entity == sink.entity;
            let near: Vec<String> =
                self.ways.iter().filter(near).map(|way| self.spelled(way)).collect();
            let there = if near.is_empty() { "none there".to_owned() } else { near.join(", ") };
            refused(format!("no link from {from} to {to}"), there)
        })
    }

    /// Pads of `entity` that have links, in order.
    pub(super) fn pads(&self, entity: &Entity) -> Vec<u32> {
        let ends = self.ways.iter().flat_map(|way| [way.from, way.to]);
        let own = ends.filter(|end| end.entity == entity.id).map(|end| end.pad);
        own.collect::<std::collections::BTreeSet<_>>().into_iter().collect()
    }

    pub(super) fn spelled(&self, way: &Way) -> String {
        let pad = |place: PadPlace| {
            let entity = self.entities.iter().find(|entity| entity.id == place.entity);
            format!("{}:{}", entity.map_or("?", |entity| entity.name.as_str()), place.pad)
        };
        format!("{} to {}", pad(way.from), pad(way.to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A receiver with one sensor, as on a Raspberry Pi 5.
    fn board() -> Graph {
        let names = ["csi2", "pisp-fe", "imx296 10-001a", "rp1-cfe-csi2_ch0"];
        let entity = |(n, name): (usize, &&str)| Entity {
            id: n as u32 + 1,
            name: (*name).to_owned(),
            node: None,
        };
        let way = |from: (u32, u32), to: (u32, u32), flags| Way {
            from: PadPlace { entity: from.0, pad: from.1 },
            to: PadPlace { entity: to.0, pad: to.1 },
            flags,
        };
        Graph {
            entities: names.iter().enumerate().map(entity).collect(),
            ways: vec![
                way((3, 0), (1, 0), ENABLED | IMMUTABLE),
                way((1, 4), (4, 0), 0),
                way((1, 4), (2, 0), ENABLED),
            ],
        }
    }

    #[test]
    fn an_entity_is_found_with_or_without_its_bus_address() {
        let mut graph = board();
        assert_eq!(graph.entity("imx296").unwrap().id, 3);
        assert_eq!(graph.entity("imx296 10-001a").unwrap().id, 3);
        let said = graph.entity("imx477").unwrap_err().to_string();
        assert!(said.contains("no entity \"imx477\"") && said.contains("\"imx296 10-001a\""));
        graph.entities.push(Entity { id: 9, name: "imx296 11-001a".to_owned(), node: None });
        let said = graph.entity("imx296").unwrap_err().to_string();
        assert!(said.contains("2 entities") && said.contains("11-001a"), "{said}");
    }

    #[test]
    fn a_link_is_found_or_the_existing_ones_are_listed() {
        let graph = board();
        assert!(!graph.way("csi2:4", "rp1-cfe-csi2_ch0:0").unwrap().is_on());
        let fixed = graph.way("imx296:0", "csi2:0").unwrap();
        assert!(fixed.is_on() && fixed.is_fixed());
        let said = graph.way("csi2:5", "rp1-cfe-csi2_ch0:0").unwrap_err().to_string();
        assert!(said.contains("no link from csi2:5 to rp1-cfe-csi2_ch0:0"), "{said}");
        assert!(said.contains("csi2:4 to rp1-cfe-csi2_ch0:0"), "{said}");
    }
}
