//! The two groups of scenes and rigs: limits of judging are set on one, and rates are stated for
//! the other. They share no scene, rig, lens or seed.

use relens::chart::scenes::Scene;
use relens::config::{Glass, RigFile};
use relens::frame::Mosaic;

use crate::Failure;
use crate::change::{lens, simulation};
use crate::view::Subject;

/// One of the groups.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Group {
    /// Scenes and rigs on which limits are set
    Limits,
    /// Scenes and rigs for which rates are stated
    Rates,
}

/// A rig of a group.
pub(crate) struct GroupRig {
    pub(crate) name: &'static str,
    /// The rig file it is made from.
    file: &'static str,
    change: fn(&mut RigFile),
}

/// Rigs of [`Group::Limits`].
const LIMITS: [GroupRig; 3] = [
    GroupRig { name: "small, plano-convex", file: "small.toml", change: |rig| singlet(rig, PLANO) },
    GroupRig {
        name: "truthful, meniscus, noisier",
        file: "truthful.toml",
        change: |rig| {
            singlet(rig, MENISCUS);
            lens(rig, |lens| lens.scene_distance_mm = Some(4200.0));
            simulation(rig, |simulation| {
                simulation.sensor.full_well_electrons = 20_000.0;
                simulation.sensor.mosaic = Some(Mosaic::Grbg);
            });
        },
    },
    GroupRig {
        name: "truthful, fused silica, finer pixels",
        file: "truthful.toml",
        change: |rig| {
            singlet(rig, SILICA);
            finer(rig, 1.6, Sizes { model_px: 19, lens_px: 29, margin_px: 11 });
        },
    },
];

/// Rigs of [`Group::Rates`].
const RATES: [GroupRig; 3] = [
    GroupRig { name: "truthful", file: "truthful.toml", change: |_| {} },
    GroupRig {
        name: "truthful, pixels of simulated",
        file: "truthful.toml",
        change: |rig| finer(rig, 2.5, Sizes { model_px: 27, lens_px: 45, margin_px: 16 }),
    },
    GroupRig {
        name: "truthful, flint, noisier",
        file: "truthful.toml",
        change: |rig| {
            singlet(rig, FLINT);
            lens(rig, |lens| lens.scene_distance_mm = Some(3900.0));
            simulation(rig, |simulation| simulation.sensor.full_well_electrons = 12_000.0);
        },
    },
];

/// A singlet of 75 mm, with radii by the lens maker's formula for a thin lens of its glass.
struct Singlet {
    radii_mm: [f64; 2],
    glass: Glass,
    stop_diameter_mm: f64,
}

const PLANO: Singlet =
    Singlet { radii_mm: [38.76, f64::INFINITY], glass: Glass::NBk7, stop_diameter_mm: 16.7 };
const MENISCUS: Singlet =
    Singlet { radii_mm: [27.93, 100.0], glass: Glass::NBk7, stop_diameter_mm: 13.4 };
const SILICA: Singlet =
    Singlet { radii_mm: [68.77, -68.77], glass: Glass::FusedSilica, stop_diameter_mm: 17.0 };
const FLINT: Singlet =
    Singlet { radii_mm: [62.0, -155.0], glass: Glass::F2, stop_diameter_mm: 15.0 };

/// Replaces the lens and its stop; the rim of the barrel before it stays.
fn singlet(rig: &mut RigFile, of: Singlet) {
    lens(rig, |lens| {
        let [.., front, back] = lens.surfaces.as_mut_slice() else { return };
        (front.radius_mm, back.radius_mm) = (of.radii_mm[0], of.radii_mm[1]);
        front.glass = of.glass;
        lens.stop_diameter_mm = of.stop_diameter_mm;
    });
}

/// Sizes of a rig with finer pixels.
struct Sizes {
    model_px: usize,
    lens_px: usize,
    margin_px: usize,
}

/// Makes pixels `times` as fine, so that the photo covers only the middle of the field.
fn finer(rig: &mut RigFile, times: f64, Sizes { model_px, lens_px, margin_px }: Sizes) {
    lens(rig, |lens| {
        lens.pixel_pitch_um /= times;
        lens.support_px = lens_px;
    });
    rig.calibration.function_support_px = model_px;
    rig.canvas.margin_px = margin_px;
}

impl Group {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Group::Limits => "limits",
            Group::Rates => "rates",
        }
    }

    pub(crate) const fn rigs(self) -> &'static [GroupRig] {
        match self {
            Group::Limits => &LIMITS,
            Group::Rates => &RATES,
        }
    }

    pub(crate) fn subjects(self) -> [Subject; 6] {
        match self {
            Group::Limits => Scene::CHARTED.map(Subject::Of),
            Group::Rates => [0, 1, 2, 3, 4, 5].map(Subject::Kept),
        }
    }

    /// The first seed of the group's rigs and photos.
    pub(crate) const fn seed(self) -> u64 {
        match self {
            Group::Limits => 3100,
            Group::Rates => 6100,
        }
    }
}

impl GroupRig {
    pub(crate) fn load(&self, seed: u64) -> Result<RigFile, Failure> {
        let mut rig = relens::config::load(std::path::Path::new(self.file))?;
        (self.change)(&mut rig);
        simulation(&mut rig, |simulation| simulation.seed = seed);
        Ok(rig)
    }
}
