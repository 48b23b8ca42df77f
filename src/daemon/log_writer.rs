//! The log on standard error, with journald's priority prefixes if the journal reads it.
//!
//! `error` is an internal error, `warn` a problem outside the program, `info` one line a photo,
//! `debug` detail.

use std::ffi::OsStr;
use std::os::fd::AsFd;
use std::sync::OnceLock;

use log::{Level, LevelFilter, Log, Metadata, Record};

/// Starts logging through `write`, which writes a line to standard error. `journal_stream` is the
/// value of the environment variable `JOURNAL_STREAM`. A second call has no effect.
pub fn start(level: LevelFilter, journal_stream: Option<&OsStr>, write: fn(&str)) {
    static WRITER: OnceLock<LogWriter> = OnceLock::new();
    let is_journal = is_journal(std::io::stderr(), journal_stream);
    let writer = WRITER.get_or_init(|| LogWriter { is_journal, write });
    if log::set_logger(writer).is_ok() {
        log::set_max_level(level);
    }
}

/// Whether `stream` is the journal's: `JOURNAL_STREAM` holds its device and inode
/// (systemd.exec(5)). The stream may have been redirected since.
fn is_journal(stream: impl AsFd, journal_stream: Option<&OsStr>) -> bool {
    let named = journal_stream.and_then(|words| words.to_str()?.split_once(':'));
    let Some((device, inode)) = named else { return false };
    rustix::fs::fstat(stream)
        .is_ok_and(|found| device.parse() == Ok(found.st_dev) && inode.parse() == Ok(found.st_ino))
}

struct LogWriter {
    is_journal: bool,
    write: fn(&str),
}

impl Log for LogWriter {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("relens")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            (self.write)(&line(record.level(), &record.args().to_string(), self.is_journal));
        }
    }

    fn flush(&self) {}
}

/// Formats a line. Control characters, which a photo's name may hold, are replaced.
fn line(level: Level, message: &str, is_journal: bool) -> String {
    let safe: String =
        message.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    // sd-daemon(3): SD_ERR 3, SD_WARNING 4, SD_INFO 6, SD_DEBUG 7.
    let (priority, plain) = match level {
        Level::Error => (3, "error: "),
        Level::Warn => (4, "warning: "),
        Level::Info => (6, ""),
        Level::Debug | Level::Trace => (7, "  "),
    };
    if is_journal { format!("<{priority}>{safe}") } else { format!("{plain}{safe}") }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use super::*;

    #[test]
    fn lines_have_journald_priorities_and_names_cannot_forge_them() {
        assert_eq!(line(Level::Info, "a.jpg restored", true), "<6>a.jpg restored");
        assert_eq!(line(Level::Warn, "disk full", false), "warning: disk full");
        assert_eq!(line(Level::Error, "a\n<3>b", true), "<3>a\u{fffd}<3>b");
    }

    #[test]
    fn only_the_stream_named_by_the_environment_is_the_journal() {
        let (stream, other) = (tempfile::tempfile().unwrap(), tempfile::tempfile().unwrap());
        let about = stream.metadata().unwrap();
        let named = format!("{}:{}", about.dev(), about.ino());
        let named = Some(OsStr::new(&named));
        assert!(is_journal(&stream, named));
        assert!(!is_journal(&other, named), "redirected to a file");
        for words in [None, Some("9:"), Some("elsewhere")] {
            assert!(!is_journal(&stream, words.map(OsStr::new)), "{words:?}");
        }
    }
}
