//! The declaration of the command line.

use clap::{Parser, Subcommand};

use super::{
    align, calibrate, chart, check, demo, manual, photograph, press, restore, run, shoot, status,
};

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
    Demo(demo::DemoOptions),
    Run(run::RunOptions),
    Calibrate(calibrate::CalibrateOptions),
    Restore(restore::RestoreOptions),
    Shoot(shoot::ShootOptions),
    Photograph(photograph::PhotographOptions),
    Chart(chart::ChartOptions),
    Align(align::AlignOptions),
    Check(check::CheckOptions),
    Status(status::StatusOptions),
    Press(press::PressOptions),
    #[command(hide = true)]
    Completions(manual::CompletionsOptions),
    #[command(hide = true)]
    Man(manual::ManOptions),
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use clap::CommandFactory;
    use clap::error::ErrorKind;

    use super::*;

    fn read_line(line: &str) -> Result<CommandLine, clap::Error> {
        CommandLine::try_parse_from(["relens"].into_iter().chain(line.split_whitespace()))
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
        for line in ["restore in.jpg -r a.toml -o out.jpg -m paper", "status", "demo"] {
            assert!(read_line(line).is_ok(), "{line}");
        }
    }

    #[test]
    fn invalid_command_lines_get_advice() {
        for (line, wanted) in [
            ("restroe x", "'restore'"),
            ("run", "--rig <RIG.toml>"),
            ("run --rig a --onec", "'--once'"),
            ("run --rig a inbox", "'inbox'"),
            ("restore -r a -o b", "<PHOTO>"),
            ("restore -r a -o b c -m hybird", "'hybrid'"),
            ("restore -r a -o b c -m magic", "[possible values: paper, digital,"),
            ("status --rig a", "'--rig'"),
            ("press --long=3", "unexpected value '3' for '--long"),
            ("shoot -r a -o b --gain 1000", "allowed 0.01 to 100"),
        ] {
            let message = read_line(line).unwrap_err().to_string();
            assert!(message.contains(wanted) && message.contains("--help"), "{line}: {message}");
        }
    }

    /// Calls of the program in `text` that name one of its commands: the words of each, and whether
    /// a backtick precedes it.
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
