//! The optical bench over time: pictures on the panel, exposures of the camera.
//!
//! Time is a number that advances when a device waits. All rows of a picture appear together; their
//! scan-out of up to one refresh is covered by `panel.settle-ms`.

use std::collections::VecDeque;
use std::sync::Arc;

use super::faults::{self, Fault};
use super::optics::{Light, Optics};
use super::panel::{self, Projection, Shading, approach};
use super::pose::PanelMap;
use super::sensor::SimulatedSensor;
use super::stripes::Beat;
use super::unrest;
use super::wear::Wear;
use crate::config::{CameraTable, DisplayTable, Faults, PanelTable, RigFile, Simulation, Unrest};
use crate::frame::{Channel, Codes, Counts, Frame, Plane, Rect, Size};
use crate::rig::{Exposed, Flip, Moment, RigError};

/// Progress at which a picture counts as settled: within 1e-5 of full scale, far below any noise.
const ARRIVED: f64 = 1.0 - 1e-5;

/// A picture on the panel, with its light on the sensor once computed.
#[derive(Clone)]
struct Picture {
    codes: Arc<Codes>,
    /// Light once computed. A mixture of two pictures has no shift, since it is not computed again.
    light: Option<PanelLight>,
}

/// Light on the sensor, and the panel's shift (x, y) for which it was computed.
type PanelLight = (Arc<[Plane; 3]>, Option<[f64; 2]>);

/// State of the bench.
pub(super) struct OpticalBench {
    pub(super) optics: Arc<Optics>,
    pub(super) projection: Projection,
    pub(super) response: [[f32; 256]; 3],
    /// Light on the sensor of a uniform panel at 255, and of its veil.
    flat: [Option<Plane>; 3],
    veil: [Option<Plane>; 3],
    shading: Option<Shading>,
    beat: Option<Beat>,
    pub(super) sensor: SimulatedSensor,
    pub(super) faults: Faults,
    pub(super) panel: PanelTable,
    pub(super) camera: CameraTable,
    pub(super) display: DisplayTable,
    pub(super) seed: u64,
    pub(super) unrest: Unrest,
    /// Wander of the panel so far, and its displacement in this capture, in sensor pixels.
    wandered_px: [f64; 2],
    moved_px: [f64; 2],
    wear: Wear,
    /// Time at which the wear started.
    worn_s: f64,
    dead_pixels: Vec<usize>,
    dust: Option<Plane>,
    now_s: f64,
    before: Picture,
    now: Picture,
    change_s: f64,
    /// Starting times of exposures whose frames are pending.
    fired_s: VecDeque<f64>,
    exposures: u64,
    /// Exposure as a multiple of the rig file's.
    exposure_times: f64,
    /// Gain as a multiple of the rig file's.
    gain_times: f64,
    sequence: u32,
    last: Option<Exposed>,
    /// Light on the sensor from a scene that takes the panel's place.
    pub(super) scene: Option<Arc<[Plane; 3]>>,
    /// Time at which a disconnected camera can be reopened; `None` while it is connected.
    away_until_s: Option<f64>,
}

impl OpticalBench {
    /// The bench of `rig` at time 0, with a black panel in the place that `map` describes.
    pub(super) fn new(
        rig: &RigFile,
        simulation: &Simulation,
        optics: Arc<Optics>,
        map: &PanelMap,
    ) -> OpticalBench {
        let (panel, display) = (rig.panel.clone(), simulation.display.clone());
        let black = Picture { codes: Arc::new(Frame::zeros(panel.size())), light: None };
        let projection = Projection::new(map, optics.grid(), optics.pad);
        OpticalBench {
            response: [0, 1, 2].map(|channel| panel::response(&display, channel)),
            flat: [None, None, None],
            veil: [None, None, None],
            beat: Beat::new(&panel, &optics, map, &projection),
            shading: Shading::new(&display.uneven, map, panel.size()),
            unrest: simulation.unrest,
            wandered_px: [0.0; 2],
            moved_px: [0.0; 2],
            optics,
            projection,
            sensor: SimulatedSensor::new(&simulation.sensor, &rig.camera),
            faults: simulation.faults,
            panel,
            camera: rig.camera.clone(),
            display,
            seed: simulation.seed,
            wear: Wear::default(),
            worn_s: 0.0,
            dead_pixels: Vec::new(),
            dust: None,
            now_s: 0.0,
            before: black.clone(),
            now: black,
            change_s: 0.0,
            fired_s: VecDeque::new(),
            exposures: 0,
            exposure_times: 1.0,
            gain_times: 1.0,
            sequence: 0,
            last: None,
            scene: None,
            away_until_s: None,
        }
    }

