//! Photo files: bytes to linear light and back, under limits, with what the file carried along.
//!
//! ```text
//! bytes ─ whole? (kind, walk) ─ decode ─ curve undone ─► Photo.light (Work, linear, 0..255)
//!                                                          │  stored orientation = the sensor's
//! bytes ◄─ encode ◄─ turned upright ◄─ curve redone ◄──────┘  (after restoring)
//! ```
//!
//! **Orientation.** The lens's field is fixed to the sensor, and a camera stores pixels as the
//! sensor sees them with a tag that says how it was held. So a photo is restored as stored,
//! whatever its tag, and turned upright once, on the way out, where the tag is cleared. A photo
//! stored upright in portrait has lost which way the camera was turned and is refused by its shape.
//!
//! **Alpha** is no light: it is set aside, resampled with the photo if need be, and put back.
//!
//! **Raw photos**, a sensor's sites in a DNG, are linear as they are. Between the sites they are
//! filled with something to look at; data are the sites. The lens blurred what the filters let
//! through, so that is what is restored; on the way out colours follow by the file's own numbers.
//! Results are TIFFs of 16 bits with the rig's curve, or JPEGs, as the rig file says.
//!
//! **Frames** of a camera that codes them as JPEG are decoded here too, and by the same worker.
//!
//! **Curve.** An embedded ICC profile's tone curves, else the rig's curve (sRGB or linear). A
//! profile's primaries are left as they are: the lens blurs each stored channel, and the result
//! carries the profile.

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
mod losses;
mod others;
mod photo;
mod png;
mod shape;
mod tiff;
mod tone;
mod turn;
pub mod worker;

pub use camera_frame::camera_frame;
pub use colour_difference::Lab;
pub use decode::{Limits, PixelLayout};
pub use dng::{CameraColours, Dng, PhotoCamera, RawTags, RigSetting};
pub use encode::{encode, preview};
pub use flaw::{Flaw, Growth, PictureError};
pub use kind::{Format, result_name};
pub use photo::{FileFacts, Manner, Photo, bytes_of, embedded, whole};
pub use tone::Tone;
pub use turn::Orientation;
