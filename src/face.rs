//! The library's face: a rig is opened, calibrated, and restores photos.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use crate::calibration::store;
use crate::chart::scenes::cut;
use crate::config;
use crate::frame::{Frame, Size, Work};
use crate::picture::{Format, Limits, Manner, Photo, encode};
use crate::pipeline::Outcome;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::restorer::Restorer;
use crate::restorer::on_rig::{self, OnRig};
use crate::rig::exposure::Devices;
use crate::rig::monotonic::Monotonic;
use crate::rig::{self, simulated};

/// A rig that is open: panel, camera, trigger and clock, real or simulated.
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
    /// Opens the rig of the rig file `path`. The bare name of a rig file that is part of the
    /// program, such as `small.toml`, needs no file. Real devices need the feature `hardware`.
    ///
    /// # Errors
    /// When the file is not taken (the message says line, key, what was found and what is allowed),
    /// or when a device cannot be had.
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

    /// Its name, as the rig file says.
    pub fn name(&self) -> &str {
        &self.file.name
    }

    /// Width and height of its photos, in pixels.
    pub fn photo_size(&self) -> Size {
        self.file.photo.size()
    }

    /// Reads the photo in the file `path`: JPEG, PNG or TIFF, 8 or 16 bits, of any size that has
    /// the shape of the rig's photos. It is resampled to theirs. A raw photo of the rig's sensor
    /// (DNG) has the rig's own size.
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

    /// The photo that the camera of a simulated rig takes of the sharp picture in the file `scene`,
    /// cut to the shape of its photos about the centre: blurred by its lens, with its noise, as an
    /// 8-bit PNG holds it. Equal seeds give equal noise.
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

    /// Whether `folder` holds a whole calibration of this rig.
    pub fn is_calibrated(&self, folder: impl AsRef<Path>) -> bool {
        store::load(folder.as_ref(), self.file.identity).is_ok()
    }

    /// Measures the rig and keeps the calibration in `folder`, which is made if need be. It shows
    /// patterns, photographs them, fits what the rig is, and judges whether that is good. What was
    /// kept before stays when this fails.
    ///
    /// # Errors
    /// When the rig is not fit to be calibrated (panel out of view, over-exposed, too dark, moving,
    /// out of focus), a capture fails, or the folder cannot be written.
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
    /// // How well the measured lens predicts a capture it has not seen.
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

    /// What restores photos on this rig, by the calibration kept in `folder` and the method that
    /// the rig file names, or the operating point chosen for the rig.
    ///
    /// # Errors
    /// When `folder` holds no whole calibration of this rig; then call [`Rig::calibrate`].
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

/// What a calibration found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibrated {
    /// Counts up by one with each calibration kept in a folder; the first is 1.
    pub generation: u32,
    /// Captures it took.
    pub captures: u32,
    /// RMS difference between a capture that no fit has seen and the measured lens's prediction of
    /// it, in grey levels of 255, of red, green and blue. The capture's noise is part of it.
    pub operator_error: [f32; 3],
    /// Share of red, green and blue light that the lens scatters wider than its functions reach,
    /// 0..1; zero where the rig file does not have it measured.
    pub scattered: [f32; 3],
}

/// A calibrated rig, photo after photo.
pub struct PhotoRestorer {
    file: config::RigFile,
    on_rig: OnRig,
}

impl PhotoRestorer {
    /// Reads a photo; as [`Rig::read`].
    ///
    /// # Errors
    /// As [`Rig::read`].
    pub fn read(&self, path: impl AsRef<Path>) -> Result<Photo, Error> {
        read(&self.file, path.as_ref())
    }

    /// Restores `photo`. The outcome says which method made the picture, why, and what is known of
    /// it without knowing the scene; a photo that no method makes better comes back as it is.
    ///
    /// # Errors
    /// When a capture fails; [`Error::remedy`] says what helps.
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
    /// // Its photograph through the lens is the photo, but for the noise.
    /// assert!(outcome.certificate.expect("it was photographed").ratio() < 1.25);
    /// let jpeg = photo.with_picture(&outcome.picture, Format::Jpeg)?;
    /// assert!(jpeg.starts_with(&[0xff, 0xd8]));
    /// # Ok(())
    /// # }
    /// ```
    pub fn restore(&mut self, photo: &Photo) -> Result<Outcome, Error> {
        Ok(self.on_rig.restore(photo, &mut |_| {})?)
    }

    /// Calibrates the rig anew or opens its devices again, as a failure's [`Error::remedy`] asks;
    /// [`Remedy::Recalibrate`] calibrates, any other opens.
    ///
    /// # Errors
    /// When that fails too.
    pub fn mend(&mut self, remedy: Remedy) -> Result<(), Error> {
        Ok(self.on_rig.mend(remedy)?)
    }
}

fn read(rig: &config::RigFile, path: &Path) -> Result<Photo, Error> {
    let photo = Photo::read(path, rig.photo.curve, &Limits::default())?.fit(rig.photo_grid())?;
    Ok(photo.with_raw_results(rig.photo.raw_results))
}

/// Whatever stood in the way, with what to do about it.
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
    /// What to do about it.
    pub fn remedy(&self) -> Remedy {
        self.0.remedy()
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

/// The message and those of its causes.
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