    pub(super) fn now(&self) -> Moment {
        Moment(self.now_s)
    }

    pub(super) fn wait_until(&mut self, moment: Moment) {
        self.now_s = self.now_s.max(moment.0);
    }

    /// Sets the exposure to `times` the rig file's. Read noise is constant in electrons, so it
    /// corresponds to less light.
    pub(super) fn expose_times(&mut self, times: f64) {
        let longer = times / self.exposure_times;
        self.camera.exposure_ms *= longer;
        self.sensor.config.white_share *= longer;
        self.sensor.config.read_noise_levels /= longer;
        self.exposure_times = times;
    }

    /// Sets the gain to `times` the rig file's. The range of counts then holds fewer electrons.
    pub(super) fn amplify_times(&mut self, times: f64) {
        let more = times / self.gain_times;
        self.sensor.config.white_share *= more;
        self.sensor.config.full_well_electrons /= more;
        self.gain_times = times;
    }

    /// Replaces the light path after a change of the panel's place or the lens's focus.
    pub(super) fn set_light_path(&mut self, optics: Arc<Optics>, map: &PanelMap) {
        self.projection = Projection::new(map, optics.grid(), optics.pad);
        self.beat = Beat::new(&self.panel, &optics, map, &self.projection);
        self.optics = optics;
        self.forget_light();
    }

    /// Sets the wear of the panel from now on.
    pub(super) fn set_wear(&mut self, wear: Wear) {
        (self.wear, self.worn_s) = (wear, self.now_s);
        self.dead_pixels = wear.dead_pixels(self.panel.size(), self.seed);
        self.dust = wear.dust(self.optics.sensor, self.seed);
        let mut display = self.display.clone();
        display.gamma.iter_mut().for_each(|gamma| *gamma *= wear.gamma_factor);
        self.response = [0, 1, 2].map(|channel| panel::response(&display, channel));
        self.forget_light();
    }

    fn forget_light(&mut self) {
        self.flat = [None, None, None];
        self.veil = [None, None, None];
        self.before.light = None;
        self.now.light = None;
    }

    pub(super) fn unplug(&mut self) {
        self.away_until_s = Some(self.now_s + self.faults.unplugged_ms / 1000.0);
        self.fired_s.clear();
    }

