//! The tables of an unattended box: `[run]`, `[nights]`, `[disk]`, `[keep]`. Each may be left out.

use super::keys::{table, words};

table! {
    /// Who says when photos are restored.
    @[derive(Copy)]
    pub struct RunTable {
        /// The folder, the button, or the button of a box that takes its photos itself.
        mode: Mode, Word(Mode::WORDS), Means("\"folder\"");
        /// How long the button is held to give a job up; in maintenance, to calibrate. Held at
        /// start: maintenance.
        long_press_ms: f64, Number(300.0, 10_000.0), Means("1500.0");
        /// From the press to the shutter, where the box takes the photo: what the finger shook
        /// comes to rest, and a second press takes it back. The default is a guess.
        countdown_s: f64, Number(0.0, 60.0), Means("2.0");
        /// What becomes of a photo with more pixels than `[photo]` has.
        larger_photos: LargerPhotos, Word(LargerPhotos::WORDS), Means("\"shrink\"");
    }
}

words! {
    /// What becomes of a photo with more pixels than the rig's.
    pub enum LargerPhotos {
        /// Its result has the rig's pixels and no more, which log and report say first.
        Shrink = "shrink",
        /// It is not restored.
        Refuse = "refuse",
    }
}

words! {
    /// What starts a restoration.
    pub enum Mode {
        /// A photo in the inbox.
        Folder = "folder",
        /// The button; photos wait for it.
        Button = "button",
        /// The button takes a photo; it and those in the inbox wait for the panel before the lens.
        Shoot = "shoot",
    }
}

table! {
    /// Photos are restored at night, and the rig's drift is watched.
    pub struct Nights {
        /// From when to when by the clock on the wall; `always` only watches the drift.
        window: String, Such("two different times as 22:00-06:00, or always", |value| {
            value.as_str().is_some_and(|window| minutes(window).is_some())
        }), Never;
        /// Whose wall, such as `Europe/Vienna`.
        time_zone: String, Such("a name of the time zone database", |value| {
            value.as_str().is_some_and(|zone| jiff::tz::TimeZone::get(zone).is_ok())
        }), Never;
        /// What makes the box's calendar believable.
        clock: ClockSource, Word(ClockSource::WORDS), Never;
        /// Photos between two pilot pictures; there is one before and one after, too.
        pilot_every_photos: usize, Whole(1, 100_000), Means("50");
        /// Longest time the rig is given to become steady.
        warm_up_max_min: f64, Number(0.0, 600.0), Means("60.0");
        /// Whether a rig that has drifted may be calibrated anew, and what came since the last
        /// good pilot be restored anew. Else the night is held.
        recalibrate: bool, Truth, Never;
        /// Farthest the pilot may be displaced, sensor pixels.
        shift_max_px: f64, Number(0.01, 10.0), Means("0.25");
        /// Farthest its brightness may be off, per cent.
        gain_max_percent: f64, Number(0.01, 100.0), Means("3.0");
        /// Most light that may have come or gone, grey levels.
        offset_max_levels: f64, Number(0.01, 255.0), Means("1.0");
        /// Most noise, as a multiple of the calibration's.
        noise_max_ratio: f64, Number(1.0, 100.0), Means("1.5");
    }
}

words! {
    /// What makes the box's calendar believable.
    pub enum ClockSource {
        /// The kernel says that the network has set it: boards without a battery clock.
        Network = "network",
        /// A battery clock: any time not before one already seen.
        Battery = "battery",
    }
}

table! {
    /// What is asked of the disk.
    @[derive(Copy)]
    pub struct DiskTable {
        /// Left free on the disk of the results, MiB: photos wait while there is less. The default
        /// is a guess at what whoever is to help needs to log in.
        floor_mib: f64, Number(0.0, 1e6), Means("256.0");
    }
}

table! {
    /// How long results and originals are kept, and how much of them; `inf` is for ever. What
    /// waits, is under way or could not be restored is kept whatever is written here.
    @[derive(Copy)]
    pub struct Keep {
        // Less than a day, or than a handful of photos, would take results away from whoever was
        // about to fetch them.
        /// A result is removed from the outbox when it is older, days.
        results_days_max: f64, Number(1.0, f64::INFINITY), Never;
        /// The oldest results are removed while all of them together are larger, MiB.
        results_mib_max: f64, Number(100.0, f64::INFINITY), Never;
        /// An original is removed from `done` when it has been there for longer, days.
        originals_days_max: f64, Number(1.0, f64::INFINITY), Never;
        /// The oldest originals are removed while all of them together are larger, MiB.
        originals_mib_max: f64, Number(100.0, f64::INFINITY), Never;
    }
}

impl Default for Keep {
    /// Everything, for ever.
    fn default() -> Keep {
        let [results_days_max, results_mib_max, originals_days_max, originals_mib_max] =
            [f64::INFINITY; 4];
        Keep { results_days_max, results_mib_max, originals_days_max, originals_mib_max }
    }
}

/// The night's first and last minute, counted from midnight; `None` for `always`.
pub type NightMinutes = Option<(u16, u16)>;

impl Nights {
    /// The window in minutes from midnight, which was found readable when the file was read.
    pub fn minutes(&self) -> Option<NightMinutes> {
        minutes(&self.window)
    }
}

fn minutes(window: &str) -> Option<NightMinutes> {
    if window == "always" {
        return Some(None);
    }
    let (from, to) = window.split_once(['-', '–'])?;
    let minute = |text: &str| {
        let (hour, minute) = text.trim().split_once(':')?;
        let (hour, minute) = (hour.parse::<u16>().ok()?, minute.parse::<u16>().ok()?);
        (hour < 24 && minute < 60).then_some(hour * 60 + minute)
    };
    let window = (minute(from)?, minute(to)?);
    (window.0 != window.1).then_some(Some(window))
}

#[cfg(test)]
mod tests {
    use crate::config::{Keep, Mode, RigFile, parse};

    fn small_and(tables: &str) -> Result<RigFile, String> {
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
    }

    #[test]
    fn the_operator_s_page_has_tables_that_are_read() {
        let page = include_str!("../../systemd/README.md");
        let tables =
            page.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let rig = small_and(tables).unwrap();
        assert_eq!(
            (rig.run.mode, rig.nights.is_some(), rig.disk.floor_mib),
            (Mode::Button, true, 256.0)
        );
        assert_eq!(rig.keep.results_days_max, 90.0);
    }
}
