//! What is put on a rig after it was calibrated, on a photo or on a method, in five strengths.

use crate::config::{self, Glare, Kind, Lens, Primaries, Simulation, Wavelength};
use crate::rig::simulated::{Wear, Witness};

/// One way for things to be other than they should.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Captures noisier than when the rig was calibrated.
    CaptureNoise,
    /// The panel was knocked.
    Shift,
    /// Light in the room.
    Ambient,
    /// The panel is darker than it was, or the camera slower.
    Gain,
    /// The panel's grey-level curve is another one.
    Response,
    /// The panel is cold and warms up during the job.
    WarmUp,
    /// The exposure is no multiple of the backlight's period.
    Flicker,
    /// Panel pixels that stay dark.
    DeadPixels,
    /// Dust on the panel.
    Dust,
    /// The photo was taken at another distance than the panel's 4 m (paper's Fig. 9).
    Distance,
    /// The photo was taken by a sharper lens than the calibrated one.
    SharperLens,
    /// The photo was taken by a worse lens than the calibrated one.
    BlurrierLens,
    /// The scene's light is broader than the panel's primaries.
    Spectrum,
    /// The lens grew dirty: a broad faint halo on photo and captures.
    Glare,
    /// Highlights beyond what the photo holds.
    Saturation,
    /// Noise in the photo.
    PhotoNoise,
    /// The photo is a JPEG.
    Jpeg,
    /// Steps longer than ‖K‖ allows.
    Step,
    /// Patches smaller than the blur.
    SmallPatch,
    /// Patches as large as the frame.
    LargePatch,
    /// A lens model of few functions.
    Functions,
}

/// What a fault is put on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The captures alone.
    Captures,
    /// The photo alone.
    Photo,
    /// The lens, after the calibration: captures and photo.
    Lens,
    /// The calibration.
    Calibration,
    /// The method's step.
    Step,
    /// The method's patches.
    Patches,
}

impl Fault {
    /// All of them.
    pub const ALL: [Fault; 21] = [
        Fault::CaptureNoise,
        Fault::Shift,
        Fault::Ambient,
        Fault::Gain,
        Fault::Response,
        Fault::WarmUp,
        Fault::Flicker,
        Fault::DeadPixels,
        Fault::Dust,
        Fault::Distance,
        Fault::SharperLens,
        Fault::BlurrierLens,
        Fault::Spectrum,
        Fault::Glare,
        Fault::Saturation,
        Fault::PhotoNoise,
        Fault::Jpeg,
        Fault::Step,
        Fault::SmallPatch,
        Fault::LargePatch,
        Fault::Functions,
    ];

    /// The words for tables, and the unit of its strengths.
    pub const fn name(self) -> (&'static str, &'static str) {
        match self {
            Fault::CaptureNoise => ("capture noise", "grey levels"),
            Fault::Shift => ("panel knocked", "px"),
            Fault::Ambient => ("ambient light", "grey levels"),
            Fault::Gain => ("gain drift", "% darker"),
            Fault::Response => ("response error", "% of gamma"),
            Fault::WarmUp => ("panel warm-up", "% of its light"),
            Fault::Flicker => ("exposure off refresh", "% bands"),
            Fault::DeadPixels => ("dead panel pixels", "in 10,000"),
            Fault::Dust => ("dust on the panel", "grains"),
            Fault::Distance => ("photo's distance", "m"),
            Fault::SharperLens => ("photo's lens sharper", "f-number"),
            Fault::BlurrierLens => ("photo's lens blurrier", "f-number"),
            Fault::Spectrum => ("broad spectrum", "times the filters"),
            Fault::Glare => ("veiling glare", "% more"),
            Fault::Saturation => ("saturated highlights", "times the light"),
            Fault::PhotoNoise => ("photo noise", "grey levels"),
            Fault::Jpeg => ("photo's JPEG", "quality"),
            Fault::Step => ("step size", "times the set one"),
            Fault::SmallPatch => ("patch below the blur", "px"),
            Fault::LargePatch => ("patch up to the frame", "px"),
            Fault::Functions => ("lens functions", "number"),
        }
    }

    /// What it is put on.
    pub const fn place(self) -> Place {
        match self {
            Fault::CaptureNoise
            | Fault::Shift
            | Fault::Ambient
            | Fault::Gain
            | Fault::Response
            | Fault::WarmUp
            | Fault::Flicker
            | Fault::DeadPixels
            | Fault::Dust => Place::Captures,
            Fault::Distance
            | Fault::SharperLens
            | Fault::BlurrierLens
            | Fault::Spectrum
            | Fault::Saturation
            | Fault::PhotoNoise
            | Fault::Jpeg => Place::Photo,
            Fault::Glare => Place::Lens,
            Fault::Step => Place::Step,
            Fault::SmallPatch | Fault::LargePatch => Place::Patches,
            Fault::Functions => Place::Calibration,
        }
    }

