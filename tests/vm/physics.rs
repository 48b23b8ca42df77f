//! Light path of the virtual rig: receives the panel's picture at the trigger (`window.rs`) and
//! answers with the sensor's counts behind the simulated lens.
//!
//! `physics TRUTH.toml SOCKET SCENE` serves one run of the virtual machine, with the panel before
//! the lens, or the picture SCENE while the panel is away. It runs outside the machine, because an
//! emulated processor takes twenty times as long, and knows nothing of the daemon.
// A test program, which panics on errors.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use relens::chart::scenes::cut;
use relens::config;
use relens::frame::{Codes, Counts, Mosaic, Plane};
use relens::picture::{Limits, Photo};
use relens::rig::exposure::Devices;
use relens::rig::shoot::sites_of;
use relens::rig::simulated;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// First byte of a picture taken while the panel is away. Four bytes follow: the exposure as a
/// multiple of the truth's (`f32`).
const AWAY: u8 = 1;
const HEADER_BYTES: usize = 5;

/// Time limit for the virtual machine to connect.
const PATIENCE: Duration = Duration::from_secs(60);

fn connected(socket: &str) -> Outcome<UnixStream> {
    let begun = Instant::now();
    loop {
        match UnixStream::connect(socket) {
            Ok(stream) => return Ok(stream),
            Err(cause) if begun.elapsed() > PATIENCE => return Err(cause.into()),
            Err(_) => std::thread::sleep(Duration::from_millis(50)),
        }
    }
}

/// Writes 8-bit counts into `bytes`: red, green and blue, or one per site with colour filters.
fn pack(counts: &Counts, mosaic: Option<Mosaic>, bytes: &mut Vec<u8>) {
    bytes.clear();
    if let Some(mosaic) = mosaic {
        let sites = sites_of(counts.planes(), mosaic);
        bytes.extend(sites.data().iter().map(|&count| count.min(255) as u8));
        return;
    }
    let [red, green, blue] = counts.planes().each_ref().map(|p| p.data());
    for ((r, g), b) in red.iter().zip(green).zip(blue) {
        bytes.extend([r, g, b].map(|&count| count.min(255) as u8));
    }
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [truth, socket, scene] = words.as_slice() else {
        return Err("usage: physics TRUTH.toml SOCKET SCENE".into());
    };
    let truth = config::load(Path::new(truth))?;
    let (mut bench, witness): (Devices, _) = simulated::open(&truth)?;
    let scene = Photo::read(Path::new(scene), truth.photo.curve, &Limits::default())?;
    let scene = cut(&scene.in_colour(), truth.camera.size());
    let mut stream = connected(socket)?;
    let size = truth.panel.size();
    let mut panel = vec![0; HEADER_BYTES + size.area() * 3];
    let mut frame = Vec::new();
    let (mut frames, mut seconds) = (0, 0.0);
    loop {
        match stream.read_exact(&mut panel) {
            Ok(()) => {}
            Err(cause) if cause.kind() == ErrorKind::UnexpectedEof => break,
            Err(cause) => return Err(cause.into()),
        }
        let begun = Instant::now();
        let planes = [0, 1, 2].map(|channel| {
            let data = &panel[HEADER_BYTES + channel * size.area()..];
            Plane::from_fn(size, |x, y| data[y * size.width + x])
        });
        witness.put_before_lens((panel[0] == AWAY).then_some(&scene));
        let times = f32::from_le_bytes([1, 2, 3, 4].map(|n| panel[n]));
        bench.expose_times(f64::from(times))?;
        let counts = bench.capture(&Codes::from_planes(planes))?.counts;
        pack(&counts, truth.mosaic(), &mut frame);
        seconds += begun.elapsed().as_secs_f64();
        frames += 1;
        stream.write_all(&frame)?;
    }
    println!("physics: {frames} frames of {:.0} ms each", seconds * 1e3 / f64::from(frames.max(1)));
    Ok(())
}
