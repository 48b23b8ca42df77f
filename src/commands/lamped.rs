//! The lamps of a box around what restores its photos: ready, busy, trouble.

use relens::daemon::{Progress, Restored, Restorer};
use relens::picture::Photo;
use relens::remedy::{AnyFailure, Remedy};
use relens::rig::lamps::{Lamp, Lamps};

/// A restorer that shows what it is doing.
pub(super) struct Lamped {
    inner: Box<dyn Restorer>,
    lamps: Lamps,
    /// A lamp that could not be set was told of.
    told: bool,
}

impl Lamped {
    /// `inner` with `lamps`, ready.
    pub(super) fn new(inner: Box<dyn Restorer>, lamps: Lamps) -> Self {
        let mut lamped = Lamped { inner, lamps, told: false };
        lamped.show(Lamp::Ready);
        lamped
    }

    /// A lamp that fails is no reason to keep a photo waiting.
    fn show(&mut self, lamp: Lamp) {
        if let Err(error) = self.lamps.show(&[lamp])
            && !std::mem::replace(&mut self.told, true)
        {
            log::warn!("{}", relens::remedy::full_message(&error));
        }
    }

    /// Ready again, or in trouble when the rig and not the photo is at fault.
    fn show_outcome(&mut self, failure: Option<Remedy>) {
        let trouble = failure.is_some_and(|remedy| remedy >= Remedy::Recalibrate);
        self.show(if trouble { Lamp::Trouble } else { Lamp::Ready });
    }
}

impl Restorer for Lamped {
    fn restore(&mut self, photo: &Photo, progress: &mut dyn FnMut(Progress)) -> Result<Restored, AnyFailure> {
        self.show(Lamp::Busy);
        let outcome = self.inner.restore(photo, progress);
        self.show_outcome(outcome.as_ref().err().map(|failure| failure.remedy()));
        outcome
    }

    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        self.show(Lamp::Busy);
        let outcome = self.inner.mend(remedy);
        self.show_outcome(outcome.as_ref().err().map(|failure| failure.remedy().max(Remedy::Recalibrate)));
        outcome
    }
}

impl Drop for Lamped {
    /// Dark when nobody works here any more.
    fn drop(&mut self) {
        let _ = self.lamps.show(&[]);
    }
}
