//! Everything light passes between panel or scene and sensor, with nothing that changes in time.

use std::sync::OnceLock;

use rustfft::num_complex::Complex;

use super::convolution::{Axis, Convolution};
use super::glare;
use super::point_spread::{Fan, Radial};
use super::pose::PanelMap;
use super::prescription::Focused;
use crate::config::{BlurGrid, Glare, Lens, Pose, Prescription, Primaries, RigFile, Simulation};
use crate::frame::{Channel, Plane, Rect, Size, once};
use crate::rig::RigError;

/// More of a function's light than this outside its support is worth a warning (guess).
const LOST_SHARE_MAX: f64 = 0.02;

/// In whose light, and on which place a function is put.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// The panel's primaries, in the green channel's geometry: a capture.
    Panel,
    /// The panel's primaries, each channel's functions on their own centroids: a capture whose
    /// lateral colour was taken out by per-channel geometry.
    PanelCentred,
    /// A scene's broad light through the sensor's filters, in the green channel's geometry: a
    /// photograph.
    Scene,
}

/// A traced lens; the scene's light is traced when the first photograph is taken.
struct TracedFunctions {
    prescription: Prescription,
    /// The geometry of the panel's distance.
    radial: Radial,
    /// The panel's magnification relative to that of a lens focused on it: focus breathing.
    breathing: f64,
    /// The lens before a scene, and the geometry of its distance.
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
        log::debug!(
            "simulated lens: focal length {:.3} mm at 540 nm, image plane {:.3} mm behind the \
             first vertex",
            lens.lens.focal_length(540.0),
            lens.image_z
        );
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
            Light::Panel | Light::PanelCentred => &self.panel,
            Light::Scene => {
                let (lens, radial) = (&self.before_scene, &self.scene_radial);
                self.scene.get_or_init(|| Fan::new(lens, &self.prescription, radial, &self.filters))
            }
        }
    }
}

/// Where the functions come from.
enum Functions {
    TracedFunctions(Box<TracedFunctions>),
    Measured(BlurGrid),
}

/// The lens of one rig. Light lives on a grid that reaches `pad` pixels beyond the sensor on every
/// side, as far as a function throws it.
pub(super) struct Optics {
    pub(super) sensor: Size,
    pub(super) photo: Rect,
    pub(super) pad: usize,
    pub(super) support_px: usize,
    functions: Functions,
    axes: [Axis; 2],
    glare: Glare,
    /// One convolution per [`Light`], planned when first needed.
    convolutions: [OnceLock<Convolution>; 3],
    /// Light towards the corners, relative to the centre, on the sensor; per [`Light`].
    dark_corners: [OnceLock<[Plane; 3]>; 3],
}

impl Optics {
    /// Traces the lens; captures and photographs are prepared when the first one is taken.
    ///
    /// # Errors
    /// When the prescription is no usable lens.
    pub(super) fn new(rig: &RigFile, simulation: &Simulation) -> Result<Optics, RigError> {
        let (sensor, photo) = (rig.camera.size(), rig.photo_on_sensor());
        let (functions, support_px) = match &simulation.lens {
            Lens::Measured(blur, _) => (Functions::Measured(blur.clone()), blur.support_px),
            Lens::Prescription(prescription, _) => {
                let traced = TracedFunctions::new(prescription, simulation, sensor)?;
                (Functions::TracedFunctions(Box::new(traced)), prescription.support_px)
            }
        };
        let pad = support_px / 2;
        let axes = match &functions {
            Functions::Measured(blur) => [
                spread(photo.size.width, blur.columns, photo.x + pad, 0),
                spread(photo.size.height, blur.rows, photo.y + pad, 0),
            ],
            // One more node on every side, so that the functions go on changing up to the border.
            Functions::TracedFunctions(traced) => [
                spread(sensor.width, traced.prescription.node_columns, pad, 1),
                spread(sensor.height, traced.prescription.node_rows, pad, 1),
            ],
        };
        let (convolutions, dark_corners) = Default::default();
        let glare = simulation.lens.glare();
        let optics = Optics {
            sensor,
            photo,
            pad,
            support_px,
            functions,
            axes,
            glare,
            convolutions,
            dark_corners,
        };
        Ok(optics)
    }

    /// Prepares captures.
    pub(super) fn prepare(&self) {
        self.warn_of_lost_light();
        self.convolution(Light::Panel);
        self.dark_corner(Light::Panel);
    }

    /// The grid light lives on.
    pub(super) fn grid(&self) -> Size {
        Size::new(self.sensor.width + 2 * self.pad, self.sensor.height + 2 * self.pad)
    }

