//! The scorer's window on the truth of a simulated rig. Nothing but scoring and tests may use it:
//! what a method or a calibration knows comes from captures.

use std::sync::Arc;

use super::devices::Shared;
use super::optics::{Light, Optics};
use super::panel::Projection;
use super::photograph::{Layer, RawPhoto, SceneLight, surrounded};
use super::pose::PanelMap;
use super::wear::Wear;
use crate::config::{Curve, Faults, Kind, Lens, Pose, Prescription, RigFile, Surround, Unrest};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Rect, Size, Work};
use crate::rig::RigError;
use crate::rig::shoot::SiteNoise;

/// What is true of a simulated rig, and handles to change it while it runs.
pub struct Witness {
    pub(super) shared: Shared,
    pub(super) optics: Arc<Optics>,
    pub(super) pose: Pose,
    pub(super) map: PanelMap,
    pub(super) panel: Size,
    pub(super) canvas: Rect,
    pub(super) surround: Surround,
    pub(super) curve: Curve,
    pub(super) rig: RigFile,
}

/// A part of a scene that is all at one distance.
#[derive(Debug, Clone)]
pub struct Depth {
    /// From the part to the first refracting surface.
    pub distance_mm: f64,
    /// How much of each of the photo's pixels it is, 0..1; all parts add up to 1.
    pub share: Plane,
}

impl Witness {
    /// The photograph the rig's camera would have taken of `scene`, which is photo-sized linear
    /// light, 0..255, as a perfect lens with the green channel's geometry would record it. What
    /// comes back are the codes a camera file holds: 8 bits, the photo's curve, dark corner, glare
    /// and noise in it, red and blue displaced by the lateral colour. `seed` is that of its noise.
    ///
    /// # Panics
    /// When `scene` is not photo-sized, which is a bug of the caller.
    pub fn photograph(&self, scene: &Frame<Work>, seed: u64) -> Frame<Work, u8> {
        assert_eq!(scene.size(), self.optics.photo.size, "a scene has the photo's size");
        let sensor = self.shared.bench().sensor.clone();
        let all = [Layer { optics: &self.optics, share: None }];
        SceneLight::new(&all, &sensor, scene, self.surround, seed).developed(self.curve)
    }

    /// `scene` (photo-sized, linear light) shaded as the lens shades a photograph of it: what the
    /// photograph would hold if the lens did nothing else.
    pub fn shaded(&self, scene: &Frame<Work>) -> Frame<Work> {
        let falloff = self.optics.dark_corner(Light::Scene);
        Frame::from_fn(|c| {
            let mut plane = scene.plane(c).clone();
            let shares = falloff[c.index()].crop(self.optics.photo);
            plane.data_mut().iter_mut().zip(shares.data()).for_each(|(v, share)| *v *= share);
            plane
        })
    }

    /// The same photograph as the sensor's sites gave it, before any developing; `None` when the
    /// sensor has no colour filters.
    ///
    /// # Panics
    /// When `scene` is not photo-sized, which is a bug of the caller.
    pub fn photograph_raw(&self, scene: &Frame<Work>, seed: u64) -> Option<RawPhoto> {
        assert_eq!(scene.size(), self.optics.photo.size, "a scene has the photo's size");
        let sensor = self.shared.bench().sensor.clone();
        let all = [Layer { optics: &self.optics, share: None }];
        SceneLight::new(&all, &sensor, scene, self.surround, seed).raw()
    }

    /// Puts `scene` (sensor-sized linear light) before the lens in the panel's place, so that the
    /// camera's next frames are photos of it; `None` brings the panel back.
    ///
    /// # Panics
    /// When `scene` is not sensor-sized, which is a bug of the caller.
    pub fn put_before_lens(&self, scene: Option<&Frame<Work>>) {
        let light = scene.map(|scene| {
            assert_eq!(scene.size(), self.optics.sensor, "the whole sensor sees the scene");
            let sensor = self.shared.bench().sensor.clone();
            let all = [Layer { optics: &self.optics, share: None }];
            Arc::new(SceneLight::new(&all, &sensor, scene, self.surround, 0).light)
        });
        self.shared.bench().scene = light;
    }

    /// [`Witness::photograph`] of a scene with parts at several distances. The lens is focused
    /// where it was; each part is as sharp as its distance lets it be.
    ///
    /// # Errors
    /// [`RigError::Refused`] when the rig's blur was measured and not traced, so that nothing is
    /// known of other distances.
    ///
    /// # Panics
    /// When `scene` or a part is not photo-sized, which is a bug of the caller.
    pub fn photograph_in_depth(
        &self,
        scene: &Frame<Work>,
        parts: &[Depth],
        seed: u64,
    ) -> Result<Frame<Work, u8>, RigError> {
        let size = self.optics.photo.size;
        let fits = scene.size() == size && parts.iter().all(|part| part.share.size() == size);
        assert!(fits, "a scene and its parts have the photo's size");
        let lenses = parts
            .iter()
            .map(|part| self.optics_of(|lens| lens.scene_distance_mm = Some(part.distance_mm)))
            .collect::<Result<Vec<Optics>, RigError>>()?;
        let layers: Vec<Layer> = lenses
            .iter()
            .zip(parts)
            .map(|(optics, part)| Layer { optics, share: Some(&part.share) })
            .collect();
        let sensor = self.shared.bench().sensor.clone();
        Ok(SceneLight::new(&layers, &sensor, scene, self.surround, seed).developed(self.curve))
    }

