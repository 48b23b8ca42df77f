//! Frames of three channels, typed by their space.

use std::marker::PhantomData;

use super::{Channel, Plane, Rect, Size};

/// Panel pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PanelSpace;
/// Camera pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SensorSpace;
/// The photo's own grid; linear light, 0..255 full scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Work;

/// Three planes of one size in the space `S`.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame<S, T = f32> {
    planes: [Plane<T>; 3],
    space: PhantomData<S>,
}

/// Input of the panel: 8-bit codes per panel pixel and channel.
pub type Codes = Frame<PanelSpace, u8>;
/// Output of the sensor: raw counts per camera pixel and channel.
pub type Counts = Frame<SensorSpace, u16>;

impl<S, T: Copy + Default> Frame<S, T> {
    /// A frame of zeros.
    pub fn zeros(size: Size) -> Self {
        Self::from_fn(|_| Plane::zeros(size))
    }

    /// A frame with `value` everywhere in all channels.
    pub fn filled(size: Size, value: T) -> Self {
        Self::from_fn(|_| Plane::filled(size, value))
    }

    /// A frame computed channel by channel. The planes must have one size.
    pub fn from_fn(mut plane: impl FnMut(Channel) -> Plane<T>) -> Self {
        Self::from_planes(Channel::ALL.map(&mut plane))
    }

    /// A frame from the planes red, green, blue.
    ///
    /// # Panics
    /// When the planes differ in size.
    pub fn from_planes(planes: [Plane<T>; 3]) -> Self {
        assert!(
            planes.iter().all(|p| p.size() == planes[0].size()),
            "the planes of a frame have one size"
        );
        Frame { planes, space: PhantomData }
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.planes[0].size()
    }

    /// All three planes in storage order.
    pub fn planes(&self) -> &[Plane<T>; 3] {
        &self.planes
    }

    /// All three planes in storage order, mutable.
    pub fn planes_mut(&mut self) -> &mut [Plane<T>; 3] {
        &mut self.planes
    }

    /// Returns the planes.
    pub fn into_planes(self) -> [Plane<T>; 3] {
        self.planes
    }

    /// The plane of one channel.
    pub fn plane(&self, channel: Channel) -> &Plane<T> {
        &self.planes[channel.index()]
    }

    /// The plane of one channel, mutable.
    pub fn plane_mut(&mut self, channel: Channel) -> &mut Plane<T> {
        &mut self.planes[channel.index()]
    }

    /// Changes each pixel by the same pixel of `other`.
    pub fn update<U: Copy>(&mut self, other: &Frame<S, U>, mut change: impl FnMut(&mut T, U)) {
        let pairs = self.planes.iter_mut().zip(&other.planes);
        pairs.for_each(|(own, other)| own.update(other, &mut change));
    }

    /// Turns every plane by half.
    pub fn turn_by_half(&mut self) {
        self.planes.iter_mut().for_each(Plane::turn_by_half);
    }

    /// Copies the pixels in `rect`, which must lie inside the frame.
    pub fn crop(&self, rect: Rect) -> Self {
        Self::from_fn(|c| self.plane(c).crop(rect))
    }
}
