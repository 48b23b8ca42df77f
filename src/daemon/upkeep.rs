//! Chores at each scan of the inbox.

use super::job::Unsettled;
use super::store::late::LateWrites;
use super::store::limits::Keeping;
use crate::config::Keep;

/// Chores at each scan of the inbox.
pub(super) struct Upkeep<'a> {
    pub(super) keeping: Keeping<'a>,
    pub(super) unsettled: Unsettled,
    pub(super) late: LateWrites,
}

impl Upkeep<'_> {
    /// Without limits, and with nothing to do.
    pub(super) fn new() -> Self {
        let keeping = Keeping::new(Keep::default(), &|| true);
        Upkeep { keeping, unsettled: Unsettled::default(), late: LateWrites::default() }
    }
}
