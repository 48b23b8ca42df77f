//! Reading of photo files in a separate process, so that a hostile file can harm nothing else.
//!
//! The worker is this program, started for each file with the file as standard input. Before it
//! reads a byte it limits its memory, processor time, open and written files (setrlimit(2)); a
//! timer ends it when it hangs. The daemon receives linear light of the rig's size, and parses no
//! byte of the file. Camera frames that are coded as JPEG are read the same way.

mod child;
mod wire;

use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{MemfdFlags, memfd_create};
use rustix::time::{
    Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, Timespec, timerfd_create,
    timerfd_settime,
};

use super::{Limits, Photo, PictureError, ReadOptions};
use crate::frame::{Counts, PhotoGrid, Size};
use wire::{Answer, Ask, Purpose};

pub use child::serve;

/// The command that makes the program a worker.
pub const WORD: &str = "read-photo";

/// How workers are started and limited.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Worker {
    /// The program.
    pub program: PathBuf,
    /// Most address space in bytes.
    pub memory_bytes_max: u64,
    /// Most processor time in seconds.
    pub processor_s_max: u64,
    /// Longest time from start to end in seconds.
    pub wall_s_max: u64,
}

impl Worker {
    /// Workers of the running program, even if its file was replaced. The limits are guesses: a
    /// 24-megapixel photo of 16 bits takes 1.0 GiB and 2 s of processor time on a desktop, ten
    /// times as long on a board.
    pub fn of_this_program() -> Worker {
        Worker::of("/proc/self/exe".into())
    }

    /// Workers of the program `program`.
    pub fn of(program: PathBuf) -> Worker {
        Worker { program, memory_bytes_max: 1536 << 20, processor_s_max: 60, wall_s_max: 120 }
    }

    /// Checks that `file`, called `name`, is complete and of a kind that is read.
    pub fn whole(&self, name: &str, file: File, limits: &Limits) -> Result<(), PictureError> {
        let ask = self.ask(name, limits, Purpose::Whole);
        match read(name, &mut &self.answer(&ask, file)?[..])? {
            Answer::Whole => Ok(()),
            other => Err(refusal(name, other)),
        }
    }

    /// The photo in `file`, called `name`, on the rig's grid.
    pub fn photo(
        &self,
        name: &str,
        file: File,
        reading: &ReadOptions,
    ) -> Result<Photo, PictureError> {
        let ReadOptions { curve, limits, grid, .. } = reading;
        let ask = self.ask(name, limits, Purpose::Photo(*curve, *grid));
        reading.finish(photo_of_answer(name, &self.answer(&ask, file)?, *grid)?)
    }

    /// The counts in `bytes`, a camera's frame of `size` coded as JPEG.
    pub fn frame(&self, bytes: &[u8], size: Size) -> Result<Counts, PictureError> {
        let name = "a camera's frame";
        let in_memory = || -> io::Result<File> {
            let mut file = File::from(memfd_create("relens-frame", MemfdFlags::CLOEXEC)?);
            file.write_all(bytes)?;
            file.rewind()?;
            Ok(file)
        };
        let file = in_memory().map_err(|source| PictureError::NoWorker { source })?;
        let limits = Limits { bytes_max: bytes.len() as u64, ..Limits::default() };
        let answer = self.answer(&self.ask(name, &limits, Purpose::Frame(size)), file)?;
        let mut rest = &answer[..];
        match read(name, &mut rest)? {
            Answer::Frame => {
                wire::read_frame(rest, size).map_err(|how| died(name, format!("it answered {how}")))
            }
            other => Err(refusal(name, other)),
        }
    }

    fn ask(&self, name: &str, limits: &Limits, purpose: Purpose) -> Ask {
        let Worker { memory_bytes_max, processor_s_max, .. } = *self;
        Ask { name: name.to_owned(), limits: *limits, purpose, memory_bytes_max, processor_s_max }
    }

