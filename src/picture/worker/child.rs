//! The worker's own side: walls around itself first, then the file.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::os::fd::AsFd;

use rustix::process::{Resource, Rlimit, Signal, set_parent_process_death_signal, setrlimit};

use super::super::{Photo, PictureError, camera_frame, whole};
use super::wire::{self, Answer, Ask, Purpose};
use crate::frame::Counts;
use crate::picture::photo::read_bytes;
use crate::remedy::full_message;

/// Answers the question `ask` (JSON) about the file at standard input, on standard output.
///
/// # Errors
/// When the question is none, a wall cannot be raised, or nobody takes the answer.
pub fn serve(ask: &str) -> io::Result<()> {
    let ask: Ask = serde_json::from_str(ask)?;
    raise_walls(&ask)?;
    let file = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    let mut out = BufWriter::new(io::stdout().lock());
    let name = &ask.name;
    let read = match ask.purpose {
        Purpose::Whole => whole(name, file, &ask.limits).map(|()| Read::Whole),
        Purpose::Photo(curve, grid) => Photo::of_file(name, file, curve, &ask.limits)
            .and_then(|photo| photo.fit(grid))
            .map(|photo| Read::Photo(Box::new(photo))),
        Purpose::Frame(size) => read_bytes(file, name, &ask.limits).and_then(|bytes| {
            let refused = |flaw| PictureError::Refused { name: name.clone(), flaw };
            camera_frame(&bytes, size).map(Read::Frame).map_err(refused)
        }),
    };
    match read {
        Ok(Read::Photo(photo)) => wire::write_photo(&mut out, &photo)?,
        Ok(Read::Frame(counts)) => wire::write_frame(&mut out, &counts)?,
        Ok(Read::Whole) => wire::write(&mut out, &Answer::Whole)?,
        Err(PictureError::Read { source, .. }) => {
            wire::write(&mut out, &Answer::Unread { words: source.to_string() })?;
        }
        Err(error) => {
            let answer = Answer::Refused { growth: error.growth(), words: full_message(&error) };
            wire::write(&mut out, &answer)?;
        }
    }
    out.flush()
}

/// What was found in a file.
enum Read {
    Whole,
    Photo(Box<Photo>),
    Frame(Counts),
}

/// Whatever the file makes of this process from here on, it is small, short, mute and alone.
fn raise_walls(ask: &Ask) -> io::Result<()> {
    let wall =
        |resource, most| setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) });
    // The daemon's end is the worker's end.
    set_parent_process_death_signal(Some(Signal::KILL))?;
    rustix::thread::set_no_new_privs(true)?;
    wall(Resource::As, ask.memory_bytes_max)?;
    wall(Resource::Cpu, ask.processor_s_max)?;
    // No file can be written, none opened beyond those that are, none left behind by a crash.
    wall(Resource::Fsize, 0)?;
    wall(Resource::Nofile, 8)?;
    wall(Resource::Core, 0)?;
    // Should the box run out of memory all the same, this is the process that goes. Not every
    // kernel lets one say so.
    let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
    Ok(())
}
