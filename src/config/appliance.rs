//! The tables of an unattended box: `[run]`, `[nights]`, `[disk]`. Each may be left out.

use super::keys::{table, words};

table! {
    /// Start of a restoration.
    @[derive(Copy)]
    pub struct RunTable {
        /// Event that starts a restoration.
        mode: Mode, Word(Mode::WORDS), Means("\"folder\"");
        /// Delay from press to shutter, where the box takes the photo: vibrations decay, and a
        /// second press cancels. The default is a guess.
        countdown_s: f64, Number(0.0, 60.0), Means("2.0");
        /// Treatment of photos with more pixels than `[photo]`.
        larger_photos: LargerPhotos, Word(LargerPhotos::WORDS), Means("\"shrink\"");
    }
}

words! {
    /// Treatment of photos with more pixels than the rig's.
    pub enum LargerPhotos {
        /// The result has the rig's size, as the log and the report state first.
        Shrink = "shrink",
        /// The photo is not restored.
        Refuse = "refuse",
    }
}

words! {
    /// Event that starts a restoration.
    pub enum Mode {
        /// A photo arrives in the inbox.
        Folder = "folder",
        /// The button is pressed; photos wait for it.
        Button = "button",
        /// The button takes a photo; restorations wait until the panel is before the lens.
        Shoot = "shoot",
    }
}

table! {
    /// Restoration at night and drift monitoring.
    pub struct Nights {
        /// Local times between which photos are restored; `always` only monitors drift.
        window: String, Such("two different times as 22:00-06:00, or always", |value| {
            value.as_str().is_some_and(|window| minutes(window).is_some())
        }), Never;
        /// Time zone, such as `Europe/Vienna`.
        time_zone: String, Such("a name of the time zone database", |value| {
            value.as_str().is_some_and(|zone| jiff::tz::TimeZone::get(zone).is_ok())
        }), Never;
        /// Source of the box's calendar time.
        clock: ClockSource, Word(ClockSource::WORDS), Never;
        /// Photos between two pilot pictures. One is taken before the first and one after the last
        /// photo, too.
        pilot_every_photos: usize, Whole(1, 100_000), Means("50");
        /// Whether a drifted rig is calibrated again and photos since the last good pilot are
        /// restored again. Otherwise the night stops.
        recalibrate: bool, Truth, Never;
    }
}

words! {
    /// Source of the box's calendar time.
    pub enum ClockSource {
        /// The network, as the kernel reports: for boards without a battery clock.
        Network = "network",
        /// A battery clock; a time before one already seen is rejected unless it comes from the
        /// network.
        Battery = "battery",
    }
}

table! {
    /// Disk space.
    @[derive(Copy)]
    pub struct DiskTable {
        /// Space kept free on the disk of the results, MiB; photos wait while there is less. The
        /// default is a guess at what an operator needs to log in.
        floor_mib: f64, Number(0.0, 1e6), Means("256.0");
    }
}

/// First and last minute of the night, counted from midnight; `None` for `always`.
pub type NightMinutes = Option<(u16, u16)>;

impl Nights {
    /// The window in minutes from midnight; `None` if it cannot be parsed.
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
    use crate::config::{Mode, RigFile, parse};

    fn small_and(tables: &str) -> Result<RigFile, String> {
        let text = format!("{}\n{tables}", include_str!("../../rig-config/small.toml"));
        parse(&text, "small.toml").map_err(|e| e.to_string())
    }

    const NIGHTS: &str = "[nights]\nwindow = \"22:00-06:00\"\ntime-zone = \"Europe/Vienna\"\n\
                          clock = \"network\"\npilot-every-photos = 50\nrecalibrate = true\n";

    #[test]
    fn by_default_photos_are_restored_on_arrival() {
        let rig = small_and("").unwrap();
        assert_eq!((rig.run.mode, rig.nights), (Mode::Folder, None));
    }

    #[test]
    fn nights_are_not_part_of_a_rig_s_identity() {
        let rig = small_and(NIGHTS).unwrap();
        assert_eq!(rig.identity, small_and("").unwrap().identity, "calibrations remain valid");
        assert_eq!(rig.nights.unwrap().minutes(), Some(Some((22 * 60, 6 * 60))));
        let always = small_and(&NIGHTS.replace("22:00-06:00", "always")).unwrap();
        assert_eq!(always.nights.unwrap().minutes(), Some(None));
    }

    #[test]
    fn errors_name_the_allowed_values() {
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
        let fixed = small_and("[run]\nlong-press-ms = 5.0\n").unwrap_err();
        assert!(fixed.contains("unknown key `long-press-ms`"), "{fixed}");
    }

    #[test]
    fn the_operator_s_page_shows_valid_tables() {
        let page = include_str!("../../systemd/README.md");
        let tables =
            page.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let rig = small_and(tables).unwrap();
        assert_eq!(
            (rig.run.mode, rig.nights.is_some(), rig.disk.floor_mib),
            (Mode::Button, true, 256.0)
        );
    }
}
