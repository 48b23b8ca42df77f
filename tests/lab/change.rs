//! Changes of a rig, each with a strength: made before or after calibration, or to the photo, the
//! captures or the method.

use relens::config::{Glare, Kind, Prescription, Primaries, RigFile, Simulation, Wavelength};
use relens::rig::simulated::{Wear, Witness};

/// A change of the rig.
#[derive(Debug)]
pub(crate) struct Change {
    /// Name in tables.
    pub(crate) name: &'static str,
    /// Unit of the strengths; empty if the change has only one.
    pub(crate) unit: &'static str,
    /// What is changed, and how.
    pub(crate) to: To,
}

/// What a change acts on, and how it does so at a strength.
#[derive(Debug)]
pub(crate) enum To {
    /// The rig file, before calibration.
    File(fn(&mut RigFile, f64)),
    /// The rig file before calibration, and how the photo is taken.
    FileAndPhoto(fn(&mut RigFile, f64), fn(&mut Taking, f64)),
    /// The rig after calibration: affects photo and captures.
    Since(fn(&mut RigFile, f64)),
    /// The camera that takes the photo, which is then not the rig's.
    Camera(fn(&mut RigFile, f64)),
    /// How the photo is taken.
    Photo(fn(&mut Taking, f64)),
    /// The running rig: affects captures alone.
    Captures(fn(&mut Witness, &Simulation, f64)),
    /// The running rig, again for each restoration: affects captures alone.
    EachJob(fn(&mut Witness, &Simulation, f64)),
    /// Columns and rows of the calibration's lens functions.
    Functions(fn(f64) -> (usize, usize)),
    /// Patches in the rig file from which the method is made.
    Patches(fn(&mut RigFile, f64)),
    /// The method's step size.
    Step,
}

/// How a photo is taken.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Taking {
    /// Additional light, a share of the scene's; the photo clips at white.
    pub(crate) brighter: f64,
    /// Additional noise, grey levels.
    pub(crate) noise_levels: f64,
    /// Quality of the photo's JPEG file; `None` if it is no JPEG.
    pub(crate) jpeg: Option<u8>,
    /// Whether the photo is developed by a camera with colour filters.
    pub(crate) developed: bool,
}

impl Change {
    /// Name with the strength.
    pub(crate) fn words(&self, strength: f64) -> String {
        match self.unit {
            "" => self.name.to_owned(),
            unit => format!("{}, {strength} {unit}", self.name),
        }
    }

    /// `rig` as it is when it is calibrated.
    pub(crate) fn filed(&self, rig: &RigFile, strength: f64) -> RigFile {
        let mut rig = rig.clone();
        if let To::File(change) | To::FileAndPhoto(change, _) = self.to {
            change(&mut rig, strength);
        }
        rig
    }

    /// Whether calibration sees the change.
    pub(crate) fn is_filed(&self) -> bool {
        matches!(self.to, To::File(_) | To::FileAndPhoto(..))
    }

    /// `rig` as it is when photos are restored.
    pub(crate) fn now(&self, rig: &RigFile, strength: f64) -> RigFile {
        let mut rig = self.filed(rig, strength);
        if let To::Since(change) = self.to {
            change(&mut rig, strength);
        }
        rig
    }
}

/// Changes the traced lens of a simulated rig.
pub(crate) fn lens(rig: &mut RigFile, change: impl FnOnce(&mut Prescription)) {
    simulation(rig, |simulation| change(&mut simulation.lens));
}

fn glare(rig: &mut RigFile, change: impl FnOnce(&mut Glare)) {
    simulation(rig, |simulation| change(&mut simulation.glare));
}

/// Changes the simulation of a simulated rig.
pub(crate) fn simulation(rig: &mut RigFile, change: impl FnOnce(&mut Simulation)) {
    if let Kind::Simulated(simulation) = &mut rig.kind {
        change(simulation);
    }
}

/// Width of the veil, pixels (study); wider than any lens function.
const VEIL_PX: f32 = 60.0;
/// Width of a smear, pixels. Guess: wider than the blur, narrower than a veil.
const SMEAR_PX: f32 = 12.0;

fn veil(rig: &mut RigFile, percent: f64, radius_px: f32) {
    glare(rig, |glare| *glare = Glare { share: (percent / 100.0) as f32, radius_px });
}

/// No change.
pub(crate) const NOTHING: Change = Change { name: "as filed", unit: "", to: To::File(|_, _| {}) };

/// Photo and captures without noise, quantised to 8 bits.
pub(crate) const NO_NOISE: Change = Change {
    name: "without noise",
    unit: "",
    to: To::File(|rig, _| {
        simulation(rig, |simulation| {
            simulation.sensor.read_noise_levels = 0.0;
            simulation.sensor.full_well_electrons = f64::INFINITY;
        });
    }),
};

/// Light scattered wider than any lens function; the model has a broad term only if one is filed.
pub(crate) const VEIL: Change = Change {
    name: "veiling glare",
    unit: "%",
    to: To::File(|rig, percent| veil(rig, percent, VEIL_PX)),
};

