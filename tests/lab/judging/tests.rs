//! The groups are disjoint; ordinary JPEGs are improved.

use relens::config::MethodName;
use relens::pipeline::Verdict;

use super::cases::{Kept, NONE};
use super::groups::Group;
use super::{Fault, restore};
use crate::change::NOTHING;
use crate::harness::{Harness, calibrated, calibration};
use crate::jpeg_coder::Quality;
use crate::view::{Subject, View};

const NO_FAULT: Fault = Fault { swept: &NONE, strength: 0.0, step: 0 };

#[test]
fn the_groups_share_no_scene_no_rig_and_no_lens() {
    let lens = |group: Group| {
        let of = group.rigs().iter().map(|rig| {
            let file = rig.load(1).unwrap();
            let simulation = file.simulation().unwrap().clone();
            (rig.name, format!("{:?}", simulation.lens))
        });
        of.collect::<Vec<_>>()
    };
    let (limits, rates) = (lens(Group::Limits), lens(Group::Rates));
    assert!(limits.len() == 3 && rates.len() == 3);
    assert!(
        limits.iter().all(|one| rates.iter().all(|other| one.0 != other.0 && one.1 != other.1))
    );
    let [limits, rates] = [Group::Limits, Group::Rates].map(Group::subjects);
    assert!(limits.iter().all(|subject| !rates.contains(subject)));
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn ordinary_jpegs_are_improved_in_luma_and_no_worse_in_colour() {
    let rig = crate::rig("small.toml").unwrap();
    let measured = calibration(&rig).unwrap();
    let mut harness = Harness::changed(&rig, &measured, &NONE.change, 0.0).unwrap();
    let kept = [85, 60].map(|quality| Kept::Jpeg(Quality { quality, pixels: (2, 2) }));
    // A retina and galaxies have too little detail to gain so much.
    let views = [0, 3, 4, 5].map(|n| View { subject: Subject::Kept(n), quarter: None });
    let of: Vec<_> = views.iter().flat_map(|&view| kept.map(|kept| (view, kept))).collect();
    let found = restore(&mut harness, &NO_FAULT, &of, &[MethodName::Hybrid], 9);
    let found = found.unwrap();
    assert_eq!(found.len(), of.len());
    for record in found {
        assert_eq!(record.verdict, Verdict::Sound, "{}", record.cells());
        assert!(!record.delivered.harms(record.photo), "{}", record.cells());
        assert!(record.delivered.ssim > record.photo.ssim + 0.02, "{}", record.cells());
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn interpolation_between_filters_is_not_taken_for_another_lens() {
    let rig = crate::rig("truthful.toml").unwrap();
    let measured = calibration(&rig).unwrap();
    let mut harness = Harness::changed(&rig, &measured, &NONE.change, 0.0).unwrap();
    let of = [3, 5].map(|n| (View { subject: Subject::Kept(n), quarter: None }, Kept::Developed));
    let found = restore(&mut harness, &NO_FAULT, &of, &[MethodName::Digital], 9);
    for record in found.unwrap() {
        assert_eq!(record.verdict, Verdict::Sound, "{}", record.cells());
        assert!(record.delivered.ssim > record.photo.ssim + 0.02, "{}", record.cells());
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn small_bright_things_through_a_narrow_lens_are_not_made_worse() {
    let rig = Group::Limits.rigs()[0].load(Group::Limits.seed()).unwrap();
    let (rig, measured) = calibrated(&rig, &NOTHING, 0.0).unwrap();
    let mut harness = Harness::changed(&rig, &measured, &NONE.change, 0.0).unwrap();
    let leaves = View { subject: Group::Limits.subjects()[5], quarter: None };
    let of = [(leaves, Kept::Own)];
    let found = restore(&mut harness, &NO_FAULT, &of, &[MethodName::Hybrid], 9);
    for record in found.unwrap() {
        assert!(!record.delivered.harms(record.photo), "{}", record.cells());
    }
}
