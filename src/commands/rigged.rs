//! A rig file made into something that restores, photographs, calibrates: the seam to the
//! machinery.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use relens::calibration::{Calibration, store};
use relens::config::{Curve, Method, OperatingPoint, Rig};
use relens::daemon::Restorer;
use relens::daemon::on_rig::{self, OnRig};
use relens::evaluate;
use relens::evaluate::chart::Chart;
use relens::evaluate::operating_point;
use relens::evaluate::test_rig::{Score, TestRig};
use relens::frame::{Frame, Work};
#[cfg(feature = "hardware")]
use relens::kiosk::screen::{Screen, draw};
use relens::measurement;
use relens::picture::{Format, Layout, Manner, encode};
use relens::pipeline::{Bench, Interruption};
use relens::remedy::Remedy;
use relens::rig::Panel;
use relens::rig::exposure::Rig as Devices;
use relens::rig::simulated;

use super::arguments::Charted;
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
    let stopwatch = Box::new(move || begun.elapsed().as_secs_f64());
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
    let mut stand = TestRig::on(rig.clone(), devices, calibration, super::clock::seconds)
        .map_err(|e| CliError::of(&e))?;
    let (mut done, total) = (0, operating_point::restorations(rig, wanted));
    let chosen = operating_point::choose(&mut stand, wanted, &mut |score| {
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
    relens::daemon::operating_point::save(kept, rig, &chosen).map_err(|e| CliError::of(&e))?;
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

/// Pixels of a PNG for a unit of a drawing: fine enough for print.
const PIXELS_A_UNIT: f64 = 2.0;

/// `relens chart`.
///
/// # Errors
/// When the rig cannot be opened, or the tables cannot be written.
pub(super) fn chart(
    rig: &Rig,
    out: &Path,
    quick: bool,
    what: Charted,
    peers: Option<&Path>,
    folder: &Path,
) -> Result<(), CliError> {
    if rig.simulation().is_none() && (what != Charted::Trade || peers.is_some()) {
        return Err(CliError::Usage(format!(
            "found the rig {}, made of devices, allowed there is the chart of speed against \
             accuracy alone: lenses and \
             faults cannot be changed on it",
            rig.name
        )));
    }
    let grey_light =
        matches!(what, Charted::Figures | Charted::Captures | Charted::Regimes) || peers.is_some();
    if grey_light && rig.photo.curve != Curve::Linear {
        let found = &rig.name;
        return Err(CliError::Usage(format!(
            "figures, regimes and peers are for rigs with linear photos, found {found}, allowed \
             for instance study.toml"
        )));
    }
    let read = |path: &Path| {
        let unreadable = |e| CliError::Usage(format!("cannot read {}: {e}", path.display()));
        std::fs::read_to_string(path).map_err(unreadable)
    };
    let rows = peers.map(read).transpose()?;
    std::fs::create_dir_all(out).map_err(|e| CliError::writing(out, &e))?;
    let mut each = |score: &Score| {
        let (scene, method) = (score.scene.name(), &score.method);
        log::info!("{scene} {method}: SSIM {:.4}, PSNR {:.2} dB", score.ssim, score.psnr_db);
    };
    let clock = super::clock::seconds;
    let made = match what {
        Charted::Trade if rig.simulation().is_none() => {
            let calibration =
                store::load(&slots(folder), rig.identity).map_err(|e| CliError::of(&e))?;
            TestRig::on(rig.clone(), open(rig)?, calibration, clock)
                .and_then(|stand| evaluate::chart::trade_on(stand, quick, &mut each))
        }
        Charted::Trade => evaluate::chart::trade(rig, quick, rows.as_deref(), clock, &mut each),
        Charted::Conditions => evaluate::chart::conditions(rig, quick, clock, &mut each),
        Charted::Stability => evaluate::stability::chart(rig, quick, clock, &mut |run| {
            let ((fault, unit), method) = (run.fault.name(), run.contestant.name());
            let gain = run.ssim - run.photo_ssim;
            let noticed = if run.verdict.noticed() { ", noticed" } else { "" };
            log::info!(
                "{fault} {} {unit}, {method}, {}: {gain:+.4}{noticed}",
                run.strength,
                run.view.name()
            );
        }),
        Charted::Regimes => evaluate::chart::regimes(rig, clock, &mut |regime, score| {
            let (scene, method, captures) =
                (score.scene.name(), &score.method, score.restored.captures);
            log::info!(
                "{}: {scene} {method}, {captures} captures: {:.2} dB",
                regime.name(),
                score.psnr_db
            );
        }),
        Charted::Sizes => evaluate::chart::sizes(rig, clock, &mut each),
        Charted::Figures => return figures(rig, out),
        Charted::Ladder => evaluate::ladder::chart(rig, clock, &mut |climb| {
            log::info!("{}: rung {}, SSIM {:.4}", climb.name, climb.taken, climb.delivered_ssim);
        }),
        Charted::Captures => evaluate::chart::captures(rig, clock),
    };
    let made = made.map_err(|e| CliError::of(&e))?;
    write_chart(&made, out)?;
    made.tables.iter().try_for_each(|(_, table)| say(&table.markdown()))?;
    say(&format!("written to {}", out.display()))
}

/// The paper's figures, each written as soon as it is measured; one that fails is left out, told,
/// and makes the command fail in the end.
fn figures(rig: &Rig, out: &Path) -> Result<(), CliError> {
    let (mut made, mut failed) = (Vec::new(), None);
    for (name, measure) in evaluate::figures::ALL {
        log::info!("{name}");
        match measure(rig, super::clock::seconds) {
            Ok(figure) => {
                write_chart(&evaluate::chart::figure(&figure), out)?;
                say(&format!(
                    "Figure {}. {} {}\n",
                    figure.number,
                    figure.agreement.words(),
                    figure.text
                ))?;
                made.push(figure);
            }
            Err(error) => {
                log::warn!("{name}: {}", relens::remedy::full_message(&error));
                failed = failed.or(Some(CliError::of(&error)));
            }
        }
    }
    let command = format!("relens chart --rig {}.toml --figures --out DIR", rig.name);
    let page = evaluate::figures::page(&made, &rig.name, &command);
    let path = out.join("README.md");
    std::fs::write(&path, page).map_err(|e| CliError::writing(&path, &e))?;
    say(&format!("written to {}", out.display()))?;
    failed.map_or(Ok(()), Err)
}

/// Writes all that a chart is made of into the folder `out`.
fn write_chart(made: &Chart, out: &Path) -> Result<(), CliError> {
    let write = |name: String, bytes: &[u8]| {
        let path = out.join(name);
        std::fs::write(&path, bytes).map_err(|e| CliError::writing(&path, &e))
    };
    for (name, table) in &made.tables {
        write(format!("{name}.md"), table.markdown().as_bytes())?;
        write(format!("{name}.csv"), table.csv().as_bytes())?;
    }
    for (name, bytes) in &made.files {
        write(name.clone(), bytes)?;
    }
    let plain = Manner::plain(Format::Png, 8, Curve::Linear);
    for (name, drawing) in &made.drawings {
        write(format!("{name}.svg"), drawing.svg().as_bytes())?;
        let pixels = drawing.pixels(PIXELS_A_UNIT);
        write(
            format!("{name}.png"),
            &encode(name, &pixels, &plain, false).map_err(|e| CliError::of(&e))?,
        )?;
    }
    let manner = Manner { layout: Layout::Grey, ..plain };
    for (name, plane) in &made.pictures {
        let picture: Frame<Work> = Frame::from_fn(|_| plane.clone());
        write(
            format!("{name}.png"),
            &encode(name, &picture, &manner, true).map_err(|e| CliError::of(&e))?,
        )?;
    }
    Ok(())
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
            let bench = Bench::new(rig, &calibration).map_err(|e| CliError::of(&e))?;
            match bench.check_backward(&mut devices, rig, &super::clock::seconds) {
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
    match relens::daemon::operating_point::load(&slots(folder), rig) {
        Ok(chosen) => {
            chosen.map_or(Ok(()), |chosen| say(&format!("{:<28}{chosen}", "operating point")))?
        }
        Err(reason) => {
            complaints.push(format!("no operating point: {reason}; run `relens calibrate`"))
        }
    }
    match complaints.is_empty() {
        true => say("all is well"),
        false => {
            Err(CliError::Failure { words: complaints.join("; "), remedy: Remedy::CallOperator })
        }
    }
}
