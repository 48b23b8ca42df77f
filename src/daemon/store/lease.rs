//! Several boxes on one set of folders: whose claim a photo in `working` is, and for how long.
//!
//! Each box works in a folder of its own, `working/NAME`, so that a photo is claimed by whoever
//! renames it there first. A box that works changes its lease there every now and then, from the
//! loop that does the work: one that hangs in a device loses its claims as one does that lost its
//! power. The others watch whether the lease *changes*, each by its own clock, for the boxes'
//! calendars may differ by years. A lease that stays as it is for
//! `lease_s` has run out, and any other box takes the photos
//! over.
//!
//! A box that was only slow or asleep may find then that its lease can have run out. Before it
//! delivers, it changes the lease, waits as long as a take-over under way may need, and looks
//! whether the photo is still where it claimed it; if not, it gives up. Between that look and the
//! delivery lie some milliseconds, against minutes of lease; a box that sleeps exactly there
//! delivers a second result.

use std::cell::Cell;
use std::collections::HashMap;
use std::ffi::{OsStr, OsString};

use crate::remedy::full_message;
use crate::rig::{Clock, Moment};

use super::folders::Folders;
use super::recover;
use crate::disk::FileError;

/// Name of the lease in a box's folder.
const LEASE: &str = ".relens-lease";

/// A lease is changed this many times before it runs out. Guess: nine may be lost to a slow
/// network.
const BEATS: f64 = 10.0;

/// Seconds in which another box moves a photo once it has found the lease run out. Guess: some
/// round trips of a slow network.
const TAKE_OVER_S: f64 = 5.0;

/// Longest lease file there is.
const BYTES_MAX: u64 = 64;

/// This box's own lease.
#[derive(Debug)]
pub(crate) struct Lease {
    lease_s: f64,
    beaten: Cell<Option<Moment>>,
    count: Cell<u64>,
}

impl Lease {
    /// A lease that runs out when it has not been changed for `lease_s`.
    pub(crate) fn new(lease_s: f64) -> Lease {
        Lease { lease_s, beaten: Cell::new(None), count: Cell::new(0) }
    }

    /// Changes the lease when it is time. A box alone on its folders needs none.
    pub(crate) fn beat(&self, folders: &Folders, now: Moment) {
        if self.beaten.get().is_none_or(|at| now.0 - at.0 >= self.lease_s / BEATS)
            && let Err(error) = self.renew(folders, now)
        {
            // There are more beats to come, and a look before anything is delivered.
            log::debug!("{}", full_message(&error));
        }
    }

    /// Sees to it that nobody takes this box for dead from here on; after a while in which one may
    /// have, a take-over that was under way is then over. Without it
    /// another box may take the photos over at any time.
    pub(crate) fn make_good(&self, folders: &Folders, clock: &dyn Clock) -> Result<(), FileError> {
        if !self.is_good(folders, clock.now()) {
            self.renew(folders, clock.now())?;
            clock.wait_until(Moment(clock.now().0 + TAKE_OVER_S.min(self.lease_s / BEATS)));
        }
        Ok(())
    }

    fn renew(&self, folders: &Folders, now: Moment) -> Result<(), FileError> {
        if !folders.shared() {
            return Ok(());
        }
        let count = self.count.get() + 1;
        let words = format!("{} {count}\n", std::process::id());
        let files = folders.files();
        files.replace_for_now(folders.working(), LEASE.as_ref(), words.as_bytes())?;
        self.beaten.set(Some(now));
        self.count.set(count);
        Ok(())
    }

    /// Whether nobody can have taken this box for dead.
    fn is_good(&self, folders: &Folders, now: Moment) -> bool {
        // Half: the others see a change later than it is made.
        !folders.shared() || self.beaten.get().is_some_and(|at| now.0 - at.0 < self.lease_s / 2.0)
    }
}

/// The other boxes' leases, as last seen to change.
#[derive(Debug, Default)]
pub(crate) struct Neighbours(HashMap<OsString, (Option<Vec<u8>>, Moment)>);

impl Neighbours {
    /// Looks at the other boxes' leases and takes over what those leave that have run out.
    pub(crate) fn look(&mut self, folders: &Folders, now: Moment, lease_s: f64) {
        let others = match folders.others() {
            Ok(others) => others,
            Err(error) => return log::debug!("{}", full_message(&error)),
        };
        self.0.retain(|name, _| others.iter().any(|(other, _)| other == name));
        for (name, theirs) in others {
            // One that cannot be read for now says nothing new.
            let path = theirs.working().join(LEASE);
            let Ok(lease) = folders.files().read(&path, BYTES_MAX) else { continue };
            let (seen, since) = self.0.entry(name.clone()).or_insert_with(|| (lease.clone(), now));
            if *seen != lease {
                (*seen, *since) = (lease, now);
            } else if now.0 - since.0 >= lease_s
                && let Err(error) = take_over(&theirs, &name)
            {
                log::warn!("{}", full_message(&error));
            }
        }
    }
}

/// Finishes what the box `name` delivered, and puts the other photos it claimed back into the
/// inbox.
fn take_over(theirs: &Folders, name: &OsStr) -> Result<(), FileError> {
    let photos = recover::photos(theirs)?;
    if !photos.is_empty() {
        log::warn!(
            "the box {} has not moved for too long; its photos are taken over",
            name.to_string_lossy()
        );
    }
    for photo in photos {
        match recover::recover_photo(theirs, &photo) {
            // Another box was quicker.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            recovered => recovered?,
        }
    }
    Ok(())
}