    /// The optics of this rig with its lens changed.
    fn optics_of(&self, change: impl FnOnce(&mut Prescription)) -> Result<Optics, RigError> {
        let mut rig = self.rig.clone();
        match &mut rig.kind {
            Kind::Simulated(simulation) => {
                if let Lens::Prescription(lens, _) = &mut simulation.lens {
                    change(lens);
                    let simulation = simulation.clone();
                    return Optics::new(&rig, &simulation);
                }
            }
            Kind::Hardware(_) => {}
        }
        Err(RigError::Refused {
            device: "simulated lens",
            found: "a measured blur".to_owned(),
            allowed: "a prescription, which can be focused".to_owned(),
        })
    }

    /// K·L: what the lens makes of `scene` (canvas-sized, linear light) in the light of the panel's
    /// primaries, or of a scene, without noise, dark corner, panel pixels or mixing, black outside
    /// the canvas. The truth behind the operator error.
    ///
    /// # Panics
    /// When `scene` is not canvas-sized, which is a bug of the caller.
    pub fn forward(&self, scene: &Frame<Work>, light: Light) -> Frame<Work> {
        assert_eq!(scene.size(), self.canvas.size, "the operator works on the canvas");
        let Rect { x, y, size } = self.canvas;
        let place = Rect { x: x + self.optics.pad, y: y + self.optics.pad, size };
        Frame::from_fn(|channel| {
            let wide = surrounded(scene.plane(channel), self.optics.grid(), place, Surround::Black);
            self.optics.through_lens(light, channel, &wide).crop(place)
        })
    }

    /// The point spread function of `channel` at sensor place `at`: its values, summing to 1.
    pub fn function(&self, light: Light, channel: Channel, at: [f64; 2]) -> Plane {
        let support = self.optics.support_px;
        let (values, _) = self.optics.function(light, channel, at);
        Plane::from_vec(Size::new(support, support), values)
            .unwrap_or_else(|| Plane::zeros(Size::new(0, 0)))
    }

    /// Where on the sensor the light of panel place `at` has its centroid, in pixels; (0, 0) is the
    /// centre of the first pixel.
    pub fn panel_to_sensor(&self, channel: Channel, at: [f64; 2]) -> [f64; 2] {
        let green = self.map.to_sensor(at);
        let off = self.optics.lateral_colour_px(channel, green);
        [green[0] + off[0], green[1] + off[1]]
    }

    /// Which panel place has its centroid at sensor place `at`.
    pub fn sensor_to_panel(&self, channel: Channel, at: [f64; 2]) -> [f64; 2] {
        let mut green = at;
        // The lateral colour changes by far less than a pixel per pixel: three rounds leave
        // nothing.
        for _ in 0..3 {
            let off = self.optics.lateral_colour_px(channel, green);
            green = [at[0] - off[0], at[1] - off[1]];
        }
        self.map.to_panel(green)
    }

    /// Light towards the corners, relative to the centre, per sensor pixel, for the panel's
    /// primaries.
    pub fn dark_corner(&self, channel: Channel) -> Plane {
        self.optics.dark_corner(Light::Panel)[channel.index()].clone()
    }

    /// What a panel showing `codes` brings to the sensor, per primary, in grey levels: everything
    /// but mixing, ambient light, black level and noise.
    pub fn light_on_sensor(&self, codes: &crate::frame::Codes) -> [Plane; 3] {
        self.shared.bench().light_of(codes)
    }

    /// The cross-channel matrix C: row is the sensor's channel, column the panel's primary.
    pub fn cross_channel(&self) -> [[f64; 3]; 3] {
        self.shared.bench().sensor.config.cross_channel
    }

    /// Light of each panel code, 0..255, leakage included.
    pub fn panel_response(&self, channel: Channel) -> [f32; 256] {
        self.shared.bench().response[channel.index()]
    }

    /// Counts without light.
    pub fn black_level_counts(&self) -> f64 {
        self.shared.bench().sensor.config.black_level_counts
    }

    /// Counts that one grey level (of 255) of a primary's light adds in its own channel.
    pub fn counts_per_level(&self) -> f64 {
        f64::from(self.shared.bench().sensor.counts_per_level())
    }

    /// What the camera counts where a photo's scene is white: where its developing puts white.
    pub fn white_count(&self) -> f64 {
        let sensor = &self.shared.bench().sensor;
        let bent = f64::from(sensor.bent(FULL_SCALE) * sensor.counts_per_level());
        bent + sensor.config.black_level_counts
    }

