//! Stops between any two steps: nothing lost, nothing duplicated, nothing confused.

use std::panic::{AssertUnwindSafe, catch_unwind};

use relens::daemon::{JobStep, Watcher};
use relens::picture::Format;

use crate::bed::*;

/// All steps in order.
const STEPS: [JobStep; 8] = [
    JobStep::Claimed,
    JobStep::Recorded,
    JobStep::Restored,
    JobStep::Named,
    JobStep::Reported,
    JobStep::Delivered,
    JobStep::Moved,
    JobStep::Closed,
];

/// Simulates the end of the program at one step.
struct StopAt(JobStep);

impl Watcher for StopAt {
    fn step(&mut self, step: JobStep) {
        if step == self.0 {
            // A panic without message and backtrace.
            std::panic::resume_unwind(Box::new("stopped"));
        }
    }
}

#[test]
fn a_stop_between_any_two_steps_loses_and_duplicates_nothing() {
    for first in STEPS {
        for second in STEPS {
            let root = fresh_root();
            let root = root.path();
            let bytes = file(Format::Png, 8, RIG);
            drop_in(root, "a.png", &bytes);
            for stop in [first, second] {
                let stopped = catch_unwind(AssertUnwindSafe(|| {
                    once_with(root, &mut Brightener::default(), &mut StopAt(stop)).unwrap()
                }));
                // Exactly one copy of the original at every moment.
                let homes = ["inbox", "working", "done", "failed"];
                let homes =
                    homes.iter().filter(|home| root.join(home).join("a.png").is_file()).count();
                assert_eq!(homes, 1, "stopped at {stop:?}");
                if root.join("done/a.png").is_file() {
                    assert!(root.join("outbox/a.png").is_file(), "done means delivered");
                }
                drop(stopped);
            }
            // A temporary file of the daemon.
            std::fs::write(root.join("outbox/.relens-1-1.tmp"), b"half").unwrap();
            once(root);
            assert_eq!(
                names(&root.join("outbox")),
                set(&["a.png", "a.png.json"]),
                "{first:?}, {second:?}"
            );
            assert_eq!(std::fs::read(root.join("done/a.png")).unwrap(), bytes);
            assert!(
                names(&root.join("inbox")).is_empty() && names(&root.join("working")).is_empty()
            );
            let hidden = |f: &str| {
                let entries = std::fs::read_dir(root.join(f)).unwrap();
                entries
                    .flatten()
                    .filter(|e| e.file_name().to_string_lossy().starts_with('.'))
                    .count()
            };
            assert_eq!((hidden("working"), hidden("outbox")), (0, 0), "{first:?}, {second:?}");
        }
    }
}

#[test]
fn another_photo_of_the_same_name_is_not_confused_with_a_delivered_one() {
    let root = fresh_root();
    let root = root.path();
    for (stop, depth) in [(JobStep::Moved, 8), (JobStep::Claimed, 16)] {
        drop_in(root, "a.png", &file(Format::Png, depth, RIG));
        let stopped = catch_unwind(AssertUnwindSafe(|| {
            once_with(root, &mut Brightener::default(), &mut StopAt(stop)).unwrap()
        }));
        assert!(stopped.is_err());
    }
    once(root);
    assert_eq!(
        names(&root.join("outbox")),
        set(&["a.png", "a.png.json", "a-2.png", "a-2.png.json"])
    );
    assert_eq!(names(&root.join("done")), set(&["a.png", "a-2.png"]));
}

#[test]
fn a_photo_that_ends_the_program_each_time_is_rejected() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "poison.png", &file(Format::Png, 8, RIG));
    for _ in 0..3 {
        let stopped = catch_unwind(AssertUnwindSafe(|| {
            once_with(root, &mut Brightener::default(), &mut StopAt(JobStep::Recorded)).unwrap()
        }));
        assert!(stopped.is_err());
    }
    drop_in(root, "good.png", &file(Format::Png, 8, RIG));
    let summary = once(root);
    assert_eq!((summary.restored.len(), summary.failed.len()), (1, 1), "{summary:?}");
    assert!(summary.failed[0].reason.contains("found 3 such attempts, allowed 3"));
}
