//! The capture ring: a fixed number of buffers that go round between driver and program.
//!
//! Own code instead of `v4l`'s stream: that one queues a buffer twice after a timeout, waits for
//! ever by default, hides errors of `poll`, and panics when it is dropped after a fault. Nothing is
//! allocated once it runs.

use std::io;

use rustix::event::{PollFd, PollFlags, poll};

use super::kernel::{Buffer, Filled, Node};
use crate::rig::monotonic::{Monotonic, left_until};
use crate::rig::{Clock, Moment};

/// Most buffers a ring has room for.
pub(super) const BUFFERS_MAX: usize = 8;

/// Buffers of a streaming camera. Dropping it stops the stream and gives the buffers back.
pub(super) struct Ring {
    buffers: heapless::Vec<Buffer, BUFFERS_MAX>,
    node: Node,
}

impl Ring {
    /// Takes `count` buffers from the driver (it may give another number), queues them all and
    /// starts.
    pub(super) fn start(node: Node, count: usize) -> io::Result<Self> {
        let count = node.request_buffers(count.clamp(2, BUFFERS_MAX) as u32)?;
        let mut ring = Ring { buffers: heapless::Vec::new(), node };
        // A driver that insists on more buffers than fit keeps the rest; they are never queued.
        for index in 0..count.min(BUFFERS_MAX as u32) {
            let buffer = ring.node.queue_new(index)?;
            let _ = ring.buffers.push(buffer);
        }
        ring.node.stream(true)?;
        Ok(ring)
    }

    /// The node it streams from.
    pub(super) fn node(&self) -> &Node {
        &self.node
    }

    /// The next filled buffer, or `None` when the deadline passes first.
    pub(super) fn next(&mut self, deadline: Moment) -> io::Result<Option<Filled>> {
        loop {
            let mut waiting = [PollFd::new(&self.node, PollFlags::IN)];
            match poll(&mut waiting, Some(&left_until(deadline))) {
                Ok(0) => return Ok(None),
                Ok(_) => {}
                Err(rustix::io::Errno::INTR) => continue,
                Err(cause) => return Err(cause.into()),
            }
            match self.node.take() {
                Ok(filled) => return Ok(Some(filled)),
                // After an error event `poll` says "ready" and there is nothing: the true cause
                // comes from here, unless there is none, and then it is the event itself that has
                // to be told.
                Err(cause) if cause.kind() == io::ErrorKind::WouldBlock => {
                    if waiting[0].revents().intersects(PollFlags::ERR | PollFlags::HUP) {
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

    /// The bytes the driver wrote into a buffer taken by [`Ring::next`].
    pub(super) fn bytes<'a>(&'a self, filled: &'a Filled) -> &'a [u8] {
        self.buffers.get(filled.index()).map_or(&[], |buffer| buffer.bytes(filled))
    }

    /// Hands a taken buffer back to the driver.
    pub(super) fn give_back(&mut self, filled: Filled) -> io::Result<()> {
        self.node.queue_again(filled)
    }
}

impl Drop for Ring {
    /// The device may be gone; then there is nothing left to stop, and nobody to tell.
    fn drop(&mut self) {
        let _ = self.node.stream(false);
        self.buffers.clear();
        let _ = self.node.request_buffers(0);
    }
}
