//! A DRM node, opened by its path or by its connector, and access to properties by name.

use std::fmt::Write;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use drm::Device as _;
use drm::control::{Device as _, ResourceHandle, connector, property};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;

use super::RigError;

pub(super) struct Card(OwnedFd);

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl drm::Device for Card {}
impl drm::control::Device for Card {}

/// Wraps an error of the panel that occurred while `doing` something.
pub(super) fn failed(doing: &'static str) -> impl Fn(std::io::Error) -> RigError {
    move |source| RigError::Failed { device: "panel", doing, source }
}

pub(super) fn commit_failed(cause: std::io::Error) -> RigError {
    match Errno::from_io_error(&cause) {
        // EACCES: this program is not DRM master (any more).
        Some(Errno::ACCESS | Errno::PERM) => RigError::held(
            "panel",
            "another program drives the display (it is DRM master); a desktop or a second relens?",
        ),
        Some(Errno::NODEV) => RigError::gone("panel", "the display driver has gone"),
        _ => failed("put a picture on")(cause),
    }
}

/// Paths of the nodes by number, whether they exist or not.
fn numbered() -> impl Iterator<Item = PathBuf> {
    (0..16).map(|n| PathBuf::from(format!("/dev/dri/card{n}")))
}

impl Card {
    fn at(path: &Path) -> Result<Card, Errno> {
        rustix::fs::open(path, OFlags::RDWR | OFlags::CLOEXEC, Mode::empty()).map(Card)
    }

    /// Opens `node`, or the one of `/dev/dri/card*` with the connector `connector` ("HDMI-A-1").
    /// Boards have nodes for 3D and for other panels, in an order that changes from boot to boot.
    ///
    /// # Errors
    /// [`RigError::Gone`] if no node that drives a display can be opened, [`RigError::Refused`] if
    /// no node or more than one has the connector.
    pub(super) fn open(node: Option<&Path>, connector: &str) -> Result<Card, RigError> {
        let candidates: Vec<PathBuf> =
            node.map_or_else(|| numbered().collect(), |path| vec![path.to_owned()]);
        let (mut cards, mut sockets) = (Vec::new(), Vec::new());
        let mut refusal = None;
        for path in candidates {
            match Card::at(&path).map(|card| (card.sockets(), card)) {
                Ok((Ok(found), card)) if !found.is_empty() => {
                    sockets.push(CardSockets { card: path, sockets: found });
                    cards.push(card);
                }
                Ok(_) => {
                    refusal.get_or_insert_with(|| format!("{} drives no display", path.display()));
                }
                Err(Errno::NOENT) if node.is_none() => {}
                Err(cause) => {
                    refusal = Some(format!("{} cannot be opened: {cause}", path.display()));
                }
            }
        }
        if cards.is_empty() {
            let what = refusal.unwrap_or_else(|| "there is no /dev/dri/card* node".to_owned());
            return Err(RigError::gone("panel", what));
        }
        let chosen = chosen(&sockets, connector)?;
        Ok(cards.swap_remove(chosen))
    }

    /// Connectors of the card, without probing them.
    fn sockets(&self) -> Result<Vec<Socket>, std::io::Error> {
        let all = self.resource_handles()?;
        let socket =
            |&handle: &connector::Handle| Ok(Socket::of(&self.get_connector(handle, false)?));
        all.connectors().iter().map(socket).collect()
    }

    /// The connector `name` ("HDMI-A-1"), its state probed.
    pub(super) fn connector(&self, name: &str) -> Result<connector::Info, RigError> {
        let mut names = Vec::new();
        for &handle in self.resource_handles().map_err(failed("list connectors"))?.connectors() {
            let info = self.get_connector(handle, true).map_err(failed("ask a connector"))?;
            if info.to_string() == name {
                return Ok(info);
            }
            names.push(Socket::of(&info).to_string());
        }
        Err(no_connector(name, &names))
    }

    pub(super) fn properties<T: ResourceHandle>(&self, object: T) -> Result<Properties, RigError> {
        let ask = failed("read properties");
        let values = self.get_properties(object).map_err(&ask)?;
        let mut all = Vec::new();
        for (&handle, &value) in &values {
            all.push((self.get_property(handle).map_err(&ask)?, value));
        }
        Ok(Properties(all))
    }
}

/// A connector, with its name in the kernel.
struct Socket {
    name: String,
    plugged_in: bool,
}

impl Socket {
    fn of(info: &connector::Info) -> Socket {
        let plugged_in = info.state() == connector::State::Connected;
        Socket { name: info.to_string(), plugged_in }
    }
}

impl std::fmt::Display for Socket {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name)?;
        if self.plugged_in { Ok(()) } else { f.write_str(" (nothing plugged in)") }
    }
}

struct CardSockets {
    card: PathBuf,
    sockets: Vec<Socket>,
}

fn no_connector(name: &str, there: &[String]) -> RigError {
    RigError::refused("panel", format!("connector {name:?}"), there.join(", "))
}

