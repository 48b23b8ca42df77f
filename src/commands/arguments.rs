//! The declaration of the command line, and messages on invalid ones.

use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, Parser, Subcommand};
use relens::config::edit_distance;

use super::align::AlignOptions;
use super::calibrate::CalibrateOptions;
use super::chart::ChartOptions;
use super::check::CheckOptions;
use super::demo::DemoOptions;
use super::manual::{CompletionsOptions, ManOptions};
use super::photograph::PhotographOptions;
use super::press::PressOptions;
use super::restore::RestoreOptions;
use super::run::RunOptions;
use super::screens::ScreensOptions;
use super::shoot::ShootOptions;
use super::status::StatusOptions;

/// The head of `relens help`.
fn long_about() -> String {
    let rigs: Vec<&str> = relens::config::built_in_names().collect();
    format!(
        "Makes cheap lenses take good photographs\n\n\
         relens shows candidate pictures on a panel, photographs them through the lens that took \
         the photo, and adjusts the candidate until its photograph matches the photo.\n\n\
         RIG.toml is a file, or one of the rigs that come with the program: {}.\n\n\
         Exit codes: 0 done; 1 some photos failed and are listed; 2 wrong use or rig file; 3 the \
         operator is needed.",
        rigs.join(", ")
    )
}

/// Makes cheap lenses take good photographs
#[derive(Debug, Parser)]
#[command(
    name = "relens",
    version,
    long_about = long_about(),
    arg_required_else_help = true,
    max_term_width = 100,
    after_help = "\
Examples:
  relens demo                             on a simulated rig; start here
  relens restore --rig RIG.toml IN.jpg -o OUT.jpg
  relens run --rig RIG.toml --folder DIR
  relens help restore"
)]
pub(super) struct CommandLine {
    #[command(subcommand)]
    pub(super) command: Command,
    /// Show debug messages as well
    #[arg(short, long, global = true)]
    pub(super) verbose: bool,
    /// Print warnings and errors alone
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(super) quiet: bool,
}

/// The commands; each one's file declares its options.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Demo(DemoOptions),
    Run(RunOptions),
    Calibrate(CalibrateOptions),
    Restore(RestoreOptions),
    Shoot(ShootOptions),
    Photograph(PhotographOptions),
    Chart(ChartOptions),
    Align(AlignOptions),
    Check(CheckOptions),
    Status(StatusOptions),
    Screens(ScreensOptions),
    Press(PressOptions),
    /// Print the version
    Version,
    #[command(hide = true)]
    Completions(CompletionsOptions),
    #[command(hide = true)]
    Man(ManOptions),
}

/// Parses the words, the program's name first.
///
/// # Errors
/// A request for help or the version, or an invalid command line; see [`error_message`].
pub(super) fn read(words: &[OsString]) -> Result<CommandLine, clap::Error> {
    CommandLine::try_parse_from(words)
}