    /// Starts a worker and returns its whole answer to `ask` about `file`.
    fn answer(&self, ask: &Ask, file: File) -> Result<Vec<u8>, PictureError> {
        let no_worker = |source| PictureError::NoWorker { source };
        let ask_json = serde_json::to_string(ask).map_err(|e| no_worker(e.into()))?;
        let mut child = Command::new(&self.program)
            .args([WORD, &ask_json])
            .env_clear()
            // More threads would not help one photo, and their stacks count as memory.
            .env("RAYON_NUM_THREADS", "1")
            .stdin(Stdio::from(file))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(no_worker)?;
        let output = self.read_output(&mut child, wire::bytes_max(ask));
        if !matches!(output, Ok(Ok(_))) {
            let _ = child.kill();
        }
        let ended = child.wait().map_err(no_worker)?;
        match output.map_err(no_worker)? {
            Ok(bytes) if ended.success() => Ok(bytes),
            Ok(_) => Err(died(&ask.name, self.cause(ended))),
            Err(how) => Err(died(&ask.name, how)),
        }
    }

    /// Reads all that `child` writes; the inner error states the limit that it exceeded.
    fn read_output(
        &self,
        child: &mut Child,
        bytes_max: u64,
    ) -> io::Result<Result<Vec<u8>, String>> {
        let Some(mut out) = child.stdout.take() else { return Ok(Ok(Vec::new())) };
        let timer = timerfd_create(TimerfdClockId::Monotonic, TimerfdFlags::CLOEXEC)?;
        let zero = Timespec { tv_sec: 0, tv_nsec: 0 };
        let end = Timespec { tv_sec: self.wall_s_max.cast_signed(), tv_nsec: 0 };
        timerfd_settime(
            &timer,
            TimerfdTimerFlags::empty(),
            &Itimerspec { it_interval: zero, it_value: end },
        )?;
        let (mut bytes, mut piece) = (Vec::new(), vec![0; 1 << 16]);
        loop {
            let mut watched =
                [PollFd::new(&out, PollFlags::IN), PollFd::new(&timer, PollFlags::IN)];
            match poll(&mut watched, None) {
                Err(rustix::io::Errno::INTR) => continue,
                polled => polled?,
            };
            if !watched[1].revents().is_empty() {
                return Ok(Err(format!("no answer within {} s", self.wall_s_max)));
            }
            match out.read(&mut piece) {
                Ok(0) => return Ok(Ok(bytes)),
                Ok(length) if (bytes.len() + length) as u64 > bytes_max => {
                    return Ok(Err("its answer was too long".to_owned()));
                }
                Ok(length) => bytes.extend_from_slice(&piece[..length]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Why a worker failed.
    fn cause(&self, ended: ExitStatus) -> String {
        match ended.signal() {
            // Rust aborts when memory is refused.
            Some(6) => {
                format!("it aborted, perhaps at its {} MiB of memory", self.memory_bytes_max >> 20)
            }
            Some(9 | 24) => {
                format!(
                    "it was killed, perhaps at its {} s of processor time",
                    self.processor_s_max
                )
            }
            Some(signal) => format!("signal {signal} ended it"),
            None => format!("it ended with {ended}"),
        }
    }
}

/// The photo called `name` on `grid` in a worker's `answer`, which is untrusted: the file may have
/// taken the worker over.
pub fn photo_of_answer(
    name: &str,
    answer: &[u8],
    grid: impl Into<PhotoGrid>,
) -> Result<Photo, PictureError> {
    let mut rest = answer;
    match read(name, &mut rest)? {
        Answer::Photo(header) => wire::read_photo(header, &mut rest, grid.into())
            .map_err(|how| died(name, format!("it answered {how}"))),
        other => Err(refusal(name, other)),
    }
}

fn read(name: &str, answer: &mut &[u8]) -> Result<Answer, PictureError> {
    wire::read(answer).map_err(|how| died(name, format!("it answered {how}")))
}

fn died(name: &str, how: String) -> PictureError {
    PictureError::Died { name: name.to_owned(), how }
}

fn refusal(name: &str, answer: Answer) -> PictureError {
    match answer {
        Answer::Refused { message, growth } => PictureError::RefusedByWorker { message, growth },
        Answer::Unread { message } => {
            PictureError::Read { path: name.into(), source: io::Error::other(message) }
        }
        Answer::Whole | Answer::Photo(_) | Answer::Frame => {
            died(name, "it answered another question".to_owned())
        }
    }
}
