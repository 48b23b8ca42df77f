//! The light path from panel or scene to sensor, without anything that changes in time.

use std::sync::OnceLock;

use rustfft::num_complex::Complex;

use super::convolution::{Axis, Convolution};
use super::glare;
use super::point_spread::{Fan, Radial};
use super::pose::PanelMap;
use super::prescription::Focused;
use crate::config::{Glare, Pose, Prescription, Primaries, Simulation};
use crate::frame::{Channel, Plane, Rect, Size, once};
use crate::rig::RigError;

/// Share of a function's light outside its support above which a warning is logged. Guess.
const LOST_SHARE_MAX: f64 = 0.02;

/// Source of the light, and geometry in which a function is placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// The panel's primaries, in the green channel's geometry: a capture.
    Panel,
    /// A scene's light behind the sensor's filters, in the green channel's geometry: a photograph.
    Scene,
}

/// A traced lens. A scene's light is traced on the first photograph.
struct TracedFunctions {
    prescription: Prescription,
    /// Radial geometry at the panel's distance.
    radial: Radial,
    /// Magnification of the panel relative to a lens focused on it: focus breathing.
    breathing: f64,
    /// Lens with the scene as its object, and radial geometry at the scene's distance.
    before_scene: Focused,
    scene_radial: Radial,
    filters: Primaries,
    panel: Fan,
    scene: OnceLock<Fan>,
}

impl TracedFunctions {
    fn new(
        prescription: &Prescription,
        simulation: &Simulation,
        sensor: Size,
    ) -> Result<TracedFunctions, RigError> {
        let filters = simulation.sensor.filters.clone();
        let lens = Focused::new(prescription, filters.lists()[Channel::Green.index()])?;
        let half = (prescription.support_px / 2) as f64;
        let [aside, down] = prescription.axis_offset_px.map(f64::abs);
        let reach_px = (sensor.width as f64 / 2.0 + half + aside)
            .hypot(sensor.height as f64 / 2.0 + half + down);
        let reach_mm = reach_px * prescription.pixel_pitch_um / 1000.0;
        let radial = Radial::new(&lens, prescription, &filters, reach_mm);
        let panel = Fan::new(&lens, prescription, &radial, &simulation.display.primaries);
        let breathing = match prescription.focus_distance_mm {
            None => 1.0,
            Some(_) => {
                let on_panel = Prescription { focus_distance_mm: None, ..prescription.clone() };
                let green = filters.lists()[Channel::Green.index()];
                let sharp = Focused::new(&on_panel, green)?.magnification(green);
                lens.magnification(green) / sharp
            }
        };
        let (before_scene, scene_radial) = match prescription.scene_distance_mm {
            None => (lens, radial.clone()),
            Some(mm) => {
                let lens = lens.looking_at(mm);
                let radial = Radial::new(&lens, prescription, &filters, reach_mm);
                (lens, radial)
            }
        };
        let scene = OnceLock::new();
        if simulation.display.primaries == filters && prescription.scene_distance_mm.is_none() {
            let _ = scene.set(panel.clone());
        }
        let prescription = prescription.clone();
        Ok(TracedFunctions {
            prescription,
            radial,
            breathing,
            before_scene,
            scene_radial,
            filters,
            panel,
            scene,
        })
    }

    fn fan(&self, light: Light) -> &Fan {
        match light {
            Light::Panel => &self.panel,
            Light::Scene => {
                let (lens, radial) = (&self.before_scene, &self.scene_radial);
                self.scene.get_or_init(|| Fan::new(lens, &self.prescription, radial, &self.filters))
            }
        }
    }
}

/// The lens of a rig, on a grid that extends the sensor by `pad` pixels on every side: half the
/// width of a function.
pub(super) struct Optics {
    pub(super) sensor: Size,
    pub(super) photo: Rect,
    pub(super) pad: usize,
    traced: Box<TracedFunctions>,
    axes: [Axis; 2],
    glare: Glare,
    /// Convolution for each [`Light`], planned on first use.
    convolutions: [OnceLock<Convolution>; 2],
    /// Relative illumination over the sensor for each [`Light`].
    dark_corners: [OnceLock<[Plane; 3]>; 2],
}

impl Optics {
    /// Traces the lens for a `sensor` with the photo at `photo`; fails if it forms no real image.
    pub(super) fn new(
        simulation: &Simulation,
        sensor: Size,
        photo: Rect,
    ) -> Result<Optics, RigError> {
        let prescription = &simulation.lens;
        let traced = Box::new(TracedFunctions::new(prescription, simulation, sensor)?);
        let pad = prescription.support_px / 2;
        let axes = [
            spread(sensor.width, prescription.node_columns, pad),
            spread(sensor.height, prescription.node_rows, pad),
        ];
        let (convolutions, dark_corners) = Default::default();
        let glare = simulation.glare;
        Ok(Optics { sensor, photo, pad, traced, axes, glare, convolutions, dark_corners })
    }

    /// Width and height of a function, pixels.
    pub(super) fn support_px(&self) -> usize {
        self.traced.prescription.support_px
    }

    /// Warns of light that is lost, and computes in advance what captures need.
    pub(super) fn prepare(&self) {
        self.warn_of_lost_light();
        self.convolution(Light::Panel);
        self.dark_corner(Light::Panel);
    }

