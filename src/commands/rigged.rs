//! A rig file made into something that restores, photographs, calibrates: the seam to the
//! machinery.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use relens::calibration::{Calibration, store};
use relens::chart;
use relens::chart::operating_point;
use relens::chart::test_rig::{Score, TestRig};
use relens::config::{Method, OperatingPoint, Rig};
use relens::daemon::Restorer;
use relens::frame::{Frame, Work};
#[cfg(feature = "hardware")]
use relens::kiosk::screen::{Screen, draw};
use relens::measurement;
use relens::pipeline::{Interruption, Pipeline};
use relens::remedy::Remedy;
use relens::restorer::on_rig::{self, OnRig};
use relens::rig::Panel;
use relens::rig::exposure::Rig as Devices;
use relens::rig::simulated;

use super::{CliError, say};

/// What restores photos on `rig`, with the calibration in `folder/calibration`. A simulated rig
/// that has none is calibrated first, which `tell` is told.
///
/// # Errors
/// When the rig cannot be opened, or has no valid calibration and is not simulated.
pub(super) fn restorer(
    rig: &Rig,
    folder: &Path,
    method: Option<Method>,
    interrupted: Option<Interruption>,
    tell: &mut dyn FnMut(&str),
) -> Result<Box<dyn Restorer>, CliError> {
    let mut devices = open(rig)?;
    let slots = slots(folder);
    std::fs::create_dir_all(&slots).map_err(|e| CliError::writing(&slots, &e))?;
    if let Err(error) = store::load(&slots, rig.identity) {
        if rig.simulation().is_none() {
            return Err(CliError::of(&error));
        }
        tell(&format!("calibrating the simulated rig {} ({error})", rig.name));
        let measured = on_rig::measure(rig, &mut devices, &slots, calibrating);
        wipe_line();
        measured?;
    }
    let begun = Instant::now();
    let stopwatch = Arc::new(move || begun.elapsed().as_secs_f64());
    let restorer = OnRig::new(rig, devices, slots, method, stopwatch, calibrating)?;
    Ok(Box::new(match interrupted {
        Some(interrupted) => restorer.interruptible(interrupted),
        None => restorer,
    }))
}

/// The codes of the photos that the simulated `rig` would take of `scenes` (photo-sized linear
/// light), the n-th with noise of its own.
///
/// # Errors
/// When the rig is not simulated or cannot be opened.
pub(super) fn photograph(
    rig: &Rig,
    scenes: &[Frame<Work>],
) -> Result<Vec<Frame<Work, u8>>, CliError> {
    let Some(simulation) = rig.simulation() else {
        let rig = &rig.name;
        return Err(CliError::Usage(format!(
            "found the rig {rig}, made of devices, allowed simulated rigs"
        )));
    };
    let (_, witness) = simulated::open(rig).map_err(|e| CliError::of(&e))?;
    let seeds = simulation.seed..;
    Ok(scenes.iter().zip(seeds).map(|(scene, seed)| witness.photograph(scene, seed)).collect())
}

/// `relens calibrate`.
///
/// # Errors
/// When the rig cannot be opened or is not fit to be calibrated; what was kept before then stays.
pub(super) fn calibrate(rig: &Rig, folder: &Path) -> Result<(), CliError> {
    let mut devices = open(rig)?;
    let kept = slots(folder);
    std::fs::create_dir_all(&kept).map_err(|e| CliError::writing(&kept, &e))?;
    let measured = on_rig::measure(rig, &mut devices, &kept, calibrating);
    wipe_line();
    let calibration = measured?;
    let [red, green, blue] = calibration.operator_error;
    say(&format!(
        "kept in {}, generation {}: {} captures; operator error {red:.2}, {green:.2}, {blue:.2} \
         grey levels in red, green, blue",
        kept.display(),
        calibration.generation,
        calibration.captures,
    ))?;
    if rig.calibration.broad_term {
        let [red, green, blue] = calibration.scattered().map(|share| 100.0 * share);
        say(&format!(
            "the lens scatters {red:.1}, {green:.1}, {blue:.1} % of red, green, blue wider than \
             its functions reach"
        ))?;
    }
    match rig.restore.operating_point {
        Some(wanted) => choose(rig, devices, calibration, &kept, wanted),
        None => Ok(()),
    }
}

/// Chooses the operating point `wanted` by scenes shown on the rig, and keeps it beside the
/// calibration.
fn choose(
    rig: &Rig,
    devices: Devices,
    calibration: Calibration,
    kept: &Path,
    wanted: OperatingPoint,
) -> Result<(), CliError> {
    let mut test_rig = TestRig::on(rig.clone(), devices, &calibration, super::clock::seconds)
        .map_err(|e| CliError::of(&e))?;
    let (mut done, total) = (0, operating_point::restorations(rig, wanted));
    let chosen = operating_point::choose(&mut test_rig, wanted, &mut |score| {
        done += 1;
        log::debug!("{} {}: SSIM {:.4}", score.scene.name(), score.method, score.ssim);
        super::service_manager().worked();
        if std::io::stderr().is_terminal() {
            let _ = write!(
                std::io::stderr(),
                "\r\x1b[2Kchoosing the operating point: {done} of {total}"
            );
        }
    });
    wipe_line();
    let nothing = || {
        let words = "no setting gave a picture of the scenes shown that could be scored".to_owned();
        CliError::Failure { words, remedy: Remedy::Recalibrate }
    };
    let chosen = chosen.map_err(|e| CliError::of(&e))?.ok_or_else(nothing)?;
    relens::restorer::operating_point::save(kept, rig, &chosen).map_err(|e| CliError::of(&e))?;
    say(&format!("operating point {chosen}"))
}

