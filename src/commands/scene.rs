//! The scene and the panel before a simulated rig's lens.

use std::path::Path;

use relens::chart::scenes::cut;
use relens::config::RigFile;
use relens::daemon::{Progress, Restorer};
use relens::frame::{Frame, Work};
use relens::kiosk::screen::Screen;
use relens::nights::pilot::Drift;
use relens::picture::{Limits, Photo};
use relens::pipeline::{Interruption, Outcome};
use relens::remedy::{AnyFailure, Remedy};
use relens::restorer::PanelView;
use relens::restorer::photo_file::TakenPhoto;
use relens::rig::frame_mark::MarkPlace;
use relens::rig::simulated::{self, Witness};

use super::error::CliError;
use super::opening;

/// The picture at `path` on the sensor of `rig`, as by a perfect lens.
pub(super) fn read(rig: &RigFile, path: &Path) -> Result<Frame<Work>, CliError> {
    let sharp = Photo::read(path, rig.photo.curve, &Limits::default())?;
    Ok(cut(&sharp.in_colour(), rig.photo_grid().sensor))
}

/// The restorer of the simulated `rig`, as by [`opening::restorer`], with `scene` before the lens
/// for photos.
pub(super) fn restorer_before(
    scene: &Frame<Work>,
    rig: &RigFile,
    folder: &Path,
    interrupted: Interruption,
) -> Result<Box<dyn Restorer>, CliError> {
    let mut witness = None;
    let open = |rig: &RigFile| {
        let (mut devices, opened) = simulated::open(rig)?;
        if let Some(place) = MarkPlace::of(rig) {
            devices.find_marks(place)?;
        }
        witness = Some(opened);
        Ok(devices)
    };
    let inner = opening::restorer(rig, folder, None, Some(interrupted), open)?;
    let scene = scene.clone();
    Ok(match witness {
        Some(witness) => Box::new(SceneThenPanel { inner, witness, scene, was_asked: false }),
        None => inner,
    })
}

/// A simulated rig whose owner removes the panel for a photo, and puts it back after the first
/// search for it has failed.
struct SceneThenPanel {
    inner: Box<dyn Restorer>,
    witness: Witness,
    scene: Frame<Work>,
    /// Whether the panel was searched for since the last photo.
    was_asked: bool,
}

impl SceneThenPanel {
    fn bring_panel(&self) {
        self.witness.put_before_lens(None);
    }

    fn aim(&self) {
        self.witness.put_before_lens(Some(&self.scene));
    }
}

impl Restorer for SceneThenPanel {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        self.inner.restore(photo, progress)
    }

    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        if remedy == Remedy::Recalibrate {
            self.bring_panel();
        }
        self.inner.mend(remedy)
    }

    fn show(&mut self, screen: &Screen) {
        self.inner.show(screen);
    }

    fn take(&mut self) -> Result<Option<TakenPhoto>, AnyFailure> {
        self.aim();
        self.was_asked = false;
        self.inner.take()
    }

    fn look_for_panel(&mut self) -> Result<PanelView, AnyFailure> {
        if std::mem::replace(&mut self.was_asked, true) {
            log::info!("putting the simulated panel before the lens");
            self.bring_panel();
        } else {
            self.aim();
        }
        self.inner.look_for_panel()
    }

    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        self.inner.pilot()
    }
}
