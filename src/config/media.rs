//! `[hardware.camera.media]`: the media graph between a board's sensor and its video node, as
//! links and formats that must be set before it gives pictures.

use super::error::ConfigError;
use super::keys::table;
use super::places::Places;

table! {
    /// The media graph of a board's camera (`media-ctl --print-topology`), in place of `device` and
    /// `card`. Entities are called as the kernel does; the bus address at a sensor's end
    /// (`imx296 10-001a`) may be left out. Links and formats are set in this order whenever the
    /// camera is opened.
    @[derive(Eq)]
    pub struct MediaGraph {
        /// The driver of the media device.
        driver: String, Text, Never;
        /// The entity that pictures are taken from.
        capture: String, Text, Never;
        /// The entity that has the sensor's controls, where it is not the video node itself.
        sensor: Option<String>, Text, Says("the video node has them");
        /// Links that must be on or off.
        link: Vec<MediaLink>, Tables(&MediaLink::TABLE), Means("[]");
        /// Formats at pads, from the sensor on: each may change what comes after it.
        format: Vec<PadFormat>, Tables(&PadFormat::TABLE), Means("[]");
    }
}

table! {
    /// A link of the media graph.
    @[derive(Eq)]
    pub struct MediaLink {
        /// The pad it comes from: an entity, `:` and the pad's number.
        from: String, Text, Never;
        /// The pad it goes to.
        to: String, Text, Never;
        /// Whether it is on.
        on: bool, Truth, Means("true");
    }
}

table! {
    /// What goes through a pad of the media graph. Its size is `[camera]`'s.
    @[derive(Eq)]
    pub struct PadFormat {
        /// An entity, `:` and the pad's number.
        pad: String, Text, Never;
        /// The name of its bus format, without `MEDIA_BUS_FMT_`.
        code: String, Such("a bus format's name, such as SRGGB10_1X10", |value| {
            value.as_str().is_some_and(|name| bus_format(name).is_some())
        }), Never;
    }
}

/// The number of a media bus format (<linux/media-bus-format.h>).
pub fn bus_format(name: &str) -> Option<u32> {
    BUS_FORMATS.iter().find(|(known, _)| *known == name).map(|&(_, number)| number)
}

/// The name of a media bus format, or its number where relens knows none.
pub fn bus_format_name(number: u32) -> String {
    let known = BUS_FORMATS.iter().find(|&&(_, of)| of == number);
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

/// An entity and the number of its pad.
pub fn entity_and_pad(text: &str) -> Option<(&str, u32)> {
    let (entity, pad) = text.rsplit_once(':')?;
    let known = |entity: &&str| !entity.is_empty();
    Some(entity).filter(known).zip(pad.parse().ok().filter(|pad| *pad <= u32::from(u16::MAX)))
}

impl MediaGraph {
    /// The rules across keys.
    pub(super) fn check(&self, places: &Places) -> Result<(), ConfigError> {
        let links = self.link.iter().flat_map(|link| [&link.from, &link.to]);
        for pad in links.chain(self.format.iter().map(|format| &format.pad)) {
            places.hold(
                entity_and_pad(pad).is_some(),
                "hardware.camera.media",
                format_args!("pad {pad:?}"),
                "an entity, : and the pad's number, such as \"csi2:4\"",
            )?;
        }
        Ok(())
    }

    /// Every entity that is named.
    pub fn entities(&self) -> impl Iterator<Item = &str> {
        let links = self.link.iter().flat_map(|link| [&link.from, &link.to]);
        let pads = links.chain(self.format.iter().map(|format| &format.pad));
        let of_pads = pads.filter_map(|pad| entity_and_pad(pad)).map(|(entity, _)| entity);
        of_pads.chain(self.sensor.as_deref()).chain([self.capture.as_str()])
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
    fn bus_formats_come_back_from_their_numbers() {
        for (name, number) in BUS_FORMATS {
            assert_eq!(bus_format(name), Some(number));
            assert_eq!(bus_format_name(number), name);
        }
        assert_eq!(bus_format("SRGGB14_1X14"), None);
        assert_eq!(bus_format_name(7), "format 0x0007");
    }
}
