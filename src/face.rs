//! The library's interface: open a rig, calibrate it, restore photos.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use crate::calibration::store;
use crate::chart::scenes::cut;
use crate::config;
use crate::frame::{Frame, Size, Work};
use crate::picture::{Format, Limits, Manner, Photo, ReadOptions, encode};
use crate::pipeline::Outcome;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::restorer::Restorer;
use crate::restorer::on_rig::{self, OnRig};
use crate::rig::exposure::Devices;
use crate::rig::monotonic::Monotonic;
use crate::rig::{self, simulated};

/// An open rig: panel, camera, trigger and clock, real or simulated.
///
/// # Examples
///
/// ```
/// # fn main() -> Result<(), relens::Error> {
/// let rig = relens::Rig::open("small.toml")?;
/// assert_eq!(rig.name(), "small");
/// assert_eq!((rig.photo_size().width, rig.photo_size().height), (256, 192));
/// # Ok(())
/// # }
/// ```
pub struct Rig {
    file: config::RigFile,
    devices: Devices,
}

impl Rig {
    /// Opens the rig that the file `path` describes, or a built-in one by its name, such as
    /// `small.toml`. Real devices need the feature `hardware`.
    ///
    /// # Errors
    /// When the file is invalid (the message states line, key, what was found and what is allowed),
    /// or a device cannot be opened.
    ///
    /// # Examples
    ///
    /// ```
    /// let refused = relens::Rig::open("no-such-rig.toml").err().expect("there is no such file");
    /// assert!(refused.to_string().contains("no-such-rig.toml"));
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Result<Rig, Error> {
        let file = config::load(path.as_ref())?;
        let devices = rig::open(&file)?;
        Ok(Rig { file, devices })
    }

    /// Name of the rig, from its file.
    pub fn name(&self) -> &str {
        &self.file.name
    }

    /// Width and height of the rig's photos, in pixels.
    pub fn photo_size(&self) -> Size {
        self.file.photo_grid().photo.size
    }

    /// Reads the photo in the file `path`: JPEG, PNG or TIFF of 8 or 16 bits, in the shape of the
    /// rig's photos, resampled to their size; or a raw photo of the rig's sensor (DNG), in its own
    /// size.
    ///
    /// # Errors
    /// When the file cannot be read, is damaged, or has another shape.
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), relens::Error> {
    /// let rig = relens::Rig::open("small.toml")?;
    /// // A square picture is no photo of a rig that takes four by three.
    /// assert!(rig.read("tests/scenes/astronaut.png").is_err());
    /// # Ok(())
    /// # }
    /// ```
    pub fn read(&self, path: impl AsRef<Path>) -> Result<Photo, Error> {
        read(&self.file, path.as_ref())
    }

    /// Photographs the sharp picture in the file `scene`, cut to the shape of the rig's photos,
    /// with a simulated rig: blurred by its lens, with its noise, in 8 bits. Equal seeds give equal
    /// noise.
    ///
    /// # Errors
    /// When the rig is not simulated, or the file cannot be read.
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), relens::Error> {
    /// let rig = relens::Rig::open("small.toml")?;
    /// let photo = rig.photograph("tests/scenes/astronaut.png", 1)?;
    /// assert_eq!(photo.light.size(), rig.photo_size());
    /// # Ok(())
    /// # }
    /// ```
    pub fn photograph(&self, scene: impl AsRef<Path>, seed: u64) -> Result<Photo, Error> {
        let curve = self.file.photo.curve;
        let sharp = Photo::read(scene.as_ref(), curve, &Limits::default())?;
        let (_, witness) = simulated::open(&self.file)?;
        let codes = witness.photograph(&cut(&sharp.in_colour(), self.photo_size()), seed);
        let manner = Manner::plain(Format::Png, 8, curve);
        let light: Frame<Work> = Frame::from_fn(|c| manner.tone.plane(c, codes.plane(c)));
        let bytes = encode("photo.png", &light, &manner, false)?;
        Ok(Photo::from_bytes("photo.png", &bytes, curve, &Limits::default())?)
    }

    /// Whether `folder` holds a valid calibration of this rig.
    pub fn is_calibrated(&self, folder: impl AsRef<Path>) -> bool {
        store::load(folder.as_ref(), self.file.identity).is_ok()
    }

    /// Measures the rig and keeps the calibration in `folder`, which is made if missing. It shows
    /// patterns, photographs them, fits the model of the rig, and judges the fit. If the
    /// measurement fails, the old calibration stays.
    ///
    /// # Errors
    /// When the rig cannot be calibrated (panel out of view, over-exposed, too dark, moving, out of
    /// focus), a capture fails, or the folder cannot be written.
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), relens::Error> {
    /// # let temporary = tempfile::tempdir().expect("a folder");
    /// # let folder = temporary.path();
    /// let mut rig = relens::Rig::open("small.toml")?;
    /// assert!(!rig.is_calibrated(folder));
    /// let calibrated = rig.calibrate(folder)?;
    /// assert!(rig.is_calibrated(folder));
    /// // The measured lens predicts a capture that was not used in its fit.
    /// assert!(calibrated.operator_error.iter().all(|&levels| levels < 3.0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn calibrate(&mut self, folder: impl AsRef<Path>) -> Result<Calibrated, Error> {
        let measured =
            on_rig::measure(&self.file, &mut self.devices, folder.as_ref(), |_| {}, None)?;
        Ok(Calibrated {
            generation: measured.generation,
            captures: measured.captures,
            operator_error: measured.operator_error,
            scattered: measured.scattered(),
        })
    }

    /// Turns the rig into a restorer with the calibration in `folder`. Its method is that of the
    /// rig file or of the chosen operating point.
    ///
    /// # Errors
    /// When `folder` holds no valid calibration of this rig; then call [`Rig::calibrate`].
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), relens::Error> {
    /// # let temporary = tempfile::tempdir().expect("a folder");
    /// # let folder = temporary.path();
    /// use relens::{Remedy, Rig};
    ///
    /// let refused = Rig::open("small.toml")?.restorer(folder).err().expect("not calibrated yet");
    /// assert_eq!(refused.remedy(), Remedy::Recalibrate);
    /// # Ok(())
    /// # }
    /// ```
    pub fn restorer(self, folder: impl AsRef<Path>) -> Result<PhotoRestorer, Error> {
        let Rig { file, devices } = self;
        let folder = folder.as_ref().to_owned();
        let stopwatch = Arc::new(Monotonic::seconds);
        let on_rig = OnRig::new(&file, devices, folder, None, stopwatch, |_| {})?;
        Ok(PhotoRestorer { file, on_rig })
    }
}

