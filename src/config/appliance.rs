//! The tables of a box that is left alone: `[run]`, `[nights]`, `[disk]`, `[keep]`, `[share]`. Each
//! may be left out; in one that is there, every number is.

use serde::{Deserialize, Serialize};

use super::ConfigError;
use super::rules::Rules;

/// `[run]`: who says when photos are restored.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Run {
    /// The folder or the button.
    pub mode: Mode,
    /// How long the button is held to give a job up; in maintenance, to calibrate.
    pub long_press_ms: f64,
}

impl Default for Run {
    /// Photos are taken as they come.
    fn default() -> Run {
        Run { mode: Mode::Folder, long_press_ms: 1500.0 }
    }
}

/// What starts a restoration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// A photo in the inbox.
    Folder,
    /// The button; photos wait for it.
    Button,
}

/// `[nights]`: photos are restored at night, and the rig's drift is watched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Nights {
    /// From when to when by the clock on the wall, `22:00-06:00`; `always` only watches the drift.
    pub window: String,
    /// Whose wall, by its name in the time zone database: `Europe/Vienna`.
    pub time_zone: String,
    /// What makes the box's calendar believable.
    pub clock: ClockSource,
    /// Photos between two pilot pictures.
    pub pilot_every_photos: usize,
    /// Longest time the rig is given to become steady.
    pub warm_up_max_min: f64,
    /// Whether the rig may be calibrated anew when it has drifted; else it is held.
    pub recalibrate: bool,
    /// Farthest the pilot may be displaced, sensor pixels.
    pub shift_max_px: f64,
    /// Farthest its brightness may be off, per cent.
    pub gain_max_percent: f64,
    /// Most light that may have come or gone, grey levels.
    pub offset_max_levels: f64,
    /// Most noise, as a multiple of the calibration's.
    pub noise_max_ratio: f64,
}

/// What makes the box's calendar believable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockSource {
    /// The kernel says that it was set by the network: boards without a battery clock.
    Network,
    /// A battery clock: any time not before one already seen.
    Battery,
}

/// `[disk]`: what is asked of the disk.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Disk {
    /// Left free on the disk of the results, MiB: photos wait while there is less.
    pub floor_mib: f64,
}

impl Default for Disk {
    /// A quarter of a gigabyte, so that whoever is to help can still log in. Guess.
    fn default() -> Disk {
        Disk { floor_mib: 256.0 }
    }
}

/// `[keep]`: how long results and originals are kept, and how much of them; `inf` is for ever. What
/// waits, is under way or could not be restored is kept whatever is written here.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Keep {
    /// A result is removed from the outbox when it is older, days.
    pub results_days_max: f64,
    /// The oldest results are removed while all of them together are larger, MiB.
    pub results_mib_max: f64,
    /// An original is removed from `done` when it has been there for longer, days.
    pub originals_days_max: f64,
    /// The oldest originals are removed while all of them together are larger, MiB.
    pub originals_mib_max: f64,
}

impl Default for Keep {
    /// Everything, for ever.
    fn default() -> Keep {
        let [results_days_max, results_mib_max, originals_days_max, originals_mib_max] =
            [f64::INFINITY; 4];
        Keep { results_days_max, results_mib_max, originals_days_max, originals_mib_max }
    }
}

/// `[share]`: boxes that work on one set of folders (`relens run --box NAME`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Share {
    /// A box that did not move for this long has lost its photos to the others. The same on all of
    /// them, and longer than any restoration is silent.
    pub lease_s: f64,
}

impl Default for Share {
    /// Five minutes: a guess.
    fn default() -> Share {
        Share { lease_s: 300.0 }
    }
}

/// The night's first and last minute, counted from midnight; `None` for `always`.
pub type Window = Option<(u16, u16)>;

impl Nights {
    /// The window in minutes from midnight, which [`check_appliance`] has found readable.
    pub fn minutes(&self) -> Option<Window> {
        if self.window == "always" {
            return Some(None);
        }
        let (from, to) = self.window.split_once(['-', '–'])?;
        let minute = |text: &str| {
            let (hour, minute) = text.trim().split_once(':')?;
            let (hour, minute) = (hour.parse::<u16>().ok()?, minute.parse::<u16>().ok()?);
            (hour < 24 && minute < 60).then_some(hour * 60 + minute)
        };
        let window = (minute(from)?, minute(to)?);
        (window.0 != window.1).then_some(Some(window))
    }
}

