//! Ground truth of a simulated rig, for scoring and tests only: methods and calibration learn about
//! a rig from captures alone.

use std::sync::Arc;

use super::devices::Shared;
use super::optics::{Light, Optics};
use super::photograph::{RawPhoto, SceneLight, surrounded};
use super::pose::PanelMap;
use super::wear::Wear;
use crate::config::{Curve, Faults, Pose, Prescription, SensorTable, Simulation, Surround, Unrest};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Rect, Size, Work};
use crate::rig::RigError;
use crate::rig::shoot::SiteNoise;

/// Ground truth of a simulated rig, with methods that change the rig while it runs.
pub struct Witness {
    pub(super) shared: Shared,
    pub(super) optics: Arc<Optics>,
    pub(super) pose: Pose,
    pub(super) map: PanelMap,
    pub(super) panel: Size,
    pub(super) canvas: Rect,
    pub(super) surround: Surround,
    pub(super) curve: Curve,
    pub(super) simulation: Simulation,
}

impl Witness {
    /// Photographs `scene`: photo-sized linear light, 0..255, as recorded by a perfect lens with
    /// the green channel's geometry. Returns the codes of a camera's file: 8 bits in the photo's
    /// curve, with dark corners, glare, lateral colour, and noise from `seed`.
    ///
    /// # Panics
    /// When `scene` is not photo-sized.
    pub fn photograph(&self, scene: &Frame<Work>, seed: u64) -> Frame<Work, u8> {
        assert_eq!(scene.size(), self.optics.photo.size, "a scene has the photo's size");
        let sensor = self.shared.bench().sensor.clone();
        SceneLight::new(&self.optics, &sensor, scene, self.surround, seed).developed(self.curve)
    }

    /// `scene` (photo-sized, linear light) with the lens's dark corners only.
    pub fn shaded(&self, scene: &Frame<Work>) -> Frame<Work> {
        let falloff = self.optics.dark_corner(Light::Scene);
        Frame::from_fn(|c| {
            let mut plane = scene.plane(c).clone();
            plane.multiply(&falloff[c.index()].crop(self.optics.photo));
            plane
        })
    }

    /// Raw sites of the photo of [`Witness::photograph`]; `None` without colour filters.
    ///
    /// # Panics
    /// When `scene` is not photo-sized.
    pub fn photograph_raw(&self, scene: &Frame<Work>, seed: u64) -> Option<RawPhoto> {
        assert_eq!(scene.size(), self.optics.photo.size, "a scene has the photo's size");
        let sensor = self.shared.bench().sensor.clone();
        SceneLight::new(&self.optics, &sensor, scene, self.surround, seed).raw()
    }

    /// Puts `scene` (sensor-sized linear light) before the lens instead of the panel; `None` brings
    /// the panel back.
    ///
    /// # Panics
    /// When `scene` is not sensor-sized.
    pub fn put_before_lens(&self, scene: Option<&Frame<Work>>) {
        let light = scene.map(|scene| {
            assert_eq!(scene.size(), self.optics.sensor, "the whole sensor sees the scene");
            let sensor = self.shared.bench().sensor.clone();
            Arc::new(SceneLight::new(&self.optics, &sensor, scene, self.surround, 0).light)
        });
        self.shared.bench().scene = light;
    }

    /// K·L: `scene` (canvas-sized, linear light, black outside) through the lens, in the light of
    /// the panel's primaries or of a scene, without noise, dark corners, panel pixels or mixing.
    /// Reference for the operator error.
    ///
    /// # Panics
    /// When `scene` is not canvas-sized.
    pub fn forward(&self, scene: &Frame<Work>, light: Light) -> Frame<Work> {
        assert_eq!(scene.size(), self.canvas.size, "the operator works on the canvas");
        let Rect { x, y, size } = self.canvas;
        let place = Rect { x: x + self.optics.pad, y: y + self.optics.pad, size };
        Frame::from_fn(|channel| {
            let wide = surrounded(scene.plane(channel), self.optics.grid(), place, Surround::Black);
            self.optics.through_lens(light, channel, &wide).crop(place)
        })
    }

    /// Point spread function of `channel` at sensor place `at`, with sum 1.
    pub fn function(&self, light: Light, channel: Channel, at: [f64; 2]) -> Plane {
        let support = self.optics.support_px();
        let (values, _) = self.optics.function(light, channel, at);
        Plane::from_vec(Size::new(support, support), values).unwrap_or_default()
    }

    /// Sensor place of the centroid of panel place `at`; (0, 0) is the centre of the first pixel.
    pub fn panel_to_sensor(&self, channel: Channel, at: [f64; 2]) -> [f64; 2] {
        let green = self.map.to_sensor(at);
        let off = self.optics.lateral_colour_px(channel, green);
        [green[0] + off[0], green[1] + off[1]]
    }

    /// Panel place whose centroid is at sensor place `at`.
    pub fn sensor_to_panel(&self, channel: Channel, at: [f64; 2]) -> [f64; 2] {
        let mut green = at;
        // The lateral colour varies slowly, so that three iterations converge.
        for _ in 0..3 {
            let off = self.optics.lateral_colour_px(channel, green);
            green = [at[0] - off[0], at[1] - off[1]];
        }
        self.map.to_panel(green)
    }

