//! The hours of the night in local time.

use jiff::civil::Time;
use jiff::tz::TimeZone;
use jiff::{Timestamp, ToSpan, Zoned};

use crate::config::{self, Nights};

/// Hours in a time zone, which keep to local time through changes of daylight saving.
#[derive(Debug, Clone)]
pub struct Window {
    minutes: config::NightMinutes,
    zone: TimeZone,
    zone_name: String,
}

/// Position of a time relative to the window.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // Fields are described with their variants.
pub enum Hours {
    /// Inside.
    Open,
    /// Outside, with the seconds until it opens, and words such as "the night begins at 22:00
    /// (Europe/Vienna)".
    Closed { opens_in_s: f64, words: String },
}

impl Window {
    /// The window of `nights`; `None` if its hours or its time zone are invalid.
    pub fn new(nights: &Nights) -> Option<Window> {
        let zone = TimeZone::get(&nights.time_zone).ok()?;
        Some(Window { minutes: nights.minutes()?, zone, zone_name: nights.time_zone.clone() })
    }

    /// Position of the time `unix_s`, seconds since 1970 UTC.
    pub fn at(&self, unix_s: f64) -> Hours {
        let Some((from, to)) = self.minutes else { return Hours::Open };
        let Ok(stamp) = Timestamp::from_millisecond((unix_s * 1e3) as i64) else {
            return self.closed(86_400.0, from);
        };
        let now = stamp.to_zoned(self.zone.clone());
        // Tonight's window and those of the days around it.
        let each = [-1i64, 0, 1, 2].into_iter().filter_map(|day| {
            let begins = self.at_local_time(&now, day, from)?;
            let ends = self.at_local_time(&now, day + i64::from(to <= from), to)?;
            Some((begins, ends))
        });
        let mut opens_in_s = f64::INFINITY;
        for (begins, ends) in each {
            if (begins..ends).contains(&unix_s) {
                return Hours::Open;
            }
            if begins > unix_s {
                opens_in_s = opens_in_s.min(begins - unix_s);
            }
        }
        self.closed(opens_in_s.min(2.0 * 86_400.0), from)
    }

    fn closed(&self, opens_in_s: f64, from: u16) -> Hours {
        let words =
            format!("the night begins at {:02}:{:02} ({})", from / 60, from % 60, self.zone_name);
        Hours::Closed { opens_in_s, words }
    }

    /// Seconds since 1970 UTC of the local `minute` of the day that is `days` after `now`'s. A time
    /// that daylight saving skips is moved on by the gap; of a repeated time, the first is
    /// returned.
    fn at_local_time(&self, now: &Zoned, days: i64, minute: u16) -> Option<f64> {
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
            recalibrate: true,
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
        let open = |n: &usize| window.at(from + 60.0 * *n as f64) == Hours::Open;
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
        assert_eq!(vienna.at(unix("2026-01-10T21:00:00Z")), Hours::Open);
        assert_eq!(vienna.at(unix("2026-01-11T04:59:00Z")), Hours::Open);
        assert!(matches!(vienna.at(unix("2026-01-11T05:00:00Z")), Hours::Closed { .. }));
    }

    #[test]
    fn a_night_with_a_clock_change_ends_by_local_time() {
        let vienna = window("22:00-06:00", "Europe/Vienna");
        assert_eq!(open_hours(&vienna, "2026-03-28T12:00:00Z", "2026-03-29T12:00:00Z"), 7.0);
        assert_eq!(open_hours(&vienna, "2026-10-24T12:00:00Z", "2026-10-25T12:00:00Z"), 9.0);
        assert_eq!(vienna.at(unix("2026-03-29T03:59:00Z")), Hours::Open, "05:59 local time");
        assert!(matches!(vienna.at(unix("2026-03-29T04:00:00Z")), Hours::Closed { .. }));
    }

    #[test]
    fn a_skipped_or_repeated_hour_opens_the_window_at_most_once() {
        // 02:00 to 03:00 does not exist on the 29th of March and comes twice on the 25th of
        // October.
        let hour = window("02:15-02:45", "Europe/Vienna");
        assert!(open_hours(&hour, "2026-03-28T12:00:00Z", "2026-03-29T12:00:00Z") <= 0.5);
        assert_eq!(open_hours(&hour, "2026-10-24T12:00:00Z", "2026-10-25T12:00:00Z"), 0.5);
        assert_eq!(open_hours(&hour, "2026-06-01T12:00:00Z", "2026-06-02T12:00:00Z"), 0.5);
    }

    #[test]
    fn a_day_window_a_half_hour_zone_and_always() {
        let day = window("09:00-17:30", "Asia/Kolkata");
        assert_eq!(open_hours(&day, "2026-01-10T00:00:00Z", "2026-01-11T00:00:00Z"), 8.5);
        assert_eq!(day.at(unix("2026-01-10T03:30:00Z")), Hours::Open, "09:00 in Kolkata");
        assert_eq!(window("always", "UTC").at(0.0), Hours::Open);
    }

    #[test]
    fn every_closed_time_has_its_opening() {
        let vienna = window("22:00-06:00", "Europe/Vienna");
        let mut at = unix("2026-03-27T00:00:00Z");
        while at < unix("2026-03-31T00:00:00Z") {
            if let Hours::Closed { opens_in_s, .. } = vienna.at(at) {
                assert_eq!(vienna.at(at + opens_in_s), Hours::Open);
                assert!(matches!(vienna.at(at + opens_in_s - 1.0), Hours::Closed { .. }));
            }
            at += 977.0;
        }
    }
}
