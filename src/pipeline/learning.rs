//! What the captures of photos teach of the lens, until it has proved itself.
//!
//! A photo whose capture shows another lens than was measured is solved with the lens refined by it
//! ([`crate::deconvolution::refinement`]). That lens is kept and held against the first capture of
//! every photo that follows. When it has explained [`PROOFS`] other photos' captures, one after the
//! other, it may take the measured one's place; when it fails one, it is forgotten. Kept is the
//! lens where it was measured to be ([`crate::deconvolution::refinement::displacement`]): a knocked
//! panel is for the pilot to see, and for a calibration to mend.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hasher};

use crate::deconvolution::refinement::{CaptureFinding, Learnt};
use crate::frame::Plane;

/// Other photos whose captures a lens must explain. Guess: each of them is a test with some hundred
/// thousand pixels, and photos are unlike each other.
const PROOFS: usize = 3;

/// What was learnt so far.
#[derive(Debug, Default)]
pub(super) struct Learning {
    lens: Option<Learnt>,
    /// Photos whose captures it explains, the one that taught it among them.
    photos: BTreeSet<u64>,
}

impl Learning {
    /// The lens that is held against the next capture.
    pub(super) fn lens(&self) -> Option<&Learnt> {
        self.lens.as_ref()
    }

    /// Takes down what a capture of `photo` said; the lens, once it has proved itself.
    pub(super) fn learn(&mut self, photo: &Plane, look: &CaptureFinding) -> Option<&Learnt> {
        let mut hasher = DefaultHasher::new();
        photo.data().iter().for_each(|v| hasher.write_u32(v.to_bits()));
        self.note(hasher.finish(), look)
    }

    /// [`Learning::learn`] of a photo by its number.
    fn note(&mut self, photo: u64, look: &CaptureFinding) -> Option<&Learnt> {
        if look.learnt_holds == Some(false) {
            log::debug!("what was learnt of the lens does not hold");
            *self = Learning::default();
        }
        match &look.refined {
            _ if look.learnt_holds == Some(true) => {
                self.photos.insert(photo);
            }
            Some(refined) if self.lens.is_none() => {
                self.lens = Some(refined.clone());
                self.photos.insert(photo);
            }
            _ => {}
        }
        // The first one taught.
        if self.photos.len() > PROOFS { self.lens.as_ref() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::LensFunctions;
    use crate::deconvolution::level_norms::LevelNorms;
    use crate::frame::Channel;

    fn look(learnt_holds: Option<bool>, refines: bool) -> CaptureFinding {
        let taps = vec![1.0];
        let functions = LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 1,
            taps: [taps.clone(), taps.clone(), taps],
        };
        let level_norms = Channel::ALL.map(|_| LevelNorms::uniform(2, 1.0));
        let refined = refines.then_some(Learnt { functions, level_norms });
        CaptureFinding { refined, learnt_holds }
    }

    #[test]
    fn a_lens_must_explain_three_other_photos_in_a_row() {
        let mut learning = Learning::default();
        assert!(learning.note(1, &look(None, true)).is_none());
        assert!(learning.note(2, &look(Some(true), true)).is_none());
        assert!(learning.note(3, &look(Some(true), true)).is_none());
        // The same photo again proves nothing, and one that cannot tell neither proves nor
        // disproves.
        assert!(learning.note(3, &look(Some(true), true)).is_none());
        assert!(learning.note(4, &look(None, false)).is_none());
        assert!(learning.note(5, &look(Some(true), true)).is_some());
    }

    #[test]
    fn a_lens_that_fails_one_photo_is_forgotten() {
        let mut learning = Learning::default();
        for photo in 1..=3 {
            assert!(learning.note(photo, &look((photo > 1).then_some(true), true)).is_none());
        }
        assert!(learning.note(4, &look(Some(false), true)).is_none());
        // What that photo taught is held against the next ones.
        assert!(learning.lens().is_some());
        assert!(learning.note(5, &look(Some(true), true)).is_none());
        assert!(learning.note(6, &look(Some(false), false)).is_none());
        assert!(learning.lens().is_none());
    }
}