/// Light scattered wider than any lens function, with the filed broad term turned off.
pub(crate) const VEIL_MISSED: Change = Change {
    name: "unmeasured veiling glare",
    unit: "%",
    to: To::File(|rig, percent| {
        veil(rig, percent, VEIL_PX);
        rig.calibration.broad_term = false;
    }),
};

/// A scene at another distance than the panel.
pub(crate) const SCENE_AT: Change = Change {
    name: "scene at another distance",
    unit: "m",
    to: To::File(|rig, metres| lens(rig, |lens| lens.scene_distance_mm = Some(1000.0 * metres))),
};

/// Scattered light, and a broad term in the model.
pub(crate) const VEIL_MEASURED: Change = Change {
    name: "veiling glare and a broad term in the model",
    unit: "%",
    to: To::File(|rig, percent| {
        veil(rig, percent, VEIL_PX);
        rig.calibration.broad_term = true;
    }),
};

/// One lens function for the whole field.
pub(crate) const ONE_FUNCTION: Change = Change {
    name: "a lens model of one function",
    unit: "",
    to: To::File(|rig, _| {
        (rig.calibration.function_columns, rig.calibration.function_rows) = (1, 1);
    }),
};

/// Panel and scene moved nearer after calibration, and the lens refocused.
pub(crate) const NEARER: Change = Change {
    name: "nearer since and refocused",
    unit: "times",
    to: To::Since(|rig, times| lens(rig, |lens| lens.object_distance_mm *= 1.0 / times)),
};

/// The lens moved sideways after calibration.
pub(crate) const DECENTRED: Change = Change {
    name: "lens off centre since",
    unit: "% of the width",
    to: To::Since(|rig, percent| {
        let aside = percent / 100.0 * rig.photo.width_px as f64;
        lens(rig, |lens| lens.axis_offset_px = [aside, 0.0]);
    }),
};

/// The lens smeared by a touch after calibration.
pub(crate) const SMEARED: Change = Change {
    name: "lens smeared since",
    unit: "%",
    to: To::Since(|rig, percent| veil(rig, percent, SMEAR_PX)),
};

/// A change with its strengths in a sweep.
#[derive(Debug)]
pub(crate) struct Swept {
    /// The change.
    pub(crate) change: Change,
    /// Strengths on a rig; the first is no change.
    pub(crate) strengths: fn(&RigFile) -> [f64; 5],
}

pub(crate) const fn swept(
    name: &'static str,
    unit: &'static str,
    strengths: fn(&RigFile) -> [f64; 5],
    to: To,
) -> Swept {
    Swept { change: Change { name, unit, to }, strengths }
}