    /// Its strengths on `rig`, the first of them no fault at all.
    pub fn strengths(self, rig: &config::Rig) -> [f64; 5] {
        let patch = rig.paper.patch_px as f64;
        match self {
            Fault::CaptureNoise => [0.0, 1.0, 2.0, 4.0, 8.0],
            Fault::Shift => [0.0, 0.25, 0.5, 1.0, 2.0],
            Fault::Ambient => [0.0, 2.0, 5.0, 10.0, 20.0],
            Fault::Gain => [0.0, 2.0, 5.0, 10.0, 20.0],
            Fault::Response => [0.0, 2.0, 5.0, 10.0, 20.0],
            Fault::WarmUp => [0.0, 2.0, 5.0, 10.0, 20.0],
            Fault::Flicker => [0.0, 1.0, 3.0, 10.0, 30.0],
            Fault::DeadPixels => [0.0, 1.0, 5.0, 20.0, 100.0],
            Fault::Dust => [0.0, 3.0, 10.0, 30.0, 100.0],
            Fault::Distance => [4.0, 2.0, 1.0, 0.6, 0.4],
            Fault::SharperLens => [4.0, 5.0, 6.5, 8.0, 11.0],
            Fault::BlurrierLens => [4.0, 3.8, 3.5, 3.2, 2.8],
            Fault::Spectrum => [1.0, 1.5, 2.0, 2.5, 3.0],
            Fault::Glare => [0.0, 5.0, 10.0, 20.0, 40.0],
            Fault::Saturation => [1.0, 1.25, 1.5, 2.0, 4.0],
            Fault::PhotoNoise => [0.0, 2.0, 4.0, 8.0, 16.0],
            Fault::Jpeg => [100.0, 95.0, 85.0, 70.0, 50.0],
            Fault::Step => [1.0, 1.25, 2.0, 4.0, 16.0],
            Fault::SmallPatch => [patch, (0.6 * patch).round(), (0.4 * patch).round(), 6.0, 4.0],
            Fault::LargePatch => {
                let frame = rig.photo.width_px as f64;
                [patch, 2.0 * patch, frame / 4.0, frame / 2.0, frame]
            }
            Fault::Functions => {
                let full =
                    (rig.calibration.function_columns * rig.calibration.function_rows) as f64;
                [full, 12.0, 4.0, 2.0, 1.0]
            }
        }
    }

    /// `rig` as the photo's camera was, when that was another.
    pub fn photo_rig(self, strength: f64, rig: &config::Rig) -> Option<config::Rig> {
        self.changed(rig, |simulation| match (self, &mut simulation.lens) {
            (Fault::Distance, Lens::Prescription(lens, _)) => {
                lens.object_distance_mm *= strength / self.strengths(rig)[0];
            }
            (Fault::SharperLens | Fault::BlurrierLens, Lens::Prescription(lens, _)) => {
                lens.stop_diameter_mm *= self.strengths(rig)[0] / strength;
            }
            (Fault::Spectrum, _) => {
                simulation.sensor.filters = broader(&simulation.sensor.filters, strength)
            }
            _ => {}
        })
    }

    /// `rig` as it is now, when it is no longer what was calibrated.
    pub fn changed_rig(self, strength: f64, rig: &config::Rig) -> Option<config::Rig> {
        if self != Fault::Glare {
            return None;
        }
        self.changed(rig, |simulation| {
            let (Lens::Prescription(_, glare) | Lens::Measured(_, glare)) = &mut simulation.lens;
            *glare = Glare { share: glare.share + strength as f32 / 100.0, ..*glare };
        })
    }

    fn changed(
        self,
        rig: &config::Rig,
        change: impl FnOnce(&mut Simulation),
    ) -> Option<config::Rig> {
        let concerned = matches!(
            self,
            Fault::Distance
                | Fault::SharperLens
                | Fault::BlurrierLens
                | Fault::Spectrum
                | Fault::Glare
        );
        let mut rig = concerned.then(|| rig.clone())?;
        if let Kind::Simulated(simulation) = &mut rig.kind {
            change(simulation);
        }
        Some(rig)
    }

    /// Functions of the lens model: columns and rows.
    pub fn functions(self, strength: f64) -> Option<(usize, usize)> {
        match (self, strength as usize) {
            (Fault::Functions, 12) => Some((4, 3)),
            (Fault::Functions, 4) => Some((2, 2)),
            (Fault::Functions, 2) => Some((2, 1)),
            (Fault::Functions, 1) => Some((1, 1)),
            _ => None,
        }
    }

    /// Does it to the captures of the rig that `witness` belongs to.
    pub fn put_on(self, strength: f64, witness: &mut Witness, simulation: &Simulation) {
        let (sensor, share) = (&simulation.sensor, strength / 100.0);
        match self {
            Fault::CaptureNoise => {
                witness.set_read_noise_levels(sensor.read_noise_levels.hypot(strength));
            }
            Fault::Shift => witness.knock_panel(0.8 * strength, 0.6 * strength),
            Fault::Ambient => {
                witness.set_ambient_levels(sensor.ambient_levels.map(|v| v + strength))
            }
            Fault::Gain => witness.set_white_share(sensor.white_share * (1.0 - share)),
            Fault::Response => {
                witness.set_wear(Wear { gamma_factor: 1.0 + share, ..Wear::default() })
            }
            // A job takes seconds; so does the warming up that shows most.
            Fault::WarmUp => {
                witness.set_wear(Wear { warm_up_share: share, warm_up_s: 2.0, ..Wear::default() });
            }
            Fault::Flicker => witness.set_wear(Wear { band_share: share, ..Wear::default() }),
            Fault::DeadPixels => {
                witness.set_wear(Wear { dead_share: strength / 10_000.0, ..Wear::default() });
            }
            Fault::Dust => {
                witness.set_wear(Wear { dust_grains: strength as usize, ..Wear::default() })
            }
            _ => {}
        }
    }
}

/// Every wavelength `factor` times as far from its channel's middle, within what light and glass
/// are.
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