    pub(super) fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        if codes.size() != self.panel.size() {
            let found = format!("a picture of {}", codes.size());
            return Err(RigError::refused("panel", found, self.panel.size().to_string()));
        }
        let vblank = (self.now_s * self.panel.refresh_hz).floor() as u64 + 1;
        let flip_s = vblank as f64 / self.panel.refresh_hz;
        self.now_s = flip_s;
        let latency_s = f64::from(self.display.latency_refreshes) / self.panel.refresh_hz;
        let change_s = flip_s + latency_s;
        // When the change begins, the panel may still be approaching the previous picture.
        let share = 1.0 - (-(change_s - self.change_s) / (self.display.response_ms / 1000.0)).exp();
        let between = (share < ARRIVED).then(|| (Arc::new(self.mixed_light(share)), None));
        self.before = self.now.clone();
        self.before.light = between.or(self.before.light.take());
        self.now = Picture { codes: Arc::new(codes.clone()), light: None };
        self.change_s = change_s;
        Ok(Flip { at: Moment(flip_s), vblank })
    }

    pub(super) fn fire(&mut self) -> Moment {
        self.fired_s.push_back(self.now_s);
        self.now()
    }

    pub(super) fn reopen(&mut self) -> Result<(), RigError> {
        if self.away_until_s.is_some_and(|until_s| self.now_s < until_s) {
            return Err(RigError::gone("camera", "not there yet"));
        }
        self.away_until_s = None;
        self.fired_s.clear();
        self.last = None;
        Ok(())
    }

    pub(super) fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        if self.away_until_s.is_some() {
            return Err(RigError::gone("camera", "it was unplugged"));
        }
        let began_s = self.fired_s.front().copied().unwrap_or(self.now_s);
        let no_frame = RigError::NoFrame { waited_ms: (deadline.0 - began_s) * 1000.0 };
        let Some(fired_s) = self.fired_s.pop_front() else {
            self.wait_until(deadline);
            return Err(no_frame);
        };
        let number = self.exposures;
        self.exposures += 1;
        self.wandered_px = unrest::wander(&self.unrest, self.wandered_px, self.seed, number);
        self.moved_px = unrest::moved(&self.unrest, self.wandered_px, fired_s, self.seed, number);
        let exposed_s = fired_s + self.camera.exposure_ms / 1000.0;
        let ready_s = exposed_s + self.sensor.config.readout_ms / 1000.0;
        let fault = faults::draw(&self.faults, self.seed, number);
        if fault == Fault::Unplugged {
            self.unplug();
            return Err(RigError::gone("camera", "it was unplugged"));
        }
        if ready_s > deadline.0 || fault == Fault::Missing {
            self.sequence = self.sequence.wrapping_add(1);
            self.wait_until(deadline);
            return Err(no_frame);
        }
        self.wait_until(Moment(ready_s));
        if let (Fault::Duplicate, Some(last)) = (fault, &self.last) {
            return Ok(last.clone());
        }
        let share = approach(self.change_s, self.display.response_ms / 1000.0, fired_s, exposed_s);
        let counts = match fault {
            Fault::Stale => self.expose(0.0, number),
            Fault::Mixed(height) => {
                let split = (height * self.camera.height_px as f64) as usize;
                let (old, new) = (self.expose(0.0, number), self.expose(share, number));
                upper_and_lower(&old, new, split)
            }
            _ => self.expose(share, number),
        };
        self.sequence = self.sequence.wrapping_add(1);
        let exposed = Exposed { counts, sequence: self.sequence, at: Moment(fired_s) };
        self.last = Some(exposed.clone());
        Ok(exposed)
    }

    /// Counts of an exposure with the panel at `share` of the transition to the current picture.
    fn expose(&mut self, share: f64, number: u64) -> Counts {
        if let Some(scene) = &self.scene {
            return self.sensor.photograph(scene, self.seed, number);
        }
        let light = if share >= ARRIVED {
            self.light_now()
        } else if share <= 1.0 - ARRIVED {
            self.light_before()
        } else {
            Arc::new(self.mixed_light(share))
        };
        let unsteady = self.wear.is_unsteady() || unrest::is_unsteady(&self.unrest);
        let light = if unsteady { Arc::new(self.unsteady(&light, number)) } else { light };
        self.sensor.expose(&light, self.optics.dark_corner(Light::Panel), self.seed, number)
    }

    /// `light` with the fluctuations of exposure `number`.
    fn unsteady(&self, light: &[Plane; 3], number: u64) -> [Plane; 3] {
        let since_s = self.now_s - self.worn_s;
        let all = unrest::light_share(&self.unrest, self.now_s, self.seed, number);
        light.each_ref().map(|plane| {
            let mut plane = plane.clone();
            let rows = plane.height();
            for y in 0..rows {
                let share = all * self.wear.row_share(y, rows, since_s, self.seed, number);
                plane.row_mut(y).iter_mut().for_each(|v| *v *= share);
            }
            plane
        })
    }

    fn mixed_light(&mut self, share: f64) -> [Plane; 3] {
        let (before, now) = (self.light_before(), self.light_now());
        let share = share as f32;
        let mix = |c: usize| {
            let mut plane = before[c].map(|v| v * (1.0 - share));
            plane.add_scaled(share, &now[c]);
            plane
        };
        [mix(0), mix(1), mix(2)]
    }

    fn light_now(&mut self) -> Arc<[Plane; 3]> {
        let picture = self.now.clone();
        let light = self.light_of_picture(picture);
        self.now.light = Some((Arc::clone(&light), Some(self.moved_px)));
        light
    }

    fn light_before(&mut self) -> Arc<[Plane; 3]> {
        let picture = self.before.clone();
        if let Some((light, None)) = picture.light {
            return light;
        }
        let light = self.light_of_picture(picture);
        self.before.light = Some((Arc::clone(&light), Some(self.moved_px)));
        light
    }

    /// Light on the sensor from `picture`, with the panel in its current place.
    fn light_of_picture(&mut self, picture: Picture) -> Arc<[Plane; 3]> {
        match picture.light {
            Some((light, Some(moved_px))) if moved_px == self.moved_px => light,
            _ => Arc::new(self.light_of(&picture.codes)),
        }
    }

    /// Light of `codes` on the sensor, per primary, with dark corners.
    pub(super) fn light_of(&mut self, codes: &Codes) -> [Plane; 3] {
        for channel in Channel::ALL {
            let c = channel.index();
            if self.flat[c].is_none() && uniform(codes.plane(channel)).is_some() {
                let white = self.emitted(channel, &Plane::filled(self.panel.size(), 255));
                self.flat[c] = Some(self.through(channel, &white));
            }
            if let (None, Some(shading)) = (&self.veil[c], &self.shading) {
                self.veil[c] = Some(self.through(channel, &shading.veil));
            }
        }
        Channel::ALL.map(|channel| {
            let (c, codes) = (channel.index(), codes.plane(channel));
            let mut light = match (uniform(codes), &self.flat[c]) {
                // Most planes of a calibration are uniform: a single flat is computed, then scaled.
                (Some(code), Some(flat)) => {
                    let level = self.response[c][usize::from(code)] / 255.0;
                    flat.map(|v| v * level)
                }
                _ => self.through(channel, &self.emitted(channel, codes)),
            };
            if let Some(veil) = &self.veil[c] {
                light.add_scaled(1.0, veil);
            }
            if let Some(beat) = &self.beat {
                beat.apply(&mut light, channel, self.projection.offset_px(self.moved_px)[0]);
            }
            light
        })
    }

    /// Light emitted by the panel's pixels, without its veil.
    fn emitted(&self, channel: Channel, codes: &Plane<u8>) -> Plane {
        let response = &self.response[channel.index()];
        let mut light = codes.map(|code| response[usize::from(code)]);
        self.dead_pixels.iter().for_each(|&n| light.data_mut()[n] = response[0]);
        if let Some(shading) = &self.shading {
            light.multiply(&shading.gain[channel.index()]);
        }
        light
    }

    /// Light on the sensor from `panel`, the light that the panel's pixels emit.
    fn through(&self, channel: Channel, panel: &Plane) -> Plane {
        let optics = &self.optics;
        let [right, down] = self.projection.offset_px(self.moved_px);
        let right = right + self.panel.subpixels.offset_px(channel);
        let on_grid = self.projection.light(panel, [right, down]);
        let blurred = optics.through_lens(Light::Panel, channel, &on_grid);
        let mut seen = blurred.crop(Rect { x: optics.pad, y: optics.pad, size: optics.sensor });
        let falloff = &optics.dark_corner(Light::Panel)[channel.index()];
        seen.multiply(falloff);
        if let Some(dust) = &self.dust {
            seen.multiply(dust);
        }
        seen
    }
}

/// The code of a uniform plane; `None` if the plane is not uniform.
fn uniform(plane: &Plane<u8>) -> Option<u8> {
    let first = *plane.data().first()?;
    plane.data().iter().all(|&code| code == first).then_some(first)
}

/// A frame with the rows above `split` from `upper` and the others from `lower`.
fn upper_and_lower(upper: &Counts, mut lower: Counts, split: usize) -> Counts {
    let Size { width, .. } = lower.size();
    for channel in Channel::ALL {
        let rows = &upper.plane(channel).data()[..split * width];
        lower.plane_mut(channel).data_mut()[..split * width].copy_from_slice(rows);
    }
    lower
}
