//! Features of a camera, by the names of the GenICam Standard Features Naming Convention (SFNC 2.7)
//! and of makers. Automatic adjustments are switched off, and every value set is read back.
//! Features are optional, unless the rig file names them.

use aravis::glib::prelude::*;
use aravis::prelude::*;
use aravis::{Device, GcAccessMode, GcBoolean, GcEnumeration, GcFloat, GcInteger};

use super::finding::failed;
use crate::config::FeatureValue;
use crate::rig::RigError;
use crate::rig::camera::memory::refused;

/// Adjustments to switch off: an enumeration to `Off`, a boolean to false, a number to its minimum.
/// The names are those of SFNC, then of FLIR, Basler, Daheng, Hikrobot, Allied Vision and The
/// Imaging Source (feature lists of their manuals; names without a camera at hand are guesses).
const OFF: &str = "\
    ExposureAuto GainAuto BlackLevelAuto BalanceWhiteAuto LUTEnable ColorTransformationEnable \
    ReverseX ReverseY TestPattern ChunkModeActive AcquisitionFrameRateEnable \
    AcquisitionFrameRateAuto GammaEnable GammaEnabled SharpeningEnable SharpeningAuto \
    SharpnessEnabled SharpnessEnable SharpnessAuto SharpnessMode BslSharpnessEnhancement \
    BslNoiseReduction Denoise SaturationEnable HueEnable DefectCorrectStaticEnable \
    DefectCorrectionEnable DeadPixelCorrect CorrectionMode ExposureAutoHighlightReduction \
    TestImageSelector LightSourcePreset HDREnable DigitalShift";

/// Values that leave the picture unchanged, set if the camera allows it.
const NEUTRAL: [(&str, f64); 5] = [
    ("Gamma", 1.0),
    ("BinningHorizontal", 1.0),
    ("BinningVertical", 1.0),
    ("DecimationHorizontal", 1.0),
    ("DecimationVertical", 1.0),
];

/// Maximum relative error of a number read back, as for a pulse: exposures and gains have steps.
const STEP: f64 = 0.003;

/// Switches the adjustments in [`OFF`] off and sets the [`NEUTRAL`] values.
pub(super) fn settle(device: &Device) -> Result<(), RigError> {
    for name in OFF.split_whitespace().filter(|name| is_there(device, name)) {
        switch_off(device, name)?;
    }
    for (name, value) in NEUTRAL {
        if is_there(device, name) && is_writable(device, name) {
            hold(device, name, &FeatureValue::Number(value))?;
        }
    }
    Ok(())
}

pub(super) fn switch_triggers_off(device: &Device) -> Result<(), RigError> {
    let selector = "TriggerSelector";
    let events = device.dup_available_enumeration_feature_values_as_strings(selector);
    for event in events.unwrap_or_default() {
        hold(device, selector, &event.as_str().into())?;
        hold_any(device, &["TriggerMode"], "Off")?;
    }
    hold_any(device, &["TriggerMode"], "Off").map(|_| ())
}

/// Sets the first of `names` that the camera has. Returns false if it has none.
pub(super) fn hold_any(
    device: &Device,
    names: &[&str],
    value: impl Into<FeatureValue>,
) -> Result<bool, RigError> {
    match names.iter().find(|name| is_there(device, name)) {
        Some(name) => hold(device, name, &value.into()).map(|()| true),
        None => Ok(false),
    }
}

pub(super) fn is_there(device: &Device, name: &str) -> bool {
    device.feature(name).is_some() && device.is_feature_available(name).unwrap_or(false)
}

fn is_writable(device: &Device, name: &str) -> bool {
    matches!(device.feature_access_mode(name), GcAccessMode::Rw | GcAccessMode::Wo)
}

fn switch_off(device: &Device, name: &str) -> Result<(), RigError> {
    let node = device.feature(name);
    let is = |kind| node.as_ref().is_some_and(|node| node.type_().is_a(kind));
    let value = if is(GcEnumeration::static_type()) {
        FeatureValue::Word("Off".to_owned())
    } else if is(GcBoolean::static_type()) {
        FeatureValue::Truth(false)
    } else if is(GcFloat::static_type()) {
        FeatureValue::Number(device.float_feature_bounds(name).map_or(0.0, |(least, _)| least))
    } else {
        let bounds = device.integer_feature_bounds(name);
        FeatureValue::Number(bounds.map_or(0.0, |(least, _)| least as f64))
    };
    // A feature that cannot be written may be permanently off.
    if !is_writable(device, name) && read(device, name).is_ok_and(|found| is_held(&found, &value)) {
        return Ok(());
    }
    hold(device, name, &value)
}

