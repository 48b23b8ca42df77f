//! The three colour channels, by name and never by a bare index, as channel order is part of a
//! calibration.

use serde::{Deserialize, Serialize};

/// One of the three colour channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// Long wavelengths.
    Red,
    /// Middle wavelengths; the one the lens is focused for.
    Green,
    /// Short wavelengths.
    Blue,
}

impl Channel {
    /// All channels in storage order.
    pub const ALL: [Channel; 3] = [Channel::Red, Channel::Green, Channel::Blue];

    /// Results of `compute` for the channels, in parallel.
    pub fn each<T: Send>(compute: impl Fn(Channel) -> T + Sync) -> [T; 3] {
        let [red, green, blue] = Channel::ALL;
        let two = || rayon::join(|| compute(green), || compute(blue));
        let (red, (green, blue)) = rayon::join(|| compute(red), two);
        [red, green, blue]
    }

    /// Index in storage order, 0..3.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Name for messages and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Channel::Red => "red",
            Channel::Green => "green",
            Channel::Blue => "blue",
        }
    }
}

/// The channels of a job: all three, or green alone for a grey photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channels {
    /// Red, green and blue.
    Colour,
    /// Green alone; the other planes of every frame stay black.
    Green,
}

impl Channels {
    /// The channels in storage order.
    pub const fn list(self) -> &'static [Channel] {
        match self {
            Channels::Colour => &Channel::ALL,
            Channels::Green => &[Channel::Green],
        }
    }
}
