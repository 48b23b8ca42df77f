//! The log on standard error: journald's priorities before each line, plain words on a terminal.
//!
//! Levels are a promise: `error` is a bug of ours, `warn` is the world misbehaving, `info` is one
//! line a photo, `debug` may be hidden without loss.

use std::io::IsTerminal;
use std::sync::OnceLock;

use log::{Level, LevelFilter, Log, Metadata, Record};

/// Starts logging; `write` puts a line on standard error. A second call changes nothing.
pub fn start(level: LevelFilter, write: fn(&str)) {
    static WRITER: OnceLock<LogWriter> = OnceLock::new();
    let writer =
        WRITER.get_or_init(|| LogWriter { terminal: std::io::stderr().is_terminal(), write });
    if log::set_logger(writer).is_ok() {
        log::set_max_level(level);
    }
}

struct LogWriter {
    terminal: bool,
    write: fn(&str),
}

impl Log for LogWriter {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("relens")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            (self.write)(&line(record.level(), &record.args().to_string(), self.terminal));
        }
    }

    fn flush(&self) {}
}

/// One line. Control characters, which a photo's name may hold, are shown and not obeyed.
fn line(level: Level, message: &str, terminal: bool) -> String {
    let safe: String =
        message.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    match (terminal, level) {
        // sd-daemon(3): SD_ERR 3, SD_WARNING 4, SD_INFO 6, SD_DEBUG 7.
        (false, Level::Error) => format!("<3>{safe}"),
        (false, Level::Warn) => format!("<4>{safe}"),
        (false, Level::Info) => format!("<6>{safe}"),
        (false, _) => format!("<7>{safe}"),
        (true, Level::Info) => safe,
        (true, Level::Error) => format!("error: {safe}"),
        (true, Level::Warn) => format!("warning: {safe}"),
        (true, _) => format!("  {safe}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn journald_gets_its_priority_and_names_cannot_forge_lines() {
        assert_eq!(line(Level::Info, "a.jpg restored", false), "<6>a.jpg restored");
        assert_eq!(line(Level::Warn, "disk full", true), "warning: disk full");
        assert_eq!(line(Level::Error, "a\n<3>b", false), "<3>a\u{fffd}<3>b");
    }
}
