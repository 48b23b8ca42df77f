//! The words of the command line, read against one table: every command with its options.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;

use relens::config::distance;

use super::CliError;

/// What the user asked for.
#[derive(Debug, PartialEq)]
pub(super) struct Parsed {
    pub(super) command: Command,
    /// Debug messages are wanted, too.
    pub(super) verbose: bool,
}

/// A command with all it needs.
#[derive(Debug, PartialEq)]
pub(super) enum Command {
    Demo { out: PathBuf },
    Run { rig: PathBuf, folder: PathBuf, once: bool, share_as: Option<OsString> },
    Calibrate { rig: PathBuf, folder: PathBuf },
    Restore(RestoreWords),
    Photograph { rig: PathBuf, scene: PathBuf, photo: PathBuf },
    Chart { rig: PathBuf, out: PathBuf, quick: bool, folder: PathBuf },
    Check { rig: PathBuf, folder: PathBuf },
    Status { folder: PathBuf },
    Screens { rig: PathBuf, out: PathBuf },
    Press { folder: PathBuf, long: bool },
    Help { about: Option<String> },
    Version,
}

/// The words of `relens restore`.
#[derive(Debug, PartialEq)]
pub(super) struct RestoreWords {
    pub(super) rig: PathBuf,
    pub(super) folder: PathBuf,
    pub(super) photo: PathBuf,
    pub(super) out: PathBuf,
    pub(super) method: Option<String>,
    pub(super) report: Option<PathBuf>,
}

/// A command as the table has it.
struct Known {
    name: &'static str,
    /// Long name, letter, whether it takes a value, whether it must be there.
    options: &'static [Option_],
    /// What each plain word is.
    words: &'static [&'static str],
}

type Option_ = (&'static str, Option<char>, bool, bool);

const RIG: Option_ = ("rig", Some('r'), true, true);
const FOLDER: Option_ = ("folder", Some('f'), true, false);
const OUT: Option_ = ("out", Some('o'), true, true);

const COMMANDS: [Known; 12] = [
    Known { name: "demo", options: &[("out", Some('o'), true, false)], words: &[] },
    Known {
        name: "run",
        options: &[RIG, FOLDER, ("once", None, false, false), ("box", None, true, false)],
        words: &[],
    },
    Known { name: "calibrate", options: &[RIG, FOLDER], words: &[] },
    Known {
        name: "restore",
        options: &[
            RIG,
            FOLDER,
            OUT,
            ("method", Some('m'), true, false),
            ("report", None, true, false),
        ],
        words: &["photo"],
    },
    Known { name: "photograph", options: &[RIG, OUT], words: &["sharp picture"] },
    Known {
        name: "chart",
        options: &[RIG, OUT, FOLDER, ("quick", None, false, false)],
        words: &[],
    },
    Known { name: "check", options: &[RIG, FOLDER], words: &[] },
    Known { name: "status", options: &[FOLDER], words: &[] },
    Known { name: "screens", options: &[RIG, OUT], words: &[] },
    Known { name: "press", options: &[FOLDER, ("long", None, false, false)], words: &[] },
    Known { name: "help", options: &[], words: &[] },
    Known { name: "version", options: &[], words: &[] },
];

/// Reads the words (without the program's name).
///
/// # Errors
/// [`CliError::Usage`], one sentence with what was found and what is allowed.
pub(super) fn parse(words: impl Iterator<Item = OsString>) -> Result<Parsed, CliError> {
    use lexopt::Arg::{Long, Short, Value};
    let mut parser = lexopt::Parser::from_args(words);
    let mut verbose = false;
    let mut known: Option<&Known> = None;
    let mut given: BTreeMap<&str, OsString> = BTreeMap::new();
    let mut plain: Vec<OsString> = Vec::new();
    let mut help = false;
    while let Some(arg) = parser.next().map_err(|e| usage(&e.to_string()))? {
        let option = match arg {
            Value(word) => {
                match known {
                    None => known = Some(command(&word.to_string_lossy())?),
                    Some(_) => plain.push(word),
                }
                continue;
            }
            Short('h') | Long("help") => {
                help = true;
                continue;
            }
            Short('v') | Long("verbose") => {
                verbose = true;
                continue;
            }
            Short('V') | Long("version") => {
                return Ok(Parsed { command: Command::Version, verbose });
            }
            Long(name) => name.to_owned(),
            Short(letter) => letter.to_string(),
        };
        let Some(command) = known else {
            return Err(usage(&format!("found the option {} before any command", dashed(&option))));
        };
        let is =
            |o: &&Option_| o.0 == option || o.1.is_some_and(|letter| option == letter.to_string());
        let Some(&(name, _, takes_value, _)) = command.options.iter().find(is) else {
            return Err(unknown_option(command, &option));
        };
        let value = match takes_value {
            true => parser
                .value()
                .map_err(|_| usage(&format!("--{name} of `{}` needs a value", command.name)))?,
            false => OsString::new(),
        };
        if given.insert(name, value).is_some() {
            return Err(usage(&format!("--{name} was given twice, allowed once")));
        }
    }
    let Some(known) = known else {
        return match help {
            true => Ok(Parsed { command: Command::Help { about: None }, verbose }),
            false => Err(usage("found no command")),
        };
    };
    if help {
        return Ok(Parsed {
            command: Command::Help { about: Some(known.name.to_owned()) },
            verbose,
        });
    }
    Ok(Parsed { command: build(known, given, plain)?, verbose })
}

fn build(
    known: &Known,
    mut given: BTreeMap<&str, OsString>,
    plain: Vec<OsString>,
) -> Result<Command, CliError> {
    if known.name == "help" {
        let about = plain
            .into_iter()
            .next()
            .map(|word| command(&word.to_string_lossy()).map(|k| k.name.to_owned()));
        return Ok(Command::Help { about: about.transpose()? });
    }
    if let Some((name, letter, ..)) = known.options.iter().find(|o| o.3 && !given.contains_key(o.0))
    {
        let short = letter.map_or(String::new(), |l| format!(" (-{l})"));
        return Err(usage(&format!("`{}` needs --{name}{short}", known.name)));
    }
    if plain.len() > known.words.len() {
        let extra = plain[known.words.len()].to_string_lossy().into_owned();
        let allowed = match known.words {
            [] => "options only".to_owned(),
            words => format!("one {}", words.join(" and one ")),
        };
        return Err(usage(&format!(
            "`{}` does not know what to do with `{extra}`, allowed {allowed}",
            known.name
        )));
    }
    if let Some(missing) = known.words.get(plain.len()) {
        return Err(usage(&format!("`{}` needs the {missing}", known.name)));
    }
    let once = given.contains_key("once");
    let quick = given.contains_key("quick");
    let long = given.contains_key("long");
    let share_as = given.remove("box");
    let mut path = |name: &str| given.remove(name).map(PathBuf::from);
    let (rig, out) = (path("rig").unwrap_or_default(), path("out"));
    let folder = path("folder").unwrap_or_else(|| PathBuf::from("."));
    let word = plain.into_iter().next().map(PathBuf::from).unwrap_or_default();
    Ok(match known.name {
        "demo" => Command::Demo { out: out.unwrap_or_else(|| PathBuf::from("relens-demo")) },
        "run" => Command::Run { rig, folder, once, share_as },
        "calibrate" => Command::Calibrate { rig, folder },
        "restore" => Command::Restore(RestoreWords {
            rig,
            folder,
            photo: word,
            out: out.unwrap_or_default(),
            report: path("report"),
            method: given.remove("method").map(|m| m.to_string_lossy().into_owned()),
        }),
        "photograph" => Command::Photograph { rig, scene: word, photo: out.unwrap_or_default() },
        "chart" => Command::Chart { rig, out: out.unwrap_or_default(), quick, folder },
        "check" => Command::Check { rig, folder },
        "status" => Command::Status { folder },
        "screens" => Command::Screens { rig, out: out.unwrap_or_default() },
        "press" => Command::Press { folder, long },
        _ => Command::Version,
    })
}

fn command(word: &str) -> Result<&'static Known, CliError> {
    if let Some(known) = COMMANDS.iter().find(|known| known.name == word) {
        return Ok(known);
    }
    let names = COMMANDS.map(|known| known.name);
    Err(usage(&format!("found the command `{word}`{}", nearest(word, &names, ""))))
}

