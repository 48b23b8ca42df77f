//! A simulated rig with its witness, opened, calibrated and ready to be scored.

use std::time::Instant;

use super::scenes::Scene;
use super::study::Score;
use crate::calibrate::{CalibrateError, calibrate};
use crate::calibration::Calibration;
use crate::config;
use crate::frame::{Channel, Channels, Frame, Plane, Work};
use crate::picture::TransferCurve;
use crate::remedy::{Remediable, Remedy};
use crate::restoration::{Bench, BenchError, Restored};
use crate::restore::method::{Method, MethodError, Watch};
use crate::restore::quality::{psnr, ssim};
use crate::rig::Rig;
use crate::rig::simulated::{OpenError, Witness, open};
