//! The hours of the night by the clock on the wall.

use jiff::civil::Time;
use jiff::tz::TimeZone;
use jiff::{Timestamp, ToSpan, Zoned};

use crate::config::{self, Nights};

const DAY_S: f64 = 86_400.0;

/// Days that are looked back for whole windows: photos that wait for longer are spoken of as
/// waiting for this long.
const DAYS_MAX: i64 = 400;

/// Hours in a time zone; through daylight saving they are what the clock on the wall says.
#[derive(Debug, Clone)]
pub struct Window {
    minutes: config::NightMinutes,
    zone: TimeZone,
    zone_name: String,
}

/// Where a moment lies.
#[derive(Debug, Clone, PartialEq)]
pub enum Hours {
    /// Inside, for so many seconds more; `None` for always.
    Open {
        /// Seconds until the window closes.
        left_s: Option<f64>,
    },
    /// Outside.
    Closed {
        /// Seconds until it opens.
        opens_in_s: f64,
        /// In words: "the night begins at 22:00 (Europe/Vienna)".
        words: String,
    },
}

impl Window {
    /// The window of a rig file; `None` for one that its check would have refused.
    pub fn new(nights: &Nights) -> Option<Window> {
        let zone = TimeZone::get(&nights.time_zone).ok()?;
        Some(Window { minutes: nights.minutes()?, zone, zone_name: nights.time_zone.clone() })
    }

    /// Where the moment `unix_s`, seconds since 1970 UTC, lies.
    pub fn at(&self, unix_s: f64) -> Hours {
        let Some((from, to)) = self.minutes else { return Hours::Open { left_s: None } };
        let Ok(stamp) = Timestamp::from_millisecond((unix_s * 1e3) as i64) else {
            return self.closed(86_400.0, from);
        };
        let now = stamp.to_zoned(self.zone.clone());
        // Tonight's opening and closing, and those of the days around: whatever daylight saving
        // does to them.
        let each = [-1i64, 0, 1, 2].into_iter().filter_map(|day| {
            let begins = self.on_wall(&now, day, from)?;
            let ends = self.on_wall(&now, day + i64::from(to <= from), to)?;
            Some((begins, ends))
        });
        let mut opens_in_s = f64::INFINITY;
        for (begins, ends) in each {
            if (begins..ends).contains(&unix_s) {
                return Hours::Open { left_s: Some(ends - unix_s) };
            }
            if begins > unix_s {
                opens_in_s = opens_in_s.min(begins - unix_s);
            }
        }
        self.closed(opens_in_s.min(2.0 * 86_400.0), from)
    }

    /// How many whole windows lie between two moments, seconds since 1970 UTC, and where the last
    /// one begins and ends; `None` when none does. A window that is always open counts by days of
    /// 24 hours.
    pub fn whole_between(&self, from_unix_s: f64, to_unix_s: f64) -> Option<(usize, (f64, f64))> {
        let Some((from, to)) = self.minutes else {
            let days = ((to_unix_s - from_unix_s) / DAY_S).floor();
            let last = from_unix_s + days * DAY_S;
            return (days >= 1.0).then_some((days as usize, (last - DAY_S, last)));
        };
        let now =
            Timestamp::from_millisecond((to_unix_s * 1e3) as i64).ok()?.to_zoned(self.zone.clone());
        let mut found = None;
        let mut nights = 0;
        for day in (-DAYS_MAX..=0).rev() {
            let begins = self.on_wall(&now, day, from)?;
            let ends = self.on_wall(&now, day + i64::from(to <= from), to)?;
            if begins < from_unix_s {
                break;
            }
            if ends <= to_unix_s {
                nights += 1;
                found = found.or(Some((begins, ends)));
            }
        }
        found.map(|last| (nights, last))
    }

    /// How long the window lasts at most, seconds; daylight saving may add an hour. Each day more
    /// holds a whole one.
    pub fn longest_s(&self) -> f64 {
        let minutes = self.minutes.map_or(0, |(from, to)| (1440 + to - from) % 1440);
        f64::from(minutes + 60) * 60.0
    }

    /// The moment `unix_s` in words: date, time of day and zone.
    pub fn on_the_wall(&self, unix_s: f64) -> String {
        match Timestamp::from_millisecond((unix_s * 1e3) as i64) {
            Ok(stamp) => {
                let zoned = stamp.to_zoned(self.zone.clone());
                format!("{} ({})", zoned.strftime("%Y-%m-%d %H:%M"), self.zone_name)
            }
            Err(_) => "a time beyond all calendars".to_owned(),
        }
    }

    fn closed(&self, opens_in_s: f64, from: u16) -> Hours {
        let words =
            format!("the night begins at {:02}:{:02} ({})", from / 60, from % 60, self.zone_name);
        Hours::Closed { opens_in_s, words }
    }

