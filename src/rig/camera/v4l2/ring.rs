//! Ring of capture buffers shared by driver and program. It allocates nothing while it runs.
//!
//! The stream of crate `v4l` is not used: it queues a buffer twice after a timeout, waits for ever
//! by default, hides errors of `poll`, and panics when dropped after a fault.

use std::io;

use rustix::event::PollFlags;

use super::kernel::{Buffer, Filled, Node};
use crate::rig::monotonic::{Monotonic, ready_by};
use crate::rig::{Clock, Moment};

pub(super) const BUFFERS_MAX: usize = 8;

/// Buffers of a streaming camera. Dropping the ring stops the stream and releases them.
pub(super) struct Ring {
    buffers: heapless::Vec<Buffer, BUFFERS_MAX>,
    pub(super) node: Node,
    /// Bytes of a whole frame; 0 if frames vary in length.
    frame_bytes: usize,
}

impl Ring {
    /// Requests `count` buffers (the driver may give another number), queues them, and starts the
    /// stream.
    pub(super) fn start(node: Node, count: usize, frame_bytes: usize) -> io::Result<Self> {
        let count = node.request_buffers(count.clamp(2, BUFFERS_MAX) as u32)?;
        let mut ring = Ring { buffers: heapless::Vec::new(), node, frame_bytes };
        // Buffers beyond the capacity are never queued.
        for index in 0..count.min(BUFFERS_MAX as u32) {
            let buffer = ring.node.map(index)?;
            let _ = ring.buffers.push(buffer);
        }
        ring.resume()?;
        Ok(ring)
    }

    pub(super) fn resume(&mut self) -> io::Result<()> {
        for buffer in &mut self.buffers {
            self.node.queue(buffer, self.frame_bytes)?;
        }
        self.node.stream(true)
    }

    /// Waits for the next filled buffer; `None` at the deadline.
    pub(super) fn next(&mut self, deadline: Moment) -> io::Result<Option<Filled>> {
        loop {
            let events = ready_by(&self.node, deadline)?;
            if events.is_empty() {
                return Ok(None);
            }
            match self.node.take() {
                Ok(filled) => return Ok(Some(filled)),
                // After an error event `poll` reports readiness, but no buffer is filled.
                Err(cause) if cause.kind() == io::ErrorKind::WouldBlock => {
                    if events.intersects(PollFlags::ERR | PollFlags::HUP) {
                        return Err(rustix::io::Errno::NODEV.into());
                    }
                    if Monotonic.now() >= deadline {
                        return Ok(None);
                    }
                }
                Err(cause) => return Err(cause),
            }
        }
    }

    /// Bytes of a buffer from [`Ring::next`].
    pub(super) fn bytes<'a>(&'a self, filled: &'a Filled) -> &'a [u8] {
        self.buffers.get(filled.index()).map_or(&[], |buffer| buffer.bytes(filled))
    }

    /// Whether the lower rows of a frame are missing.
    pub(super) fn is_torn(&self, filled: &Filled) -> bool {
        let buffer = self.buffers.get(filled.index());
        buffer.is_some_and(|buffer| buffer.is_torn(filled, self.frame_bytes))
    }

    /// Returns a buffer to the driver.
    pub(super) fn give_back(&mut self, filled: Filled) -> io::Result<()> {
        match self.buffers.get_mut(filled.index()) {
            Some(buffer) => self.node.queue(buffer, self.frame_bytes),
            None => Ok(()),
        }
    }
}

impl Drop for Ring {
    /// Errors are ignored, since the device may be gone.
    fn drop(&mut self) {
        let _ = self.node.stream(false);
        self.buffers.clear();
        let _ = self.node.request_buffers(0);
    }
}
