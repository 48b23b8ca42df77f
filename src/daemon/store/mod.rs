//! The files of the drop folder and their moves; independent of the rig and the loop.
//!
//! ```text
//! inbox/a.jpg ─ claim ─► working/a.jpg ─ read, restore ─► outbox/a.jpg.json, outbox/a.jpg
//!                             │                                  only then
//!                             ├─────────────────────────────► done/a.jpg
//!                             └─ cannot be restored ─────────► failed/a.jpg, failed/a.jpg.txt
//! ```
//!
//! A photo is in exactly one of `inbox`, `working`, `done`, `failed`. Results are whole or absent;
//! no file is ever overwritten, a duplicate name gets a number. After a power cut at any instant,
//! [`Folders::open`] completes or reverts interrupted jobs; after a disk error in a running daemon,
//! [`recover::settle`] does.

pub(super) mod claim;
pub(super) mod companions;
pub(super) mod deliver;
pub(super) mod folders;
pub(super) mod hints;
pub(super) mod inbox;
pub(super) mod late;
pub(super) mod ledger;
pub(super) mod names;
pub(super) mod night_record;
pub(super) mod open;
pub(super) mod recover;
pub(super) mod report_file;
pub(super) mod taken;
pub(super) mod waiting;
pub(super) mod withdraw;
