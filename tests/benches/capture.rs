//! Wall time of a simulated capture, of opening the rig, and of one frame in `relens align`.

use divan::{Bencher, black_box};
use relens::alignment::{GreenSites, Sharpness};
use relens::config::{self, RigFile};
use relens::frame::{Codes, Counts, Frame, Mosaic, Plane, Size};
use relens::rig::pixel_format::PixelFormat;
use relens::rig::simulated;

fn main() {
    divan::main();
}

fn rig(name: &str) -> RigFile {
    config::load(std::path::Path::new(name)).expect("built in")
}

const RIGS: [&str; 4] = ["simulated.toml", "study.toml", "small.toml", "paper-synthetic.toml"];

/// The `n`-th picture, different in every pixel from the one before.
fn picture(rig: &RigFile, n: usize) -> Codes {
    Frame::from_fn(|channel| {
        Plane::from_fn(rig.panel.size(), |x, y| {
            ((x * 7 + y * 13 + n * 31) * (channel.index() + 3) % 251) as u8
        })
    })
}

#[divan::bench(args = RIGS, sample_count = 5)]
fn capture(bencher: Bencher, name: &str) {
    let config = rig(name);
    let (mut rig, _) = simulated::open(&config).expect("a good lens");
    let mut n = 0;
    bencher
        .with_inputs(|| {
            n += 1;
            picture(&config, n)
        })
        .bench_local_refs(|codes| black_box(rig.capture(codes)).expect("no faults"));
}

#[divan::bench(args = RIGS, sample_count = 3, sample_size = 1)]
fn open(bencher: Bencher, name: &str) {
    let config = rig(name);
    bencher.bench(|| simulated::open(black_box(&config)).map(|_| ()).expect("a good lens"));
}

/// The two cameras of hardware.md.
const SENSORS: [(usize, usize); 2] = [(1920, 1200), (1456, 1088)];

/// Bytes of a driver's frame, 16-bit Bayer.
fn raw_frame(size: Size) -> Vec<u8> {
    (0..size.area()).flat_map(|n| ((n * 31 % 1021) as u16).to_le_bytes()).collect()
}

/// Processor time of `relens align` from a frame's bytes to nine figures, one core.
#[divan::bench(args = SENSORS)]
fn look(bencher: Bencher, (width, height): (usize, usize)) {
    let size = Size::new(width, height);
    let (bytes, sites) = (raw_frame(size), GreenSites::behind(Some(Mosaic::Rggb)));
    let format = PixelFormat::raw(Mosaic::Rggb, 10);
    let mut scratch = Plane::zeros(size);
    let (mut counts, mut first): (Counts, Counts) = (Frame::zeros(size), Frame::zeros(size));
    format.unpack(&bytes, 2 * width, &mut first, &mut scratch).expect("a whole frame");
    bencher.bench_local(|| {
        format.unpack(black_box(&bytes), 2 * width, &mut counts, &mut scratch).expect("whole");
        Sharpness::of(&first, &counts, sites, 64.0)
    });
}

/// Processor time of [`look`] without unpacking, which every capture needs.
#[divan::bench(args = SENSORS)]
fn look_at_counts(bencher: Bencher, (width, height): (usize, usize)) {
    let size = Size::new(width, height);
    let sites = GreenSites::behind(Some(Mosaic::Rggb));
    let picture: Counts =
        Frame::from_fn(|_| Plane::from_fn(size, |x, y| ((x * 7 + y * 13) * 31 % 1021) as u16));
    bencher.bench_local(|| Sharpness::of(black_box(&picture), &picture, sites, 64.0));
}
