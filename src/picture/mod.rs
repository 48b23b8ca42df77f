//! Photo files: bytes to linear light and back, under limits, with their metadata.
//!
//! ```text
//! bytes ─ kind, walk ─ decode ─ curve undone ─► Photo.light (Work, linear, 0..255)
//!                                                          │  stored orientation = the sensor's
//! bytes ◄─ encode ◄─ turned upright ◄─ curve redone ◄──────┘  (after restoring)
//! ```
//!
//! **Orientation.** The lens's field is fixed to the sensor, and cameras store pixels in the
//! sensor's orientation with a tag. A photo is therefore restored as stored, and turned upright on
//! writing, with the tag cleared. A photo stored upright in portrait does not state which way the
//! camera was turned; the sensor's gain pattern shows it, and without that the photo is refused.
//!
//! **Alpha** is set aside, resampled with the photo, and written back.
//!
//! **Raw photos**, a sensor's sites in a DNG, are linear. Only the sites are data; they are
//! interpolated for display. The light behind the colour filters is restored, and converted to sRGB
//! on writing by the matrices in the file. Results are TIFFs of 16 bits with the rig's curve, or
//! JPEGs, as set in the rig file.
//!
//! **Frames** of a camera that codes them as JPEG are decoded here too, by the same worker.
//!
//! **Curve.** The tone curves of an embedded ICC profile are used, or else the rig's curve (sRGB or
//! linear). A profile's primaries are not applied: the lens blurs each stored channel, and the
//! result carries the profile.

mod camera_frame;
mod colour_difference;
mod decode;
pub(crate) mod dng;
mod encode;
mod exif;
mod flaw;
mod iptc;
mod jpeg;
mod kind;
mod metadata;
mod others;
mod photo;
mod png;
mod reading;
mod shape;
mod tiff;
mod tone;
mod turn;
pub mod worker;

pub use camera_frame::camera_frame;
pub use colour_difference::Lab;
pub use decode::Limits;
pub use dng::{CameraColours, Dng, PhotoCamera, RawTags, RigSetting};
pub use encode::{encode, preview};
pub use flaw::{Flaw, Growth, PictureError};
pub use image::ColorType;
pub use kind::{Format, HEAD_BYTES, is_companion, result_name};
pub use photo::{FileFacts, Manner, Photo, embedded};
pub use reading::{ReadOptions, bytes_of, whole};
pub use tone::Tone;
pub use turn::Orientation;
