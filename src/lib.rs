//! relens makes cheap lenses take good photographs.
//!
//! A photo taken through a bad lens is restored by *that lens*: the box shows candidate pictures on
//! a panel, photographs them through the same lens, and adjusts the candidate until its photograph
//! is the photo.
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
//! let restored = photo.with_picture(&outcome.picture, Format::Png)?;
//! std::fs::write(folder.join("restored.png"), restored)?;
//! # Ok(())
//! # }
//! ```
//!
//! A real rig is opened by its own rig file, with the feature `hardware`; the rest is the same, and
//! [`Rig::read`] reads the photos that its camera took.
//!
//! # Inside
//!
//! Only what is listed below is for other programs. The light path, drawn once:
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
//! Three spaces are types that do not mix: *Panel* (panel pixels, codes), *Sensor* (camera pixels,
//! counts) and *Work* (the photo's grid, linear light, 0..255). A lens blurs light, so everything
//! between decoding and encoding is linear light. The rig's own camera took the photo, so the Work
//! grid is the sensor's grid: captures are never resampled, and the candidate is resampled once, to
//! the finer panel.
//!
//! Layers; a module imports only from layers below its own, and siblings do not import each other
//! (`tests/tidy` holds this):
//!
//! | layer | modules | what |
//! |---|---|---|
//! | 0 | [`frame`], [`remedy`] | vocabulary: planes, spaces, channels; what to do about a failure |
//! | 1 | [`deconvolution`], [`patterns`] | the paper's mathematics; what is shown on purpose |
//! | 1 | [`disk`] | whatever is kept, behind a trait that tests stand in for |
//! | 2 | [`config`] | the rig file |
//! | 3 | [`picture`] | photo files, and frames coded like them |
//! | 4 | [`calibration`], [`rig`] | fits and their store; the devices, real or simulated |
//! | 5 | [`light_path`], [`measurement`] | forward convolution by a rig; show, see, fit, judge |
//! | 5 | [`alignment`], [`diagnosis`] | a rig's focus, aim and brightness; its timing |
//! | 5 | [`kiosk`] | button, lamps, screens |
//! | 6 | [`pipeline`], [`nights`] | one photo on a calibrated rig; hours, clock trust, drift |
//! | 7 | [`restorer`] | what is kept beside a rig, photo after photo |
//! | 8 | [`daemon`], [`chart`] | drop folder, jobs, reports; speed, operating point |
//! | 9 | [`face`] | the library: open, calibrate, restore, photograph |
//!
//! Start reading at [`deconvolution`], then [`light_path`].

// Hidden modules document themselves to who works on them: `cargo doc --document-private-items`.
#![allow(rustdoc::private_intra_doc_links)]

// What the program, the laboratory, the tests and the fuzzing reach, and nobody else should. Hidden
// from the pages alone, so that the compiler still asks for the documentation of each item.
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
