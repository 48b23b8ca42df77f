//! Mutated input: photos of each format, the rig file, calibration slots, records of photos under
//! way. Seed and number of mutations are fixed; mutations are cuts, flips, runs, splices and
//! numbers at their limits. No input may cause a panic or a hang, or be accepted wrongly.

use std::path::Path;

use relens::calibration::store::{self, SlotFault, StoreError};
use relens::config::{self, Curve};
use relens::frame::Size;
use relens::picture::{Format, Limits, Photo};

use crate::bed::*;

/// Knuth's linear congruential generator for MMIX; any will do.
pub struct Mutator(pub u64);

impl Mutator {
    fn below(&mut self, n: usize) -> usize {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n.max(1)
    }

    /// `bytes` with one to five mutations.
    fn mutate(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        for _ in 0..=self.below(4) {
            if bytes.is_empty() {
                break;
            }
            // Headers are more sensitive.
            let reach = if self.below(3) == 0 { bytes.len() } else { bytes.len().min(200) };
            let at = self.below(reach);
            let run = (1 + self.below(8)).min(bytes.len() - at);
            match self.below(7) {
                0 => bytes[at] ^= 1 << self.below(8),
                1 => bytes[at] = self.below(256) as u8,
                2 => bytes[at..at + run].fill(0xff),
                3 => bytes[at..at + run].fill(0),
                4 => bytes.truncate(at),
                5 => {
                    let piece = bytes[at..at + run].to_vec();
                    let to = self.below(bytes.len());
                    bytes.splice(to..to, piece);
                }
                _ => {
                    let limits: [&[u8]; 4] =
                        [&[0x7f, 0xff, 0xff, 0xff], &[0xff, 0xff], &[0, 0, 0, 0], &[0x80, 0, 0, 0]];
                    for (byte, limit) in bytes[at..].iter_mut().zip(limits[self.below(4)]) {
                        *byte = *limit;
                    }
                }
            }
        }
        bytes
    }
}

#[test]
fn mutated_photos_give_an_error_message_or_a_photo() {
    let limits = Limits { pixels_max: 200_000, decoder_bytes_max: 8 << 20, ..Limits::default() };
    let mut counts = [0; 2];
    for (seed, (name, format, bits)) in [
        ("a.jpg", Format::Jpeg, 8),
        ("a.png", Format::Png, 8),
        ("a.png", Format::Png, 16),
        ("a.tif", Format::Tiff, 8),
        ("a.tif", Format::Tiff, 16),
    ]
    .into_iter()
    .enumerate()
    {
        let whole = file(format, bits, Size::new(32, 24));
        let mut mutator = Mutator(seed as u64);
        for _ in 0..1500 {
            let bytes = mutator.mutate(&whole);
            match Photo::from_bytes(name, &bytes, Curve::Srgb, &limits)
                .and_then(|photo| photo.fit(RIG))
            {
                Ok(photo) => {
                    counts[0] += 1;
                    assert!(
                        photo.light.size() == RIG
                            && photo.light.planes()[1].data().iter().all(|v| v.is_finite())
                    );
                }
                Err(error) => {
                    counts[1] += 1;
                    let words = relens::remedy::full_message(&error);
                    assert!(words.contains(name) && words.contains("allowed"), "{words}");
                }
            }
        }
    }
    println!("{} photos, {} errors", counts[0], counts[1]);
    assert!(counts[0] > 100 && counts[1] > 1000, "{counts:?}");
}

