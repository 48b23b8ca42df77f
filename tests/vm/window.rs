//! The virtual rig's panel and camera: sends the scan-out at each trigger out of the virtual
//! machine to the lens (`physics.rs`), and delivers the sensor's counts through the camera's node.
//!
//! `window TRUTH.toml /dev/dri/card0 /dev/video0 LINE-NUMBER PORT SHUTTER AWAY PLUG
//! [EXPOSURE-MS INTERVAL-MS]` runs until it is killed. While a file SHUTTER exists, the camera
//! gives no frames; while a file AWAY exists, a scene is before the lens instead of the panel; once
//! a file PLUG exists, a USB camera is there too (`usb_camera.rs`). It knows nothing of the daemon:
//! the trigger comes from the kernel's trace of GPIO values, the picture from the display driver.
//!
//! With the last two arguments the camera runs free, and its frames are stamped as by `uvcvideo`:
//! at their first packet, up to an interval after the end of the exposure. A frame shows the
//! scan-out at the start of its exposure.
//!
//! The picture is read at the trigger while the lens is computed in another thread. Every flip,
//! exposure and frame is a line of standard output with its `CLOCK_MONOTONIC` time.
#![allow(unsafe_code)] // mmap of the scanned-out buffer
// A test program, which panics on errors.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, unreachable_pub)]

mod scanout;
mod trace;
mod usb_camera;
mod usb_ip;
mod uvc_descriptors;

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::sync::mpsc;

use relens::config;
use relens::frame::Codes;
use relens::rig::monotonic::Monotonic;
use relens::rig::{Clock, Moment};
use v4l::video::Output;

use self::scanout::{Card, Shown};
use self::trace::{Event, Trace};
use self::usb_camera::UsbCamera;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// State that the threads share.
struct Bench {
    truth: config::RigFile,
    free_run: Option<FreeRun>,
    usb: UsbCamera,
}

/// An exposure in progress.
struct Exposure {
    begun_s: f64,
    exposure_s: f64,
}

/// Timing of a free-running camera, in seconds.
#[derive(Clone, Copy)]
struct FreeRun {
    exposure_s: f64,
    interval_s: f64,
}

/// Delays of the first packet of successive frames, as shares of an interval.
const HELD_BACK: [f64; 5] = [0.0, 0.6, 0.3, 0.9, 0.05];

/// Latency, milliseconds, beyond which the picture of an exposure may be a later one, so that it is
/// skipped.
const LATE_MS: f64 = 50.0;

/// The camera's node, ready for frames.
fn camera(video: &str, truth: &config::RigFile, free_run: Option<FreeRun>) -> Outcome<v4l::Device> {
    let node = v4l::Device::with_path(video)?;
    let size = truth.camera.size();
    let code = if truth.mosaic().is_some() { b"RGGB" } else { b"RGB3" };
    let wanted = v4l::Format::new(size.width as u32, size.height as u32, v4l::FourCC::new(code));
    let got = Output::set_format(&node, &wanted)?;
    if (got.width, got.height, got.fourcc) != (wanted.width, wanted.height, wanted.fourcc) {
        return Err(format!("the camera's node takes {got}").into());
    }
    if let Some(FreeRun { interval_s, .. }) = free_run {
        let interval = v4l::Fraction::new((interval_s * 1e4).round() as u32, 10_000);
        Output::set_params(&node, &v4l::video::output::Parameters::new(interval))?;
    }
    // Until a writer has streamed, a reader's STREAMON fails.
    let kind = v4l::buffer::Type::VideoOutput as u32;
    // SAFETY: VIDIOC_STREAMON takes a pointer to the buffer type.
    unsafe {
        let argument = std::ptr::from_ref(&kind).cast_mut().cast();
        v4l::v4l2::ioctl(node.handle().fd(), v4l::v4l2::vidioc::VIDIOC_STREAMON, argument)?;
    }
    Ok(node)
}

/// Delivers each frame after its exposure and read-out, or later, once it is computed; the driver
/// stamps it at delivery. A free-running camera drops frames that would be delayed by more than an
/// interval.
fn deliver(
    bench: &Bench,
    video: &str,
    mut port: File,
    exposures: mpsc::Receiver<Exposure>,
) -> Outcome<()> {
    let truth = &bench.truth;
    let mut node = camera(video, truth, bench.free_run)?;
    println!("the window is open");
    let readout_s = truth.simulation().map_or(0.0, |s| s.sensor.readout_ms) / 1e3;
    let samples = if truth.mosaic().is_some() { 1 } else { 3 };
    let mut bytes = vec![0; truth.camera.size().area() * samples];
    for (exposure, held_back) in exposures.into_iter().zip(HELD_BACK.into_iter().cycle()) {
        let Exposure { begun_s: rise_s, exposure_s } = exposure;
        port.read_exact(&mut bytes)?;
        if let Some(FreeRun { interval_s, .. }) = bench.free_run {
            Monotonic.wait_until(Moment(rise_s + exposure_s + held_back * interval_s));
            if Monotonic.now().0 > rise_s + exposure_s + interval_s {
                println!("the exposure at {rise_s:.6} is dropped");
                continue;
            }
        } else {
            Monotonic.wait_until(Moment(rise_s + exposure_s + readout_s));
        }
        bench.usb.send(&bytes);
        if node.write(&bytes)? != bytes.len() {
            return Err("the camera's node takes smaller frames".into());
        }
        let now_s = Monotonic.now().0;
        println!(
            "{now_s:.6} frame of the exposure at {rise_s:.6}, {:.0} ms after it",
            (now_s - rise_s) * 1e3
        );
    }
    Ok(())
}

