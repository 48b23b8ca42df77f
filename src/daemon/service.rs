//! Notifications to the service manager: ready, status, watchdog, stopping (sd_notify(3): datagrams
//! of `KEY=value` lines to the socket named in `NOTIFY_SOCKET`).
//!
//! The watchdog is fed by finished work alone: a scan of the inbox, a step of a restoration, a
//! capture of a calibration, a photo. There is no timer, so that a loop that hangs starves it.

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

use super::report::state::Doing;
use super::watcher::Watcher;
use crate::restorer::Progress;

/// The service manager, if there is one.
#[derive(Debug, Default)]
pub struct ServiceManager {
    socket: Option<UnixDatagram>,
}

impl ServiceManager {
    /// The manager at `address`, the value of `NOTIFY_SOCKET`: a path, or an abstract name after
    /// `@`.
    pub fn at(address: Option<&OsStr>) -> ServiceManager {
        let socket = address.and_then(|address| {
            let bytes = address.as_bytes();
            let to = match bytes.strip_prefix(b"@") {
                Some(name) => SocketAddr::from_abstract_name(name),
                None => SocketAddr::from_pathname(OsStr::from_bytes(bytes)),
            };
            let socket = UnixDatagram::unbound().ok()?;
            socket.connect_addr(&to.ok()?).ok()?;
            Some(socket)
        });
        ServiceManager { socket }
    }

    /// Sends a notification. Errors are ignored: a manager that waits in vain acts by itself.
    fn send(&self, words: &str) {
        if let Some(socket) = &self.socket {
            let _ = socket.send(words.as_bytes());
        }
    }

    /// Reports that the service has started.
    pub fn ready(&self) {
        self.send("READY=1");
    }

    /// Feeds the watchdog.
    pub fn worked(&self) {
        self.send("WATCHDOG=1");
    }

    /// Reports that the service is stopping.
    pub fn stopping(&self) {
        self.send("STOPPING=1\nSTATUS=stopping");
    }

    /// Sets the status line of `systemctl status`.
    pub fn status(&self, words: &str) {
        let one_line: String =
            words.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        self.send(&format!("STATUS={one_line}"));
    }
}

/// A watcher that notifies the service manager and forwards to another watcher.
pub struct Supervised<'a> {
    manager: &'a ServiceManager,
    inner: Box<dyn Watcher + 'a>,
    photo: String,
}

impl<'a> Supervised<'a> {
    /// Creates a watcher that notifies `manager`, then `inner`.
    pub fn new(manager: &'a ServiceManager, inner: Box<dyn Watcher + 'a>) -> Supervised<'a> {
        Supervised { manager, inner, photo: String::new() }
    }
}

impl Watcher for Supervised<'_> {
    fn begun(&mut self, name: &str, number: usize, of: usize) {
        self.photo = format!("restoring {name}, {number} of {}", of.max(number));
        self.manager.status(&self.photo);
        self.inner.begun(name, number, of);
    }

    fn progress(&mut self, progress: Progress) {
        self.manager.worked();
        let words = format!("{}: {}, {} captures", self.photo, progress.doing, progress.captures);
        self.manager.status(&words);
        self.inner.progress(progress);
    }

    fn ended(&mut self) {
        self.manager.worked();
        self.inner.ended();
    }

    fn scanned(&mut self) {
        self.manager.worked();
        self.inner.scanned();
    }

    fn doing(&mut self, doing: &Doing) {
        match doing {
            Doing::Restoring { .. } => {}
            Doing::Waiting => self.manager.status("waiting for photos"),
            Doing::Paused { reason } => self.manager.status(&format!("waiting: {reason}")),
            Doing::Held { reason } => self.manager.status(&format!("needs help: {reason}")),
            Doing::Ended => self.manager.stopping(),
        }
        self.inner.doing(doing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(socket: &UnixDatagram) -> Vec<String> {
        socket.set_nonblocking(true).unwrap();
        let mut words = Vec::new();
        let mut buffer = [0; 4096];
        while let Ok(length) = socket.recv(&mut buffer) {
            words.push(String::from_utf8(buffer[..length].to_vec()).unwrap());
        }
        words
    }

    #[test]
    fn status_and_work_are_sent_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        let manager = ServiceManager::at(Some(path.as_os_str()));
        let mut watcher = Supervised::new(&manager, Box::new(()));
        manager.ready();
        watcher.doing(&Doing::Waiting);
        watcher.scanned();
        watcher.begun("a\nREADY=0.jpg", 1, 2);
        watcher.doing(&Doing::Ended);
        assert_eq!(
            received(&socket),
            [
                "READY=1",
                "STATUS=waiting for photos",
                "WATCHDOG=1",
                "STATUS=restoring a READY=0.jpg, 1 of 2",
                "STOPPING=1\nSTATUS=stopping"
            ]
        );
    }

    #[test]
    fn abstract_names_work_and_a_missing_manager_is_ignored() {
        let name = format!("relens-test-{}", std::process::id());
        let address = SocketAddr::from_abstract_name(name.as_bytes()).unwrap();
        let socket = UnixDatagram::bind_addr(&address).unwrap();
        ServiceManager::at(Some(OsStr::new(&format!("@{name}")))).worked();
        assert_eq!(received(&socket), ["WATCHDOG=1"]);
        ServiceManager::at(None).worked();
        ServiceManager::at(Some(OsStr::new("/nowhere/at/all"))).worked();
    }
}
