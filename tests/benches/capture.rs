//! What a simulated capture costs in wall time, and opening the rig.

use divan::{Bencher, black_box};
use relens::config::{self, RigFile};
use relens::frame::{Codes, Frame, Plane};
use relens::rig::simulated;

fn main() {
    divan::main();
}

fn rig(name: &str) -> RigFile {
    config::load(std::path::Path::new(name)).expect("built in")
}

/// A picture with something in every pixel, another one each time: nothing can be kept from the
/// last.
const RIGS: [&str; 4] = ["simulated.toml", "study.toml", "small.toml", "paper-synthetic.toml"];

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