/// Faults of a rig, a photo or a method; the effects of every real rig are in
/// [`crate::truths::TRUTHS`].
pub(crate) static SWEPT: [Swept; 21] = [
    swept(
        "capture noise",
        "grey levels",
        |_| [0.0, 1.0, 2.0, 4.0, 8.0],
        To::Captures(|witness, simulation, levels| {
            witness.change_sensor(|sensor| {
                sensor.read_noise_levels = simulation.sensor.read_noise_levels.hypot(levels);
            });
        }),
    ),
    swept(
        "panel knocked",
        "px",
        |_| [0.0, 0.25, 0.5, 1.0, 2.0],
        To::Captures(|witness, _, px| witness.knock_panel(0.8 * px, 0.6 * px)),
    ),
    swept(
        "ambient light",
        "grey levels",
        |_| [0.0, 2.0, 5.0, 10.0, 20.0],
        To::Captures(|witness, simulation, levels| {
            witness.change_sensor(|sensor| {
                sensor.ambient_levels = simulation.sensor.ambient_levels.map(|v| v + levels);
            });
        }),
    ),
    // A darker panel, or a slower camera.
    swept(
        "gain drift",
        "% darker",
        |_| [0.0, 2.0, 5.0, 10.0, 20.0],
        To::Captures(|witness, simulation, percent| {
            witness.change_sensor(|sensor| {
                sensor.white_share = simulation.sensor.white_share * (1.0 - percent / 100.0);
            });
        }),
    ),
    swept(
        "response error",
        "% of gamma",
        |_| [0.0, 2.0, 5.0, 10.0, 20.0],
        To::Captures(|witness, _, percent| {
            witness.set_wear(Wear { gamma_factor: 1.0 + percent / 100.0, ..Wear::default() });
        }),
    ),
    // A job takes seconds, and so does the warm-up that matters most.
    swept(
        "panel warm-up",
        "% of its light",
        |_| [0.0, 2.0, 5.0, 10.0, 20.0],
        To::EachJob(|witness, _, percent| {
            let warm_up_share = percent / 100.0;
            witness.set_wear(Wear { warm_up_share, warm_up_s: 2.0, ..Wear::default() });
        }),
    ),
    swept(
        "exposure off refresh",
        "% bands",
        |_| [0.0, 1.0, 3.0, 10.0, 30.0],
        To::Captures(|witness, _, percent| {
            witness.set_wear(Wear { band_share: percent / 100.0, ..Wear::default() });
        }),
    ),
    swept(
        "dead panel pixels",
        "in 10,000",
        |_| [0.0, 1.0, 5.0, 20.0, 100.0],
        To::Captures(|witness, _, count| {
            witness.set_wear(Wear { dead_share: count / 10_000.0, ..Wear::default() });
        }),
    ),
    swept(
        "dust on the panel",
        "grains",
        |_| [0.0, 3.0, 10.0, 30.0, 100.0],
        To::Captures(|witness, _, grains| {
            witness.set_wear(Wear { dust_grains: grains as usize, ..Wear::default() });
        }),
    ),
    // The panel stands at 4 m (paper's Fig. 9).
    swept(
        "photo's distance",
        "m",
        |_| [4.0, 2.0, 1.0, 0.6, 0.4],
        To::Camera(|rig, m| lens(rig, |lens| lens.object_distance_mm *= m / 4.0)),
    ),
    swept("photo's lens sharper", "f-number", |_| [4.0, 5.0, 6.5, 8.0, 11.0], STOPPED),
    swept("photo's lens blurrier", "f-number", |_| [4.0, 3.8, 3.5, 3.2, 2.8], STOPPED),
    // The scene's light is broader than the panel's primaries.
    swept(
        "broad spectrum",
        "times the filters",
        |_| [1.0, 1.5, 2.0, 2.5, 3.0],
        To::Camera(|rig, times| {
            simulation(rig, |simulation| {
                simulation.sensor.filters = broader(&simulation.sensor.filters, times);
            });
        }),
    ),
    swept(
        "veiling glare",
        "% more",
        |_| [0.0, 5.0, 10.0, 20.0, 40.0],
        To::Since(|rig, percent| glare(rig, |glare| glare.share += percent as f32 / 100.0)),
    ),
    swept(
        "saturated highlights",
        "times the light",
        |_| [1.0, 1.25, 1.5, 2.0, 4.0],
        To::Photo(|taking, times| taking.brighter = times - 1.0),
    ),
    swept(
        "photo noise",
        "grey levels",
        |_| [0.0, 2.0, 4.0, 8.0, 16.0],
        To::Photo(|taking, levels| taking.noise_levels = levels),
    ),
    swept(
        "photo's JPEG",
        "quality",
        |_| [100.0, 95.0, 85.0, 70.0, 50.0],
        To::Photo(|taking, quality| taking.jpeg = (quality < 100.0).then_some(quality as u8)),
    ),
    swept("step size", "times the set one", |_| [1.0, 1.25, 2.0, 4.0, 16.0], To::Step),
    swept(
        "patch below the blur",
        "px",
        |rig| {
            let patch = rig.paper.patch_px as f64;
            [patch, (0.6 * patch).round(), (0.4 * patch).round(), 6.0, 4.0]
        },
        PATCHES,
    ),
    swept(
        "patch up to the frame",
        "px",
        |rig| {
            let (patch, frame) = (rig.paper.patch_px as f64, rig.photo.width_px as f64);
            [patch, 2.0 * patch, frame / 4.0, frame / 2.0, frame]
        },
        PATCHES,
    ),
    swept(
        "lens functions",
        "number",
        |rig| {
            let filed = rig.calibration.function_columns * rig.calibration.function_rows;
            [filed as f64, 12.0, 4.0, 2.0, 1.0]
        },
        To::Functions(|number| match number as usize {
            12 => (4, 3),
            4 => (2, 2),
            2 => (2, 1),
            _ => (1, 1),
        }),
    ),
];

/// The stop opened or closed, from f/4.
const STOPPED: To =
    To::Camera(|rig, f_number| lens(rig, |lens| lens.stop_diameter_mm *= 4.0 / f_number));

const PATCHES: To = To::Patches(set_patch);

/// Sets patches of `px`. The margin is at most half of that, or neighbours' light would be sewn in.
pub(crate) fn set_patch(rig: &mut RigFile, px: f64) {
    rig.paper.patch_px = px as usize;
    rig.paper.margin_px = rig.paper.margin_px.min(rig.paper.patch_px / 2);
}

/// `filters` with wavelengths `factor` times as far from their channel's mean, within the
/// visible range.
fn broader(filters: &Primaries, factor: f64) -> Primaries {
    let wider = |list: &[Wavelength]| {
        let total: f64 = list.iter().map(|w| w.1).sum();
        let middle = list.iter().map(|w| w.0 * w.1).sum::<f64>() / total;
        let moved = |w: &Wavelength| {
            Wavelength((middle + factor * (w.0 - middle)).clamp(400.0, 700.0), w.1)
        };
        list.iter().map(moved).collect()
    };
    let [red, green, blue] = filters.lists().map(wider);
    Primaries { red_nm: red, green_nm: green, blue_nm: blue }
}