/// The message for an invalid command line: what was found, and what is allowed.
pub(super) fn error_message(error: &clap::Error, words: &[OsString]) -> String {
    let line = CommandLine::command();
    let of = |kind| error.get(kind).map(ToString::to_string).unwrap_or_default();
    let (found, value) = (of(ContextKind::InvalidArg), of(ContextKind::InvalidValue));
    // Options before the command belong to the program.
    let mut before = words.iter().skip(1).take_while(|word| **word != *found);
    let command = before.find_map(|word| line.find_subcommand(word)).unwrap_or(&line);
    let name = match command.get_name() {
        "relens" => "relens".to_owned(),
        name => format!("relens {name}"),
    };
    let message = match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let names = line.get_subcommands().filter(|c| !c.is_hide_set()).map(|c| c.get_name());
            let hint = hint(error, ContextKind::SuggestedSubcommand, names);
            format!("found the command `{}`{hint}", of(ContextKind::InvalidSubcommand))
        }
        ErrorKind::UnknownArgument if !found.starts_with('-') => {
            format!("`{name}` does not take `{found}`")
        }
        ErrorKind::UnknownArgument => {
            let options = command.get_opts().filter_map(|option| option.get_long());
            let dashed: Vec<_> = options.map(|name| format!("--{name}")).collect();
            let hint = hint(error, ContextKind::SuggestedArg, dashed.iter().map(String::as_str));
            format!("`{name}` has no option `{found}`{hint}")
        }
        ErrorKind::MissingRequiredArgument => format!("`{name}` needs {found}"),
        ErrorKind::InvalidValue if value.is_empty() => format!("`{name}` needs a value: {found}"),
        ErrorKind::InvalidValue => {
            let allowed = match error.get(ContextKind::ValidValue) {
                Some(ContextValue::Strings(values)) => values.iter().map(String::as_str).collect(),
                _ => Vec::new(),
            };
            let hint = hint(error, ContextKind::SuggestedValue, allowed.into_iter());
            format!("found `{value}` for {found}{hint}")
        }
        ErrorKind::ValueValidation => {
            let why = std::error::Error::source(error).map(ToString::to_string);
            format!("found `{value}` for {found}, allowed {}", range(&why.unwrap_or_default()))
        }
        ErrorKind::ArgumentConflict if of(ContextKind::PriorArg) == found => {
            format!("{found} was given twice, allowed once")
        }
        ErrorKind::ArgumentConflict => {
            format!("found {found} beside {}, allowed one of them", of(ContextKind::PriorArg))
        }
        _ => {
            let whole = error.to_string();
            let first = whole.lines().next().unwrap_or_default();
            first.trim_start_matches("error: ").to_owned()
        }
    };
    let page = name.replacen("relens", "relens help", 1);
    format!("{message}; see `{page}`")
}

/// The allowed values, by a value parser's message.
fn range(why: &str) -> String {
    if let Some((_, allowed)) = why.split_once(", allowed ") {
        return allowed.to_owned();
    }
    match why.split_once(" is not in ").and_then(|(_, range)| range.split_once("..")) {
        Some((least, "")) => format!("{least} or more"),
        Some((least, most)) => format!("{least} to {}", most.trim_start_matches('=')),
        None => "a number".to_owned(),
    }
}

/// `; did you mean …?` or `, allowed: …`.
fn hint<'a>(
    error: &clap::Error,
    kind: ContextKind,
    allowed: impl Iterator<Item = &'a str>,
) -> String {
    let near: Vec<&str> = match error.get(kind) {
        Some(ContextValue::String(near)) => vec![near],
        Some(ContextValue::Strings(near)) => near.iter().map(String::as_str).collect(),
        _ => Vec::new(),
    };
    let found = match kind {
        ContextKind::SuggestedSubcommand => ContextKind::InvalidSubcommand,
        ContextKind::SuggestedArg => ContextKind::InvalidArg,
        _ => ContextKind::InvalidValue,
    };
    let found = error.get(found).map(ToString::to_string).unwrap_or_default();
    let near: Vec<&str> = near.into_iter().filter(|name| is_near(&found, name)).collect();
    if near.is_empty() {
        return format!(", allowed: {}", allowed.collect::<Vec<_>>().join(", "));
    }
    format!("; did you mean {}?", near.join(" or "))
}

