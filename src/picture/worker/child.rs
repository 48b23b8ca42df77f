//! The worker's side: limits itself, then reads the file.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::os::fd::AsFd;

use rustix::process::{Resource, Rlimit, Signal, set_parent_process_death_signal, setrlimit};

use super::super::{Photo, PictureError, camera_frame, whole};
use super::wire::{self, Answer, Ask, Purpose, write};
use crate::picture::reading::read_bytes;
use crate::remedy::full_message;

/// Answers the question `ask` (JSON) about the file at standard input, on standard output.
///
/// # Errors
/// When the question is invalid, a limit cannot be set, or the answer cannot be written.
pub fn serve(ask: &str) -> io::Result<()> {
    let ask: Ask = serde_json::from_str(ask)?;
    limit_itself(&ask)?;
    let file = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    let mut out = BufWriter::new(io::stdout().lock());
    let name = &ask.name;
    let written = match ask.purpose {
        Purpose::Whole => {
            whole(name, file, &ask.limits).map(|()| write(&mut out, &Answer::<()>::Whole))
        }
        Purpose::Photo(curve, grid) => read_bytes(file, name, &ask.limits.on(grid))
            .and_then(|bytes| Photo::from_bytes(name, &bytes, curve, &ask.limits.on(grid)))
            .and_then(|photo| photo.fit(grid))
            .map(|photo| wire::write_photo(&mut out, &photo)),
        Purpose::Frame(size) => read_bytes(file, name, &ask.limits)
            .and_then(|bytes| camera_frame(&bytes, size).map_err(|flaw| flaw.of(name)))
            .map(|counts| wire::write_frame(&mut out, &counts)),
    };
    match written {
        Ok(written) => written?,
        Err(PictureError::Read { source, .. }) => {
            write(&mut out, &Answer::<()>::Unread { message: source.to_string() })?;
        }
        Err(error) => {
            let answer =
                Answer::<()>::Refused { growth: error.growth(), message: full_message(&error) };
            write(&mut out, &answer)?;
        }
    }
    out.flush()
}

/// Limits this process in memory, time and files, whatever the file makes it do.
fn limit_itself(ask: &Ask) -> io::Result<()> {
    let limit =
        |resource, most| setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) });
    // The worker ends with the daemon.
    set_parent_process_death_signal(Some(Signal::KILL))?;
    rustix::thread::set_no_new_privs(true)?;
    limit(Resource::As, ask.memory_bytes_max)?;
    limit(Resource::Cpu, ask.processor_s_max)?;
    // No file can be written, hardly any opened, and a crash leaves no core.
    limit(Resource::Fsize, 0)?;
    limit(Resource::Nofile, 8)?;
    limit(Resource::Core, 0)?;
    // When memory runs out, the kernel should end this process first; not every kernel permits it.
    let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
    Ok(())
}
