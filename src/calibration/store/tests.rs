//! Slots after power cuts, lost bytes and changes of rig.

use super::*;
use crate::calibration::example::calibration;

fn slot(folder: &Path, name: &str) -> Calibration {
    read_slot(&LocalDisk::new(vec![folder.to_owned()]), &folder.join(name)).unwrap()
}

#[test]
fn the_newer_slot_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let rig = calibration().rig;
    assert!(matches!(load(folder.path(), rig), Err(StoreError::Empty { .. })));
    for generation in 1..=3 {
        let kept = Calibration { generation, ..calibration() };
        save(folder.path(), &kept).unwrap();
        assert_eq!(load(folder.path(), rig).unwrap(), kept);
    }
    // Generations 2 and 3 are stored; losing 3 leaves 2.
    assert_eq!(SLOTS.map(|s| slot(folder.path(), s).generation), [3, 2]);
    std::fs::write(folder.path().join(SLOTS[0]), b"").unwrap();
    assert_eq!(load(folder.path(), rig).unwrap().generation, 2);
    // The next calibration replaces the invalid slot.
    save(folder.path(), &Calibration { generation: 3, ..calibration() }).unwrap();
    assert_eq!(SLOTS.map(|s| slot(folder.path(), s).generation), [3, 2]);
}

#[test]
fn every_flipped_bit_is_noticed() {
    let whole = encode(&calibration()).unwrap();
    assert_eq!(decode(&whole).unwrap(), calibration());
    for at in 0..whole.len() {
        for bit in 0..8 {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << bit;
            assert!(decode(&bytes).is_err(), "bit {bit} of byte {at} went unnoticed");
        }
    }
}

#[test]
fn every_truncation_and_extension_is_noticed() {
    let whole = encode(&calibration()).unwrap();
    for length in 0..whole.len() {
        assert!(decode(&whole[..length]).is_err(), "cut to {length} bytes went unnoticed");
    }
    let mut longer = whole;
    longer.push(0);
    assert_eq!(decode(&longer), Err(SlotFault::Bad("damaged".to_owned())));
}

#[test]
fn a_write_cut_short_leaves_the_old_slot() {
    let folder = tempfile::tempdir().unwrap();
    let old = calibration();
    save(folder.path(), &old).unwrap();
    let new = encode(&Calibration { generation: 8, ..calibration() }).unwrap();
    // Every length within the header, then one in seven; with `RELENS_POWER` set, every length.
    let all = std::env::var_os("RELENS_POWER").is_some();
    for length in (0..new.len()).filter(|at| all || *at < 512 || at % 7 == 0) {
        // The cut may hit the temporary file or, where rename is not atomic, the slot.
        for name in [format!("{}.new", SLOTS[1]), SLOTS[1].to_owned()] {
            std::fs::write(folder.path().join(name), &new[..length]).unwrap();
            assert_eq!(load(folder.path(), old.rig).unwrap(), old);
        }
    }
}

#[test]
fn two_invalid_slots_and_another_rig_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    save(folder.path(), &calibration()).unwrap();
    let other = load(folder.path(), 5).unwrap_err();
    assert!(matches!(
        other,
        StoreError::OtherRig { found, allowed: 5, .. } if found == calibration().rig
    ));
    assert_eq!(other.remedy(), Remedy::Recalibrate);
    for slot in SLOTS {
        std::fs::write(
            folder.path().join(slot),
            b"relenscl and then something else entirely, no slot",
        )
        .unwrap();
    }
    let bad = load(folder.path(), calibration().rig).unwrap_err();
    assert!(bad.to_string().contains("slot a: written in format"), "{bad}");
}

#[test]
fn undamaged_bytes_without_a_calibration_are_refused() {
    let mut wrong = calibration();
    wrong.functions.taps[0].pop();
    assert!(matches!(decode(&encode(&wrong).unwrap()), Err(SlotFault::Contents(_))));
    let dark = Calibration { counts_per_level: [0.0, 1.0, 1.0], ..calibration() };
    assert!(matches!(decode(&encode(&dark).unwrap()), Err(SlotFault::Contents(_))));
}
