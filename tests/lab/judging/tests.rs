//! The groups have nothing in common.

use super::groups::Group;

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
