//! The button on a GPIO line.

use std::time::Duration;

use gpiocdev::line::{Bias, EdgeDetection, Value};

use super::button::Debounce;
use super::gpio_line::{CONSUMER, LineName, find};
use super::monotonic::Monotonic;
use super::{Clock, Moment, RigError};

/// Edge events read at one go: the kernel queues 16 a line.
const EVENTS: usize = 16;

/// A button on an input line.
pub struct Button {
    request: gpiocdev::Request,
    offset: u32,
    debounce: Debounce,
}

fn failed(doing: &'static str) -> impl Fn(gpiocdev::Error) -> RigError {
    move |cause| RigError::Failed { device: "button", doing, source: std::io::Error::other(cause) }
}

impl Button {
    /// Takes the line with its pull resistor towards "off".
    ///
    /// # Errors
    /// When there is no such line, or another program has it.
    pub fn open(name: &LineName, debounce_ms: f64) -> Result<Self, RigError> {
        let place = find("button", name)?;
        let mut builder = gpiocdev::Request::builder();
        builder.on_chip(&place.node).with_consumer(CONSUMER).with_line(place.offset);
        builder.with_edge_detection(EdgeDetection::BothEdges);
        if name.active_low {
            builder.as_active_low().with_bias(Bias::PullUp);
        } else {
            builder.with_bias(Bias::PullDown);
        }
        let request = builder.request().map_err(failed("take its line"))?;
        let debounce = Debounce::new(debounce_ms, Monotonic.now());
        Ok(Button { request, offset: place.offset, debounce })
    }

    /// Waits for an edge until `deadline` at the longest, and returns the level read then.
    ///
    /// # Errors
    /// When the line can no longer be read.
    pub fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
        let left_s = (deadline.0 - Monotonic.now().0).clamp(0.0, 3600.0);
        let waited = self.request.wait_edge_event(Duration::from_secs_f64(left_s));
        if waited.map_err(failed("wait for its edges"))? {
            let mut events = self.request.new_edge_event_buffer(EVENTS);
            events.read_event().map_err(failed("read its edges"))?;
        }
        let level = self.request.value(self.offset).map_err(failed("read its level"))?;
        Ok(level == Value::Active)
    }

    /// Waits for a press until `deadline`; true when there was one.
    ///
    /// # Errors
    /// When the line can no longer be read.
    pub fn pressed(&mut self, deadline: Moment) -> Result<bool, RigError> {
        loop {
            let level = self.request.value(self.offset).map_err(failed("read its level"))?;
            if self.debounce.read(level == Value::Active, Monotonic.now()) {
                return Ok(true);
            }
            let now = Monotonic.now().0;
            if now >= deadline.0 {
                return Ok(false);
            }
            let until =
                self.debounce.look_again_at().map_or(deadline.0, |again| again.0.min(deadline.0));
            let wait = Duration::from_secs_f64((until - now).clamp(0.0, 3600.0));
            if self.request.wait_edge_event(wait).map_err(failed("wait for its edges"))? {
                // Emptied and not looked at. (`read_edge_event` would read eight and return the
                // first.)
                let mut events = self.request.new_edge_event_buffer(EVENTS);
                events.read_event().map_err(failed("read its edges"))?;
            }
        }
    }
}
