//! What the service manager is told: ready, what is being done, that work goes on, and the end.
//!
//! The watchdog is fed by finished work alone: a look at the inbox, a step of a restoration, a
//! capture of a calibration, a photo. There is no timer: a loop that hangs starves it.
//! (sd_notify(3): datagrams of `KEY=value` lines to the socket named in `NOTIFY_SOCKET`.)

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::sync::{Mutex, PoisonError};

use super::report::state::Doing;
use super::store::claim::JobStep;
use super::watcher::Watcher;
use crate::restorer::Progress;

/// The service manager, or nobody.
#[derive(Debug, Default)]
pub struct ServiceManager {
    socket: Option<UnixDatagram>,
    /// The status told last; each is told once.
    status: Mutex<String>,
}

impl ServiceManager {
    /// The one at `address`, the value of `NOTIFY_SOCKET`: a path, or a name after `@`.
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
        ServiceManager { socket, status: Mutex::default() }
    }

    /// A manager that does not listen is no trouble of ours; one that waits in vain acts by itself.
    fn tell(&self, words: &str) {
        if let Some(socket) = &self.socket {
            let _ = socket.send(words.as_bytes());
        }
    }

    /// The service has started.
    pub fn ready(&self) {
        self.tell("READY=1");
    }

    /// Work was finished: the watchdog may rest.
    pub fn worked(&self) {
        self.tell("WATCHDOG=1");
    }

    /// The service ends in good order.
    pub fn stopping(&self) {
        self.tell("STOPPING=1\nSTATUS=ending");
    }

    /// What the service is doing, in one line for `systemctl status`.
    pub fn status(&self, words: &str) {
        let one_line: String =
            words.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let mut told = self.status.lock().unwrap_or_else(PoisonError::into_inner);
        if *told != one_line {
            self.tell(&format!("STATUS={one_line}"));
            *told = one_line;
        }
    }
}

/// A watcher that tells the service manager, and another one.
pub struct Supervised<'a> {
    manager: &'a ServiceManager,
    inner: Box<dyn Watcher + 'a>,
    photo: String,
}

impl<'a> Supervised<'a> {
    /// Tells `manager` what `inner` is told.
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

    fn step(&mut self, step: JobStep) {
        self.inner.step(step);
    }

    fn ended(&mut self) {
        self.manager.worked();
        self.inner.ended();
    }

    fn looked(&mut self) {
        self.manager.worked();
        self.inner.looked();
    }

    fn doing(&mut self, doing: &Doing) {
        match doing {
            Doing::Restoring { .. } => {}
            Doing::Waiting => self.manager.status("waiting for photos"),
            Doing::Paused { reason } => self.manager.status(&format!("not now: {reason}")),
            Doing::Held { reason } => self.manager.status(&format!("needs help: {reason}")),
            Doing::Ended => self.manager.stopping(),
        }
        self.inner.doing(doing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(socket: &UnixDatagram) -> Vec<String> {
        socket.set_nonblocking(true).unwrap();
        let mut words = Vec::new();
        let mut buffer = [0; 4096];
        while let Ok(length) = socket.recv(&mut buffer) {
            words.push(String::from_utf8(buffer[..length].to_vec()).unwrap());
        }
        words
    }

    #[test]
    fn the_manager_hears_states_once_and_work_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        let manager = ServiceManager::at(Some(path.as_os_str()));
        let mut watcher = Supervised::new(&manager, Box::new(()));
        manager.ready();
        watcher.doing(&Doing::Waiting);
        watcher.doing(&Doing::Waiting);
        watcher.looked();
        watcher.begun("a\nREADY=0.jpg", 1, 2);
        watcher.doing(&Doing::Ended);
        assert_eq!(
            heard(&socket),
            [
                "READY=1",
                "STATUS=waiting for photos",
                "WATCHDOG=1",
                "STATUS=restoring a READY=0.jpg, 1 of 2",
                "STOPPING=1\nSTATUS=ending"
            ]
        );
    }

    #[test]
    fn an_abstract_name_is_found_and_nobody_is_no_trouble() {
        let name = format!("relens-test-{}", std::process::id());
        let address = SocketAddr::from_abstract_name(name.as_bytes()).unwrap();
        let socket = UnixDatagram::bind_addr(&address).unwrap();
        ServiceManager::at(Some(OsStr::new(&format!("@{name}")))).worked();
        assert_eq!(heard(&socket), ["WATCHDOG=1"]);
        ServiceManager::at(None).worked();
        ServiceManager::at(Some(OsStr::new("/nowhere/at/all"))).worked();
    }
}