/// The results of a calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibrated {
    /// The number of the calibration in its folder, from 1.
    pub generation: u32,
    /// Captures made.
    pub captures: u32,
    /// RMS difference between a capture not used in any fit and its prediction by the measured
    /// lens, noise included, in grey levels of 255, for red, green and blue.
    pub operator_error: [f32; 3],
    /// Share of red, green and blue light scattered beyond the reach of the lens functions, 0..1;
    /// zero if the rig file disables its measurement.
    pub scattered: [f32; 3],
}

/// Restorer of photos on a calibrated rig.
pub struct PhotoRestorer {
    file: config::RigFile,
    on_rig: OnRig,
}

impl PhotoRestorer {
    /// Reads the photo in the file `path`, as [`Rig::read`] does.
    ///
    /// # Errors
    /// As [`Rig::read`].
    pub fn read(&self, path: impl AsRef<Path>) -> Result<Photo, Error> {
        read(&self.file, path.as_ref())
    }

    /// Restores `photo`. The outcome states the method, the reason, and the evidence for the
    /// result; a photo that no method improves is returned as it is.
    ///
    /// # Errors
    /// When a capture fails; see [`Error::remedy`].
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), relens::Error> {
    /// # let temporary = tempfile::tempdir().expect("a folder");
    /// # let folder = temporary.path();
    /// use relens::{Format, Rig, Verdict};
    ///
    /// let mut rig = Rig::open("small.toml")?;
    /// rig.calibrate(folder)?;
    /// let photo = rig.photograph("tests/scenes/coffee.png", 1)?;
    /// let outcome = rig.restorer(folder)?.restore(&photo)?;
    /// assert_eq!(outcome.verdict, Verdict::Sound);
    /// // Its photograph through the lens matches the photo, up to noise.
    /// assert!(outcome.certificate.expect("it was photographed").ratio() < 1.25);
    /// let jpeg = photo.with_picture(outcome.delivered(&photo), Format::Jpeg)?;
    /// assert!(jpeg.starts_with(&[0xff, 0xd8]));
    /// # Ok(())
    /// # }
    /// ```
    pub fn restore(&mut self, photo: &Photo) -> Result<Outcome, Error> {
        Ok(self.on_rig.restore(photo, &mut |_| {})?)
    }

    /// Applies the remedy of a failure: [`Remedy::Recalibrate`] calibrates, any other opens the
    /// devices again.
    ///
    /// # Errors
    /// When that fails.
    pub fn mend(&mut self, remedy: Remedy) -> Result<(), Error> {
        Ok(self.on_rig.mend(remedy)?)
    }
}

fn read(rig: &config::RigFile, path: &Path) -> Result<Photo, Error> {
    let reading = ReadOptions::of(rig);
    Ok(reading.finish(Photo::read(path, reading.curve, &reading.limits)?.fit(reading.grid)?)?)
}

/// Any failure, with its remedy.
///
/// # Examples
///
/// ```
/// use relens::{Remedy, Rig};
///
/// let error = Rig::open("no-such-rig.toml").err().expect("there is no such file");
/// assert_eq!(error.remedy(), Remedy::CallOperator);
/// ```
pub struct Error(AnyFailure);

impl Error {
    /// The remedy.
    pub fn remedy(&self) -> Remedy {
        self.0.remedy()
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

/// Writes the message, followed by its causes.
impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&full_message(&*self.0))
    }
}

impl std::error::Error for Error {}

impl From<AnyFailure> for Error {
    fn from(failure: AnyFailure) -> Error {
        Error(failure)
    }
}

impl<E: Remediable + Send + Sync + 'static> From<E> for Error {
    fn from(error: E) -> Error {
        Error(Box::new(error))
    }
}

#[cfg(feature = "genicam")]
#[cfg(test)]
mod genicam_box_tests;