    /// The panel's map in the green geometry for `pose`.
    pub(super) fn map(&self, pose: &Pose, panel: Size) -> PanelMap {
        match &self.functions {
            Functions::Measured(_) => PanelMap::new(pose, panel, self.sensor, f64::INFINITY, None),
            Functions::TracedFunctions(traced) => {
                let pitch = traced.prescription.pixel_pitch_um / 1000.0;
                let distance =
                    traced.prescription.object_distance_mm * traced.radial.magnification() / pitch;
                let breathing = traced.breathing;
                let pose = &Pose {
                    sensor_px_per_panel_px: pose.sensor_px_per_panel_px * breathing,
                    shift_x_px: pose.shift_x_px * breathing,
                    shift_y_px: pose.shift_y_px * breathing,
                    ..*pose
                };
                PanelMap::new(
                    pose,
                    panel,
                    self.sensor,
                    distance,
                    Some((traced.radial.clone(), pitch)),
                )
            }
        }
    }

    /// Sensor place `at` from where the optical axis meets the sensor.
    fn relative_to_axis(&self, at: [f64; 2]) -> [f64; 2] {
        let offset = match &self.functions {
            Functions::TracedFunctions(traced) => traced.prescription.axis_offset_px,
            Functions::Measured(_) => [0.0; 2],
        };
        let middle = [self.sensor.width, self.sensor.height].map(|side| (side as f64 - 1.0) / 2.0);
        [at[0] - middle[0] - offset[0], at[1] - middle[1] - offset[1]]
    }

    /// How far the light of `channel` seen at sensor place `at` in the green geometry really is
    /// from there.
    pub(super) fn lateral_colour_px(&self, channel: Channel, at: [f64; 2]) -> [f64; 2] {
        let Functions::TracedFunctions(traced) = &self.functions else { return [0.0; 2] };
        let from_axis = self.relative_to_axis(at);
        let radius = from_axis[0].hypot(from_axis[1]);
        let out = traced.panel.offset_px(channel, radius);
        if radius > 0.0 { from_axis.map(|v| v / radius * out) } else { [0.0; 2] }
    }

    /// The function of `channel` for a point seen at sensor place `at`, row-major, and the share of
    /// light outside its support. Of a measured blur the nearest one.
    pub(super) fn function(&self, light: Light, channel: Channel, at: [f64; 2]) -> (Vec<f32>, f64) {
        match &self.functions {
            Functions::TracedFunctions(traced) => {
                let own_centroid = light == Light::PanelCentred;
                traced.fan(light).function(
                    channel,
                    self.relative_to_axis(at),
                    self.support_px,
                    own_centroid,
                )
            }
            Functions::Measured(blur) => {
                let nearest = |axis: Axis, x: f64| {
                    let place = (x + self.pad as f64 - axis.first) / axis.step;
                    (place.round().max(0.0) as usize).min(axis.count - 1)
                };
                let (column, row) = (nearest(self.axes[0], at[0]), nearest(self.axes[1], at[1]));
                (blur.function(row, column, channel.index()).to_vec(), 0.0)
            }
        }
    }

    /// What is left of a grating of `frequency` lines a pixel, along columns and rows, of which
    /// `channel` sees the panel's light at sensor place `at`: the transfer function. Nothing is
    /// known of gratings finer than the taps of a measured blur; it passes none.
    pub(super) fn passed(
        &self,
        channel: Channel,
        at: [f64; 2],
        frequency: [f64; 2],
    ) -> Complex<f64> {
        match &self.functions {
            Functions::TracedFunctions(traced) => {
                traced.panel.passed(channel, self.relative_to_axis(at), frequency)
            }
            Functions::Measured(_) => Complex::default(),
        }
    }

    fn convolution(&self, light: Light) -> &Convolution {
        once(&self.convolutions[light as usize], || {
            Convolution::new(self.grid(), self.axes, self.support_px, |channel, column, row| {
                let place = |axis: Axis, n: usize| axis.place(n) - self.pad as f64;
                let at = [place(self.axes[0], column), place(self.axes[1], row)];
                self.function(light, channel, at).0
            })
        })
    }

    /// Light towards the corners relative to the centre, on the sensor.
    pub(super) fn dark_corner(&self, light: Light) -> &[Plane; 3] {
        self.dark_corners[light as usize].get_or_init(|| {
            Channel::ALL.map(|channel| {
                let Functions::TracedFunctions(traced) = &self.functions else {
                    return Plane::filled(self.sensor, 1.0);
                };
                // Smooth over the field: looked up by radius, half a pixel apart.
                let (right, bottom) =
                    (self.sensor.width as f64 - 1.0, self.sensor.height as f64 - 1.0);
                let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
                let reach =
                    corners.map(|at| self.relative_to_axis(at)).map(|[dx, dy]| dx.hypot(dy));
                let radii = (reach.into_iter().fold(0.0, f64::max) * 2.0) as usize + 2;
                let fan = traced.fan(light);
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

    /// Light of one channel on the grid, through the lens: blurred and veiled, on the grid, without
    /// the dark corner.
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
                    self.support_px
                );
            }
        }
    }
}

/// `count` tile centres over `length` pixels from `start` on, with `guard` more on either side.
fn spread(length: usize, count: usize, start: usize, guard: usize) -> Axis {
    let step = length as f64 / count as f64;
    let first = start as f64 + (0.5 - guard as f64) * step - 0.5;
    Axis { first, step, count: count + 2 * guard }
}