/// Whether `found` may be a slip for `name`: its beginning, or a third of its letters amiss.
fn is_near(found: &str, name: &str) -> bool {
    let longer = found.len().max(name.len());
    name.starts_with(found) || edit_distance(found, name) <= longer.div_ceil(3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::{Path, PathBuf};

    fn read_line(line: &str) -> Result<CommandLine, clap::Error> {
        read(
            &["relens"]
                .into_iter()
                .chain(line.split_whitespace())
                .map(OsString::from)
                .collect::<Vec<_>>(),
        )
    }

    fn message_for(line: &str) -> String {
        let words: Vec<_> =
            ["relens"].into_iter().chain(line.split_whitespace()).map(OsString::from).collect();
        error_message(&read(&words).unwrap_err(), &words)
    }

    #[test]
    fn the_declaration_is_sound() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn the_help_names_every_built_in_rig() {
        let page = CommandLine::command().render_long_help().to_string();
        for name in relens::config::built_in_names() {
            assert!(page.contains(name), "{name}: {page}");
        }
    }

    #[test]
    fn valid_command_lines_are_parsed_in_any_order() {
        let line = read_line("run --once -f box --rig=a.toml -v").unwrap();
        assert!(line.verbose && matches!(line.command, Command::Run(_)));
        assert!(read_line("-v demo").unwrap().verbose);
        assert!(read_line("restore -q a.jpg b.jpg - -r a.toml -o out").unwrap().quiet);
        for line in ["restore in.jpg -r a.toml -o out.jpg -m paper", "version", "status", "demo"] {
            assert!(read_line(line).is_ok(), "{line}");
        }
    }

    #[test]
    fn invalid_command_lines_get_one_line_of_advice() {
        for (line, wanted) in [
            ("restroe x", "found the command `restroe`; did you mean restore?"),
            ("xyz", "allowed: demo, run"),
            ("frobnicate", "found the command `frobnicate`, allowed: demo, run"),
            ("calib", "did you mean calibrate?"),
            ("run", "`relens run` needs --rig <RIG.toml>"),
            ("run --rig a --onec", "did you mean --once?"),
            ("run --rig", "needs a value: --rig"),
            ("run --rig a --rig b", "given twice"),
            ("run --rig a inbox", "`relens run` does not take `inbox`"),
            ("restore -r a -o b", "needs <PHOTO>"),
            ("restore -r a -o b c -m hybird", "did you mean hybrid?"),
            ("restore -r a -o b c -m magic", "allowed: paper, digital,"),
            ("--once run", "`relens` has no option `--once`"),
            ("status --rig a", "`relens status` has no option `--rig`, allowed: --folder"),
            ("press --long=3", "unexpected value '3' for '--long'"),
        ] {
            let message = message_for(line);
            assert!(message.contains(wanted) && message.lines().count() == 1, "{line}: {message}");
        }
    }

    /// Every call of the program with one of its commands in `text`: the words, and whether they
    /// stand between backticks.
    fn calls(text: &str) -> Vec<(String, bool)> {
        let declared = CommandLine::command();
        let mut found = Vec::new();
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            for (at, _) in line.match_indices("relens ") {
                let words = &line[at + "relens ".len()..];
                let words = words.split(['#', '`', ';', '|', '>', '&', ')']).next().unwrap();
                let words = words.trim().trim_end_matches(" 2").replace(['"', '\''], "");
                let first = words.split(' ').next().unwrap();
                let begins = line[..at].chars().next_back().is_none_or(|c| " `/".contains(c));
                if begins && words.contains(" -") && declared.find_subcommand(first).is_some() {
                    found.push((words, line[..at].ends_with('`')));
                }
            }
        }
        found
    }

    fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            match entry.path() {
                path if path.is_dir() => files_below(&path, found),
                path if path.extension().is_none_or(|e| e != "rs") => found.push(path),
                _ => {}
            }
        }
    }

    #[test]
    fn every_call_in_pages_and_scripts_is_valid() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut files = vec![root.join("README.md"), root.join("hardware.md")];
        for folder in ["rig-config", "systemd", "tests"] {
            files_below(&root.join(folder), &mut files);
        }
        let mut read_calls = 0;
        for file in files {
            let Ok(text) = std::fs::read_to_string(&file) else { continue };
            for (words, is_quoted) in calls(&text) {
                read_calls += 1;
                let error = read_line(&words).err().map(|error| error.kind());
                let is_valid = match error {
                    None => true,
                    Some(ErrorKind::MissingRequiredArgument) => is_quoted,
                    Some(_) => false,
                };
                assert!(is_valid, "{}: relens {words}: {error:?}", file.display());
            }
        }
        assert!(read_calls > 20, "found {read_calls} calls");
    }
}