fn unknown_option(command: &Known, option: &str) -> CliError {
    let names: Vec<&str> = command.options.iter().map(|o| o.0).collect();
    usage(&format!(
        "`{}` has no option {}{}",
        command.name,
        dashed(option),
        nearest(option, &names, "--")
    ))
}

fn dashed(option: &str) -> String {
    if option.chars().count() == 1 { format!("-{option}") } else { format!("--{option}") }
}

/// `; did you mean …?` or `, allowed are …`.
fn nearest(word: &str, known: &[&str], dashes: &str) -> String {
    let best = known.iter().min_by_key(|name| distance(word, name));
    match best {
        Some(best) if distance(word, best) <= best.len().div_ceil(3) => {
            format!("; did you mean {dashes}{best}?")
        }
        Some(_) => format!(", allowed are {dashes}{}", known.join(&format!(", {dashes}"))),
        None => ", it has none".to_owned(),
    }
}

fn usage(what: &str) -> CliError {
    CliError::Usage(format!("{what} (`relens help` tells more)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Result<Parsed, CliError> {
        parse(line.split_whitespace().map(OsString::from))
    }

    fn complaint(line: &str) -> String {
        let trouble = words(line).unwrap_err();
        assert_eq!(trouble.exit_code(), 2, "{line}");
        trouble.to_string()
    }

    #[test]
    fn right_words_are_understood_in_any_order() {
        let run =
            Command::Run { rig: "a.toml".into(), folder: "box".into(), once: true, share_as: None };
        assert_eq!(
            words("run --once -f box --rig=a.toml").unwrap(),
            Parsed { command: run, verbose: false }
        );
        let Command::Restore(restore) =
            words("restore in.jpg -r a.toml -o out.jpg -m paper").unwrap().command
        else {
            panic!("restore");
        };
        assert_eq!((restore.photo, restore.method), ("in.jpg".into(), Some("paper".to_owned())));
        assert_eq!(words("run -h").unwrap().command, Command::Help { about: Some("run".into()) });
        assert!(words("demo -v").unwrap().verbose);
    }

    #[test]
    fn wrong_words_get_one_sentence_with_the_right_ones() {
        for (line, wanted) in [
            ("", "found no command"),
            ("restroe x", "did you mean restore?"),
            ("frobnicate", "allowed are demo, run"),
            ("run", "`run` needs --rig (-r)"),
            ("run --rig a --onec", "did you mean --once?"),
            ("run --rig", "--rig of `run` needs a value"),
            ("run --rig a --rig b", "given twice"),
            ("run --rig a inbox", "does not know what to do with `inbox`"),
            ("restore -r a -o b", "needs the photo"),
            ("--once run", "before any command"),
            ("status --rig a", "`status` has no option --rig, allowed are --folder"),
        ] {
            assert!(complaint(line).contains(wanted), "{line}: {}", complaint(line));
        }
    }
}
