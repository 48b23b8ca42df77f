//! A DRM node: opened by path or found by its connector, its properties looked up by name.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use drm::control::{Device as _, ResourceHandle, connector, property};
use rustix::fs::{Mode, OFlags};

use super::RigError;

/// An open DRM node.
pub(super) struct Card(OwnedFd);

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl drm::Device for Card {}
impl drm::control::Device for Card {}

/// A failure of the panel with its cause.
pub(super) fn failed(doing: &'static str) -> impl Fn(std::io::Error) -> RigError {
    move |source| RigError::Failed { device: "panel", doing, source }
}

impl Card {
    /// Opens `node`, or when none is given the first `/dev/dri/card*` that has a connector: boards
    /// have nodes for 3D alone, and their order changes from boot to boot.
    ///
    /// # Errors
    /// When the node cannot be opened or has no connector.
    pub(super) fn open(node: Option<&Path>) -> Result<(Card, PathBuf), RigError> {
        let numbered = (0..16).map(|n| PathBuf::from(format!("/dev/dri/card{n}")));
        let candidates: Vec<PathBuf> =
            node.map_or_else(|| numbered.collect(), |path| vec![path.to_owned()]);
        let mut refusal = None;
        for path in candidates {
            match rustix::fs::open(&path, OFlags::RDWR | OFlags::CLOEXEC, Mode::empty()) {
                Ok(fd) => {
                    let card = Card(fd);
                    let connectors = card.resource_handles().map(|all| all.connectors().len());
                    if connectors.is_ok_and(|n| n > 0) {
                        return Ok((card, path));
                    }
                    refusal.get_or_insert_with(|| format!("{} drives no display", path.display()));
                }
                Err(rustix::io::Errno::NOENT) if node.is_none() => {}
                Err(cause) => {
                    refusal = Some(format!("{} cannot be opened: {cause}", path.display()));
                }
            }
        }
        let what = refusal.unwrap_or_else(|| "there is no /dev/dri/card* node".to_owned());
        Err(RigError::Gone { device: "panel", what })
    }

    /// The connector called `name` ("HDMI-A-1"), its state probed afresh when `probe`.
    ///
    /// # Errors
    /// [`RigError::Refused`] with the names there are.
    pub(super) fn connector(&self, name: &str, probe: bool) -> Result<connector::Info, RigError> {
        let mut names = Vec::new();
        for &handle in self.resource_handles().map_err(failed("list connectors"))?.connectors() {
            let info = self.get_connector(handle, probe).map_err(failed("ask a connector"))?;
            if info.to_string() == name {
                return Ok(info);
            }
            let plugged = if info.state() == connector::State::Connected {
                ""
            } else {
                " (nothing plugged in)"
            };
            names.push(format!("{info}{plugged}"));
        }
        Err(RigError::Refused {
            device: "panel",
            found: format!("connector {name:?}"),
            allowed: names.join(", "),
        })
    }

    /// All properties of `object` with their present values.
    ///
    /// # Errors
    /// When the kernel does not tell.
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

/// The properties of one object.
pub(super) struct Properties(Vec<(property::Info, property::RawValue)>);

impl Properties {
    /// The property called `name` and its value.
    pub(super) fn get(&self, name: &str) -> Option<(&property::Info, property::RawValue)> {
        self.0
            .iter()
            .find(|(info, _)| info.name().to_bytes() == name.as_bytes())
            .map(|(info, value)| (info, *value))
    }

    /// The handle of a property that every driver of this kind has.
    ///
    /// # Errors
    /// [`RigError::Refused`] when this one has not.
    pub(super) fn handle(&self, name: &str) -> Result<property::Handle, RigError> {
        self.get(name).map(|(info, _)| info.handle()).ok_or_else(|| RigError::Refused {
            device: "panel",
            found: format!("a driver without the property {name}"),
            allowed: "drivers with atomic mode setting".to_owned(),
        })
    }
}

/// The number behind the word `choice` of an enumerated property.
pub(super) fn choice_value(info: &property::Info, choice: &str) -> Option<property::RawValue> {
    match info.value_type() {
        property::ValueType::Enum(choices) => {
            let (_, named) = choices.values();
            named
                .iter()
                .find(|c| c.name().to_bytes() == choice.as_bytes())
                .map(property::EnumValue::value)
        }
        _ => None,
    }
}
