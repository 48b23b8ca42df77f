//! Solution of a prepared photo by a method, cropped to the photo.

use super::Pipeline;
use super::stages::{BoundedLens, Prepared, Solved};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::method::{About, Method, MethodError, Problem, Solution, Watch};
use crate::frame::{Channel, Frame, Work};
use crate::rig::exposure::Devices;

impl Pipeline {
    /// Solves `photo` by `method` on `rig`; `watch` is called after each step.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn solve(
        &self,
        rig: &mut Devices,
        photo: &Prepared<'_>,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<Solved, MethodError> {
        let mut path = self.light_path(rig).interruptible(self.interruption.as_deref());
        let (captures, seconds) = (path.captures(), path.seconds());
        if let Some(BoundedLens { model, .. }) = &photo.lens {
            path = path.at_focus_of(model);
            Channel::ALL.iter().for_each(|&c| self.lens.model.release_spectra(c));
        }
        let solution = self.pose(photo, |problem| method.solve(problem, &mut path, watch))?;
        let solved = self.finish(photo, method.about(), solution);
        Ok(Solved {
            captures: path.captures() - captures,
            capture_seconds: path.seconds() - seconds,
            waited_seconds: path.waited_seconds(),
            ..solved
        })
    }

    /// Poses `photo` as a problem, and returns the result of `solve`.
    pub(super) fn pose<T>(&self, photo: &Prepared<'_>, solve: impl FnOnce(&Problem<'_>) -> T) -> T {
        let is_raw = photo.observation.sampling.mosaic().is_some();
        let lens = self.lens_of(photo);
        let norms = if is_raw { lens.norms_at_sites() } else { &lens.norms };
        let is_hopeless = |prediction: &Frame<Work>| self.is_hopeless(photo, prediction);
        solve(&Problem {
            is_hopeless: Some(&is_hopeless),
            observation: &photo.observation,
            model: &lens.model,
            norm_squared: norms.squared,
            level_norms: &norms.levels,
            pixel_norms: &lens.norms.levels,
            capture_mosaic: self.correction.layout().canvas_mosaic(),
            capture_noise: self.capture_noise,
            stopwatch: &*self.stopwatch,
        })
    }

    /// The `solution` of `photo`, cropped to the photo and with its outliers put back.
    pub(super) fn finish(
        &self,
        photo: &Prepared<'_>,
        about: &'static About,
        solution: Solution,
    ) -> Solved {
        let mut picture = solution.picture.crop(photo.observation.rect);
        if let Some(outliers) = &photo.outliers {
            outliers.put_back(&mut picture, &photo.photo);
        }
        Solved { picture, solution, about, captures: 0, capture_seconds: 0.0, waited_seconds: 0.0 }
    }
}