/// Index of the card with the connector `name`. Names are unique only within a card; of two cards,
/// the one with a panel plugged in is chosen.
fn chosen(cards: &[CardSockets], name: &str) -> Result<usize, RigError> {
    let having = |plugged_alone: bool| -> Vec<usize> {
        let fits = |socket: &Socket| socket.name == name && (socket.plugged_in || !plugged_alone);
        let has = |n: &usize| cards[*n].sockets.iter().any(fits);
        (0..cards.len()).filter(has).collect()
    };
    let (all, plugged_in) = (having(false), having(true));
    match (&all[..], &plugged_in[..]) {
        ([only], _) | (_, [only]) => Ok(*only),
        ([], _) => {
            let of_card = |one: &CardSockets| {
                let names = one.sockets.iter().map(Socket::to_string).collect::<Vec<_>>();
                match cards.len() {
                    1 => names.join(", "),
                    _ => format!("{} of {}", names.join(", "), one.card.display()),
                }
            };
            Err(no_connector(name, &cards.iter().map(of_card).collect::<Vec<_>>()))
        }
        (several, _) => {
            let node = |&n: &usize| cards[n].card.display().to_string();
            let nodes = several.iter().map(node).collect::<Vec<_>>().join(", ");
            let found = format!("{} cards with a connector {name:?}", several.len());
            let allowed = format!("one of them: hardware.panel.node = one of {nodes}");
            Err(RigError::refused("panel", found, allowed))
        }
    }
}

/// Writes the connectors of all cards, with modes and properties, to `text`. The contents of blobs
/// are left out: the monitor's description contains its serial number.
pub(super) fn describe(text: &mut impl Write) -> std::fmt::Result {
    for path in numbered() {
        let Ok(card) = Card::at(&path) else { continue };
        let driver = card.get_driver().map(|driver| driver.name().to_string_lossy().into_owned());
        writeln!(text, "{}: {}", path.display(), driver.unwrap_or_default())?;
        for handle in card.resource_handles().iter().flat_map(|all| all.connectors().to_vec()) {
            let Ok(info) = card.get_connector(handle, false) else { continue };
            writeln!(text, " {}", Socket::of(&info))?;
            for mode in info.modes() {
                let ((width, height), hz) = (mode.size(), mode.vrefresh());
                writeln!(text, "  {width}×{height} at {hz} Hz, {} kHz", mode.clock())?;
            }
            let Ok(properties) = card.properties(handle) else { continue };
            for (info, value) in &properties.0 {
                let choices = match info.value_type() {
                    property::ValueType::Enum(choices) => {
                        let named = choices.values().1.iter().map(|c| (c.value(), c.name()));
                        format!(" of {:?}", named.collect::<Vec<_>>())
                    }
                    property::ValueType::Blob => " (blob)".to_owned(),
                    _ => String::new(),
                };
                writeln!(text, "  {} = {value}{choices}", info.name().to_string_lossy())?;
            }
        }
    }
    Ok(())
}

pub(super) struct Properties(Vec<(property::Info, property::RawValue)>);

impl Properties {
    pub(super) fn get(&self, name: &str) -> Option<(&property::Info, property::RawValue)> {
        let mut all = self.0.iter().map(|(info, value)| (info, *value));
        all.find(|(info, _)| info.name().to_bytes() == name.as_bytes())
    }

    /// Handle of a property that every driver with atomic mode setting should have.
    pub(super) fn handle(&self, name: &str) -> Result<property::Handle, RigError> {
        self.get(name).map(|(info, _)| info.handle()).ok_or_else(|| {
            let found = format!("a driver without the property {name}");
            RigError::refused("panel", found, "drivers with atomic mode setting")
        })
    }
}

/// Value of an enumerated property that stands for the word `choice`.
pub(super) fn choice_value(info: &property::Info, choice: &str) -> Option<property::RawValue> {
    let property::ValueType::Enum(choices) = info.value_type() else { return None };
    let (_, named) = choices.values();
    let choice = named.iter().find(|c| c.name().to_bytes() == choice.as_bytes())?;
    Some(choice.value())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn card(number: usize, sockets: &[(&str, bool)]) -> CardSockets {
        let socket = |&(name, plugged_in): &(&str, bool)| Socket { name: name.into(), plugged_in };
        let card = PathBuf::from(format!("/dev/dri/card{number}"));
        CardSockets { card, sockets: sockets.iter().map(socket).collect() }
    }

    fn said(cards: &[CardSockets], name: &str) -> String {
        chosen(cards, name).expect_err("no such connector").to_string()
    }

    #[test]
    fn the_card_is_the_one_that_has_the_connector() {
        let dsi_first = [card(0, &[("DSI-1", true)]), card(1, &[("HDMI-A-1", true)])];
        assert_eq!(chosen(&dsi_first, "HDMI-A-1").unwrap(), 1);
        assert_eq!(chosen(&dsi_first, "DSI-1").unwrap(), 0);
        let said = said(&dsi_first, "HDMI-A-2");
        assert!(said.contains("DSI-1 of /dev/dri/card0, HDMI-A-1 of /dev/dri/card1"), "{said}");
    }

    #[test]
    fn of_two_cards_with_the_connector_the_one_with_a_panel_is_chosen() {
        let two = [card(0, &[("HDMI-A-1", false)]), card(1, &[("HDMI-A-1", true)])];
        assert_eq!(chosen(&two, "HDMI-A-1").unwrap(), 1);
        for plugged_in in [false, true] {
            let both = [0, 1].map(|n| card(n, &[("HDMI-A-1", plugged_in)]));
            let said = said(&both, "HDMI-A-1");
            assert!(said.contains("node") && said.contains("/dev/dri/card1"), "{said}");
        }
    }

    #[test]
    fn an_empty_socket_is_chosen_if_it_is_the_only_one() {
        assert_eq!(chosen(&[card(0, &[("HDMI-A-1", false)])], "HDMI-A-1").unwrap(), 0);
        let said = said(&[card(0, &[("HDMI-A-1", false)])], "DP-1");
        assert!(said.ends_with("allowed HDMI-A-1 (nothing plugged in)"), "{said}");
    }
}
