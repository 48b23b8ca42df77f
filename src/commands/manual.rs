//! `relens completions` and `relens man`, generated from the command line's declaration.

use std::path::PathBuf;

use clap::{Args, Command, ValueHint};
use clap_complete::Shell;
use clap_mangen::Man;

use super::error::CliError;
use super::output::say;

/// Print the completions for a shell
#[derive(Debug, Args)]
pub(super) struct CompletionsOptions {
    /// Shell to complete in
    shell: Shell,
}

/// Print the manual page relens(1), or write the pages of all commands
#[derive(Debug, Args)]
pub(super) struct ManOptions {
    /// Write the pages into this folder, which must exist
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: Option<PathBuf>,
}

pub(super) fn completions(
    options: &CompletionsOptions,
    mut command: Command,
) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, "relens", &mut script);
    say(String::from_utf8_lossy(&script).trim_end());
    Ok(())
}

pub(super) fn man(options: &ManOptions, command: Command) -> Result<(), CliError> {
    let mut program = command.disable_help_subcommand(true);
    program.build();
    let Some(folder) = &options.out else {
        say(page(program).page.trim_end());
        return Ok(());
    };
    let commands = program.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    for command in commands.chain([program.clone()]) {
        let ManPage { file_name, page } = page(command);
        let path = folder.join(file_name);
        std::fs::write(&path, page).map_err(|e| CliError::writing(&path, e))?;
    }
    Ok(())
}

/// `page` with the examples under their own heading, line by line, so that they can be copied.
fn with_examples(page: &str) -> String {
    let Some((before, from)) = page.split_once(".SH EXTRA\nExamples:\n") else {
        return page.to_owned();
    };
    let (examples, after) = from.split_once(".SH ").unwrap_or((from, ""));
    let next = if after.is_empty() { "" } else { ".SH " };
    format!("{before}.SH EXAMPLES\n.nf\n{examples}.fi\n{next}{after}")
}

struct ManPage {
    file_name: String,
    page: String,
}

fn page(command: Command) -> ManPage {
    let man = Man::new(command).source(concat!("relens ", env!("CARGO_PKG_VERSION")));
    let mut page = Vec::new();
    // Writing to memory does not fail.
    let _ = man.render(&mut page);
    let page = with_examples(&String::from_utf8_lossy(&page));
    ManPage { file_name: man.get_filename(), page }
}
