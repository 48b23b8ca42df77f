//! Events of the kernel's tracer: flips of the display and edges of the trigger line; for a
//! free-running camera, exposures at regular intervals instead of edges.

use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

use relens::rig::Clock;
use relens::rig::monotonic::Monotonic;
use rustix::fs::OFlags;

use super::Outcome;

/// An event with its `CLOCK_MONOTONIC` time in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A flip.
    Flip { at_s: f64 },
    /// A rising edge of the trigger line.
    Rise { at_s: f64 },
}

/// Delay after which the record contains all flips before an exposure.
const RECORDED_S: f64 = 0.01;

/// Starts of a free-running camera's exposures.
struct FreeRun {
    next_s: f64,
    interval_s: f64,
}

/// A private instance of the kernel's tracer that records flips and edges.
pub struct Trace {
    pipe: File,
    text: String,
    rise: String,
    free_run: Option<FreeRun>,
    /// A recorded event that follows the last exposure reported, not reported itself yet.
    kept: Option<Event>,
}

impl Trace {
    /// Starts tracing. `line` is the trigger's global number; it is ignored for a camera that
    /// exposes every `interval_s`.
    pub fn start(line: &str, interval_s: Option<f64>) -> Outcome<Trace> {
        let folder = Path::new("/sys/kernel/tracing/instances/physics");
        if !folder.exists() {
            fs::create_dir(folder)?;
        }
        // The clock of flip events and frames; by default the tracer uses a clock per processor.
        fs::write(folder.join("trace_clock"), "mono")?;
        fs::write(folder.join("events/gpio/gpio_value/enable"), "1")?;
        fs::write(folder.join("events/drm/drm_vblank_event_delivered/enable"), "1")?;
        fs::write(folder.join("trace"), "")?;
        // A free-running camera must not wait for the display.
        let flags = interval_s.map_or(0, |_| OFlags::NONBLOCK.bits() as i32);
        let pipe =
            File::options().read(true).custom_flags(flags).open(folder.join("trace_pipe"))?;
        let rise = format!("gpio_value: {line} set 1");
        let free_run =
            interval_s.map(|interval_s| FreeRun { next_s: Monotonic.now().0, interval_s });
        Ok(Trace { pipe, text: String::new(), rise, free_run, kept: None })
    }

    /// Waits for the next event.
    pub fn next(&mut self) -> Outcome<Event> {
        loop {
            let event = self.kept.take().or_else(|| self.recorded());
            if let Some(FreeRun { next_s, interval_s }) = &mut self.free_run {
                let at_s = *next_s;
                let is_first = match event {
                    Some(Event::Flip { at_s: flip_s }) => flip_s > at_s,
                    Some(Event::Rise { .. }) => continue,
                    None => Monotonic.now().0 > at_s + RECORDED_S,
                };
                if is_first {
                    *next_s += *interval_s;
                    self.kept = event;
                    return Ok(Event::Rise { at_s });
                }
            }
            if let Some(event) = event {
                return Ok(event);
            }
            let mut chunk = [0; 4096];
            match self.pipe.read(&mut chunk) {
                Ok(read) => self.text.push_str(std::str::from_utf8(&chunk[..read])?),
                Err(nothing) if nothing.kind() == ErrorKind::WouldBlock => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(cause) => return Err(cause.into()),
            }
        }
    }

    /// The next event in the buffer.
    fn recorded(&mut self) -> Option<Event> {
        while let Some(end) = self.text.find('\n') {
            let line: String = self.text.drain(..=end).collect();
            if let Some(event) = self.event(&line) {
                return Some(event);
            }
        }
        None
    }

    /// Event of a line `task-pid [cpu] flags seconds: event: …`; `None` for other lines.
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