    /// Standard deviation of a capture's noise at a light of `level`, in grey levels, before
    /// rounding.
    pub fn noise_levels(&self, level: f64) -> f64 {
        self.shared.bench().sensor.noise_levels(level)
    }

    /// The noise of one exposure's sites, with what rounding to counts adds.
    pub fn site_noise(&self) -> SiteNoise {
        let gain = self.counts_per_level();
        let of = |level| (gain * self.noise_levels(level)).powi(2);
        let (at_black, white) = (of(0.0), of(FULL_SCALE.into()));
        let per_count = (white - at_black) / (gain * f64::from(FULL_SCALE));
        SiteNoise { at_black: [at_black + 1.0 / 12.0; 3], per_count: [per_count; 3] }
    }

    /// The response of each pixel of the sensor in a channel, about 1, and its own light in grey
    /// levels.
    pub fn fixed_pattern(&self, channel: Channel) -> [Plane; 2] {
        self.shared.bench().sensor.fixed_pattern(channel, self.optics.sensor)
    }

    /// From now on things go wrong with these probabilities.
    pub fn set_faults(&self, faults: Faults) {
        self.shared.bench().faults = faults;
    }

    /// From now on this much other light falls on the panel, per channel, in grey levels.
    pub fn set_ambient_levels(&self, levels: [f64; 3]) {
        self.shared.bench().sensor.config.ambient_levels = levels;
    }

    /// From now on captures and photographs carry this much light-independent noise, in grey
    /// levels.
    pub fn set_read_noise_levels(&self, levels: f64) {
        self.shared.bench().sensor.config.read_noise_levels = levels;
    }

    /// From now on a pixel holds this many electrons at its largest count; infinite for no shot
    /// noise.
    pub fn set_full_well_electrons(&self, electrons: f64) {
        self.shared.bench().sensor.config.full_well_electrons = electrons;
    }

    /// From now on white fills this share of the sensor's range: a longer or shorter exposure.
    pub fn set_white_share(&self, share: f64) {
        self.shared.bench().sensor.config.white_share = share;
    }

    /// From now on the panel is worn like this; [`Wear::default`] makes it new again.
    pub fn set_wear(&self, wear: Wear) {
        self.shared.bench().set_wear(wear);
    }

    /// Pulls the camera's plug for `faults.unplugged-ms`.
    pub fn unplug(&self) {
        self.shared.bench().unplug();
    }

    /// From now on captures differ from each other by this much.
    pub fn set_unrest(&self, unrest: Unrest) {
        self.shared.bench().unrest = unrest;
    }

    /// Someone turns the focus ring: the lens is now focused at `distance_mm`, for captures and
    /// photographs. What stays where it was is magnified otherwise.
    ///
    /// # Errors
    /// [`RigError::Refused`] when the rig's blur was measured and not traced.
    pub fn refocus(&mut self, distance_mm: f64) -> Result<(), RigError> {
        let focus = |lens: &mut Prescription| lens.focus_distance_mm = Some(distance_mm);
        self.optics = Arc::new(self.optics_of(focus)?);
        if let Kind::Simulated(simulation) = &mut self.rig.kind
            && let Lens::Prescription(lens, _) = &mut simulation.lens
        {
            focus(lens);
        }
        self.optics.prepare();
        self.place_panel();
        Ok(())
    }

    /// Someone knocks at the panel: it now stands (`x_px`, `y_px`) sensor pixels further right and
    /// down.
    pub fn knock_panel(&mut self, x_px: f64, y_px: f64) {
        self.pose.shift_x_px += x_px;
        self.pose.shift_y_px += y_px;
        self.place_panel();
    }

    /// Someone puts the panel elsewhere: it now stands as `pose` says, `distance_mm` before a lens
    /// whose focus stays where it was.
    ///
    /// # Errors
    /// [`RigError::Refused`] when the rig's blur was measured and not traced.
    pub fn move_panel(&mut self, pose: Pose, distance_mm: f64) -> Result<(), RigError> {
        let place = |lens: &mut Prescription| {
            lens.focus_distance_mm.get_or_insert(lens.object_distance_mm);
            lens.object_distance_mm = distance_mm;
        };
        self.optics = Arc::new(self.optics_of(place)?);
        if let Kind::Simulated(simulation) = &mut self.rig.kind
            && let Lens::Prescription(lens, _) = &mut simulation.lens
        {
            place(lens);
        }
        self.optics.prepare();
        self.pose = pose;
        self.place_panel();
        Ok(())
    }

    /// Brings the bench to the panel's pose and the lens's focus.
    fn place_panel(&mut self) {
        self.map = self.optics.map(&self.pose, self.panel);
        let projection = Projection::new(&self.map, self.optics.grid(), self.optics.pad);
        self.shared.bench().set_light_path(Arc::clone(&self.optics), &self.map, projection);
    }
}