/// The rules of these tables.
pub(super) fn check_appliance(
    rules: &Rules,
    run: Run,
    nights: Option<&Nights>,
    disk: Disk,
    keep: Keep,
    share: Share,
) -> Result<(), ConfigError> {
    rules.within("disk.floor-mib", disk.floor_mib, 0.0, 1e6)?;
    rules.within("run.long-press-ms", run.long_press_ms, 300.0, 10_000.0)?;
    // A slow network may keep a lease from being changed for some seconds.
    rules.within("share.lease-s", share.lease_s, 30.0, 86_400.0)?;
    // Less than a day, or than a handful of photos, would take results away from whoever was about
    // to fetch them.
    rules.within("keep.results-days-max", keep.results_days_max, 1.0, f64::INFINITY)?;
    rules.within("keep.results-mib-max", keep.results_mib_max, 100.0, f64::INFINITY)?;
    rules.within("keep.originals-days-max", keep.originals_days_max, 1.0, f64::INFINITY)?;
    rules.within("keep.originals-mib-max", keep.originals_mib_max, 100.0, f64::INFINITY)?;
    let Some(nights) = nights else { return Ok(()) };
    let readable = nights.minutes().is_some();
    rules.hold(
        readable,
        "nights.window",
        &nights.window,
        "two different times as 22:00-06:00, or always",
    )?;
    let known = jiff::tz::TimeZone::get(&nights.time_zone).is_ok();
    rules.hold(known, "nights.time-zone", &nights.time_zone, "a name of the time zone database")?;
    let every = nights.pilot_every_photos;
    rules.hold(
        (1..=100_000).contains(&every),
        "nights.pilot-every-photos",
        every,
        "1 to 100000",
    )?;
    rules.within("nights.warm-up-max-min", nights.warm_up_max_min, 0.0, 600.0)?;
    rules.within("nights.shift-max-px", nights.shift_max_px, 0.01, 10.0)?;
    rules.within("nights.gain-max-percent", nights.gain_max_percent, 0.01, 100.0)?;
    rules.within("nights.offset-max-levels", nights.offset_max_levels, 0.01, 255.0)?;
    rules.within("nights.noise-max-ratio", nights.noise_max_ratio, 1.0, 100.0)
}

#[cfg(test)]
mod tests {
    use crate::config::{Keep, Mode, Rig, parse};

    fn small_and(tables: &str) -> Result<Rig, String> {
        let text = format!("{}\n{tables}", include_str!("../../rig-config/small.toml"));
        parse(&text, "small.toml", std::path::Path::new("")).map_err(|e| e.to_string())
    }

    const NIGHTS: &str = "[nights]\nwindow = \"22:00-06:00\"\ntime-zone = \
     \"Europe/Vienna\"\nclock = \"network\"\n\
        pilot-every-photos = 50\nwarm-up-max-min = 60.0\nrecalibrate = true\nshift-max-px = 0.25\n\
        gain-max-percent = 3.0\noffset-max-levels = 1.0\nnoise-max-ratio = 1.5\n";

    #[test]
    fn a_rig_file_without_them_takes_photos_as_they_come() {
        let rig = small_and("").unwrap();
        assert_eq!((rig.run.mode, rig.nights, rig.keep), (Mode::Folder, None, Keep::default()));
        assert_eq!(rig.share.lease_s, 300.0);
    }

    #[test]
    fn what_is_kept_has_a_limit_or_none() {
        let keep = "[keep]\nresults-days-max = 30.0\nresults-mib-max = inf\noriginals-days-max = \
         90.0\n\
            originals-mib-max = 20000.0\n";
        let rig = small_and(keep).unwrap();
        assert_eq!((rig.keep.results_days_max, rig.keep.results_mib_max), (30.0, f64::INFINITY));
        assert_eq!(rig.identity, small_and("").unwrap().identity, "the calibration stays good");
        for (from, to, wanted) in [
            ("= 30.0", "= 0.5", "allowed 1 to inf"),
            ("= 20000.0", "= nan", "allowed 100 to inf"),
            ("originals-mib-max = 20000.0\n", "", "missing key `originals-mib-max`"),
        ] {
            let complaint = small_and(&keep.replace(from, to)).unwrap_err();
            assert!(complaint.contains(wanted), "{complaint}");
        }
    }

    #[test]
    fn nights_are_read_and_do_not_make_it_another_rig() {
        let rig = small_and(NIGHTS).unwrap();
        assert_eq!(rig.identity, small_and("").unwrap().identity, "the calibration stays good");
        assert_eq!(rig.nights.unwrap().minutes(), Some(Some((22 * 60, 6 * 60))));
        let always = small_and(&NIGHTS.replace("22:00-06:00", "always")).unwrap();
        assert_eq!(always.nights.unwrap().minutes(), Some(None));
    }

    #[test]
    fn wrong_words_are_told_with_the_right_ones() {
        for (from, to, wanted) in [
            ("22:00-06:00", "22:00-25:00", "22:00-06:00, or always"),
            ("22:00-06:00", "22:00-22:00", "two different times"),
            ("Europe/Vienna", "Europe/Wien", "time zone database"),
            ("= 50", "= 0", "1 to 100000"),
            (
                "pilot-every-photos",
                "pilot-every-photo",
                "nearest known one is `pilot-every-photos`",
            ),
        ] {
            let complaint = small_and(&NIGHTS.replace(from, to)).unwrap_err();
            assert!(complaint.contains(wanted), "{complaint}");
        }
        assert!(
            small_and("[run]\nmode = \"button\"\nlong-press-ms = 5.0\n")
                .unwrap_err()
                .contains("300 to 10000")
        );
        assert!(small_and("[share]\nlease-s = 5.0\n").unwrap_err().contains("30 to 86400"));
    }

    #[test]
    fn the_readme_s_tables_are_read() {
        let readme = include_str!("../../README.md");
        let tables =
            readme.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let rig = small_and(tables).unwrap();
        assert_eq!(
            (rig.run.mode, rig.nights.is_some(), rig.disk.floor_mib),
            (Mode::Button, true, 256.0)
        );
        assert_eq!((rig.keep.results_days_max, rig.share.lease_s), (90.0, 300.0));
    }
}
