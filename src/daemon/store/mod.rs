//! What lies on the disk, and how it is moved: it knows no rig and no loop.
//!
//! ```text
//! inbox/a.jpg ─ claim ─► working/a.jpg ─ read, restore ─► outbox/a.jpg.json, outbox/a.jpg
//!                             │                                  only then
//!                             ├─────────────────────────────► done/a.jpg
//!                             └─ cannot be restored ─────────► failed/a.jpg, failed/a.jpg.txt
//! ```
//!
//! A photo is in exactly one of `inbox`, `working`, `done`, `failed`. Results are whole or absent;
//! no name is ever overwritten, a second one gets a number. Whatever instant the power fails at,
//! [`Folders::open`] finishes or takes back what was under way; whatever a disk does to a living
//! daemon, [`recover::settle`] does.

pub(super) mod claim;
pub(super) mod deliver;
pub(super) mod error;
pub(super) mod folders;
pub(super) mod hints;
pub(super) mod inbox;
pub(super) mod ledger;
pub(super) mod limits;
pub(super) mod night_record;
pub(super) mod open;
pub(super) mod pilots;
pub(super) mod recover;
pub(super) mod report_file;
pub(super) mod taken;
pub(super) mod waiting;
pub(super) mod withdraw;