    /// Size of the extended grid.
    pub(super) fn grid(&self) -> Size {
        Size::new(self.sensor.width + 2 * self.pad, self.sensor.height + 2 * self.pad)
    }

    /// The map of a panel in `pose`, in the green channel's geometry.
    pub(super) fn map(&self, pose: &Pose, panel: Size) -> PanelMap {
        let TracedFunctions { prescription, radial, breathing, .. } = &*self.traced;
        let pitch = prescription.pixel_pitch_um / 1000.0;
        let distance = prescription.object_distance_mm * radial.magnification() / pitch;
        let pose = &Pose {
            sensor_px_per_panel_px: pose.sensor_px_per_panel_px * breathing,
            shift_x_px: pose.shift_x_px * breathing,
            shift_y_px: pose.shift_y_px * breathing,
            ..*pose
        };
        PanelMap::new(pose, panel, self.sensor, distance, (radial.clone(), pitch))
    }

    /// Converts sensor place `at` to one relative to the optical axis.
    fn relative_to_axis(&self, at: [f64; 2]) -> [f64; 2] {
        let offset = self.traced.prescription.axis_offset_px;
        let middle = [self.sensor.width, self.sensor.height].map(|side| (side as f64 - 1.0) / 2.0);
        [at[0] - middle[0] - offset[0], at[1] - middle[1] - offset[1]]
    }

    /// Lateral colour of `channel` at sensor place `at` of the green geometry.
    pub(super) fn lateral_colour_px(&self, channel: Channel, at: [f64; 2]) -> [f64; 2] {
        let from_axis = self.relative_to_axis(at);
        let radius = from_axis[0].hypot(from_axis[1]);
        let out = self.traced.panel.offset_px(channel, radius);
        if radius > 0.0 { from_axis.map(|v| v / radius * out) } else { [0.0; 2] }
    }

    /// The function of `channel` for a point seen at sensor place `at`, row-major, and the share of
    /// light outside its support.
    pub(super) fn function(&self, light: Light, channel: Channel, at: [f64; 2]) -> (Vec<f32>, f64) {
        self.traced.fan(light).function(channel, self.relative_to_axis(at), self.support_px())
    }

    /// Optical transfer function of `channel` at sensor place `at` in the panel's light, for a
    /// grating of `frequency` lines per pixel along columns and rows.
    pub(super) fn transfer(
        &self,
        channel: Channel,
        at: [f64; 2],
        frequency: [f64; 2],
    ) -> Complex<f64> {
        self.traced.panel.transfer(channel, self.relative_to_axis(at), frequency)
    }

    fn convolution(&self, light: Light) -> &Convolution {
        once(&self.convolutions[light as usize], || {
            Convolution::new(self.grid(), self.axes, self.support_px(), |channel, column, row| {
                let place = |axis: Axis, n: usize| axis.place(n) - self.pad as f64;
                let at = [place(self.axes[0], column), place(self.axes[1], row)];
                self.function(light, channel, at).0
            })
        })
    }

    /// Relative illumination over the sensor, per channel.
    pub(super) fn dark_corner(&self, light: Light) -> &[Plane; 3] {
        self.dark_corners[light as usize].get_or_init(|| {
            Channel::ALL.map(|channel| {
                // Tabulated by radius in steps of half a pixel.
                let (right, bottom) =
                    (self.sensor.width as f64 - 1.0, self.sensor.height as f64 - 1.0);
                let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
                let reach =
                    corners.map(|at| self.relative_to_axis(at)).map(|[dx, dy]| dx.hypot(dy));
                let radii = (reach.into_iter().fold(0.0, f64::max) * 2.0) as usize + 2;
                let fan = self.traced.fan(light);
                let table: Vec<f32> = (0..radii)
                    .map(|n| fan.relative_light(channel, n as f64 / 2.0) as f32)
                    .collect();
                Plane::from_fn(self.sensor, |x, y| {
                    let [dx, dy] = self.relative_to_axis([x as f64, y as f64]);
                    table[((dx.hypot(dy) * 2.0).round() as usize).min(radii - 1)]
                })
            })
        })
    }

    /// Light of one channel on the grid, blurred and with glare, without dark corners.
    pub(super) fn through_lens(&self, light: Light, channel: Channel, on_grid: &Plane) -> Plane {
        glare::scatter(self.convolution(light).apply(channel, on_grid), self.glare)
    }

    fn warn_of_lost_light(&self) {
        for channel in Channel::ALL {
            let lost = self.function(Light::Panel, channel, [0.0, 0.0]).1;
            if lost > LOST_SHARE_MAX {
                let percent = lost * 100.0;
                log::warn!(
                    "the simulated lens throws {percent:.1} % of a corner's {} light beyond \
                     lens.support-px = {}",
                    channel.name(),
                    self.support_px()
                );
            }
        }
    }
}

/// An axis of `count` nodes over `length` pixels from `start` on, and one more node on either side,
/// so that functions vary up to the border.
fn spread(length: usize, count: usize, start: usize) -> Axis {
    let step = length as f64 / count as f64;
    Axis { first: start as f64 - 0.5 * step - 0.5, step, count: count + 2 }
}
