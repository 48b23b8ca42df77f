//! Binning: a camera that delivers means over blocks of its sensor's pixels.

use super::{Camera, Exposed, Moment, RigError};
use crate::frame::binning::{bin, is_any};
use crate::frame::{Counts, Frame, Size};

/// A binned camera. Behind colour filters it averages interpolated planes, so that every colour has
/// the same centre. The interpolation is linear and uniform, and is measured with the lens.
struct BinnedCamera {
    inner: Box<dyn Camera + Send>,
    by: usize,
    count_max: u16,
    /// Whether frames are delivered in the sensor's own pixels.
    own: bool,
}

/// Bins the camera `inner`, whose largest count is `count_max`, by `by` pixels along each side. A
/// block that contains a saturated pixel has the largest count.
pub(super) fn binned(
    inner: Box<dyn Camera + Send>,
    by: usize,
    count_max: u16,
) -> Box<dyn Camera + Send> {
    match by {
        1 => inner,
        by => Box::new(BinnedCamera { inner, by, count_max, own: false }),
    }
}

impl BinnedCamera {
    fn binned(&self, counts: &Counts) -> Counts {
        let BinnedCamera { by, count_max, .. } = *self;
        Frame::from_fn(|c| {
            let plane = counts.plane(c);
            let clipped = is_any(plane, by, |count| count >= count_max);
            let mut means = bin(plane, by).map(|mean: f32| mean.round() as u16);
            means.update(&clipped, |mean, clipped| *mean = if clipped { count_max } else { *mean });
            means
        })
    }
}

impl Camera for BinnedCamera {
    fn size(&self) -> Size {
        let Size { width, height } = self.inner.size();
        if self.own { self.inner.size() } else { Size::new(width / self.by, height / self.by) }
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        let exposed = self.inner.frame(deadline)?;
        if self.own {
            return Ok(exposed);
        }
        let counts = self.binned(&exposed.counts);
        self.inner.give_back(exposed.counts);
        Ok(Exposed { counts, ..exposed })
    }

    fn deliver_own(&mut self, own: bool) {
        self.own = own;
    }

    fn give_back(&mut self, counts: Counts) {
        if counts.size() == self.inner.size() {
            self.inner.give_back(counts);
        }
    }

    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        self.inner.expose_times(times)
    }

    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        self.inner.amplify_times(times)
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.inner.reopen()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Plane;

    /// A camera that delivers the same frame again and again.
    struct Still(Counts);

    impl Camera for Still {
        fn size(&self) -> Size {
            self.0.size()
        }

        fn frame(&mut self, at: Moment) -> Result<Exposed, RigError> {
            Ok(Exposed { counts: self.0.clone(), sequence: 1, at })
        }

        fn reopen(&mut self) -> Result<(), RigError> {
            Ok(())
        }
    }

    #[test]
    fn a_binned_frame_is_of_means_and_saturated_as_any_of_its_pixels() {
        let value = |x: usize, y: usize| if (x, y) == (5, 1) { 1023 } else { (10 * x + y) as u16 };
        let own: Counts = Frame::from_fn(|_| Plane::from_fn(Size::new(8, 4), value));
        let mut camera = binned(Box::new(Still(own.clone())), 2, 1023);
        let counts = camera.frame(Moment(0.0)).unwrap().counts;
        assert_eq!((camera.size(), counts.size()), (Size::new(4, 2), Size::new(4, 2)));
        // Interpolation carries a saturated site one pixel farther.
        assert_eq!(counts.planes()[0].data(), [6, 26, 1023, 1023, 8, 28, 1023, 1023]);
        camera.give_back(counts);
        camera.deliver_own(true);
        assert_eq!(
            (camera.frame(Moment(0.0)).unwrap().counts, camera.size()),
            (own, Size::new(8, 4))
        );
    }
}
