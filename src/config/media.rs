//! `[hardware.camera.media]`: links and formats of the media graph between a board's sensor and its
//! video node.

use super::keys::{Allowed, table};

table! {
    /// Media graph of a board's camera (`media-ctl --print-topology`), instead of `device` or
    /// `card`. Entities have the kernel's names; a sensor's bus address (`imx296 10-001a`) may be
    /// left out. Links and formats are set in this order whenever the camera is opened.
    @[derive(Eq)]
    pub struct MediaGraph {
        /// Driver of the media device.
        driver: String, Text, Never;
        /// Entity that delivers the frames.
        capture: String, Text, Never;
        /// Entity with the sensor's controls.
        sensor: Option<String>, Text, Says("the video node");
        /// Links to enable or disable.
        link: Vec<MediaLink>, Tables(&MediaLink::TABLE), Means("[]");
        /// Formats of pads from the sensor onwards, since each may change those after it.
        format: Vec<PadFormat>, Tables(&PadFormat::TABLE), Means("[]");
    }
}

table! {
    /// A link of the media graph.
    @[derive(Eq)]
    pub struct MediaLink {
        /// Source pad: an entity, `:` and the pad's number.
        from: String, PAD, Never;
        /// Sink pad.
        to: String, PAD, Never;
        /// Whether the link is enabled.
        on: bool, Truth, Means("true");
    }
}

table! {
    /// Format of a pad of the media graph, with the size of `[camera]`.
    @[derive(Eq)]
    pub struct PadFormat {
        /// Pad: an entity, `:` and the pad's number.
        pad: String, PAD, Never;
        /// Name of the bus format, without `MEDIA_BUS_FMT_`.
        code: String, Such("a bus format's name, such as SRGGB10_1X10", |value| {
            value.as_str().is_some_and(|name| bus_format(name).is_some())
        }), Never;
    }
}

/// Number of a media bus format (<linux/media-bus-format.h>).
pub fn bus_format(name: &str) -> Option<u32> {
    BUS_FORMATS.iter().find(|(one, _)| *one == name).map(|&(_, number)| number)
}

/// Name of a media bus format, or its number if it is unknown.
pub fn bus_format_name(number: u32) -> String {
    let known = BUS_FORMATS.iter().find(|&&(_, one)| one == number);
    known.map_or_else(|| format!("format {number:#06x}"), |(name, _)| (*name).to_owned())
}

const BUS_FORMATS: [(&str, u32); 22] = [
    ("Y8_1X8", 0x2001),
    ("Y10_1X10", 0x200a),
    ("Y12_1X12", 0x2013),
    ("Y16_1X16", 0x202e),
    ("SBGGR8_1X8", 0x3001),
    ("SGBRG8_1X8", 0x3013),
    ("SGRBG8_1X8", 0x3002),
    ("SRGGB8_1X8", 0x3014),
    ("SBGGR10_1X10", 0x3007),
    ("SGBRG10_1X10", 0x300e),
    ("SGRBG10_1X10", 0x300a),
    ("SRGGB10_1X10", 0x300f),
    ("SBGGR12_1X12", 0x3008),
    ("SGBRG12_1X12", 0x3010),
    ("SGRBG12_1X12", 0x3011),
    ("SRGGB12_1X12", 0x3012),
    ("SBGGR16_1X16", 0x301d),
    ("SGBRG16_1X16", 0x301e),
    ("SGRBG16_1X16", 0x301f),
    ("SRGGB16_1X16", 0x3020),
    ("BGR888_1X24", 0x1013),
    ("RGB888_1X24", 0x100a),
];

/// Splits a pad into its entity and number.
pub fn entity_and_pad(text: &str) -> Option<(&str, u32)> {
    let (entity, pad) = text.rsplit_once(':')?;
    let is_named = |entity: &&str| !entity.is_empty();
    Some(entity).filter(is_named).zip(pad.parse().ok().filter(|pad| *pad <= u32::from(u16::MAX)))
}

const PAD: Allowed =
    Allowed::Such("an entity, : and the pad's number, such as \"csi2:4\"", |value| {
        value.as_str().is_some_and(|pad| entity_and_pad(pad).is_some())
    });

impl MediaGraph {
    /// All entities named in links and formats, and those of sensor and capture.
    pub fn entities(&self) -> impl Iterator<Item = &str> {
        let links = self.link.iter().flat_map(|link| [&link.from, &link.to]);
        let pads = links.chain(self.format.iter().map(|format| &format.pad));
        let entities = pads.filter_map(|pad| entity_and_pad(pad)).map(|(entity, _)| entity);
        entities.chain(self.sensor.as_deref()).chain([self.capture.as_str()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pad_is_an_entity_and_a_number() {
        assert_eq!(entity_and_pad("csi2:4"), Some(("csi2", 4)));
        assert_eq!(entity_and_pad("imx296 10-001a:0"), Some(("imx296 10-001a", 0)));
        for wrong in ["csi2", ":4", "csi2:", "csi2:-1", "csi2:99999"] {
            assert_eq!(entity_and_pad(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn bus_formats_round_trip_through_their_numbers() {
        for (name, number) in BUS_FORMATS {
            assert_eq!(bus_format(name), Some(number));
            assert_eq!(bus_format_name(number), name);
        }
        assert_eq!(bus_format("SRGGB14_1X14"), None);
        assert_eq!(bus_format_name(7), "format 0x0007");
    }
}