#[test]
fn mutated_rig_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.toml");
    let mut counts = [0; 2];
    for (seed, name) in
        ["small.toml", "simulated.toml", "raspberry-pi-5.toml"].into_iter().enumerate()
    {
        let whole =
            std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("rig-config").join(name))
                .unwrap();
        let text = String::from_utf8(whole.clone()).unwrap();
        let numbers = [
            "0",
            "-1",
            "1e308",
            "nan",
            "inf",
            "18446744073709551616",
            "9223372036854775807",
            "\"\"",
            "[]",
        ];
        let mut mutator = Mutator(seed as u64);
        for n in 0..300 {
            let bytes = match n % 3 {
                0 => mutator.mutate(&whole),
                // Replace one value by another.
                _ => {
                    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
                    let valued: Vec<usize> =
                        (0..lines.len()).filter(|&i| lines[i].contains(" = ")).collect();
                    let at = valued[mutator.below(valued.len())];
                    let key = lines[at].split(" = ").next().unwrap_or_default().to_owned();
                    lines[at] = format!("{key} = {}", numbers[mutator.below(numbers.len())]);
                    lines.join("\n").into_bytes()
                }
            };
            std::fs::write(&path, &bytes).unwrap();
            counts[usize::from(config::load(&path).is_err())] += 1;
        }
    }
    println!("{} rigs, {} errors", counts[0], counts[1]);
    assert!(counts[1] > 300, "{counts:?}");
}

#[test]
fn invalid_slots_are_refused() {
    // A valid header before a random payload.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration-a.slot");
    let mut header = b"relenscl".to_vec();
    header.extend(store::VERSION.to_le_bytes());
    let (mut mutator, mut parsed) = (Mutator(5), 0);
    for n in 0..2000 {
        let mut bytes = header.clone();
        bytes.extend((0..64).map(|_| mutator.below(256) as u8));
        if n % 2 == 0 {
            bytes = mutator.mutate(&bytes);
        }
        // A valid checksum, so that the payload is parsed.
        let crc = crc32fast::hash(&bytes);
        bytes.extend(crc.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let refused = store::load(folder.path(), 7).unwrap_err();
        let StoreError::BothBad { a, .. } = &refused else { panic!("{refused}") };
        parsed += usize::from(matches!(a, SlotFault::Contents(_)));
    }
    assert!(parsed >= 1000, "{parsed} payloads were parsed");
}

#[test]
fn mutated_records_lose_no_photo() {
    let root = fresh_root();
    let root = root.path();
    let bytes = file(Format::Png, 8, RIG);
    drop_in(root, "a.png", &bytes);
    // A valid record of this photo.
    let record = std::cell::RefCell::new(Vec::new());
    struct Look<'a>(&'a Path, &'a std::cell::RefCell<Vec<u8>>);
    impl relens::daemon::Watcher for Look<'_> {
        fn step(&mut self, step: relens::daemon::JobStep) {
            if step == relens::daemon::JobStep::Named {
                let found = std::fs::read_dir(self.0.join("working")).unwrap().flatten();
                let found =
                    found.map(|e| e.path()).find(|p| p.to_string_lossy().contains(".ledger-"));
                *self.1.borrow_mut() = std::fs::read(found.unwrap()).unwrap();
            }
        }
    }
    once_with(root, &mut Brightener::default(), &mut Look(root, &record)).unwrap();
    let record = record.into_inner();
    let mut mutator = Mutator(9);
    for n in 0..150 {
        let root = fresh_root();
        let root = root.path();
        std::fs::create_dir_all(root.join("working")).unwrap();
        std::fs::create_dir_all(root.join("outbox")).unwrap();
        // A result of that name that relens did not write.
        std::fs::write(root.join("outbox/a.png"), b"somebody else's").unwrap();
        std::fs::write(root.join("working/a.png"), &bytes).unwrap();
        // FNV-1a of the name, as in the ledger.
        let hash = b"a.png".iter().fold(0xcbf2_9ce4_8422_2325u64, |h, b| {
            (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3)
        });
        std::fs::write(root.join(format!("working/.ledger-{hash:016x}")), mutator.mutate(&record))
            .unwrap();
        let summary = once(root);
        assert_eq!(summary.restored.len(), 1, "{n}: {summary:?}");
        assert_eq!(std::fs::read(root.join("outbox/a.png")).unwrap(), b"somebody else's");
        assert!(root.join("outbox/a-2.png").is_file() && root.join("done/a.png").is_file());
    }
}
