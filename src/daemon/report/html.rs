//! Text of the gallery's pages. File names and errors are escaped.

use jiff::Timestamp;

/// `text` escaped for HTML content and quoted attributes, control characters replaced.
pub(super) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars().map(harmless) {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
    }
    safe
}

/// Replaces characters that would disguise a name.
pub(super) fn harmless(c: char) -> char {
    match c {
        // Bidirectional overrides.
        '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => '\u{fffd}',
        c if c.is_control() => '\u{fffd}',
        c => c,
    }
}

/// HTML of a time in UTC, which the page's script converts to local time.
pub(super) fn moment(unix_s: u64) -> String {
    let stamp = i64::try_from(unix_s).ok().and_then(|s| Timestamp::from_second(s).ok());
    match stamp.filter(|_| unix_s > 0) {
        Some(stamp) => format!(
            "<time datetime=\"{stamp}\" data-unix=\"{unix_s}\">{}</time>",
            stamp.strftime("%Y-%m-%d %H:%M UTC")
        ),
        None => "at an unknown time".to_owned(),
    }
}

pub(super) fn span(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 119.5 => format!("{s:.0} s"),
        s if s < 7170.0 => format!("{:.0} min", s / 60.0),
        s => {
            let minutes = (s / 60.0).round();
            format!("{:.0} h {:02.0} min", (minutes / 60.0).floor(), minutes % 60.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_two_or_three_digits() {
        for (seconds, wanted) in
            [(4.31, "4.3 s"), (60.0, "60 s"), (720.0, "12 min"), (29_100.0, "8 h 05 min")]
        {
            assert_eq!(span(seconds), wanted);
        }
    }
}