    /// The moment at which the wall's clock of the day `days` after that of `now` says `minute`. A
    /// time that daylight saving skips is the one as long after midnight; one that comes twice is
    /// its first coming.
    fn on_wall(&self, now: &Zoned, days: i64, minute: u16) -> Option<f64> {
        let date = now.date().checked_add(days.days()).ok()?;
        let time = Time::new((minute / 60) as i8, (minute % 60) as i8, 0, 0).ok()?;
        let zoned = date.to_datetime(time).to_zoned(self.zone.clone()).ok()?;
        Some(zoned.timestamp().as_millisecond() as f64 / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ClockSource;

    fn window(hours: &str, zone: &str) -> Window {
        Window::new(&Nights {
            window: hours.into(),
            time_zone: zone.into(),
            clock: ClockSource::Network,
            pilot_every_photos: 1,
            warm_up_max_min: 0.0,
            recalibrate: true,
            shift_max_px: 1.0,
            gain_max_percent: 1.0,
            offset_max_levels: 1.0,
            noise_max_ratio: 1.0,
        })
        .unwrap()
    }

    fn unix(text: &str) -> f64 {
        text.parse::<Timestamp>().unwrap().as_millisecond() as f64 / 1e3
    }

    /// Hours the window is open between two moments, minute by minute.
    fn open_hours(window: &Window, from: &str, to: &str) -> f64 {
        let (from, to) = (unix(from), unix(to));
        let minutes = ((to - from) / 60.0) as usize;
        let open = |n: &usize| matches!(window.at(from + 60.0 * *n as f64), Hours::Open { .. });
        (0..minutes).filter(open).count() as f64 / 60.0
    }

    #[test]
    fn an_ordinary_night_over_midnight() {
        let vienna = window("22:00-06:00", "Europe/Vienna");
        assert_eq!(
            vienna.at(unix("2026-01-10T20:59:00Z")),
            Hours::Closed {
                opens_in_s: 60.0,
                words: "the night begins at 22:00 (Europe/Vienna)".into()
            }
        );
        assert_eq!(
            vienna.at(unix("2026-01-10T21:00:00Z")),
            Hours::Open { left_s: Some(8.0 * 3600.0) }
        );
        assert_eq!(vienna.at(unix("2026-01-11T04:59:00Z")), Hours::Open { left_s: Some(60.0) });
        assert!(matches!(vienna.at(unix("2026-01-11T05:00:00Z")), Hours::Closed { .. }));
    }

    #[test]
    fn the_night_the_clocks_change_is_an_hour_longer_or_shorter_and_ends_by_the_wall() {
        let vienna = window("22:00-06:00", "Europe/Vienna");
        assert_eq!(open_hours(&vienna, "2026-03-28T12:00:00Z", "2026-03-29T12:00:00Z"), 7.0);
        assert_eq!(open_hours(&vienna, "2026-10-24T12:00:00Z", "2026-10-25T12:00:00Z"), 9.0);
        assert!(
            matches!(vienna.at(unix("2026-03-29T03:59:00Z")), Hours::Open { .. }),
            "05:59 by the wall"
        );
        assert!(matches!(vienna.at(unix("2026-03-29T04:00:00Z")), Hours::Closed { .. }));
    }

    #[test]
    fn an_hour_that_is_skipped_or_comes_twice_is_no_trouble() {
        // 02:00 to 03:00 does not exist on the 29th of March and comes twice on the 25th of
        // October.
        let hour = window("02:15-02:45", "Europe/Vienna");
        assert!(open_hours(&hour, "2026-03-28T12:00:00Z", "2026-03-29T12:00:00Z") <= 0.5);
        assert_eq!(open_hours(&hour, "2026-10-24T12:00:00Z", "2026-10-25T12:00:00Z"), 0.5);
        assert_eq!(open_hours(&hour, "2026-06-01T12:00:00Z", "2026-06-02T12:00:00Z"), 0.5);
    }

    #[test]
    fn whole_windows_are_counted_and_the_last_is_named() {
        let vienna = window("22:00-06:00", "Europe/Vienna");
        let between = |from: &str, to: &str| vienna.whole_between(unix(from), unix(to));
        let night = (unix("2026-01-10T21:00:00Z"), unix("2026-01-11T05:00:00Z"));
        assert_eq!(between("2026-01-10T20:00:00Z", "2026-01-11T05:00:00Z"), Some((1, night)));
        assert_eq!(between("2026-01-10T20:00:00Z", "2026-01-11T04:59:00Z"), None, "it is not over");
        assert_eq!(between("2026-01-10T21:01:00Z", "2026-01-11T20:59:00Z"), None, "it had begun");
        assert_eq!(between("2026-01-08T12:00:00Z", "2026-01-11T12:00:00Z"), Some((3, night)));
        assert_eq!(between("2026-01-11T12:00:00Z", "2026-01-10T12:00:00Z"), None);
        // Through the night in which the clocks change.
        assert_eq!(
            between("2026-03-28T12:00:00Z", "2026-03-29T04:00:00Z").map(|(n, _)| n),
            Some(1)
        );
        let always = window("always", "UTC");
        assert_eq!(always.whole_between(0.0, 86_399.0), None);
        assert_eq!(always.whole_between(0.0, 200_000.0), Some((2, (86_400.0, 172_800.0))));
        assert_eq!(vienna.on_the_wall(night.1), "2026-01-11 06:00 (Europe/Vienna)");
        assert_eq!([vienna.longest_s(), always.longest_s()], [9.0 * 3600.0, 3600.0]);
    }

    #[test]
    fn a_day_window_a_half_hour_zone_and_always() {
        let day = window("09:00-17:30", "Asia/Kolkata");
        assert_eq!(open_hours(&day, "2026-01-10T00:00:00Z", "2026-01-11T00:00:00Z"), 8.5);
        assert!(
            matches!(day.at(unix("2026-01-10T03:30:00Z")), Hours::Open { .. }),
            "09:00 in Kolkata"
        );
        assert_eq!(window("always", "UTC").at(0.0), Hours::Open { left_s: None });
    }

    #[test]
    fn every_closed_moment_names_when_it_opens() {
        let vienna = window("22:00-06:00", "Europe/Vienna");
        let mut at = unix("2026-03-27T00:00:00Z");
        while at < unix("2026-03-31T00:00:00Z") {
            if let Hours::Closed { opens_in_s, .. } = vienna.at(at) {
                assert!(matches!(vienna.at(at + opens_in_s), Hours::Open { .. }));
                assert!(matches!(vienna.at(at + opens_in_s - 1.0), Hours::Closed { .. }));
            }
            at += 977.0;
        }
    }
}
