//! relens makes cheap lenses take good photographs.
//!
//! A photo taken through a bad lens is restored by *that lens*: the box shows candidate pictures on
//! a panel, photographs them through the same lens, and adjusts the candidate until its photograph
//! is the photo. The light path, drawn once:
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
//! (`tests/tidy.rs` holds this):
//!
//! | layer | modules | what |
//! |---|---|---|
//! | 0 | [`frame`], [`remedy`] | vocabulary: planes, spaces, channels; what to do about a failure |
//! | 1 | [`deconvolution`], [`patterns`] | the paper's mathematics; what is shown on purpose |
//! | 1 | [`disk`] | whatever is kept, behind a trait that tests stand in for |
//! | 2 | [`config`] | the rig file |
//! | 3 | [`calibration`], [`rig`] | fits and their store; the devices, real or simulated |
//! | 3 | [`picture`] | photo files |
//! | 4 | [`light_path`], [`measurement`] | forward convolution through a rig; show, see, fit, judge |
//! | 4 | [`diagnosis`], [`kiosk`] | a rig's timing; button, lamps, screens |
//! | 5 | [`pipeline`], [`nights`] | one photo on a calibrated rig; hours, clock trust, drift |
//! | 6 | [`restorer`] | what is kept beside a rig, photo after photo |
//! | 7 | [`daemon`], [`chart`] | drop folder, jobs, reports; speed and accuracy, operating point |
//!
//! Start reading at [`deconvolution`], then [`light_path`].

pub mod calibration;
pub mod chart;
pub mod config;
pub mod daemon;
pub mod deconvolution;
pub mod diagnosis;
pub mod disk;
pub mod frame;
pub mod kiosk;
pub mod light_path;
pub mod measurement;
pub mod nights;
pub mod patterns;
pub mod picture;
pub mod pipeline;
pub mod remedy;
pub mod restorer;
pub mod rig;