    /// Relative illumination per sensor pixel, for the panel's primaries.
    pub fn dark_corner(&self, channel: Channel) -> Plane {
        self.optics.dark_corner(Light::Panel)[channel.index()].clone()
    }

    /// Light on the sensor while the panel shows `codes`, per primary in grey levels, without
    /// mixing, ambient light, black level and noise.
    pub fn light_on_sensor(&self, codes: &crate::frame::Codes) -> [Plane; 3] {
        self.shared.bench().light_of(codes)
    }

    /// Cross-channel matrix C: rows are sensor channels, columns panel primaries.
    pub fn cross_channel(&self) -> [[f64; 3]; 3] {
        self.shared.bench().sensor.config.cross_channel
    }

    /// Light of each panel code, 0..255, with leakage.
    pub fn panel_response(&self, channel: Channel) -> [f32; 256] {
        self.shared.bench().response[channel.index()]
    }

    /// Counts without light.
    pub fn black_level_counts(&self) -> f64 {
        self.shared.bench().sensor.config.black_level_counts
    }

    /// Counts per grey level (of 255) of a primary's light in its own channel.
    pub fn counts_per_level(&self) -> f64 {
        f64::from(self.shared.bench().sensor.counts_per_level())
    }

    /// Counts that the camera's development renders as white.
    pub fn white_count(&self) -> f64 {
        let sensor = &self.shared.bench().sensor;
        let bent = f64::from(sensor.bent(FULL_SCALE) * sensor.counts_per_level());
        bent + sensor.config.black_level_counts
    }

    /// Standard deviation of a capture's noise at light `level`, in grey levels, before rounding.
    pub fn noise_levels(&self, level: f64) -> f64 {
        self.shared.bench().sensor.noise_levels(level)
    }

    /// Noise of the sites in one exposure, including rounding to counts.
    pub fn site_noise(&self) -> SiteNoise {
        let gain = self.counts_per_level();
        let power = |level| (gain * self.noise_levels(level)).powi(2);
        let (at_black, white) = (power(0.0), power(FULL_SCALE.into()));
        let per_count = (white - at_black) / (gain * f64::from(FULL_SCALE));
        SiteNoise { at_black: [at_black + 1.0 / 12.0; 3], per_count: [per_count; 3] }
    }

    /// Gain of each pixel in a channel, about 1, and its dark signal in grey levels.
    pub fn fixed_pattern(&self, channel: Channel) -> [Plane; 2] {
        self.shared.bench().sensor.fixed_pattern(channel, self.optics.sensor)
    }

    /// Sets the probabilities of faults.
    pub fn set_faults(&self, faults: Faults) {
        self.shared.bench().faults = faults;
    }

    /// Changes the physics of the sensor.
    pub fn change_sensor(&self, change: impl FnOnce(&mut SensorTable)) {
        change(&mut self.shared.bench().sensor.config);
    }

    /// Sets the wear of the panel; [`Wear::default`] is a new panel.
    pub fn set_wear(&self, wear: Wear) {
        self.shared.bench().set_wear(wear);
    }

    /// Disconnects the camera for [`Faults::unplugged_ms`].
    pub fn unplug(&self) {
        self.shared.bench().unplug();
    }

    /// Sets how panel and light change from capture to capture.
    pub fn set_unrest(&self, unrest: Unrest) {
        self.shared.bench().unrest = unrest;
    }

    /// Turns the focus ring to `distance_mm`, for captures and photographs; the magnification
    /// changes.
    ///
    /// # Errors
    /// When the lens has no real image at this focus.
    pub fn refocus(&mut self, distance_mm: f64) -> Result<(), RigError> {
        self.change_lens(self.pose.clone(), |lens| lens.focus_distance_mm = Some(distance_mm))
    }

    /// Moves the panel by (`x_px`, `y_px`) sensor pixels to the right and down.
    pub fn knock_panel(&mut self, x_px: f64, y_px: f64) {
        self.pose.shift_x_px += x_px;
        self.pose.shift_y_px += y_px;
        self.place_panel();
    }

    /// Moves the panel to `pose` at `distance_mm`; the focus of the lens is unchanged.
    ///
    /// # Errors
    /// When the lens has no real image at its focus.
    pub fn move_panel(&mut self, pose: Pose, distance_mm: f64) -> Result<(), RigError> {
        self.change_lens(pose, |lens| {
            lens.focus_distance_mm.get_or_insert(lens.object_distance_mm);
            lens.object_distance_mm = distance_mm;
        })
    }

    /// Changes the lens, with the panel in `pose`.
    fn change_lens(
        &mut self,
        pose: Pose,
        change: impl FnOnce(&mut Prescription),
    ) -> Result<(), RigError> {
        let mut simulation = self.simulation.clone();
        change(&mut simulation.lens);
        self.optics = Arc::new(Optics::new(&simulation, self.optics.sensor, self.optics.photo)?);
        (self.simulation, self.pose) = (simulation, pose);
        self.optics.prepare();
        self.place_panel();
        Ok(())
    }

    /// Updates the bench to the panel's pose and the lens's focus.
    fn place_panel(&mut self) {
        self.map = self.optics.map(&self.pose, self.panel);
        self.shared.bench().set_light_path(Arc::clone(&self.optics), &self.map);
    }
}
