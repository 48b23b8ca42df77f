//! The kernel's own record of what happened when: flips of the display and rises of the trigger
//! line.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use super::Outcome;

/// One thing that happened, with its moment on `CLOCK_MONOTONIC` in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A flip came into effect.
    Flip { at_s: f64 },
    /// The trigger line rose.
    Rise { at_s: f64 },
}

/// A private instance of the kernel's tracer with the two events that matter.
pub struct Trace {
    pipe: File,
    text: String,
    rise: String,
}

impl Trace {
    /// `line` is the trigger's number in the kernel's count of all lines.
    pub fn start(line: &str) -> Outcome<Trace> {
        let folder = Path::new("/sys/kernel/tracing/instances/physics");
        if !folder.exists() {
            fs::create_dir(folder)?;
        }
        // The clock of flip events and frames; the tracer's usual one is each processor's own.
        fs::write(folder.join("trace_clock"), "mono")?;
        fs::write(folder.join("events/gpio/gpio_value/enable"), "1")?;
        fs::write(folder.join("events/drm/drm_vblank_event_delivered/enable"), "1")?;
        fs::write(folder.join("trace"), "")?;
        let pipe = File::open(folder.join("trace_pipe"))?;
        Ok(Trace { pipe, text: String::new(), rise: format!("gpio_value: {line} set 1") })
    }

    /// Waits for the next event.
    pub fn next(&mut self) -> Outcome<Event> {
        loop {
            while let Some(end) = self.text.find('\n') {
                let line: String = self.text.drain(..=end).collect();
                if let Some(event) = self.event(&line) {
                    return Ok(event);
                }
            }
            let mut chunk = [0; 4096];
            let read = self.pipe.read(&mut chunk)?;
            self.text.push_str(std::str::from_utf8(&chunk[..read])?);
        }
    }

    /// `task-pid [cpu] flags seconds: event: …`
    fn event(&self, line: &str) -> Option<Event> {
        let (kind, at) = match (line.find("drm_vblank_event_delivered: "), line.find(&self.rise)) {
            (Some(at), _) => (true, at),
            (None, Some(at)) => (false, at),
            (None, None) => return None,
        };
        let at_s = line[..at].split_whitespace().last()?.trim_end_matches(':').parse().ok()?;
        Some(if kind { Event::Flip { at_s } } else { Event::Rise { at_s } })
    }
}