/// Describes a picture by its mean code and a checksum.
fn fingerprint(codes: &Codes) -> String {
    let data = codes.planes()[1].data();
    let mean = data.iter().map(|&code| f64::from(code)).sum::<f64>() / data.len() as f64;
    format!("mean {mean:.2}, checksum {:08x}", crc32fast::hash(data))
}

fn look(
    bench: &Bench,
    card: &str,
    line: &str,
    mut port: File,
    [shutter, away]: [&Path; 2],
    exposures: &mpsc::Sender<Exposure>,
) -> Outcome<()> {
    let Bench { truth, free_run, usb } = bench;
    let card = Card::open(Path::new(card))?;
    let mut trace = Trace::start(line, free_run.map(|free_run| free_run.interval_s))?;
    let mut shown = card.scanned_out()?;
    let nominal_s = truth.camera.exposure_ms / 1e3;
    loop {
        let event = trace.next()?;
        let late_ms = |at_s: f64| (Monotonic.now().0 - at_s) * 1e3;
        match event {
            Event::Flip { at_s } => {
                // Read here and not at the trigger, since the kernel names a buffer before its
                // scan-out begins.
                shown = card.scanned_out()?;
                let number = shown.as_ref().map_or(0, |shown| shown.number);
                println!("{at_s:.6} flip to {number}, seen {:.1} ms later", late_ms(at_s));
            }
            Event::Rise { at_s } if shutter.exists() => {
                println!("{at_s:.6} trigger, the shutter is closed");
            }
            Event::Rise { at_s } if free_run.is_some() && late_ms(at_s) > LATE_MS => {
                println!("{at_s:.6} exposure, seen {:.1} ms later, is left out", late_ms(at_s));
            }
            Event::Rise { at_s } => {
                let codes =
                    shown.as_ref().map_or_else(|| Codes::zeros(truth.panel.size()), Shown::codes);
                let number = shown.as_ref().map_or(0, |shown| shown.number);
                let seen = late_ms(at_s);
                println!(
                    "{at_s:.6} exposure of {number} ({}), seen {seen:.1} ms later",
                    fingerprint(&codes)
                );
                if codes.size() != truth.panel.size() {
                    println!(
                        "the panel shows {}, the truth has {}",
                        codes.size(),
                        truth.panel.size()
                    );
                    continue;
                }
                let set_s = usb.exposure_s();
                let exposure_s = free_run.map_or(nominal_s, |free_run| free_run.exposure_s);
                let exposure = Exposure { begun_s: at_s, exposure_s: set_s.unwrap_or(exposure_s) };
                exposures.send(exposure)?;
                port.write_all(&[u8::from(away.exists())])?;
                let times = set_s.map_or(1.0, |set_s| (set_s / nominal_s) as f32);
                port.write_all(&times.to_le_bytes())?;
                for plane in codes.planes() {
                    port.write_all(plane.data())?;
                }
            }
        }
    }
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (first, last) = words.split_at(words.len().min(8));
    let ([truth, card, video, line, port, shutter, away, plug], [] | [_, _]) = (first, last) else {
        return Err("usage: window TRUTH.toml CARD VIDEO LINE-NUMBER PORT SHUTTER AWAY PLUG \
                    [EXPOSURE-MS INTERVAL-MS]"
            .into());
    };
    let seconds =
        last.iter().map(|ms| Ok(ms.parse::<f64>()? / 1e3)).collect::<Outcome<Vec<_>>>()?;
    let free_run = match seconds[..] {
        [exposure_s, interval_s] => Some(FreeRun { exposure_s, interval_s }),
        _ => None,
    };
    let truth = config::load(Path::new(truth))?;
    let usb = UsbCamera::new(truth.camera.size());
    let bench = &Bench { truth, free_run, usb };
    let port = OpenOptions::new().read(true).write(true).open(port)?;
    let answers = port.try_clone()?;
    let (begun, exposures) = mpsc::channel();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            if let Err(cause) = bench.usb.run(Path::new(plug)) {
                println!("there is no USB camera any more: {cause}");
            }
        });
        scope.spawn(move || {
            if let Err(cause) = deliver(bench, video, answers, exposures) {
                println!("the window shuts: {cause}");
                // A dead physics process must not look like a slow camera.
                std::process::exit(1);
            }
        });
        look(bench, card, line, port, [shutter, away].map(Path::new), &begun)
    })
}
