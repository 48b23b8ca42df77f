//! relens makes cheap lenses take good photographs.
//!
//! A photo taken through a bad lens is restored with *that lens*: relens shows candidate pictures
//! on a panel, photographs them through the same lens, and adjusts the candidate until its
//! photograph matches the photo.
//!
//! # Examples
//!
//! A simulated rig takes a photo through its bad lens, is calibrated, and restores the photo:
//!
//! ```
//! use relens::{Format, Rig};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let temporary = tempfile::tempdir()?;
//! # let folder = temporary.path();
//! let mut rig = Rig::open("small.toml")?;
//! let photo = rig.photograph("tests/scenes/astronaut.png", 1)?;
//! rig.calibrate(folder)?;
//! let outcome = rig.restorer(folder)?.restore(&photo)?;
//! let restored = photo.with_picture(outcome.delivered(&photo), Format::Png)?;
//! std::fs::write(folder.join("restored.png"), restored)?;
//! # Ok(())
//! # }
//! ```
//!
//! A real rig needs its own rig file and the feature `hardware`; the rest is the same, and
//! [`Rig::read`] reads the photos of its camera.
//!
//! # Inside
//!
//! Only the items listed below are for other programs. The light path:
//!
//! ```text
//! photo file ─ decode ─ linear light ─► B (Work)
//!                                       │
//!        ┌──────────────────────────────▼────────────────────────────┐
//!        │ L (Work) ─ warp ─ panel response⁻¹ ─ 8 bit, dithered ─► PANEL │
//!        │   ▲                                                  lens      │
//!        │ step, shrink ◄─ dark corner ◄─ C⁻¹ ◄─ black ◄──────── SENSOR │
//!        └───────────────────────────────────────────────────────────┘
//!                   until the residual is at the noise ─► picture, certificate, report
//! ```
//!
//! Three spaces are separate types: *Panel* (panel pixels, codes), *Sensor* (camera pixels, counts)
//! and *Work* (the photo's grid, linear light, 0..255). A lens blurs light, so everything between
//! decoding and encoding is linear light. The rig's own camera took the photo, so the Work grid is
//! the sensor's grid: captures are never resampled, and the candidate is resampled once, to the
//! finer panel.
//!
//! Layers: a module imports only from layers below its own (`tests/tidy` checks this):
//!
//! | layer | modules | contents |
//! |---|---|---|
//! | 0 | [`frame`], [`remedy`] | planes, spaces, channels; remedies for failures |
//! | 1 | [`deconvolution`], [`patterns`] | the paper's mathematics; test patterns |
//! | 1 | [`disk`] | file storage, behind a trait for tests |
//! | 2 | [`config`] | the rig file |
//! | 3 | [`picture`] | photo files and coded camera frames |
//! | 4 | [`calibration`], [`rig`] | fits and their store; the devices, real or simulated |
//! | 5 | [`light_path`], [`measurement`] | forward convolution by a rig; measurement and fits |
//! | 5 | [`diagnosis`] | a rig's timing |
//! | 5 | [`kiosk`] | button, lamps, screens |
//! | 6 | [`alignment`] | a rig's focus, aim and brightness |
//! | 6 | [`pipeline`], [`nights`] | one photo on a calibrated rig; schedule, clock, drift |
//! | 7 | [`restorer`] | the restorer on a rig and the files that it keeps |
//! | 8 | [`daemon`], [`chart`] | drop folder, jobs, reports; speed, operating point |
//! | 9 | [`face`] | the library: open, calibrate, restore, photograph |
//!
//! Start reading at [`deconvolution`], then [`light_path`].

// Hidden modules have pages for developers: `cargo doc --document-private-items`.
#![allow(rustdoc::private_intra_doc_links)]

// These modules are for the program, the laboratory, tests and fuzzing alone. They are hidden only
// when the documentation is built, so that the compiler still requires it.
#[cfg_attr(doc, doc(hidden))]
pub mod alignment;
#[cfg_attr(doc, doc(hidden))]
pub mod calibration;
#[cfg_attr(doc, doc(hidden))]
pub mod chart;
#[cfg_attr(doc, doc(hidden))]
pub mod config;
#[cfg_attr(doc, doc(hidden))]
pub mod daemon;
#[cfg_attr(doc, doc(hidden))]
pub mod deconvolution;
#[cfg_attr(doc, doc(hidden))]
pub mod diagnosis;
#[cfg_attr(doc, doc(hidden))]
pub mod disk;
#[cfg_attr(doc, doc(hidden))]
pub mod face;
#[cfg_attr(doc, doc(hidden))]
pub mod frame;
#[cfg_attr(doc, doc(hidden))]
pub mod kiosk;
#[cfg_attr(doc, doc(hidden))]
pub mod light_path;
#[cfg_attr(doc, doc(hidden))]
pub mod measurement;
#[cfg_attr(doc, doc(hidden))]
pub mod nights;
#[cfg_attr(doc, doc(hidden))]
pub mod patterns;
#[cfg_attr(doc, doc(hidden))]
pub mod picture;
#[cfg_attr(doc, doc(hidden))]
pub mod pipeline;
#[cfg_attr(doc, doc(hidden))]
pub mod remedy;
#[cfg_attr(doc, doc(hidden))]
pub mod restorer;
#[cfg_attr(doc, doc(hidden))]
pub mod rig;

pub use config::Curve;
pub use deconvolution::stage::ResultStage;
pub use face::{Calibrated, Error, PhotoRestorer, Rig};
pub use frame::{Channel, Channels, Frame, Plane, Size, Work};
pub use picture::{Format, Photo};
pub use pipeline::{
    CertifiedFocus, Evidence, Grain, Iteration, OpticalResidual, Outcome, Residuals, Verdict,
};
pub use remedy::Remedy;