/// The devices of `rig`.
fn open(rig: &Rig) -> Result<Devices, CliError> {
    relens::rig::open(rig).map_err(|e| CliError::of(&e))
}

/// Shows on the panel what keeps `rig` from being opened, if the panel alone can be had; until the
/// value is dropped. A simulated panel nobody sees.
pub(super) fn show_trouble(rig: &Rig, reason: &str) -> Option<Box<dyn Panel + Send>> {
    #[cfg(feature = "hardware")]
    if let relens::config::Kind::Hardware(hardware) = &rig.kind {
        let to_do =
            "Look after camera, panel and their cables. The box tries again by itself.".to_owned();
        let screen = Screen::Trouble { what: reason.to_owned(), to_do };
        let mut panel = relens::rig::hardware::open_panel(rig, hardware).ok()?;
        let codes = draw(&screen, panel.size(), None);
        panel.show(&codes).ok()?;
        return Some(panel);
    }
    log::debug!("{} has no panel to show it on: {reason}", rig.name);
    None
}

/// Where the calibration is kept.
fn slots(folder: &Path) -> PathBuf {
    folder.join("calibration")
}

/// The progress of a calibration: each capture is work done; a line on a terminal.
fn calibrating(progress: measurement::Progress) {
    super::service_manager().worked();
    if std::io::stderr().is_terminal() {
        let measurement::Progress { step, captures, total } = progress;
        let _ = write!(
            std::io::stderr(),
            "\r\x1b[2Kcalibrating: {step}, capture {captures} of {total}"
        );
    }
}

fn wipe_line() {
    if std::io::stderr().is_terminal() {
        let _ = write!(std::io::stderr(), "\r\x1b[2K");
    }
}

/// `relens chart`.
///
/// # Errors
/// When the rig cannot be opened, or the tables cannot be written.
pub(super) fn chart(rig: &Rig, out: &Path, quick: bool, folder: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(out).map_err(|e| CliError::writing(out, &e))?;
    let mut each = |score: &Score| {
        let (scene, method) = (score.scene.name(), &score.method);
        log::info!("{scene} {method}: SSIM {:.4}, PSNR {:.2} dB", score.ssim, score.psnr_db);
    };
    let clock = super::clock::seconds;
    let (trade, remark) = if rig.simulation().is_some() {
        (chart::trade(rig, quick, clock, &mut each), "")
    } else {
        let calibration =
            store::load(&slots(folder), rig.identity).map_err(|e| CliError::of(&e))?;
        let trade = TestRig::on(rig.clone(), open(rig)?, &calibration, clock)
            .and_then(|mut test_rig| chart::trade_on(&mut test_rig, quick, &mut each));
        (trade, " The scenes were shown on the rig's own panel.")
    };
    let made = chart::chart(rig, &trade.map_err(|e| CliError::of(&e))?, remark);
    let write = |name: String, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| CliError::writing(&path, &e))
    };
    for (stem, table) in &made.tables {
        write(format!("{stem}.md"), table.markdown())?;
        write(format!("{stem}.csv"), table.csv())?;
        say(&table.markdown())?;
    }
    for (stem, drawing) in &made.drawings {
        write(format!("{stem}.svg"), drawing.svg())?;
    }
    say(&format!("written to {}", out.display()))
}

/// `relens check`: opens every device, measures the rig's timing, looks for its calibration and
/// tries its backward convolution.
///
/// # Errors
/// When the operator is needed: the first device that cannot be had, or else everything else that
/// is wrong.
pub(super) fn check(rig: &Rig, folder: &Path) -> Result<(), CliError> {
    let mut devices = open(rig)?;
    let marks = if devices.has_marks() {
        "found, every frame is proven"
    } else {
        "none: frames are trusted by their time"
    };
    say(&format!(
        "{:<28}{} panel, {} camera",
        "devices",
        devices.panel.size(),
        devices.camera.size()
    ))?;
    say(&format!("{:<28}{marks}", "frame marks"))?;
    let timing = relens::diagnosis::measure(&mut devices, rig.panel.refresh_hz)
        .map_err(|e| CliError::of(&e))?;
    say(timing.to_string().trim_end())?;
    let mut complaints = timing.complaints();
    match store::load(&slots(folder), rig.identity) {
        Ok(calibration) => {
            let (generation, captures) = (calibration.generation, calibration.captures);
            say(&format!("{:<28}generation {generation}, {captures} captures", "calibration"))?;
            let pipeline = Pipeline::new(rig, &calibration).map_err(|e| CliError::of(&e))?;
            match pipeline.check_backward(&mut devices) {
                Ok(check) => {
                    say(&format!("{:<28}{check}", "backward convolution"))?;
                    complaints.extend(check.complaint());
                }
                Err(error) => complaints.push(relens::remedy::full_message(&*error)),
            }
        }
        Err(error) => {
            complaints.push(relens::remedy::full_message(&error));
            say(&format!("{:<28}none that can be used", "calibration"))?;
        }
    }
    match relens::restorer::operating_point::load(&slots(folder), rig) {
        Ok(chosen) => {
            chosen.map_or(Ok(()), |chosen| say(&format!("{:<28}{chosen}", "operating point")))?
        }
        Err(reason) => complaints.push(format!(
            "no operating point: {}; run `relens calibrate`",
            relens::remedy::full_message(&reason)
        )),
    }
    match complaints.is_empty() {
        true => say("all is well"),
        false => {
            Err(CliError::Failure { words: complaints.join("; "), remedy: Remedy::CallOperator })
        }
    }
}
