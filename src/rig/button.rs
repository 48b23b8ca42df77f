//! A button on a GPIO line. Kernels drop edges, so an edge only triggers a reading of the level.

use std::error::Error;

use gpiocdev::line::{Bias, EdgeDetection, Value};

use crate::config::{GpioLine, Level};
use crate::rig::gpio_line::{CONSUMER, find};
use crate::rig::monotonic::ready_by;
use crate::rig::{ButtonLevel, Moment, RigError};

/// Edge events read at a time; the kernel queues 16 per line.
const EVENTS: usize = 16;

/// A button on a GPIO line.
pub struct Button {
    request: gpiocdev::Request,
    offset: u32,
}

fn failed<E: Error + Send + Sync + 'static>(doing: &'static str) -> impl Fn(E) -> RigError {
    move |cause| RigError::Failed { device: "button", doing, source: std::io::Error::other(cause) }
}

impl Button {
    /// Requests the line with its pull resistor towards "off"; errors as in [`find`].
    pub fn open(name: &GpioLine) -> Result<Self, RigError> {
        let place = find("button", name)?;
        let mut builder = gpiocdev::Request::builder();
        builder.on_chip(&place.node).with_consumer(CONSUMER).with_line(place.offset);
        builder.with_edge_detection(EdgeDetection::BothEdges);
        if name.active == Level::Low {
            builder.as_active_low().with_bias(Bias::PullUp);
        } else {
            builder.with_bias(Bias::PullDown);
        }
        let request = builder.request().map_err(failed("take its line"))?;
        Ok(Button { request, offset: place.offset })
    }
}

impl ButtonLevel for Button {
    fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
        let waited = ready_by(&self.request, deadline);
        if !waited.map_err(failed("wait for its edges"))?.is_empty() {
            let mut events = self.request.new_edge_event_buffer(EVENTS);
            events.read_event().map_err(failed("read its edges"))?;
        }
        let level = self.request.value(self.offset).map_err(failed("read its level"))?;
        Ok(level == Value::Active)
    }
}