/// Sets the feature `name`, which must be there, to `value` and reads it back.
pub(super) fn hold(device: &Device, name: &str, value: &FeatureValue) -> Result<(), RigError> {
    if !is_there(device, name) {
        return Err(refused(
            format!("feature {name}"),
            "one that the camera has (`arv-tool-0.8 features`)",
        ));
    }
    let node = device.feature(name);
    let is_whole = node.is_some_and(|node| {
        node.type_().is_a(GcInteger::static_type()) && !node.type_().is_a(GcFloat::static_type())
    });
    let outcome = match value {
        FeatureValue::Truth(truth) => device.set_boolean_feature_value(name, *truth),
        FeatureValue::Word(word) => device.set_string_feature_value(name, word),
        FeatureValue::Number(number) if is_whole => {
            device.set_integer_feature_value(name, number.round() as i64)
        }
        FeatureValue::Number(number) => device.set_float_feature_value(name, *number),
    };
    let found = outcome.and_then(|()| read(device, name));
    match found {
        Ok(found) if is_held(&found, value) => Ok(()),
        Ok(found) => Err(refused(
            format!("{name} = {}, which reads back as {}", written(value), written(&found)),
            allowed(device, name),
        )),
        Err(error) => Err(match failed(&error, "set a feature") {
            RigError::Failed { source, .. } => {
                refused(format!("{name} = {} ({source})", written(value)), allowed(device, name))
            }
            other => other,
        }),
    }
}

pub(super) fn read(device: &Device, name: &str) -> Result<FeatureValue, aravis::glib::Error> {
    let node = device.feature(name);
    let is = |kind| node.as_ref().is_some_and(|node| node.type_().is_a(kind));
    if is(GcBoolean::static_type()) {
        device.boolean_feature_value(name).map(FeatureValue::Truth)
    } else if is(GcFloat::static_type()) {
        device.float_feature_value(name).map(FeatureValue::Number)
    } else if is(GcInteger::static_type()) && !is(GcEnumeration::static_type()) {
        device.integer_feature_value(name).map(|value| FeatureValue::Number(value as f64))
    } else {
        device.string_feature_value(name).map(|word| FeatureValue::Word(word.to_string()))
    }
}

/// Value of the feature `name`; `None` if it is not a number.
pub(super) fn number(device: &Device, name: &str) -> Option<f64> {
    match read(device, name) {
        Ok(FeatureValue::Number(value)) => Some(value),
        _ => None,
    }
}

fn is_held(found: &FeatureValue, wanted: &FeatureValue) -> bool {
    match (found, wanted) {
        (FeatureValue::Number(found), FeatureValue::Number(wanted)) => {
            (found - wanted).abs() <= STEP * wanted.abs()
        }
        (found, wanted) => found == wanted,
    }
}

fn written(value: &FeatureValue) -> String {
    match value {
        FeatureValue::Truth(truth) => truth.to_string(),
        FeatureValue::Number(number) => number.to_string(),
        FeatureValue::Word(word) => word.clone(),
    }
}

/// Allowed values of the feature `name`, for messages.
fn allowed(device: &Device, name: &str) -> String {
    if let Ok(words) = device.dup_available_enumeration_feature_values_as_strings(name) {
        return words.iter().map(|word| word.as_str()).collect::<Vec<_>>().join(", ");
    }
    let whole = device.integer_feature_bounds(name).map(|(low, high)| format!("{low} to {high}"));
    let bounds = device.float_feature_bounds(name).map(|(low, high)| format!("{low} to {high}"));
    bounds.or(whole).unwrap_or_else(|_| "a value that the camera keeps".to_owned())
}

impl From<f64> for FeatureValue {
    fn from(number: f64) -> Self {
        FeatureValue::Number(number)
    }
}

impl From<&str> for FeatureValue {
    fn from(word: &str) -> Self {
        FeatureValue::Word(word.to_owned())
    }
}
